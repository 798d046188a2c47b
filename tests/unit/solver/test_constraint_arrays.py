"""Costs of all combinations at once are those of single combinations."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.model.expression import Apply, Expression, Name
from robochoc.model.problem import INFINITE, Constraint, Function, Predicate
from robochoc.solver.constraint_arrays import cost_array
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


@examples(150, slow=3000)
@given(NUMBERS, st.one_of(COLUMNS, SMALL))
def test_functions(body: Expression, columns: Sequence[Sequence[tuple[int, ...]]]) -> None:
    compared(Constraint("C", Function("F", NAMES, body), NAMES, NAMES), columns)


@examples(150, slow=3000)
@given(TRUTHS, st.one_of(COLUMNS, SMALL), st.sampled_from([INFINITE, 3]))
def test_predicates(body: Expression, columns: Sequence[Sequence[tuple[int, ...]]], cost: float) -> None:
    compared(Constraint("C", Predicate("P", NAMES, body), NAMES, NAMES, cost=cost), columns)


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


@pytest.mark.parametrize("operator", ["div", "mod", "pow"])
def test_operators_that_may_be_undefined_have_none(operator: str) -> None:
    body = Apply("ne", (Apply(operator, (Name("X"), Name("Y"))), Apply("add", (Name("i"), Name("V3.1")))))
    columns = [(0,)], [(0, 1)], [(2,)]
    assert not compared(Constraint("C", Predicate("P", NAMES, body), NAMES, NAMES), columns)
