"""The optimum of a list of tasks brings what the list says, by brute force from what the guide says."""

from __future__ import annotations

import itertools
from fractions import Fraction
from math import isqrt
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

from robochoc.formats import check_team
from robochoc.run import Options, Runtime, solve
from tests.support.task_lists import imported, mistakes


def length(start: list[int], end: list[int], told: dict[str, Any]) -> Fraction:
    """Return a way in whole 1/10**places, halves up; a point without a place is no way off."""
    if not start or not end:
        return Fraction(0)
    parts = [abs(one - other) for one, other in zip(start, end, strict=True)]
    unit = 10 ** told["places"]
    if told["distance"] == "streets":
        return Fraction(sum(parts))
    doubled = isqrt(4 * unit**2 * sum(part**2 for part in parts))
    return Fraction((doubled + 1) // 2, unit)


def is_able(robot: dict[str, Any], task: dict[str, Any], told: dict[str, Any]) -> bool:
    if not set(task["needs"]) <= set(robot["skills"]) or task["load"] > robot["capacity"]:
        return False
    if "deadline" not in task or not robot.get("at") or not task.get("at"):
        return True
    parts = [abs(one - other) for one, other in zip(robot["at"], task["at"], strict=True)]
    limit = task["deadline"] * robot["speed"]
    if told["distance"] == "streets":
        return bool(sum(parts) <= limit)
    return bool(sum(part**2 for part in parts) <= limit**2)


def ways(robot: dict[str, Any], tasks: tuple[str, ...], told: dict[str, Any]) -> Fraction:
    """Return the length of the ways to all tasks, each from where the robot stands."""
    places = [told["tasks"][task].get("at", []) for task in tasks]
    return sum((length(robot.get("at", []), place, told) for place in places), Fraction())


def tour(robot: dict[str, Any], tasks: list[dict[str, Any]], told: dict[str, Any]) -> Fraction | None:
    """Return the length of the shortest tour of the tasks in time, of all orders; None: there is none."""
    exact = {**told, "places": 9}
    found = []
    for order in itertools.permutations([task for task in tasks if task.get("at")]):
        stops = [robot["at"], *(task["at"] for task in order)]
        legs = [length(start, end, exact) for start, end in itertools.pairwise(stops)]
        times = list(itertools.accumulate(legs))
        if all(time <= task.get("deadline", 10**9) * robot["speed"] for time, task in zip(times, order, strict=True)):
            found.append(sum(legs, Fraction()))
    unit = 10 ** told["places"]
    return Fraction(int(2 * min(found) * unit + 1) // 2, unit) if found else None


def brings(told: dict[str, Any], doers: dict[str, tuple[str, ...]]) -> Fraction | None:
    """Return what it brings if robots do tasks so; None: it is not allowed."""
    total = Fraction(0)
    for name, tasks in doers.items():
        robot = told["robots"][name]
        if len(tasks) > robot["most"] or sum(told["tasks"][task]["load"] for task in tasks) > robot["capacity"]:
            return None
        if not all(is_able(robot, told["tasks"][task], told) for task in tasks):
            return None
        way = tour(robot, [told["tasks"][task] for task in tasks], told) if told["tours"] else ways(robot, tasks, told)
        if way is None:
            return None
        total -= way
        total += sum(one["worth"] for one in told["synergies"] if set(one["tasks"]) <= set(tasks))
    for name, task in told["tasks"].items():
        crew = sum(name in tasks for tasks in doers.values())
        if crew not in (0, task["robots"]):
            return None
        total += task["worth"] * bool(crew)
    return total


def best(told: dict[str, Any]) -> Fraction:
    """Return the most that a list can bring, by all ways to share its tasks out."""
    names = list(told["tasks"])
    sets = [chosen for number in range(len(names) + 1) for chosen in itertools.combinations(names, number)]
    shares = (
        dict(zip(told["robots"], each, strict=True)) for each in itertools.product(sets, repeat=len(told["robots"]))
    )
    return max(one for share in shares if (one := brings(told, share)) is not None)


def random_list(chance: Random, *, alone: bool, tours: bool = False) -> dict[str, Any]:
    """A list of two or three robots and three tasks; `alone`: of one task each; `tours`: of tours."""
    skills = ["arm", "eye"]

    def point() -> list[int]:
        return [chance.randrange(10), chance.randrange(10)]

    robots = {
        name: {
            "skills": chance.sample(skills, chance.choice((1, 2, 2))),
            "capacity": chance.randrange(1, 5),
            "most": 1 if alone else chance.randrange(1, 4),
            "speed": chance.choice((1, 2)),
            "at": point(),
        }
        for name in ("r1", "r2", "r3")[: chance.choice((2, 3))]
    }
    tasks: dict[str, dict[str, Any]] = {
        name: {
            "needs": chance.sample(skills, chance.choice((0, 1, 1))),
            "worth": 2 * chance.randrange(12),
            "load": chance.choice((1, 2)),
            "robots": 1 if alone or chance.random() < 0.8 else 2,
        }
        for name in ("t1", "t2", "t3")
    }
    for task in tasks.values():
        if chance.random() < 0.9:
            task["at"] = point()
        if chance.random() < 0.3:
            task["deadline"] = chance.randrange(1, 12)
    synergies = [] if alone else [{"tasks": ["t1", "t2"], "worth": chance.randrange(-5, 6)}] * chance.choice((0, 1, 2))
    shown = {"distance": chance.choice(("streets", "straight")), "places": chance.choice((0, 2)), "tours": tours}
    return {**shown, "robots": robots, "tasks": tasks, "synergies": synergies}


@pytest.mark.parametrize("kind", ["alone", "several", "tours"])
@pytest.mark.parametrize("batch", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_the_optimum_brings_what_the_list_says(tmp_path: Path, kind: str, batch: int, warm_ace: None) -> None:
    del warm_ace
    alone = kind == "alone"
    chance = Random(f"tasks {kind} {batch}")
    checked = 0
    for _ in range(60 if batch else 6):
        told = random_list(chance, alone=alone, tours=kind == "tours")
        able = any(is_able(r, t, told) for r in told["robots"].values() for t in told["tasks"].values())
        text = yaml.safe_dump(told)
        if not able and not alone:
            assert "no robot can do any of the tasks" in mistakes(text, tmp_path)
            continue
        team = imported(text, tmp_path).team
        check_team(team)
        outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
        assert outcome.cost is not None
        assert Fraction(outcome.cost) == best(told), text
        checked += 1
    assert checked > 3
