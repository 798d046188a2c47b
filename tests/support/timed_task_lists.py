"""Random lists with windows, durations, precedence and teams, and their meaning by brute force."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from random import Random
from typing import Any

from tests.support.random_task_lists import Meaning, exact, random_list, rounded_fraction, size_of

Plan = tuple[tuple[str, ...], Fraction, Mapping[str, int]]
"""Tasks, the cost of the way minus synergies, and the starts of ordered tasks, in steps."""


class TimedMeaning(Meaning):
    """The meaning of a list with times, by brute force."""

    def __init__(self, told: Mapping[str, Any]) -> None:
        super().__init__(told)
        self.step = exact(told.get("step", 1))
        self.after = {name: self.names(task.get("after", [])) for name, task in self.tasks.items()}
        self.joint = {name for name, task in self.tasks.items() if "team" in task and size_of(task) > 1}
        self.ordered = {name for name, before in self.after.items() for name in (name, *before) if before} | self.joint

    @staticmethod
    def names(after: str | Sequence[str]) -> list[str]:
        return [after] if isinstance(after, str) else [*after]

    def best(self) -> Fraction:
        if not self.is_touring:
            return super().best()
        plans = [[*self.plans(one)] for one in self.robots.values()]
        return max(found for each in itertools.product(*plans) if (found := self.value_of(each)) is not None)

    def plans(self, robot: Mapping[str, Any]) -> Iterator[Plan]:
        """Yield the shortest way for each set of tasks and each choice of starts."""
        able = [name for name, task in self.tasks.items() if self.is_able(robot, task)]
        for number in range(min(robot.get("most", len(able)), len(able)) + 1):
            for tasks in itertools.combinations(able, number):
                if sum(self.tasks[name].get("load", 1) for name in tasks) > robot.get("capacity", len(tasks) * 9):
                    continue
                extra = sum(exact(one["worth"]) for one in self.synergies if {*one["tasks"]} <= {*tasks})
                found: dict[tuple[tuple[str, int], ...], Fraction] = {}
                for order in itertools.permutations(tasks):
                    for length, starts in self.schedules(robot, order):
                        found[starts] = min(length, found.get(starts, length))
                for starts, length in found.items():
                    yield tasks, extra - rounded_fraction(length, self.places), dict(starts)

    def schedules(
        self, robot: Mapping[str, Any], order: Sequence[str]
    ) -> Iterator[tuple[Fraction, tuple[tuple[str, int], ...]]]:
        """Yield the length of a way and the starts, for each possible choice of starts."""
        speed = exact(robot.get("speed", 1))
        ready = [(Fraction(), Fraction(), robot.get("at"), ())]
        for name in order:
            task, reached = self.tasks[name], []
            for length, time, at, starts in ready:
                way = self.length(at, task.get("at"), 9) if robot.get("at") else Fraction()
                here = task["at"] if robot.get("at") and task.get("at") else at
                arrival = time + way / speed
                if arrival > exact(task.get("deadline", 10**9)):
                    continue
                earliest, latest = map(exact, task.get("window", (0, 10**9)))
                begin = max(arrival, earliest)
                for start in self.starts(name, begin, latest):
                    used = () if name not in self.ordered else ((name, int(start / self.step)),)
                    end = start + exact(task.get("duration", 0))
                    reached.append((length + way, end, here, (*starts, *used)))
            ready = reached
        for length, _, _, starts in ready:
            yield length, tuple(sorted(starts))

    def starts(self, name: str, begin: Fraction, latest: Fraction) -> list[Fraction]:
        if begin > latest:
            return []
        if name not in self.ordered:
            return [begin]
        return [slot * self.step for slot in range(-int(-begin // self.step), int(latest // self.step) + 1)]

    def value_of(self, each: Sequence[Plan]) -> Fraction | None:
        for name, before in self.after.items():
            for other in before:
                late = [starts[name] for tasks, _, starts in each if name in tasks]
                soon = [starts[other] for tasks, _, starts in each if other in tasks]
                if late and not soon:
                    return None
                gap = exact(self.tasks[other].get("duration", 0))
                if any((one - two) * self.step < gap for one in late for two in soon):
                    return None
        if any(len({starts[name] for tasks, _, starts in each if name in tasks}) > 1 for name in self.joint):
            return None
        return self.value([(tasks, cost) for tasks, cost, _ in each])


def timed_list(chance: Random) -> dict[str, Any]:
    """Return a random list with times."""
    told = {**random_list(chance), "tours": True, "model": "several", "step": chance.choice((1, 2, 0.5))}
    names = [*told["tasks"]]
    for place, (name, task) in enumerate(told["tasks"].items()):
        task["worth"] = 6 * chance.randrange(2, 9)
        if chance.random() < 0.5:
            task["duration"] = chance.choice((1, 2.5, 3))
        if chance.random() < 0.4:
            earliest = chance.choice((0, 2, 5.5))
            task["window"] = [earliest, earliest + chance.choice((1, 4, 9))]
        if place and chance.random() < 0.5:
            others = names[:place] if chance.random() < 0.5 else names[place - 1 : place]
            told["tasks"][name]["after"] = others if len(others) > 1 or chance.random() < 0.5 else others[0]
            for one in (name, *others):
                early = chance.randrange(4)
                told["tasks"][one].setdefault("window", [early, early + 4])
    return told


def team_list(chance: Random) -> dict[str, Any]:
    """Return a random list with teams, with times or without tours."""
    told = timed_list(chance)
    if chance.random() < 0.3:
        told = {**random_list(chance), "model": "several", "tours": False}
    for task in told["tasks"].values():
        if chance.random() < 0.7:
            skills = chance.sample(["arm", "eye", "7"], chance.choice((1, 2, 2, 3)))
            places = {skill: chance.choice((1, 1, 1, 2)) for skill in skills}
            task.pop("robots", None)
            task["team"] = chance.choice((places, places, places, 2))
            task["worth"] = 12 * chance.randrange(2, 9)
            early = chance.randrange(5)
            if told["tours"]:
                task.setdefault("window", [early, early + chance.choice((4, 9))])
    for robot in told["robots"]:
        if chance.random() < 0.8:
            told["robots"][robot] = {
                **(told["robots"][robot] or {}),
                "skills": chance.sample(["arm", "eye", "7"], chance.choice((1, 2, 3))),
            }
    return told
