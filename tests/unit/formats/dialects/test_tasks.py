"""Lists of robots and tasks: what a list says is what the team's optimum brings, and what is wrong has its line."""

from __future__ import annotations

import itertools
from fractions import Fraction
from math import isqrt
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

from robochoc.cli.reports.outcome import outcome_report
from robochoc.formats import InvalidInputError, check_team, read_team, write_team
from robochoc.formats.dialects.dialect import Imported, ImportOptions
from robochoc.formats.dialects.registry import read_foreign, recognise
from robochoc.formats.problems import read_problem
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import CENTRAL

LIST = """robots:
  ann: {at: [0, 0], skills: [camera, gripper], capacity: 3}
  bob: {at: [8, 1], skills: [camera], most: 2}
  cid: {at: [4, 6], skills: [gripper], capacity: 2}
tasks:
  survey: {at: [1, 2], needs: camera, worth: 10}
  inspect: {at: [7, 3], needs: camera, worth: 9, deadline: 5}
  fetch: {at: [3, 4], needs: gripper, worth: 12, load: 2}
  carry: {at: [5, 5], needs: gripper, worth: 20, robots: 2}
  paint: {needs: brush, worth: 50}
synergies:
  - {tasks: [survey, inspect], worth: 2}
distance: streets
"""


def imported(text: str, folder: Path, infinity: int | None = None) -> Imported:
    path = folder / "tasks.yaml"
    path.write_text(text)
    return read_foreign([path], ImportOptions(infinity=infinity))


def mistakes(text: str, folder: Path) -> str:
    with pytest.raises(InvalidInputError) as caught:
        imported(text, folder)
    return str(caught.value).replace(f"{folder / 'tasks.yaml'}:", "")


# The truth, from what the guide says


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


TOURS = """distance: streets
tours: yes
robots:
  ann: {at: [0, 0]}
  bob: {at: [9, 9], most: 1}
tasks:
  near: {at: [4, 0], worth: 5}
  far: {at: [6, 0], worth: 5}
  late: {at: [6, 1], worth: 5, deadline: 6}
  radio: {worth: 1}
"""


def cost_of(text: str, folder: Path, protocol: str = "dpop") -> Any:  # noqa: ANN401 - an exact number
    return solve(imported(text, folder).team, Options(protocol=protocol, runtime=Runtime.SIMULATOR)).cost


def test_the_way_to_a_task_begins_where_the_one_before_it_is(tmp_path: Path, warm_ace: None) -> None:
    """The robot ann does near, far and radio, 6 away; a way of its own pays not for far. There is no time for late."""
    del warm_ace
    assert cost_of(TOURS, tmp_path) == 5 + 5 + 1 - 6
    assert cost_of(TOURS.replace("tours: yes\n", ""), tmp_path) == 1 + 1
    assert cost_of(TOURS.replace("deadline: 6", "deadline: 7"), tmp_path) == 15 + 1 - 7
    assert cost_of(TOURS.replace("deadline: 6", "deadline: 3.5").replace("0, 0]", "0, 0], speed: 2"), tmp_path) == 9


def test_where_a_deadline_asks_for_it_the_tour_is_longer(tmp_path: Path, warm_ace: None) -> None:
    del warm_ace
    text = """tours: yes
robots:
  ann: {at: [5, 0]}
tasks:
  left: {at: [1, 0], worth: 100}
  right: {at: [8, 0], worth: 100, deadline: DEADLINE}
"""
    assert cost_of(text.replace("DEADLINE", "99"), tmp_path) == 200 - (3 + 7)
    assert cost_of(text.replace("8, 0]", "10, 0]").replace("DEADLINE", "99"), tmp_path) == 200 - (4 + 9)
    assert cost_of(text.replace("8, 0]", "10, 0]").replace("DEADLINE", "12"), tmp_path) == 200 - (5 + 9)


@pytest.mark.parametrize("protocol", ["ssi", "cbba"])
def test_auctions_bid_what_a_task_adds_to_the_tour(protocol: str, tmp_path: Path, warm_ace: None) -> None:
    del warm_ace
    assert cost_of(TOURS, tmp_path, protocol) == 5


def test_of_one_task_each_a_tour_is_the_way_there(tmp_path: Path) -> None:
    text = TOURS.replace("{at: [0, 0]}", "{at: [0, 0], most: 1}")
    assert imported(text, tmp_path).team == imported(text.replace("tours: yes\n", ""), tmp_path).team


def test_too_many_sets_of_tasks_are_refused_at_once(tmp_path: Path) -> None:
    tasks = "".join(f"  t{place}: {{at: [{place}, 0], worth: 1}}\n" for place in range(40))
    text = f"tours: yes\nrobots:\n  ann: {{at: [0, 0], most: MOST}}\ntasks:\n{tasks}"
    said = mistakes(text.replace("MOST", "40"), tmp_path)
    assert "the robot 'ann' has time and room for more than 4,096 sets of tasks (write most:" in said
    assert said.startswith("3: ")
    assert len(imported(text.replace("MOST", "2"), tmp_path).team["ann"].variables) == 40
    hurried = text.replace("MOST", "40").replace("worth: 1", "worth: 1, deadline: 0.5")
    assert imported(hurried, tmp_path).team["ann"].variables


def test_tours_are_yes_or_no(tmp_path: Path) -> None:
    assert "the tours 'often', which it cannot have (write tours: yes, or tours: no)" in mistakes(
        TOURS.replace("tours: yes", "tours: often"), tmp_path
    )
    assert cost_of(TOURS.replace("tours: yes", "tours: no"), tmp_path) == 2


def test_both_models_solve_alike_from_a_folder(tmp_path: Path) -> None:
    for most in (1, 2):
        text = LIST.replace("capacity: 3", f"most: {most}").replace("capacity: 2", f"most: {most}")
        read = imported(text.replace("most: 2", f"most: {most}").replace("robots: 2", "robots: 1"), tmp_path)
        write_team(read.team, tmp_path / f"team{most}")
        team = read_team(tmp_path / f"team{most}")
        assert len(team["ann"].variables) == (1 if most == 1 else 3)
        costs = [solve(one, Options(protocol=CENTRAL)).cost for one in (team, read.team)]
        assert costs[0] == costs[1] is not None


def test_it_is_recognised_by_what_it_has(tmp_path: Path) -> None:
    path = tmp_path / "any.yaml"
    for text, name in (
        (LIST, "tasks"),
        ("robots: {a: }\ntasks: {t: {worth: 1}}", "tasks"),
        ("robots: {a: }", "tasks"),
        ("name: x\nobjective: min\ndomains: {}\nvariables: {}\nagents: {}", "pydcop"),
    ):
        path.write_text(text)
        dialect = recognise(path)
        assert dialect is not None
        assert dialect.name == name
    (tmp_path / "any.txt").write_text(LIST)
    assert recognise(tmp_path / "any.txt") is None


def test_who_does_which_task_is_a_table(tmp_path: Path) -> None:
    team = imported(LIST, tmp_path).team
    told = outcome_report(team, solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)))
    assert told.splitlines()[1:5] == [
        "    robot  does",
        "    ann    fetch, carry",
        "    bob    survey, inspect",
        "    cid    carry",
    ]


def test_a_robot_of_one_task_has_it_as_its_value(tmp_path: Path) -> None:
    text = "robots: {ann: {most: 1}, bob: {most: 1}}\ntasks: {dig: {worth: 3}, lay-1: {worth: -1}}"
    team = imported(text, tmp_path).team
    assert [one.name for one in team["ann"].variables] == ["ann.task"]
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert sorted(map(str, outcome.labelled(outcome.assignment).values())) == ["dig", "none"]
    assert "    nobody does lay-1" in outcome_report(team, outcome)


def test_names_that_are_not_allowed_here_come_back(tmp_path: Path) -> None:
    path = tmp_path / "tasks.yaml"
    path.write_text("robots: {r-1: , r-2: }\ntasks: {pick up: {worth: 3}, 7: {worth: 1}}")
    read = read_problem(path)
    assert read.names == {
        "r_1": "r-1",
        "r_2": "r-2",
        **{f"r_{n}.{now}": f"r-{n}.{was}" for n in (1, 2) for now, was in (("pick_up", "pick up"), ("v7", "7"))},
    }


def test_what_nobody_can_do_is_told(tmp_path: Path) -> None:
    told = LIST.replace("tasks:\n", "  dan: {skills: dance}\ntasks:\n", 1)
    assert [note.text for note in imported(told, tmp_path).notes] == [
        "the robot dan, which can do none of the tasks",
        "the task paint, which no robot can do",
    ]


@pytest.mark.parametrize(
    ("now", "then", "told"),
    [
        ("skills: [camera]", "skill: [camera]", "3: the robot 'bob' has the key 'skill' (did you mean 'skills'?)"),
        ("most: 2", "most: 2.5", "3: the robot 'bob' has the most '2.5', which it cannot have (write a whole number"),
        ("most: 2", "most: yes", "3: the robot 'bob' has the most 'True'"),
        ("most: 2", "speed: 0", "3: the robot 'bob' has the speed 0 (write more than 0)"),
        ("at: [8, 1]", "at: [8]", "3: the robot 'bob' has the at, which it cannot have (write at: [X, Y]"),
        ("at: [8, 1]", "at: [8, x]", "3: the robot 'bob' has the at 'x'"),
        ("at: [8, 1]", "at: [8, 1, 0]", "3: a place has another number of coordinates than others"),
        (", worth: 10", "", "6: the task 'survey' has no worth (write worth: and a number)"),
        ("worth: 10", "worth: .inf", "6: the task 'survey' has the worth 'inf'"),
        ("robots: 2", "robots: 3", "9: the task 'carry' is worth 20, which 3 robots cannot share"),
        ("[survey, inspect]", "[survey, inspct]", "a synergy has the task 'inspct', which is not there (did you mean"),
        ("[survey, inspect]", "[survey, survey]", "12: a synergy is not of two tasks"),
        (
            "streets",
            "air",
            "13: the file has the distance 'air', which it cannot have (write one of streets, straight)",
        ),
        ("distance: streets", "model: assignment", "may do 2 tasks, and the model is assignment"),
        ("distance: streets", "places: 10", "has 10 places"),
        ("  bob:", "  ann:", "3: 'ann' stands twice"),
        ("robots:\n", "robots: []\nrobot:\n", "the file has the key 'robot'"),
        ("fetch: {", "fetch: !!python/object:os.system {", "8: the tag"),
        ("  cid:", "  a.b: {skills: eye}\n  a: {skills: eye}\n  cid:", None),
    ],
)
def test_what_is_wrong_is_told_with_its_line(now: str, then: str, told: str | None, tmp_path: Path) -> None:
    assert now in LIST
    text = LIST.replace(now, then, 1)
    if told is None:
        text = text.replace("tasks:\n", "tasks:\n  c: {needs: eye, worth: 1}\n  b.c: {needs: eye, worth: 1}\n", 1)
        told = "the robots a.b and a would both have a variable a.b.c"
    assert told in mistakes(text, tmp_path)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    text = LIST.replace("most: 2", "most: -1").replace("worth: 12", "worth: much").replace("load: 2", "load: 2")
    assert len(mistakes(text, tmp_path).splitlines()) == 2


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("robots: {a: }\ntasks: {none: {worth: 1}}\nmodel: assignment", "2: a task is called 'none', as no task is"),
        ("robots: {a: }\ntasks: {t t: {worth: 1}}\nmodel: assignment", "2: 't t'"),
        ("robots: {a: }", "has no tasks"),
        ("robots: 3\ntasks: 4", "1: robots is no mapping"),
        ("robots: {}\ntasks: {t: {worth: 1}}", "1: has no robots (write at least one)"),
        ("robots: {a: }\ntasks: {t: 3}", "2: the task 't' is no mapping"),
        ("robots: {7: , '7': }\ntasks: {t: {worth: 1}}", "robots has '7' twice"),
        ("robots: {a: {most: 0}}\ntasks: {t: {worth: 1}}", "no robot can do any of the tasks"),
        ("robots: {a: }\ntasks: {t: {worth: 1}}\nsynergies: 3", "3: synergies is no list"),
    ],
)
def test_what_cannot_be_a_list_is_refused(text: str, told: str, tmp_path: Path) -> None:
    assert told in mistakes(text, tmp_path)


def test_aliases_are_counted_in_full(tmp_path: Path) -> None:
    bomb = "robots:\n  a: {skills: &a [x, x, x, x, x, x, x, x, x, x]}\n"
    bomb += "".join(f"  b{n}: &{chr(98 + n)} {{skills: [{', '.join([f'*{chr(97 + n)}'] * 10)}]}}\n" for n in range(8))
    assert "values, counting what aliases repeat" in mistakes(bomb + "tasks: {t: {worth: 1}}", tmp_path)


def test_too_much_is_refused(tmp_path: Path) -> None:
    robots = "".join(f"  r{number}: {{}}\n" for number in range(17))
    assert "and 17 could do it" in mistakes(f"robots:\n{robots}tasks: {{t: {{worth: 4, robots: 2}}}}", tmp_path)
    tasks = "".join(f"  t{number}: {{worth: 1}}\n" for number in range(1001))
    assert "has 1001 tasks (1000 are allowed)" in mistakes(f"robots: {{a: }}\ntasks:\n{tasks}", tmp_path)
    with pytest.raises(InvalidInputError, match="which 'infinity' says nothing about"):
        imported(LIST, tmp_path, infinity=3)


def test_random_changes_of_a_list_are_read_or_refused(tmp_path: Path) -> None:
    """Nothing but `InvalidInputError` comes out."""
    chance = Random("bytes")
    read = refused = 0
    for _ in range(60):
        text = list(LIST)
        for _ in range(chance.randrange(1, 4)):
            text[chance.randrange(len(text))] = chance.choice("{}[]:,-&*!0a \n'")
        try:
            read += bool(imported("".join(text), tmp_path).team.robots)
        except InvalidInputError:
            refused += 1
    assert read
    assert refused
