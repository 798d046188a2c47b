"""Normalised costs: 0 or more, minimised, and told back exactly."""

from __future__ import annotations

import itertools
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.model.cost_units import cost_shown
from robochoc.model.costs import UnboundedCostError, flat_units, normalized, normalized_robot, user_cost
from robochoc.model.expression import Type, evaluate, parse
from robochoc.model.expression.bounds import ANY_INTEGER, Interval, bounds
from robochoc.model.expression.tree import UndefinedValueError
from robochoc.model.problem import INFINITE, Function
from robochoc.solver.encoding import max_cost
from robochoc.verification.checker import assignment_cost, constraint_cost
from tests.support.examples import examples
from tests.support.real_costs import random_costs_team


@examples(60)
@given(st.integers(0, 10**6))
def test_normalised_costs_tell_the_cost_of_every_assignment(seed: int) -> None:
    team = random_costs_team(seed)
    counted = normalized(team)
    units = team.robots[0].costs
    for values in itertools.product(*(variable.domain for variable in team.variables.values())):
        assignment = dict(zip(team.variables, values, strict=True))
        inner = [constraint_cost(one, assignment) for one in counted.constraints()]
        outer = [(one, constraint_cost(one, assignment)) for one in team.constraints()]
        assert all(cost >= 0 for cost in inner)
        assert [cost == INFINITE for cost in inner] == [cost == INFINITE for _, cost in outer]
        if INFINITE not in inner:
            unit = Fraction(1, 10**units.places)
            exact = units.constant * unit + sum(
                Fraction(cost) * (1 if isinstance(one.definition, Function) else unit) for one, cost in outer
            )
            assert Fraction(user_cost(counted, assignment_cost(counted, assignment))) == exact


@examples(60)
@given(st.integers(0, 10**6))
def test_a_normalised_function_says_its_bounds_by_itself(seed: int) -> None:
    for constraint in normalized(random_costs_team(seed)).constraints():
        if isinstance(constraint.definition, Function):
            unknown = dict.fromkeys(constraint.definition.parameters, ANY_INTEGER)
            low, high = bounds(constraint.definition.body, unknown)
            assert low >= 0
            assert high <= max_cost(constraint) < INFINITE


def test_a_team_with_plain_costs_stays_as_it_is() -> None:
    team = next(team for team in map(random_costs_team, range(1000)) if normalized(team) is team)
    assert flat_units(team) == team.robots[0].costs
    counted = normalized(next(team for team in map(random_costs_team, range(9)) if normalized(team) is not team))
    assert normalized(counted) is counted


def test_a_function_over_unknown_domains_must_say_its_bounds() -> None:
    team = next(
        team
        for team in map(random_costs_team, range(99))
        if any(isinstance(one.definition, Function) for one in team.robots[-1].shared)
    )
    with pytest.raises(UnboundedCostError, match=r"the cost of C[0-9] has no bounds"):
        normalized_robot(team.robots[-1], team.robots[-1].costs, {})


_TEXTS = (
    *("add(X,Y)", "sub(X,Y)", "mul(X,Y)", "mul(X,Y,X)", "div(X,Y)", "mod(X,Y)", "pow(X,Y)", "min(X,Y)", "max(X,Y)"),
    *("abs(X)", "neg(X)", "dist(X,Y)", "if(lt(X,Y),X,neg(Y))", "add(mul(X,X),neg(abs(Y)))"),
)


@examples(200)
@given(st.sampled_from(_TEXTS), *[st.integers(-9, 9)] * 4)
def test_no_value_lies_outside_the_bounds(text: str, a: int, b: int, c: int, d: int) -> None:
    expression = parse(text, ("X", "Y"), Type.INTEGER)
    limits = {"X": Interval(min(a, b), max(a, b)), "Y": Interval(min(c, d), max(c, d))}
    low, high = bounds(expression, limits)
    for x, y in itertools.product(range(min(a, b), max(a, b) + 1), range(min(c, d), max(c, d) + 1)):
        try:
            value = evaluate(expression, {"X": x, "Y": y})
        except UndefinedValueError:
            continue
        assert low <= value <= high


def test_bounds_of_what_is_unknown() -> None:
    expression = parse("max(0, min(mul(X,Y), 100))", ("X", "Y"), Type.INTEGER)
    assert bounds(expression, {"X": ANY_INTEGER, "Y": ANY_INTEGER}) == (0, 100)


@pytest.mark.parametrize(
    ("cost", "shown"), [(1234567, "1,234,567"), (Decimal("1.5E-8"), "0.000000015"), (2.0, "2"), (-2.5, "-2.5")]
)
def test_a_cost_is_shown_with_all_its_digits(cost: float | Decimal, shown: str) -> None:
    assert cost_shown(cost) == shown
