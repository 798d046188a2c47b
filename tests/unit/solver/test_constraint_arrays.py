"""Costs of all combinations at once are those of single combinations."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.model.expression import OPERATORS, Apply, Constant, Expression, Name, Type
from robochoc.model.expression.tree import is_total
from robochoc.model.problem import INFINITE, Constraint, Function, Predicate
from robochoc.solver.constraint_arrays import RowCosts, cost_array
from robochoc.solver.encoding import cost_function
from tests.support.examples import examples
from tests.support.random_expressions import NAMES, NUMBERS, TRUTHS, small_or_huge

ORDERED = ("Y", "V3.1", "X", "i")
"""The variables of three axes, two on the second."""
COLUMNS = st.tuples(
    *(st.lists(st.tuples(*[small_or_huge()] * width), min_size=1, max_size=3, unique=True) for width in (1, 2, 1))
)
SMALL = st.tuples(
    *(st.lists(st.tuples(*[st.integers(-3, 4)] * width), min_size=1, max_size=4, unique=True) for width in (1, 2, 1))
)


def compared(constraint: Constraint, columns: Sequence[Sequence[tuple[int, ...]]]) -> bool:
    """Return whether there is an array; it must have the costs of single combinations."""
    found = cost_array(constraint, ORDERED, columns)
    if found is None:
        return False
    price = cost_function(constraint, ORDERED)
    rows = itertools.product(*columns)
    assert found.shape == tuple(map(len, columns))
    assert found.ravel().tolist() == [float(price([*itertools.chain(*row)])) for row in rows]
    return True


def compared_by_row(constraint: Constraint, columns: Sequence[Sequence[tuple[int, ...]]]) -> bool:
    """Return whether rows are supported; their costs must be those of single combinations."""
    found = RowCosts(constraint, ORDERED, columns)
    if found.most is None:
        return False
    price = cost_function(constraint, ORDERED)
    above, lowest, own = columns
    places = [*itertools.product(range(len(above)), range(len(own)))]
    costs = found.of([np.array([place for place, _ in places]), np.array([place for _, place in places])])
    expected = [[float(price([*above[one], *last, *own[other]])) for last in lowest] for one, other in places]
    assert costs.tolist() == expected
    assert max((cost for row in expected for cost in row if cost < INFINITE), default=0) <= found.most
    return True


@examples(150, slow=3000)
@given(NUMBERS, st.one_of(COLUMNS, SMALL))
def test_functions(body: Expression, columns: Sequence[Sequence[tuple[int, ...]]]) -> None:
    constraint = Constraint("C", Function("F", NAMES, body), NAMES, NAMES)
    assert compared(constraint, columns) >= compared_by_row(constraint, columns)


@examples(150, slow=3000)
@given(TRUTHS, st.one_of(COLUMNS, SMALL), st.sampled_from([INFINITE, 3]))
def test_predicates(body: Expression, columns: Sequence[Sequence[tuple[int, ...]]], cost: float) -> None:
    constraint = Constraint("C", Predicate("P", NAMES, body), NAMES, NAMES, cost=cost)
    assert compared(constraint, columns) >= compared_by_row(constraint, columns)


@pytest.mark.parametrize("operator", ["neg", "abs", "sqr", "add", "sub", "dist", "mul", "min", "max", "eq", "ne", "lt"])
def test_common_operators_have_arrays(operator: str) -> None:
    names = [Name(name) for name in NAMES[: 1 if operator in {"neg", "abs", "sqr"} else 2]]
    body = Apply("le", (Apply(operator, tuple(names)), Apply("add", (*names, Name("i"), Name("V3.1")))))
    columns = [(-2,), (0,), (5,)], [(1, 1), (2, -1)], [(-4,), (4,)]
    parameters = ("i", 3, "X", "V3.1")  # a constant, and the second axis only in part
    variables = ("i", "X", "V3.1")
    predicate = Predicate("P", NAMES, body)
    assert compared(Constraint("C", predicate, NAMES, NAMES), columns)
    assert compared(Constraint("C", predicate, variables, parameters), columns)


def test_operators_that_are_always_defined_have_arrays() -> None:
    columns = [(-2,), (0,), (5,)], [(1, 1), (2, -1)], [(-4,), (4,)]
    for operator, row in OPERATORS.items():
        numbers = [Name(name) for name in NAMES[: len(row.takes)]]
        arguments = [
            Apply("lt", (number, Constant(2))) if kind == Type.BOOLEAN else number
            for number, kind in zip(numbers, row.takes, strict=True)
        ]
        body = Apply("lt", (Apply(operator, tuple(arguments)), Constant(3)))
        constraint = Constraint("C", Predicate("P", NAMES, body), NAMES, NAMES)
        assert compared(constraint, columns) is compared_by_row(constraint, columns) is is_total(body), operator
