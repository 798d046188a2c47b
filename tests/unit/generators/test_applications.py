"""N-ary problems, frequency assignment and smart lighting: costs follow the definitions."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team
from robochoc.generators.frequencies import WEIGHTS, frequencies
from robochoc.generators.nary import nary
from robochoc.generators.smart_homes import smart_homes
from robochoc.model.problem import Function, Predicate, Relation, Team
from tests.support.cases import cases
from tests.support.evaluation import digest
from tests.support.examples import examples


def test_seeds_give_the_same_problems_on_every_machine() -> None:
    teams: list[Team] = [
        nary(agents=6, domain=3, constraints=5, tightness=0.2, seed=1),
        nary(agents=6, domain=2, constraints=5, arity=4, max_cost=9, seed=2),
        frequencies(agents=6, frequencies=4, seed=3),
        smart_homes(agents=5, rules=3, seed=4),
    ]
    assert {team.name: digest(team) for team in teams} == {
        "nary-6-3-5x3-0.2-1": "b6530e0407037fbf",
        "nary-6-2-5x4-0.0-cost9-2": "22d34e85080fee08",
        "frequencies-6-4-100-40-3-3": "7c6433b613318972",
        "smart-homes-5-3-5-3-3-10-4": "18127db9874f99fc",
    }


@given(st.integers(1, 6), st.integers(1, 3), st.integers(0, 8), st.floats(0, 1), st.integers(0, 2**32))
@examples(25)
def test_each_constraint_forbids_its_fraction(
    agents: int, domain: int, constraints: int, tightness: float, seed: int
) -> None:
    arity = min(agents, 3)
    plain = nary(agents=agents, domain=domain, constraints=constraints, arity=arity, tightness=tightness, seed=seed)
    costly = nary(
        agents=agents, domain=domain, constraints=constraints, arity=arity, tightness=tightness, max_cost=5, seed=seed
    )
    for team in (plain, costly):
        check_team(team)
        found = list(team.constraints())
        assert len(found) == constraints
        for one in found:
            assert isinstance(one.definition, Relation)
            assert len(set(one.variables)) == arity
            costs = [one.definition.cost(row) for row in product(range(1, domain + 1), repeat=arity)]
            assert sum(cost == float("inf") for cost in costs) == round(tightness * domain**arity)


@given(st.integers(1, 8), st.integers(1, 5), st.integers(1, 5), st.integers(0, 2**32))
@examples(25)
def test_near_links_are_separated(agents: int, number: int, separation: int, seed: int) -> None:
    team = frequencies(agents=agents, frequencies=number, side=20, distance=10, separation=separation, seed=seed)
    check_team(team)
    for one in team.constraints():
        assert isinstance(one.definition, Predicate)
        required = int(one.definition.name.removeprefix("apart"))
        assert 1 <= required <= separation
        assert one.cost in WEIGHTS
        for row in product(range(1, number + 1), repeat=2):
            assert one.definition.holds(row) == (abs(row[0] - row[1]) >= required)


@given(st.integers(3, 6), st.integers(0, 4), st.integers(2, 4), st.integers(0, 2**32))
@examples(25)
def test_levels_cost_energy_and_rules_cost_differences(agents: int, rules: int, levels: int, seed: int) -> None:
    team = smart_homes(agents=agents, rules=rules, levels=levels, seed=seed)
    check_team(team)
    for one in team.constraints():
        assert isinstance(one.definition, Function)
        rows = list(product(range(levels), repeat=len(one.variables)))
        costs = [one.definition.cost(row) for row in rows]
        assert min(costs) >= 0
        if one.name.startswith("energy"):
            assert costs == [costs[1] * level for level in range(levels)]


def test_numbers_out_of_bounds_are_refused() -> None:
    refused: list[tuple[Callable[[], object], str]] = [
        (lambda: nary(agents=2, domain=2, constraints=1), "arity is 3; it must be from 1 to 2"),
        (lambda: nary(agents=9, domain=100, constraints=2, arity=4), "more than 1,000,000 together"),
        (lambda: nary(agents=9, domain=2, constraints=2, tightness=1.5), "tightness is 1.5"),
        (lambda: frequencies(agents=0, frequencies=2), "agents is 0"),
        (lambda: frequencies(agents=2, frequencies=2, separation=0), "separation is 0"),
        (lambda: smart_homes(agents=2, rules=1), "lamps is 3; it must be from 1 to 2"),
        (lambda: smart_homes(agents=9, rules=1, levels=100, lamps=4), "100,000,000 combinations of levels"),
    ]
    with cases() as each:
        for make, message in refused:
            with each(message), pytest.raises(ValueError, match=message):
                make()
