"""What random command lines are made of: teams of all kinds, options that may be there, and what a refusal is."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from subprocess import CompletedProcess

from robochoc.model.problem import Team
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.loose_problems import loosened
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team

TEAMS: dict[str, Callable[[Random], Team]] = {
    "satisfaction": random_team,
    "costs": random_cost_team,
    "partially known": random_pkc_team,
    "several variables": random_complex_team,
    "several variables and costs": random_complex_cost_team,
    "superfluous links": lambda chance: loosened(random_team(chance), chance),
}
ORDERS = ("given", "lexicographic", "max-degree", "min-width", "dom-deg", "dfs", "random")


def some(chance: Random, likely: float, *words: object) -> list[str]:
    """An option, with one of the values after its name, or nothing."""
    option, *values = words
    return [str(option), str(chance.choice(values))] if chance.random() < likely else []


def assert_refused(done: CompletedProcess[str], what: str) -> None:
    """A refusal is one line, perhaps after the command's usage, and nothing is printed as a result."""
    assert not done.stdout, what
    told = [line for line in done.stderr.splitlines() if line]
    assert told, what
    assert len(told) == 1 or told[0].startswith("Usage:"), what
