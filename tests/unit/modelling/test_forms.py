"""Functions of models accept lists and arrays as well as single arguments and tables."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import Any

import numpy as np
import pytest

import robochoc
from robochoc.modelling.errors import ModelTypeError
from tests.support.cases import looped


def pair() -> tuple[robochoc.Model, Any, Any]:
    """Return a model of two robots, and their variables of three and two values."""
    model = robochoc.Model("pair")
    x = model.robot("r0").variable("x", [5, 7, 9])
    y = model.robot("r1").variable("y", ["a", "b"])
    return model, x, y


def test_conditions_are_given_one_by_one_or_as_a_list() -> None:
    _, x, y = pair()
    conditions = [x == 5, y == "a"]
    for junction in (robochoc.all_of, robochoc.any_of):
        expected = repr(junction(conditions))
        assert repr(junction(*conditions)) == repr(junction(iter(conditions))) == expected
        assert repr(junction(np.array(conditions, dtype=object))) == expected
        assert repr(junction(conditions[0])) == repr(conditions[0])
    assert repr(robochoc.all_of()) == repr(robochoc.all_of([]))
    with pytest.raises(ModelTypeError):
        robochoc.all_of("xy")


@looped(
    ("table", "of_both", "best"),
    [
        ([3, 1, 2], False, (7, 1)),
        (np.array([3, 2, 0.5]), False, (9, Decimal("0.5"))),
        ([[4, 3], [2, 5], [6, 6]], True, (7, 2)),
        (np.array([[4, 3], [2, 5], [6, 1]]), True, (9, 1)),
        ([(math.inf, 3), (8, math.inf), (6, 6)], True, (5, 3)),
    ],
)
def test_costs_follow_the_order_of_domains(table: Any, of_both: bool, best: tuple[int, Decimal]) -> None:  # noqa: ANN401, FBT001 - a case
    model, x, y = pair()
    model.minimize(robochoc.costs([x, y] if of_both else x, table))
    solution = model.solve("dpop")
    assert (solution[x], solution.cost) == best


def test_lists_of_costs_that_do_not_fit_are_refused() -> None:
    _, x, y = pair()
    for scope, table, message in (
        (x, [1, 2], "2 costs, but r0.x has 3 values"),
        ([x, y], [[1, 2], [1], [1, 2]], "1 costs, but r1.y has 2 values"),
        ([x, y], [1, 2, 3], "1 is not a list of costs .*each value of r1.y"),
        (x, "abc", "'abc' is not a list"),
        (x + 1, [1, 2, 3], "is not a variable.*use a dict"),
        (x, ["a", 2, 3], "invalid cost 'a'"),
    ):
        with pytest.raises(robochoc.ModelError, match=message):
            robochoc.costs(scope, table)


def test_an_infinite_cost_makes_a_constraint_hard() -> None:
    for cost in (math.inf, np.inf):
        model, x, _ = pair()
        model.add(x == 9, cost=cost)
        model.minimize(x)
        solution = model.solve("dpop")
        assert (solution[x], solution.cost) == (9, 9)
        model.add(x == 5, cost=cost)
        assert model.solve("dpop").verdict == "no-solution"
    with pytest.raises(robochoc.ModelError, match="inf"):
        model.add(x == 9, cost=-math.inf)
