"""CPMpy models, split over robots: the same solutions and the same optimum as CPMpy's own evaluation of each model."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from random import Random
from typing import Any

import pytest

import robochoc
from robochoc.model.costs import normalized, told_cost
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.modelling.cpmpy_models import cpmpy_team
from robochoc.solver.central import CentralSolver

cp = pytest.importorskip("cpmpy", reason="the extra cpmpy")
argval = pytest.importorskip("cpmpy.expressions.utils").argval
IncompleteFunctionError = pytest.importorskip("cpmpy.exceptions").IncompleteFunctionError

Term = Any
"""CPMpy's expressions."""
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 11))]
EACH = 20


def term(chance: Random, x: Term, depth: int) -> Term:
    """A random integer expression over the variables `x`."""
    if depth == 0 or chance.random() < 0.3:
        return chance.choice([*x, *x, chance.randint(-2, 3)])
    one, other = (term(chance, x, depth - 1) for _ in range(2))
    kinds: list[Callable[[], Term]] = [
        lambda: one + other,
        lambda: one - other,
        lambda: chance.randint(-2, 3) * one,
        lambda: one * other,
        lambda: -(x[0] + one),
        lambda: abs(x[1] - other),
        lambda: cp.max([one, other, x[0]]),
        lambda: cp.min([one, other, x[1]]),
        lambda: (x[0] + one) // other,
        lambda: (x[1] + one) % other,
        lambda: cp.Count(list(x), other),
        lambda: cp.NValue(list(x)),
        lambda: cp.Element([3, 1, 2], x[2]),
        lambda: cp.Element(list(x), x[0]),
        lambda: (x[0] == 1) + other,
    ]
    return chance.choice(kinds)()


def fact(chance: Random, x: Term, b: Term, depth: int) -> Term:
    """A random Boolean expression."""
    one, other = term(chance, x, depth), term(chance, x, depth)
    comparisons: list[Callable[[], Term]] = [
        lambda: x[0] + one == other,
        lambda: x[1] - one != other,
        lambda: x[2] + one <= other,
        lambda: x[0] + one > other,
    ]
    if depth == 0 or chance.random() < 0.4:
        return chance.choice(comparisons)()
    left, right = (fact(chance, x, b, depth - 1) for _ in range(2))
    kinds: list[Callable[[], Term]] = [
        lambda: left & right,
        lambda: left | right | ~b,
        lambda: left.implies(right),
        lambda: ~left,
        lambda: b == left,
        lambda: cp.Xor([left, right, b]),
        lambda: cp.IfThenElse(b, left, right),
        lambda: cp.AllDifferent(list(x)) | left,
        lambda: b.implies(cp.AllEqual(list(x))),
        lambda: cp.Table(list(x), [[0, 1, 2], [2, 1, 0], [1, 1, 1]]) | b,
    ]
    return chance.choice(kinds)()


GLOBALS: list[Callable[[Random, Term], Term]] = [
    lambda _, x: cp.AllDifferent(x),
    lambda _, x: cp.AllDifferentExcept0(x),
    lambda _, x: cp.AllEqual(x[:2]),
    lambda _, x: cp.Increasing(x),
    lambda _, x: cp.Circuit(x),
    lambda _, x: cp.InDomain(x[0], [0, 2]),
    lambda c, x: cp.Table(list(x), [[c.randint(0, 2) for _ in x] for _ in range(5)]),
    lambda c, x: cp.NegativeTable(list(x), [[c.randint(0, 2) for _ in x] for _ in range(5)]),
    lambda c, x: cp.Cumulative(list(x), [c.randint(0, 2) for _ in x], demand=[1, 2, 2], capacity=c.randint(2, 4)),
    lambda c, x: cp.GlobalCardinalityCount(list(x), [0, 1], [1, c.randint(0, 2)]),
    lambda c, x: cp.Element(list(x), x[1]) == c.randint(0, 2),
    lambda c, x: cp.LexLess([x[0], x[1]], [x[2], c.randint(0, 2)]),
]


def random_model(chance: Random) -> tuple[Term, list[Term]]:
    """A model over four variables, and CPMpy's own solutions of it by trying everything."""
    x = cp.intvar(0, 2, shape=3, name="x")
    b = cp.boolvar(name="b")
    model = cp.Model([x[0] + b >= 0, x[1] >= 0, x[2] >= 0])
    for _ in range(chance.randint(0, 2)):
        model += fact(chance, x, b, 2)
    for _ in range(chance.randint(0, 1)):
        model += chance.choice(GLOBALS)(chance, x)
    if chance.random() < 0.7:
        objective = term(chance, x, 2) + 2 * x[0] - 3 * x[1] + b
        (model.minimize if chance.random() < 0.5 else model.maximize)(objective)
    return model, [*x, b]


def assignments(variables: list[Term]) -> Iterator[tuple[int, ...]]:
    for values in itertools.product(*(range(variable.lb, variable.ub + 1) for variable in variables)):
        for variable, value in zip(variables, values, strict=True):
            variable._value = bool(value) if variable.is_bool() else value  # noqa: SLF001 - as its solvers do
        yield values


def by_hand(model: Term, variables: list[Term]) -> tuple[bool, int | None]:
    """Whether there is a solution, and the best objective: each constraint is asked for its value."""
    found: list[int] = []
    for _ in assignments(variables):
        if all(argval(one) for one in model.constraints):
            with suppress(IncompleteFunctionError):
                found.append(0 if model.objective_ is None else int(argval(model.objective_)))
    if not found or model.objective_ is None:
        return bool(found), None
    return True, (min if model.objective_is_min else max)(found)


def solved(team: Team) -> tuple[bool, int | None]:
    small = normalized(team)
    answer = CentralSolver().solve(small)
    cost = None if answer.cost is None else told_cost(small, answer.cost)
    return answer.verdict is not Verdict.NO_SOLUTION, None if cost is None else int(cost)


@pytest.mark.parametrize("batch", BATCHES)
def test_random_models_have_the_same_optimum(batch: int) -> None:
    for seed in range(EACH * batch, EACH * (batch + 1)):
        model, variables = random_model(Random(seed))
        assert solved(cpmpy_team(model)) == by_hand(model, variables), (seed, str(model))


@pytest.mark.parametrize("kind", range(len(GLOBALS)))
def test_each_global_constraint(kind: int) -> None:
    for seed in range(3):
        x = cp.intvar(0, 2, shape=3, name="x")
        one = GLOBALS[kind](Random(seed), x)
        cost = [Random(seed).randint(-3, 3) for _ in range(3)]
        model = cp.Model([one, *(each >= 0 for each in x)], minimize=cp.sum(cost[i] * x[i] for i in range(3)) + x[0])
        assert solved(cpmpy_team(model)) == by_hand(model, list(x)), (seed, str(model))


def test_owners_names_and_kinds() -> None:
    x = cp.intvar(1, 3, shape=(2, 2), name="grid")
    model = cp.Model([cp.AllDifferent(x[0]), x[1, 0] > x[0, 1]], maximize=cp.sum(x))
    by_row = cpmpy_team(model, lambda name: f"row{name[5]}")
    assert by_row.order == ("row0", "row1")
    assert list(by_row.variables) == ["grid_0_0", "grid_0_1", "grid_1_0", "grid_1_1"]
    named = {variable.name: "all" for variable in x.flat}
    assert cpmpy_team(model, named).order == ("all",)
    outcome = robochoc.from_cpmpy(model, name="grid").solve("dpop", runtime="simulator")
    assert (outcome.team, outcome.cost) == ("grid", 11)
    with pytest.raises(ValueError, match="owner says no robot"):
        cpmpy_team(model, {"grid[0,0]": "r"})


def test_what_has_no_counterpart_is_refused() -> None:
    x = cp.intvar(0, 10**6, name="x")
    with pytest.raises(ValueError, match="1,000,001 values"):
        cpmpy_team(cp.Model(x > 3))
    with pytest.raises(TypeError, match=r"takes a cpmpy\.Model"):
        cpmpy_team("x")
    with pytest.raises(ValueError, match="no variables"):
        cpmpy_team(cp.Model())
