"""Starts with repairs, rules for the answer, counts and bounds, in any combination, compared with brute force."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from random import Random
from typing import Any

import pytest

from robochoc.model.problem import Team
from robochoc.run import Options, solve
from robochoc.run.options import AnswerRule
from robochoc.run.registry import protocol_named, protocol_names
from tests.simulation.drawing import is_refused
from tests.simulation.invariants import violated
from tests.simulation.plan import Plan
from tests.support.brute_force import priced_solutions
from tests.support.encrypted_problems import affordable
from tests.support.examples import are_the_same, count, drawn
from tests.support.loose_problems import loose_team
from tests.support.random_options import random_options

pytestmark = pytest.mark.fresh

ADDED: tuple[dict[str, Any], ...] = (
    {"repair": False},
    {"answer": AnswerRule.FINAL},
    {"count": True},
    {"bounds": True},
    {"messages": 40},
)


def _start(team: Team, found: list[tuple[dict[str, int], float]], chance: Random) -> dict[str, int | None]:
    """Return a solution, any assignment, or a part of one."""
    if found and chance.random() < 0.4:
        return {**chance.choice(found)[0]}
    share = chance.choice((0.5, 1.0))
    return {name: chance.choice([*one.domain]) for name, one in team.variables.items() if chance.random() < share}


def _team(protocol: str, chance: Random) -> Team:
    return loose_team(protocol, chance, costs=protocol_named(protocol).traits.costs and chance.random() < 0.6)


def _options(team: Team, protocol: str, start: dict[str, int | None], chance: Random) -> Options:
    """Return options at random that can be combined."""
    kind = protocol_named(protocol)
    settings = {"cycles": chance.choice("18")} if hasattr(kind.settings, "cycles") else {}
    messages = None if settings or kind.traits.complete else 2000
    options = replace(random_options(team, protocol, chance), settings=settings, messages=messages)
    for added in ({"start": start}, *(one for one in ADDED if chance.random() < 0.5)):
        more = replace(options, **added)
        options = options if is_refused(team, more) else more
    return options


@count("teams", 100, 800)
def test_answers_are_right_with_any_combination(teams: int) -> None:
    seen = Counter[str]()
    counting = [name for name in protocol_names() if protocol_named(name).traits.counts]
    for number in range(teams):
        chance = drawn(f"combined start {number}")
        protocol = chance.choice(counting if chance.random() < 0.3 else protocol_names())
        team = affordable(protocol, partial(_team, protocol, chance))
        found = list(priced_solutions(team))
        options = _options(team, protocol, _start(team, found, chance), chance)
        outcome = solve(team, options)
        assert not [*violated(Plan(number, team, options), outcome)], (number, options)
        if outcome.count is not None:
            least = min((cost for _, cost in found), default=0)
            assert outcome.count == sum(cost == least for _, cost in found), (number, options)
        seen.update(name for name in ("start", "bounds") if getattr(options, name))
        seen.update(f"{name} {getattr(options, name)}" for name in ("repair", "answer"))
        seen.update(count=outcome.count is not None, repaired=outcome.repair is not None)
    if are_the_same():
        assert all(seen.values()), seen
