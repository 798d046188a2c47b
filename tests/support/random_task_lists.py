"""Random lists of tasks over every combination of keys, and their meaning in the guide, by brute force."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from decimal import ROUND_HALF_UP, Decimal, localcontext
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import yaml

from robochoc.formats import InvalidInputError
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign
from robochoc.model.problem import Team

List = Mapping[str, Any]
_FAR = Fraction(10**9)


def exact(number: object) -> Fraction:
    return Fraction(str(number))


def places_of(numbers: Iterator[object]) -> int:
    return max((len(str(one).partition(".")[2].rstrip("0")) for one in numbers), default=0)


class Meaning:
    """The meaning of a list, as docs/guides/tasks.md defines it."""

    def __init__(self, told: List) -> None:
        self.told = told
        self.robots: Mapping[str, List] = {name: one or {} for name, one in told["robots"].items()}
        self.tasks: Mapping[str, List] = told["tasks"]
        self.synergies: Sequence[List] = told.get("synergies", ())
        alone = all(one.get("most") == 1 for one in self.robots.values())
        alone = alone and all(size_of(one) == 1 for one in self.tasks.values())
        self.model = told.get("model", "assignment" if alone else "several")
        self.is_touring = bool(told.get("tours")) and self.model == "several"
        worths = (one["worth"] for one in (*self.tasks.values(), *self.synergies))
        self.places = max(told.get("places", 0), places_of(worths))

    def refusals(self) -> Iterator[str]:
        """Yield parts of the messages of which one is expected."""
        if len({len(one["at"]) for one in (*self.robots.values(), *self.tasks.values()) if one.get("at")}) > 1:
            yield "a different number of coordinates"
            return
        if self.model == "assignment":
            if any(one.get("most", 1) != 1 for one in self.robots.values()):
                yield "the model assignment allows one"
            if any(size_of(one) > 1 for one in self.tasks.values()):
                yield "the model assignment allows one"
            if "none" in self.tasks:
                yield "the name 'none' is reserved"
        elif not any(self.is_able(one, task) for one in self.robots.values() for task in self.tasks.values()):
            yield "no robot can do any of the tasks"
        for task in self.tasks.values():
            if exact(task["worth"]) * 10**self.places % size_of(task):
                yield "cannot be divided"

    def best(self) -> Fraction:
        """Return the most that the list can bring, over all ways to share the tasks out."""
        kinds = [[*self.sets(one)] for one in self.robots.values()]
        return max(found for each in itertools.product(*kinds) if (found := self.value(each)) is not None)

    def sets(self, robot: List) -> Iterator[tuple[tuple[str, ...], Fraction]]:
        """Yield each set of tasks that a robot can do by itself, and what its way costs and its synergies bring."""
        most = 1 if self.model == "assignment" else robot.get("most", len(self.tasks))
        able = [name for name, task in self.tasks.items() if self.is_able(robot, task)]
        for number in range(min(most, len(able)) + 1):
            for tasks in itertools.combinations(able, number):
                load = sum(self.tasks[name].get("load", 1) for name in tasks)
                way = self.tour(robot, tasks) if self.is_touring else self.ways(robot, tasks)
                if way is None or load > robot.get("capacity", load):
                    continue
                extra = sum(exact(one["worth"]) for one in self.synergies if {*one["tasks"]} <= {*tasks})
                yield tasks, (extra if self.model == "several" else 0) - way

    def value(self, each: Sequence[tuple[tuple[str, ...], Fraction]]) -> Fraction | None:
        total = sum((own for _, own in each), Fraction())
        for name, task in self.tasks.items():
            crew = [robot for robot, (tasks, _) in zip(self.robots.values(), each, strict=True) if name in tasks]
            if crew and not is_complete(crew, task):
                return None
            total += exact(task["worth"]) * bool(crew)
        return total

    def is_able(self, robot: List, task: List) -> bool:
        needs, has = (
            [one] if isinstance(one, str) else one for one in (task.get("needs", []), robot.get("skills", []))
        )
        team = task.get("team")
        if isinstance(team, dict) and {*team}.isdisjoint(has):
            return False
        if not {*needs} <= {*has} or robot.get("most") == 0 or task.get("load", 1) > robot.get("capacity", _FAR):
            return False
        return self.length(robot.get("at"), task.get("at"), 9) <= self.time(robot, task)

    def time(self, robot: List, task: List) -> Fraction:
        return exact(task.get("deadline", _FAR)) * exact(robot.get("speed", 1))

    def ways(self, robot: List, tasks: Sequence[str]) -> Fraction:
        places = [self.tasks[name].get("at") for name in tasks]
        return sum((self.length(robot.get("at"), place, self.places) for place in places), Fraction())

    def tour(self, robot: List, tasks: Sequence[str]) -> Fraction | None:
        """Return the length of the shortest tour in time; None: there is none. A robot without a place has no ways."""
        if not robot.get("at"):
            return Fraction()
        found = []
        for order in itertools.permutations([self.tasks[name] for name in tasks if self.tasks[name].get("at")]):
            stops = [robot["at"], *(task["at"] for task in order)]
            times = list(itertools.accumulate(self.length(*leg, 9) for leg in itertools.pairwise(stops)))
            if all(time <= self.time(robot, task) for time, task in zip(times, order, strict=True)):
                found.append(times[-1] if times else Fraction())
        return rounded_fraction(min(found), self.places) if found else None

    def length(self, start: Sequence[object] | None, end: Sequence[object] | None, places: int) -> Fraction:
        if not start or not end:
            return Fraction()
        with localcontext(prec=80):
            parts = [abs(Decimal(str(one)) - Decimal(str(other))) for one, other in zip(start, end, strict=True)]
            if self.told.get("distance") == "streets":
                return rounded(sum(parts, Decimal()), places)
            return rounded(sum((part * part for part in parts), Decimal()).sqrt(), places)


def size_of(task: List) -> int:
    """Return the number of robots that a task requires."""
    team = task.get("team", task.get("robots", 1))
    return sum(team.values()) if isinstance(team, dict) else team


def is_complete(crew: Sequence[List], task: List) -> bool:
    """Return whether robots are as many as a task requires, and each can have a place of its team."""
    team = task.get("team")
    if len(crew) != size_of(task):
        return False
    if not isinstance(team, dict):
        return True
    places = [skill for skill, number in team.items() for _ in range(number)]
    skills = [[one["skills"]] if isinstance(one["skills"], str) else one["skills"] for one in crew]
    return any(
        all(place in has for place, has in zip(order, skills, strict=True)) for order in itertools.permutations(places)
    )


def rounded(number: Decimal, places: int) -> Fraction:
    return Fraction(number.quantize(Decimal(1).scaleb(-places), ROUND_HALF_UP))


def rounded_fraction(number: Fraction, places: int) -> Fraction:
    return rounded(Decimal(number.numerator) / Decimal(number.denominator), places)


def random_list(chance: Random) -> dict[str, Any]:
    """Return two or three robots and two or three tasks; each key is there or not."""
    axes = chance.choice((2, 2, 2, 3))

    def number() -> object:
        return chance.choice((chance.randrange(-9, 10), chance.randrange(-90, 90) / 10))

    def point() -> list[object]:
        return [number() for _ in range(axes if chance.random() < 0.99 else 5 - axes)]

    def skills(most: int) -> object:
        found = chance.sample(["arm", "eye", "7"], chance.randint(0, most))
        return found[0] if len(found) == 1 and chance.random() < 0.5 else found

    def some(**values: object) -> dict[str, Any]:
        return {name: one for name, one in values.items() if chance.random() < 0.55}

    alone = chance.random() < 0.4
    robots: dict[str, Any] = {
        name: some(
            at=point(), skills=skills(3), capacity=chance.randrange(5), speed=chance.choice((1, 2, 0.5)),
            most=chance.choice((0, 1, 2, 3)),
        )
        | ({"most": 1} if alone else {})
        or None
        for name in chance.sample(["ann", "bob", "r3", "a.b"], chance.choice((2, 2, 3)))
    }  # fmt: skip
    names = chance.sample(["t1", "fix", "t3", "paint"], chance.choice((2, 3)))
    if chance.random() < 0.01:
        names[0] = "none"
    tasks = {
        name: {"worth": chance.choice((chance.randrange(-3, 40), 6 * chance.randrange(8), chance.randrange(400) / 10))}
        | some(at=point(), needs=skills(1), load=chance.randrange(4), deadline=chance.choice((0, 3, 9, 12.5)))
        | ({"robots": chance.choice((1, 2, 2, 3))} if not alone and chance.random() < 0.25 else {})
        for name in names
    }
    synergies = [
        {"tasks": chance.sample(names, 2), "worth": chance.choice((chance.randrange(-9, 10), 2.5))}
        for _ in range(chance.randrange(3))
    ]
    head = some(
        name="a list", model=chance.choice(("several", "several", "assignment")), places=chance.randrange(3),
        distance=chance.choice(("streets", "straight")), tours=chance.random() < 0.7, synergies=synergies,
    )  # fmt: skip
    parts = [*head.items(), ("robots", robots), ("tasks", tasks)]
    chance.shuffle(parts)
    return dict(parts)


def written(told: List, style: str) -> str:
    if style == "json":
        return json.dumps(told)
    return yaml.safe_dump(told, default_flow_style=style == "flow", sort_keys=False)


def read_or_refused(path: Path) -> tuple[Team | None, str]:
    try:
        return read_foreign([path], ImportOptions()).team, ""
    except InvalidInputError as error:
        return None, str(error)
