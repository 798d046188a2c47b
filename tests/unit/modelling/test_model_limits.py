"""What a model refuses because it would fill the memory, or never end: one message, with the line."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction

import pytest

import robochoc
from robochoc.modelling.errors import ModelError
from robochoc.modelling.terms import Term


def two() -> tuple[robochoc.Model, Term, Term]:
    model = robochoc.Model("limits")
    return model, model.robot("A").variable("x", range(3)), model.robot("B").variable("y", range(3))


def grown(term: Term, grow: Callable[[Term], Term], times: int) -> Term:
    for _ in range(times):
        term = grow(term)
    return term


def test_a_term_that_holds_itself_over_and_over() -> None:
    _, x, y = two()
    with pytest.raises(ModelError, match=rf"{__file__}.*a term has more than 1,000,000 subterms"):
        grown(x + y, lambda term: term * term, 60)


def test_a_term_of_many_levels() -> None:
    _, x, y = two()
    with pytest.raises(ModelError, match=rf"{__file__}.*a term has more than 200 levels"):
        grown(x, lambda term: abs(term - y), 20000)


def test_terms_that_are_long_and_flat() -> None:
    model, x, y = two()
    model.minimize(sum(abs(x - y - n % 7) for n in range(1200)))
    model.add([x + y < n for n in range(5, 1200)])
    assert model.solve("central").verdict == "optimal"


@pytest.mark.parametrize("cost", [Decimal("1e9999999"), Decimal("-1e-9999999"), Fraction(1, 10**9000), 10**30])
def test_costs_that_no_file_holds(cost: Decimal | Fraction | int) -> None:
    model, x, y = two()

    def build() -> object:
        model.add(x != y, cost=cost)
        return model.team

    with pytest.raises(ModelError, match=r"too large or too small|decimal places|31 digits"):
        build()


def test_a_range_beyond_64_bits() -> None:
    with pytest.raises(ModelError, match="more than 100,000 values"):
        robochoc.Model("m").robot("A").variable("x", range(10**30))


@pytest.mark.parametrize(
    ("solve", "error"),
    [
        (lambda model: model.solve(messages="5"), TypeError),
        (lambda model: model.solve(seed="x"), TypeError),
        (lambda model: model.solve(messages=-1), ValueError),
        (lambda model: model.solve(timeout=float("nan")), ValueError),
        (lambda model: model.solve(delay=-5, runtime="simulator"), ValueError),
    ],
)
def test_options_that_are_no_numbers(solve: Callable[[robochoc.Model], object], error: type[Exception]) -> None:
    with pytest.raises(error, match="is not allowed; expected"):
        solve(two()[0])
