"""CPMpy models, split over robots: the same solutions and the same optimum as CPMpy's own evaluation of each model."""

from __future__ import annotations

import copy
import importlib.util
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any

import pytest

import robochoc
from robochoc.model.costs import normalized, user_cost
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.modelling.cpmpy_models import cpmpy_team
from robochoc.solver.central import CentralSolver
from tests.support.examples import count
from tests.support.random_cpmpy import Judge, RandomExpressions, cp

pytestmark = pytest.mark.skipif(importlib.util.find_spec("cpmpy") is None, reason="the extra cpmpy")

Term = Any
"""CPMpy's expressions."""


def argval(expression: Term) -> Any:  # noqa: ANN401 - a number or a truth value
    """Return what CPMpy computes for the values that its variables have."""
    return cp.expressions.utils.argval(expression)


def drawn(seed: int) -> RandomExpressions:
    return RandomExpressions(Random(seed))


def model_of(given: RandomExpressions, *constraints: Term) -> Term:
    """Return a model of `constraints` in which all variables stand."""
    return cp.Model([*(variable >= variable.lb for variable in given.variables), *constraints])


def check_solutions(given: RandomExpressions, constraint: Term) -> None:
    """Check that the team of a constraint allows the assignments for which CPMpy says that the constraint holds."""
    team = cpmpy_team(model_of(given, constraint))
    judge = Judge(team, [variable.name for variable in given.variables])
    for values in given.assignments():
        assert judge.allows(values) is bool(argval(constraint)), (values, str(constraint))


@count("number", fast=40, slow=5000)
def test_random_expressions_hold_where_cpmpy_says_so(number: int) -> None:
    for seed in range(number):
        given = drawn(seed)
        check_solutions(given, given.fact(3) if seed % 3 else given.constraint(2))


@pytest.mark.slow
def test_the_two_judges_of_cpmpy_agree() -> None:
    pytest.importorskip("ortools", reason="the extra ortools")
    refused = 0
    for seed in range(300):
        given = drawn(seed)
        constraint = given.fact(3) if seed % 3 else given.constraint(2)
        held = {values for values in given.assignments() if argval(constraint)}
        solved: set[tuple[int, ...]] = set()
        model = model_of(given, constraint)
        try:
            model.solveAll("ortools", display=lambda: solved.add(tuple(int(one.value()) for one in given.variables)))  # noqa: B023
        except Exception:  # noqa: BLE001 - CPMpy 1.1.1 makes invalid models of some expressions
            refused += 1
        else:
            assert solved == held, (seed, str(constraint))
    assert refused < 20


def test_one_global_constraint_that_must_hold_and_is_negated_elsewhere() -> None:
    for name in ("MDD", "Circuit", "Regular"):
        given = drawn(0)
        x = given.x
        same = {
            "MDD": lambda: cp.MDD(x[:2], [("r", 0, "a"), ("r", 1, "b"), ("a", 2, "t"), ("b", 0, "t")]),  # noqa: B023
            "Circuit": lambda: cp.Circuit(x),  # noqa: B023
            "Regular": lambda: cp.Regular(x, [("a", 0, "b"), ("b", 1, "b"), ("b", 2, "a")], "a", ["b"]),  # noqa: B023
        }[name]()
        for constraints in ([same, given.b.implies(~same)], [given.b.implies(~same), same], [same | given.b, ~same]):
            team = cpmpy_team(model_of(given, *constraints))
            judge = Judge(team, [variable.name for variable in given.variables])
            for values in given.assignments():
                assert judge.allows(values) is all(argval(one) for one in constraints), (values, name)


def partial(x: Term, b: Term) -> list[Term]:
    """Return constraints that hold also where a quotient, a remainder or an element in them has no value."""
    pay, grid = cp.cpm_array([1, 1]), cp.cpm_array([[1, 0], [1, 1]])
    facts = [pay[x[2]] == 1, 1 // x[0] == 1, 5 % x[1] == 0, grid[x[2], x[1]] == 1, cp.AllDifferent([4 // x[0], x[1]])]
    facts += [cp.Increasing([x[1], 3 // x[0]]), pay[x[2]] + 2 // x[1] <= 3, pay[1 // x[0]] == 1]
    kinds: list[Callable[[Term], Term]] = [
        lambda fact: ~fact,
        lambda fact: fact == False,  # noqa: E712 - CPMpy's operator
        lambda fact: b.implies(~fact),
        lambda fact: fact.implies(b),
        lambda fact: b == fact,
        lambda fact: ~(fact & b),
        lambda fact: cp.Xor([fact, b]),
        lambda fact: cp.IfThenElse(fact, b, ~b),
        lambda fact: cp.sum([fact, b, ~fact]) <= 1,
    ]
    return [kind(fact) for kind in kinds for fact in facts]


def test_partial_functions_make_the_nearest_boolean_expression_false() -> None:
    given = drawn(0)
    for constraint in partial(given.x, given.b):
        check_solutions(given, constraint)


def test_an_element_is_compared_with_any_expression_on_either_side() -> None:
    given = drawn(0)
    x, y, z = given.x
    for element in (cp.Element([3, -1, 2], y), cp.Element([x, 1, z], y), cp.cpm_array([[1, 2], [3, 0]])[y, z]):
        for other in (x + 1, z + 0 * x, 2, y, cp.max([x, z]), 6 // x):
            for constraint in (element >= other, other == element, other != element, other < element):
                check_solutions(given, constraint)


def by_hand(model: Term, given: RandomExpressions) -> tuple[bool, int | None]:
    """Return whether there is a solution, and the best objective: each constraint is asked for its value."""
    found: list[int] = []
    for _ in given.assignments():
        if all(argval(one) for one in model.constraints):
            with suppress(cp.exceptions.IncompleteFunctionError):
                found.append(0 if model.objective_ is None else int(argval(model.objective_)))
    if not found or model.objective_ is None:
        return bool(found), None
    return True, (min if model.objective_is_min else max)(found)


def solved(team: Team) -> tuple[bool, int | None]:
    small = normalized(team)
    answer = CentralSolver().solve(small)
    cost = None if answer.cost is None else user_cost(small, answer.cost)
    return answer.verdict is not Verdict.NO_SOLUTION, None if cost is None else int(cost)


@count("number", fast=25, slow=500)
def test_random_models_have_the_same_optimum(number: int) -> None:
    for seed in range(number):
        given, chance = drawn(seed), Random(seed)
        model = model_of(given, *(given.fact(2) for _ in range(chance.randint(0, 2))))
        if chance.random() < 0.8:
            objective = given.number(2) + 2 * given.x[0] - 3 * given.x[1] + given.b
            (model.minimize if chance.random() < 0.5 else model.maximize)(objective)
        assert solved(cpmpy_team(model)) == by_hand(model, given), (seed, str(model))


def test_owners_by_variables_and_terms_in_functions_of_cpmpy() -> None:
    x = cp.intvar(1, 3, shape=3, name="x")
    model = cp.Model(cp.AllDifferent(x))
    assert cpmpy_team(model, {x[0]: "a", x[1]: "b", x[2]: "a"}).owner == {"x_0": "a", "x_2": "a", "x_1": "b"}
    ours = [robochoc.Model().robot(name).variable("x", range(3)) for name in "ab"]
    for call in (cp.AllDifferent, cp.max):
        with pytest.raises(robochoc.ModelError, match=r"test_cpmpy_models.py:\d+: a function of CPMpy .*all_different"):
            call(ours)


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
    for owner in ({"grid[0,0]": "r"}, lambda _: None):
        with pytest.raises(robochoc.ModelError, match="owner has no robot"):
            cpmpy_team(model, owner)  # type: ignore[arg-type] # wrong on purpose
    with pytest.raises(robochoc.ModelError, match=r"owner failed for .*the name of a variable, a text"):
        cpmpy_team(model, lambda variable: variable.name)
    with pytest.raises(robochoc.ModelError, match="owner returns <built-in method upper"):
        cpmpy_team(model, lambda variable: variable.upper)
    with pytest.raises(robochoc.ModelError, match="owner='r' is not allowed"):
        cpmpy_team(model, "r")  # type: ignore[arg-type] # wrong on purpose


def test_models_and_solutions_are_indexed_by_variables_of_cpmpy() -> None:
    x = cp.intvar(1, 3, shape=2, name="x")
    team = robochoc.from_cpmpy(cp.Model(x[0] < x[1], maximize=2 * x[0] + x[1]))
    team.add(team[x[1]] > 2)
    solution = copy.deepcopy(team).solve("dpop")
    assert [solution[one] for one in x] == [solution[one.name] for one in x] == [solution["x_0"], 3] == [2, 3]
    assert x[0] in solution
    assert cp.intvar(0, 1, name="y") not in solution
    assert "4 constraints" in repr(team)
    with pytest.raises(robochoc.ModelError, match=r"or robochoc\.from_cpmpy"):
        team.add(x[0] > 1)
    with pytest.raises(robochoc.UnsupportedError, match=r"cpmpy\.tools\.mus"):
        team.conflict()


def test_what_has_no_counterpart_is_refused() -> None:
    x = cp.intvar(0, 10**6, name="x")
    with pytest.raises(ValueError, match="1,000,001 values"):
        cpmpy_team(cp.Model(x > 3))
    with pytest.raises(TypeError, match=r"requires a cpmpy\.Model"):
        cpmpy_team("x")
    with pytest.raises(ValueError, match="no variables"):
        cpmpy_team(cp.Model())
    y = cp.intvar(0, 1, name="y")
    with pytest.raises(ValueError, match="CPMpy cannot decompose its 'circuit'"):
        cpmpy_team(cp.Model(cp.Circuit([y == 1, y])))
