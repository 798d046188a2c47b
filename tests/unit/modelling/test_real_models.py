"""`ModelRobot.real`: problems in Python whose variables are real numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from itertools import product
from pathlib import Path

import pytest

import robochoc
from robochoc import ModelError, Verdict
from robochoc.formats import read_team
from robochoc.model.expression import evaluate
from robochoc.model.expression.fixed_point import fixed_point
from robochoc.model.expression.tree import Type
from robochoc.model.problem import Team
from robochoc.model.waypoints import position
from robochoc.modelling.numbers import exact
from robochoc.modelling.real_terms import RealTranslator
from robochoc.modelling.terms import Term, number
from tests.support.cases import looped
from tests.support.examples import drawn

WIND = ((-1, Fraction(1, 4)), (2, Fraction(3, 4)))


def rail() -> robochoc.Model:
    model = robochoc.Model("rail")
    x = model.robot("A").real("x", 0, 10)
    y = model.robot("B").real("y", 0, 10)
    model.add(abs(x - y) >= 1.25)
    model.minimize((x - 2.5) ** 2 + (x - y + 3) ** 2 + abs(y - 4))
    return model


def test_the_optimum_is_proven_and_files_are_read_back(tmp_path: Path) -> None:
    model = rail()
    solution = model.solve("dpop")
    assert solution.verdict == Verdict.OPTIMAL
    assert (solution.cost, solution["A.x"], solution["B.y"]) == (1, 2.0, 4.5)
    assert solution[model["A.x"] + 0.5] == Fraction(5, 2)
    model.save(tmp_path / "rail")
    assert "real X0" in (tmp_path / "rail" / "A.xml").read_text()
    assert read_team(tmp_path / "rail") == model.team
    again = robochoc.Model.load(tmp_path / "rail")
    again.add(again["A.x"] >= 2.25)
    assert again.solve("dpop").cost == Decimal("1.062500")
    assert model.solve("dpop", start={"A.x": 2.123, "B.y": 5}).cost == 1


def test_terms_have_exact_values() -> None:
    model = robochoc.Model("terms")
    robot = model.robot("A")
    x = robot.real("x", -5, 5, precision=0.01)
    n, half = robot.variable("n", range(-3, 4)), robot.variable("h", [0.5, 1])
    given: dict[Term, object] = {x: -2.37, n: 2, half: 0.5}
    terms: list[Term] = [
        x * 1.5 - n + 0.25, (x - half) ** 2, abs(x - n) * half, x // 2, x % 2, -x, 3 - x, x / 4 + n / 8,
        robochoc.minimum(x, n, half), robochoc.if_then_else(x <= n, x * n, half), (x <= -2.37) * 3 + (x == n) * 5,
        x.is_in([1.5, -2.37]) * half,
    ]  # fmt: skip
    for term in map(number, terms):
        names = {one: one.name.replace(".", "_") for one in term.variables}
        source = RealTranslator(names).whole_number(term).expression
        body = fixed_point(source, ["A_x"], 2, Type.INTEGER, 6)
        found = evaluate(body, {"A_x": -237, "A_n": 2, "A_h": 1})
        assert Fraction(found, 10**6) == term.value(given), repr(term)  # type: ignore[arg-type] # variables


def test_factors_that_are_not_decimals_are_truncated() -> None:
    model = robochoc.Model("thirds")
    x = model.robot("A").real("x", 0, 1)
    model.maximize(x / 3 + Fraction(1, 2))
    assert model.solve("dpop").cost == Decimal("0.833333")


def test_private_parts_and_integers() -> None:
    model = robochoc.Model("mixed")
    a, b = model.robot("A"), model.robot("B")
    x, n = a.real("x", 0, 4, points=3), b.variable("n", range(3))
    a.knows(x - n >= 3.75)
    model.add(n >= 1, cost=0.5)
    model.minimize((x - 1.125) ** 2)
    solution = model.solve("asym-pt-fb")
    assert (solution["A.x"], solution["B.n"], solution.cost) == (3.75, 0, Decimal("7.390625"))


def test_a_condition_that_never_holds_excludes_all_real_numbers() -> None:
    model = robochoc.Model("never")
    x = model.robot("A").real("x", 0, 1)
    model.add(x - x >= 0.5)
    model.minimize(x)
    assert model.solve("dpop").verdict == Verdict.NO_SOLUTION


def test_expected_costs_on_grids_agree_with_enumeration() -> None:
    chance = drawn("real and random variables")
    for _ in range(6):
        model = robochoc.Model("chance")
        x = model.robot("A").real("x", -1, chance.choice([1, 3]), precision=0.1, points=3)
        n = model.robot("B").variable("n", range(3))
        wind = model.random("wind", {-1: 0.25, 2: 0.75}, seen_by=[n] if chance.random() < 0.5 else [])
        cost = chance.choice([2, 0.5]) * (x - n - wind) ** 2 + chance.choice([abs(x - wind), x * n, x * wind])
        model.minimize(cost)
        policies = product([-1, 0, 1] if x.codes.ends[1] == 10 else [-1, 1, 3], range(3), range(3))
        seen = "n.wind" in " ".join(model.team.variables)
        best = min(
            sum(share * exact(cost.value({x: a, n: c if seen and w > 0 else b, wind: w})) for w, share in WIND)
            for a, b, c in policies
        )
        solution = model.solve(chance.choice(["dpop", "afb"]))
        assert solution.verdict == Verdict.SOLUTION
        assert Fraction(solution.cost or 0) == best


@looped(("wrong", "message"), [
    (lambda m: m.robots["A"].real("y", 1, 1), "the interval from 1 to 1 is empty"),
    (lambda m: m.robots["A"].real("y", 0, 0.0005), "0.0005 is not a number of at most 18 digits with the precision"),
    (lambda m: m.robots["A"].real("y", 0, 1, precision=0.02), "invalid precision 0.02"),
    (lambda m: m.robots["A"].real("y", 0, 1, points=1), "invalid points=1"),
    (lambda m: m.robots["A"].real("x", 0, 1), "variable A.x exists already"),
    (lambda m: m.add(robochoc.allowed(m["A.x"], [1, 2])), "can be expressed only as a table, and A.x is real"),
    (lambda m: m.minimize(robochoc.function(abs, m["A.x"])), "can be expressed only as a table, and A.x is real"),
    (lambda m: m.minimize(m["A.x"] + m["A.x"] ** m["A.x"]), "(A.x ** A.x) can be expressed only as a table"),
    (lambda m: m.minimize(m["A.x"] ** 9), "more than 18 decimal places"),
    (lambda m: m.add(m["A.x"] <= m.robots["A"].real("y", 0, 1, precision=0.1)), "different precisions"),
    (lambda m: m.robots["A"].topic("/goal", x=m["A.x"] ** m["A.x"]), "files cannot express the position"),
    (lambda m: m.robots["A"].topic("/goal", x=m["A.x"] ** 9), "more than 18 decimal places"),
])  # fmt: skip
def test_mistakes_are_reported(wrong: Callable[[robochoc.Model], object], message: str) -> None:
    model = robochoc.Model("wrong")
    model.robot("A").real("x", 0, 1)

    def team() -> Team:
        wrong(model)
        return model.team

    with pytest.raises(ModelError, match=re.escape(message)) as caught:
        team()
    assert str(caught.value).startswith(f"{__file__}:")


def test_positions_of_robots_are_exact(tmp_path: Path) -> None:
    model = robochoc.Model("drone")
    robot = model.robot("A")
    x, level = robot.real("x", 0, 10, precision=0.01), robot.variable("level", range(3))
    robot.topic("/goal", x=x * 2 + 0.5, y=level, z=1.5)
    robot.topic("/level", x=level, y=0, z=0)
    team = model.team
    values = {"A.x": 137, "A.level": 2}
    assert [position(topic, values) for topic in team["A"].topics] == [(3.24, 2, 1.5), (2, 0, 0)]
    model.save(tmp_path / "drone")
    assert read_team(tmp_path / "drone") == team
