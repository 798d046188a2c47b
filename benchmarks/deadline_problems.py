"""The problems of the part `deadline`: 12 families with costs, of 6 to 300 robots, five problems each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import combinations
from random import Random
from typing import Any

from measure import ROOT

from robochoc.generators.families import FAMILIES
from robochoc.model.problem import Team
from robochoc.modelling.functions import function
from robochoc.modelling.model import Model

MAP = ROOT / "docs" / "examples" / "building" / "building.yaml"
SEEDS = range(5)


def deadline_problem(family: str, seed: int) -> Team:
    """Return the problem of `family` with `seed`, which determines its parameters too."""
    return PROBLEMS[family](Random(f"deadline {family} {seed}"))


def _size(chance: Random, least: int, most: int) -> int:
    """Return a number from `least` to `most`; its logarithm is uniform."""
    return round(math.exp(chance.uniform(math.log(least), math.log(most))))


def _generated(family: str, chance: Random, **parameters: Any) -> Team:  # noqa: ANN401 - those of the family
    """Return a problem of one of robochoc's families. Other seeds are tried if a seed gives no problem."""
    for _ in range(100):
        try:
            return FAMILIES[family](**parameters, seed=chance.randrange(10**6))
        except ValueError as error:
            why = error
    raise why


def _random(chance: Random, robots: tuple[int, int], degree: tuple[float, float], tightness: float = 0) -> Team:
    agents = _size(chance, *robots)
    density = min(1.0, chance.uniform(*degree) / (agents - 1))
    sizes = {"agents": agents, "domain": chance.randint(3, 10), "density": density, "max_cost": 100}
    return _generated("random", chance, **sizes, tightness=tightness)


def _colouring(chance: Random, conflicts: str, graph: str) -> Team:
    more = {"links": 2} if graph == "scale-free" else {"neighbours": 6, "rewiring": 0.3}
    agents = _size(chance, 50, 300)
    return _generated("coloring", chance, agents=agents, colors=3, graph=graph, conflicts=conflicts, **more)


def _meetings(chance: Random, model: str, persons: tuple[int, int]) -> Team:
    agents = _size(chance, *persons)
    meetings = round(agents * chance.uniform(0.6, 1.0))
    return _generated("meetings", chance, agents=agents, meetings=meetings, slots=8, model=model, participants=3)


def _formation(chance: Random) -> Team:
    """Return a formation: each robot chooses a place at a distance of its own, and no place is chosen twice."""
    robots = _size(chance, 6, 16)
    places = [(chance.uniform(0, 100), chance.uniform(0, 100)) for _ in range(robots + 2)]
    model = Model("formation")
    chosen = []
    costs: Any = 0
    for number in range(robots):
        x, y = chance.uniform(0, 100), chance.uniform(0, 100)
        place = model.robot(f"Robot{number}").variable("place", range(len(places)))
        distances = [round(math.dist((x, y), one)) for one in places]
        costs += function(lambda value, distances=distances: distances[value], place)
        chosen.append(place)
    for one, other in combinations(chosen, 2):
        model.add(one != other)
    model.minimize(costs)
    return model.team


def _wide(chance: Random) -> Team:
    """Return robots with a charging slot and a task each: slots are limited, and no task is done twice."""
    robots, slots, tasks = chance.randint(6, 10), 3, chance.randint(5, 8)
    model = Model("wide")
    own = []
    costs: Any = 0
    for number in range(robots):
        robot = model.robot(f"Robot{number}")
        slot, task = robot.variable("slot", range(slots)), robot.variable("task", range(tasks + 1))
        distances = [round(10 * chance.uniform(1, 12)) for _ in range(tasks)] + [300]
        weight = chance.randint(1, 10)
        costs += function(lambda value, distances=distances: distances[value], task)
        costs += function(lambda value, weight=weight: 10 * weight * value, slot)
        own.append((slot, task))
    docks = math.ceil(robots / slots)
    for time in range(slots):
        model.add(sum(one == time for one, _ in own) <= docks)
    for (_, one), (_, other) in combinations(own, 2):
        model.add((one != other) | (one == tasks))
    model.minimize(costs)
    return model.team


PROBLEMS: Mapping[str, Callable[[Random], Team]] = {
    "random small": lambda chance: _random(chance, (8, 30), (3, 6)),
    "random sparse": lambda chance: _random(chance, (50, 300), (2, 4)),
    "random dense": lambda chance: _random(chance, (30, 100), (8, 20)),
    "random with conflicts": lambda chance: _random(chance, (20, 200), (3, 6), tightness=0.2),
    "soft colouring": lambda chance: _colouring(chance, "soft", "small-world"),
    "weighted colouring": lambda chance: _colouring(chance, "weighted", "scale-free"),
    "ising": lambda chance: _generated("ising", chance, rows=chance.randint(4, 12), columns=chance.randint(4, 20)),
    "meetings": lambda chance: _meetings(chance, "eav", (8, 40)),
    "meetings by person": lambda chance: _meetings(chance, "peav", (8, 40)),
    "tasks": lambda chance: _generated("tasks", chance, agents=_size(chance, 8, 40), tasks=_size(chance, 4, 12)),
    "formations": _formation,
    "wide robots": _wide,
}  # fmt: skip
"""For each family, the function that makes a problem from a random number generator."""
