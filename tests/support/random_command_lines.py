"""What random command lines are made of: teams of all kinds, options that may be there, and what a refusal is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random
from subprocess import CompletedProcess

from robochoc.model.problem import Team
from robochoc.run.registry import protocol_named
from tests.support.allocation_problems import random_allocation
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.loose_problems import loosened
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team, with_unique_definitions
from tests.support.real_costs import random_costs_team

TEAMS: dict[str, Callable[[Random], Team]] = {
    "satisfaction": random_team,
    "costs": random_cost_team,
    "partially known": random_pkc_team,
    "several variables": random_complex_team,
    "several variables and costs": random_complex_cost_team,
    "superfluous links": lambda chance: loosened(random_team(chance), chance),
    "asymmetric costs": lambda chance: random_asymmetric_team(chance, simple=chance.random() < 0.5),
    "costs that people have": lambda chance: random_costs_team(chance.getrandbits(32)),
    "tasks": lambda chance: random_allocation(chance, simple=True).team,
}
FORMATS = {"frodo": "xml", "xcsp3": "xml", "pydcop": "yaml", "cfn": "cfn"}
"""Formats of other tools that teams are exported to, and how such files are called."""
ORDERS = ("given", "lexicographic", "max-degree", "min-width", "dom-deg", "dfs", "random")


def any_team(chance: Random) -> Team:
    """A team of any kind; in one of four, robots differ in weight."""
    team = with_unique_definitions(TEAMS[chance.choice(sorted(TEAMS))](chance))
    if chance.random() < 0.75:
        return team
    return replace(team, robots=tuple(replace(robot, weight=chance.randint(1, 4)) for robot in team.robots))


def by_the_time(chance: Random, likely: float, *deadlines: float) -> list[str]:
    """A deadline, mostly with some time to improve the answer, or none."""
    words = some(chance, likely, "--deadline", *deadlines)
    return [*words, *some(chance, 0.6, "--improve", 0.001, 0.05, 0.3)] if words else []


def endless(chance: Random, words: list[str]) -> list[str]:
    """So many cycles that a short deadline in `words` ends a local search, if it has cycles; or a few, or nothing."""
    name = words[words.index("--protocol") + 1] if "--protocol" in words else "auto"
    if name == "auto" or "cycles" not in protocol_named(name).settings.__struct_fields__ or chance.random() < 0.3:
        return []
    short = "--deadline" in words and float(words[words.index("--deadline") + 1]) < 1
    return ["--set", f"cycles={100_000 if short else chance.choice((1, 10, 40))}"]


def some(chance: Random, likely: float, *words: object) -> list[str]:
    """An option, with one of the values after its name, or nothing."""
    option, *values = words
    return [str(option), str(chance.choice(values))] if chance.random() < likely else []


def assert_refused(done: CompletedProcess[str], what: str) -> None:
    """A refusal is one line, perhaps after the command's usage, and nothing is printed as a result.

    What is told of a file of another tool comes before it.
    """
    assert not done.stdout, what
    told = [line for line in done.stderr.splitlines() if line and ": infinity: " not in line]
    assert told, what
    assert len(told) == 1 or told[0].startswith("Usage:"), what
