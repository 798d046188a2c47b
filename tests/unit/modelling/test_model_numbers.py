"""Numbers of a model: constants, sums that cancel, numbers of NumPy, costs that are rounded."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robochoc
from robochoc.formats import InvalidInputError
from robochoc.modelling.terms import ModelVariable, Term
from tests.support.cases import looped


def two() -> tuple[robochoc.Model, ModelVariable, ModelVariable]:
    model = robochoc.Model("numbers")
    return model, model.robot("a").variable("x", [1, 2]), model.robot("b").variable("y", [1, 2])


def three() -> tuple[robochoc.Model, list[ModelVariable]]:
    model = robochoc.Model("numbers")
    return model, [model.robot(name).variable("x", range(3)) for name in "abc"]


CONSTANTS: list[tuple[Callable[[Term], Any], bool]] = [
    (lambda _: robochoc.all_different(3, 4), True),
    (lambda _: robochoc.all_different([3, 3]), False),
    (lambda x: robochoc.all_different([x]), True),
    (lambda _: robochoc.all_different([]), True),
    (lambda _: robochoc.all_of([]), True),
    (lambda _: robochoc.any_of([]), False),
    (lambda _: robochoc.minimum(3, 4) > 2, True),
    (lambda x: x - x > 2, False),
    (lambda x: 0 * x >= 0, True),
    (lambda x: x.is_in([]), False),
    (lambda x: robochoc.if_then_else(robochoc.any_of([]), x, 5) == 5, True),
    (lambda _: robochoc.cumulative([1, 2], [1, 1], [1, 1], 2), True),
    (lambda _: robochoc.element([1, 2], 2) == 1, False),
    (lambda _: robochoc.element([1, 2], 1) == 2, True),
    (lambda _: ~(robochoc.element([1, 2], 2) == 1), False),
    (lambda _: [], True),
]
"""Conditions whose variables, if they have any, do not matter, and whether they hold."""
EVERY = ("dpop", "sfb", "adopt", "mgm", "maxsum", "bnb-adopt-fdac", "central")


@pytest.mark.parametrize("cost", [None, 7, -2])
def test_constants_are_the_same_for_hard_and_soft_constraints(cost: int | None, tmp_path: Path) -> None:
    for number, (make, holds) in enumerate(CONSTANTS):
        model, x, y = two()
        model.add(x != y)
        model.minimize(x + y)
        model.add(make(x), cost=cost)
        assert all(constraint.variables for constraint in model.team.constraints())
        protocol = EVERY[number % len(EVERY)]
        runtime = "arrays" if protocol in {"mgm", "maxsum"} else "simulator"
        model.save(tmp_path / f"{number}")
        for problem in (model, robochoc.Model.load(tmp_path / f"{number}")):
            options: dict[str, Any] = {} if protocol == "central" else {"runtime": runtime}
            outcome = problem.solve(protocol, **options)
            if cost is None and not holds:
                assert outcome.verdict in {"no-solution", "unknown"}, number
            else:
                assert outcome.cost == 3 + (0 if holds else cost or 0), number


def test_a_constant_counts_against_a_sum_that_is_maximised() -> None:
    model, x, y = two()
    model.maximize(x + y)
    model.add(robochoc.any_of([]), robochoc.all_of([]), cost=Decimal("0.5"))
    model.maximize(robochoc.minimum(3, Decimal("4.25")))
    outcome = model.solve("dpop", runtime="simulator")
    assert outcome.cost == Decimal("6.5")


def test_a_constant_of_too_many_digits_is_named() -> None:
    model, x, _ = two()
    model.minimize(x + 10**18)
    with pytest.raises(InvalidInputError, match="the constant of the costs has 19 digits"):
        _ = model.team


def test_an_undefined_constant_forbids() -> None:
    model, x, _ = two()
    model.minimize(x + robochoc.element([1], 3))
    assert model.solve("dpop", runtime="simulator").verdict == "no-solution"


def test_constants_in_satisfaction_parts_and_events() -> None:
    model, x, y = two()
    model.add(robochoc.any_of([]))
    assert model.solve("abt", runtime="simulator").verdict == "no-solution"
    model, x, y = two()
    event = model.after_solution()
    event.add(robochoc.all_of([]), x != y)
    assert model.solve("abt", runtime="simulator").epochs[1].verdict == "solution"
    model.after_solution().add(robochoc.any_of([]), x == y, name="both")
    with pytest.raises(robochoc.ModelError, match="the constraint both is always violated"):
        _ = model.team
    with pytest.raises(robochoc.ModelError, match="over variables of no robot"):
        model.robots["a"].knows(robochoc.any_of([]))
    with pytest.raises(robochoc.ModelError, match="always False"):
        model.add(x is y, cost=3)


def test_sums_that_cancel() -> None:
    cases: list[tuple[Callable[..., Any], object]] = [
        (lambda x: [x[0], -x[0] + x[1]], 0),
        (lambda x: [x[0], -x[0]], 0),
        (lambda x: [x[0] * x[1], 3 - x[2], x[2] - x[2]], 1),
        (lambda x: [0 * x[0] + Fraction(1, 4)], Decimal("0.25")),
    ]
    for sums, best in cases:
        model, x = three()
        for one in sums(x):
            model.minimize(one)
        assert model.solve("dpop", runtime="simulator").cost == best


def test_a_quotient_with_the_factor_0_still_has_to_have_a_value() -> None:
    uses: list[Callable[..., Any]] = [
        lambda m, t: m.add(0 * t >= 0),
        lambda m, t: m.add(t - t == 0),
        lambda m, t: m.minimize(2 * t - t - t),
    ]
    for use in uses:
        model, x = three()
        use(model, 1 // x[0])
        model.minimize(x[0] + x[1])
        assert model.solve("dpop", runtime="simulator").cost == 1


SCALARS = [np.float32(0.1), np.float64(0.1), np.float16(0.5), np.int64(2), np.uint8(1), np.bool_(True), np.int32(0)]


@looped("scalar", SCALARS)
def test_scalars_of_numpy_mean_what_python_numbers_do(scalar: Any) -> None:  # noqa: ANN401 - any of them
    def solved(given: Any) -> object:  # noqa: ANN401 - a number of NumPy or Python
        model, x = three()
        model.minimize(given * x[0] + x[1] * given + given - x[2] + (given - x[0]) + robochoc.minimum(given, x[2]))
        model.add(given <= x[0] + 2, x[1] >= given - 1, np.True_ if given is scalar else True)
        model.add((x[0] == given) | (x[1] != x[2]), cost=given)
        model.minimize(robochoc.function(lambda a, b: given + a + b, x[0], x[1]))
        model.minimize(robochoc.costs(x[2], {0: given}, default=given))
        model.add(robochoc.function(lambda a, b: np.bool_(a <= b) if given is scalar else a <= b, x[0], x[1]))
        return model.solve("dpop", runtime="simulator").cost

    plain = scalar.item() if not isinstance(scalar, np.float32) else 0.1
    assert solved(scalar) == solved(plain)


def test_integers_of_numpy_as_weights_and_counts() -> None:
    model = robochoc.Model("numpy")
    x = model.robot("a", weight=np.int64(2)).variable("x", np.arange(3))  # type: ignore[arg-type]
    model.after_messages(np.int64(2)).remove_value(x, np.int64(1))  # type: ignore[arg-type]
    model.minimize(x, places=np.int64(0))  # type: ignore[arg-type]
    assert model.team["a"].weight == 2
    assert model.team.scenario[0].after == 2
    with pytest.raises(robochoc.ModelError, match="not a number of messages"):
        model.after_messages(-1)
    with pytest.raises(robochoc.ModelError, match="not a number"):
        _ = x * np.array([1, 2])


def test_numpy_arrays_of_weights() -> None:
    model, x = three()
    model.minimize(np.array([1, 2, 3]) @ np.array(x) + np.float32(0.5))
    model.add(sum(np.array([1, 1]) * x[0]) == 2)
    assert model.solve("dpop", runtime="simulator").cost == Decimal("1.5")


def test_distances_are_costs_once_they_are_rounded() -> None:
    def model_of(places: int | None) -> robochoc.Model:
        model, x = three()
        model.add(robochoc.all_different(x))
        for one, other in ((0, 1), (1, 2)):
            model.minimize(robochoc.function(math.hypot, x[one], x[other]), places=places)
        model.minimize(x[0] / 3 + math.pi, places=places)
        return model

    assert model_of(3).solve("dpop", runtime="simulator").cost == Decimal("6.378")  # 1 + 2.236 + 3.142
    assert model_of(0).solve("dpop", runtime="simulator").cost == 6
    with pytest.raises(robochoc.ModelError, match=r"decimal places \(round all costs by minimize\(..., places=3\)"):
        _ = model_of(None).team
    with pytest.raises(robochoc.ModelError, match="expected an integer from 0 to 9"):
        model_of(10)


def test_of_two_nearest_numbers_costs_are_rounded_to_the_even_one() -> None:
    model, x, y = two()
    model.maximize(robochoc.costs(x, {1: 0.125, 2: 0.375}), places=2)
    model.maximize(robochoc.costs(y, {1: 1}, default=0), places=2)
    assert model.solve("dpop", runtime="simulator").cost == Decimal("1.38")
