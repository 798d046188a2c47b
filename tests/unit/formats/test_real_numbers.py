"""Real domains, parameters and results in files."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import InvalidInputError, read_team, write_team
from robochoc.formats.real_numbers import REAL_KINDS
from robochoc.formats.result import read_result, result_json
from robochoc.model.constraint import Function
from robochoc.model.expression import Apply, Constant, Expression, ExpressionError, Name, Type, evaluate, parse, text
from robochoc.model.expression.fixed_point import fixed_point
from robochoc.model.expression.tree import DECIMAL
from robochoc.model.problem import RemoveValue, Team
from robochoc.model.waypoints import position
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.examples import drawn

A = """\
<instance>
  <presentation type="DisWCSP"/>
  <domains><domain name="D" type="real">0..10</domain></domains>
  <variables><variable name="x" domain="D"/></variables>
  <functions>
    <function name="home"><parameters>real X</parameters>
      <expression><functional>sqr(X - 2.5)</functional></expression></function>
  </functions>
  <constraints><constraint name="near" reference="home" scope="x"/></constraints>
  <agents_neighbours><agents_parent/><agents_children><agent name="B"/></agents_children></agents_neighbours>
</instance>
"""
B = """\
<instance>
  <presentation type="DisWCSP"/>
  <domains><domain name="D" type="real" points="5">-1..10.5</domain><domain name="I">0..1</domain></domains>
  <variables><variable name="y" domain="D"/><variable name="on" domain="I"/></variables>
  <predicates>
    <predicate name="apart"><parameters>real X real Y</parameters>
      <expression><functional>ge(dist(X, Y), 1.25)</functional></expression></predicate>
  </predicates>
  <functions>
    <function name="away"><parameters>real X real Y int N</parameters>
      <expression><functional>if(eq(N, 1), sqr(X - Y + 3), 7.25)</functional></expression></function>
  </functions>
  <agents_neighbours>
    <agents_parent><agent name="A"><constraints>
      <constraint name="c" reference="away" scope="x y on"/>
      <constraint name="d" reference="apart" scope="x y"/>
    </constraints></agent></agents_parent>
    <agents_children/>
  </agents_neighbours>
</instance>
"""


def _team(folder: Path, a: str = A, b: str = B) -> Team:
    folder.mkdir(exist_ok=True)
    (folder / "A.xml").write_text(a)
    (folder / "B.xml").write_text(b)
    return read_team(folder)


def test_a_real_domain_has_an_interval_and_a_grid(tmp_path: Path) -> None:
    team = _team(tmp_path / "t")
    domain = team.variables["y"].domain
    assert [domain.label(value) for value in domain] == [-1, 1.875, 4.75, 7.625, 10.5]
    assert len(team.variables["x"].domain) == 9
    function = team["B"].shared[0].definition
    assert isinstance(function, Function)
    assert function.cost([1500, 4000, 1]) == 250_000  # (1.5 - 4 + 3)^2 = 0.25, with six decimal places
    assert function.cost([1500, 4000, 0]) == 7_250_000


def test_written_teams_are_read_as_equal_teams(tmp_path: Path) -> None:
    team = _team(tmp_path / "t")
    write_team(team, tmp_path / "copy" / "t")
    again = read_team(tmp_path / "copy" / "t")
    assert again == team
    assert "sqr(sub(X,2.5))" in (tmp_path / "copy" / "t" / "A.xml").read_text()


def test_results_contain_numbers_and_are_read_back(tmp_path: Path) -> None:
    team = _team(tmp_path / "t")
    outcome = solve(team, Options(protocol="afb", runtime=Runtime.SIMULATOR))
    written = result_json(outcome)
    assert b'"x":2.5,"y":5.5' in written
    assert read_result(written).assignment == outcome.assignment
    assert outcome.labelled(outcome.assignment)["x"] == 2.5


def test_coordinates_are_exact(tmp_path: Path) -> None:
    topic = '<topics><topic name="/a" x="mul(x, 100)" y="x" z="2"/></topics><functions>'
    team = _team(tmp_path / "t", A.replace("<functions>", topic, 1))
    assert position(team["A"].topics[0], {"x": 2345}) == (234.5, 2.345, 2)
    write_team(team, tmp_path / "copy" / "t")
    assert read_team(tmp_path / "copy" / "t") == team


def test_a_scenario_removes_points(tmp_path: Path) -> None:
    folder = tmp_path / "t"
    _team(folder)
    event = '<scenario><event after="solved"><remove_value variable="x" value="2.5"/></event></scenario>'
    (folder / "scenario.xml").write_text(event)
    assert read_team(folder).scenario[0].changes == (RemoveValue("x", 2500),)


@looped(("old", "new", "message"), [
    ("0..10</domain>", "10..0</domain>", "A.xml:3: the interval 10..0 is empty"),
    ("0..10</domain>", "0..0.0001</domain>", "A.xml:3: 0.0001 has more decimal places than the precision 0.001"),
    ("0..10</domain>", "0 5</domain>", "A.xml:3: '0 5' is not an interval of real numbers"),
    ("0..10</domain>", "0..10: 3 11</domain>", "A.xml:3: the value 11.0 of domain D is outside its interval"),
    ('type="real">', 'type="real" points="1">', "A.xml:3: points is 1"),
    ('type="real">', 'type="integer" points="3">', "A.xml:3: only a real domain has points"),
    ('"DisWCSP"', '"DisWCSP" precision="0.02"', "A.xml:2: invalid precision '0.02'"),
    ('"DisWCSP"', '"DisWCSP" scale="0.01"', "has 6 decimal places, costs 2"),
    ('"DisWCSP"', '"DisWCSP" precision="0.01"', "0.001, but 'x' is a real number with the precision 0.01"),
    ("real X", "int X", "at character"),
    ("<parameters>real X</parameters>", "<parameters>steps X real X</parameters>", "real and steps cannot be mixed"),
    ('reference="home"', 'reference="le"', "le requires 2 terms"),
    ("sqr(X - 2.5)", "pow(2, X)", "the exponent of a power of real numbers must be a constant"),
    ("sqr(X - 2.5)", "pow(X, 9)", "more than 18 decimal places"),
    ("sqr(X - 2.5)", "X / 2", "unknown sign '/'"),
])  # fmt: skip
def test_mistakes_are_reported(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in A
    with pytest.raises(InvalidInputError) as caught:
        _team(tmp_path / "t", A.replace(old, new, 1))
    found = str(caught.value)
    if message.endswith("but 'x' is"):
        assert (
            "expects a real number with the precision 0.001, but 'x' is a real number with the precision 0.01" in found
        )
    else:
        assert message in found


@looped(("scope", "reference", "message"), [
    ("x y", "le", ""),
    ("x on", "le", "'x' is a real number with the precision 0.001, but 'on' is an integer"),
    ("x on 3", "away", "away expects a real number"),
    ("on x on", "away", "away expects a real number"),
    ("x y", "global:allDifferent", "expects an integer, but 'y' is a real number"),
])  # fmt: skip
def test_arguments_have_the_kind_of_the_parameters(scope: str, reference: str, message: str, tmp_path: Path) -> None:
    b = B.replace('reference="apart" scope="x y"', f'reference="{reference}" scope="{scope}"')
    if not message:
        _team(tmp_path / "t", b=b)
        return
    with pytest.raises(InvalidInputError, match=message):
        _team(tmp_path / "t", b=b)


def _random_expression(chance: Random, depth: int, wanted: Type = Type.INTEGER) -> Expression:
    """Return an expression over the real numbers X and Y and the integer N."""
    if wanted == Type.BOOLEAN:
        operator = chance.choice(["lt", "le", "eq", "ne", "ge"])
        return Apply(operator, tuple(_random_expression(chance, depth - 1) for _ in range(2)))
    if depth <= 0 or chance.random() < 0.2:
        decimal = Apply(DECIMAL, (Constant(chance.randint(-99, 99)), Constant(chance.choice([1, 2]))))
        leaves: list[Expression] = [Name("X"), Name("Y"), Name("N"), Constant(chance.randint(-3, 3)), decimal]
        return chance.choice(leaves)
    operator = chance.choice(["add", "sub", "mul", "min", "max", "dist", "neg", "abs", "sqr", "if", "div"])
    if operator == "if":
        return Apply("if", (_random_expression(chance, depth - 1, Type.BOOLEAN),
                            *(_random_expression(chance, depth - 1) for _ in range(2))))  # fmt: skip
    arity = 1 if operator in {"neg", "abs", "sqr"} else 2
    return Apply(operator, tuple(_random_expression(chance, depth - 1) for _ in range(arity)))


def _truncated(value: Fraction, places: int) -> Fraction:
    scaled = value * 10**places
    return Fraction(abs(scaled.numerator) // scaled.denominator * (1 if scaled >= 0 else -1), 10**places)


def _exact(expression: Expression, values: dict[str, Fraction]) -> tuple[Fraction, bool]:
    """Return the exact value, and whether a quotient was truncated or undefined, so that it may differ."""
    match expression:
        case Constant(value):
            return Fraction(value), False
        case Name(name):
            return values[name], False
        case Apply(operator, (Constant(digits), Constant(places))) if operator == DECIMAL:
            return Fraction(digits, 10**places), False
        case Apply("div", _):
            return Fraction(0), True
        case Apply(operator, arguments):
            parts = [_exact(one, values) for one in arguments]
            given, differs = [one for one, _ in parts], any(other for _, other in parts)
            meanings: dict[str, Callable[..., Fraction | bool]] = {
                "add": lambda x, y: x + y, "sub": lambda x, y: x - y, "mul": lambda x, y: x * y, "min": min,
                "max": max, "dist": lambda x, y: abs(x - y), "neg": lambda x: -x, "abs": abs, "sqr": lambda x: x * x,
                "if": lambda c, x, y: x if c else y, "lt": lambda x, y: x < y, "le": lambda x, y: x <= y,
                "eq": lambda x, y: x == y, "ne": lambda x, y: x != y, "ge": lambda x, y: x >= y,
            }  # fmt: skip
            return Fraction(meanings[operator](*given)), differs


def test_fixed_point_is_exact_arithmetic() -> None:
    chance = drawn("fixed point")
    compared = 0
    for _ in range(400):
        wanted = chance.choice([Type.INTEGER, Type.BOOLEAN])
        source = _random_expression(chance, 3, wanted)
        assert parse(text(source), ["X", "Y", "N"], wanted, decimals=True) == source
        try:
            body = fixed_point(source, ["X", "Y"], 2, wanted, 6)
        except ExpressionError:
            continue
        steps = {"X": chance.randint(-300, 300), "Y": chance.randint(-300, 300), "N": chance.randint(-2, 2)}
        numbers = {"X": Fraction(steps["X"], 100), "Y": Fraction(steps["Y"], 100), "N": Fraction(steps["N"])}
        exact, differs = _exact(source, numbers)
        if not differs:
            compared += 1
            found = evaluate(body, steps)
            assert found == (exact if wanted == Type.BOOLEAN else _truncated(exact, 6) * 10**6), text(source)
    assert compared > 100


def test_quotients_have_six_places() -> None:
    body = fixed_point(parse("div(X, 3)", ["X"], Type.INTEGER, decimals=True), ["X"], 3, Type.INTEGER, 6)
    assert evaluate(body, {"X": 1000}) == 333_333
    assert evaluate(body, {"X": -1000}) == -333_333
    whole = fixed_point(parse("div(N, 3)", ["N"], Type.INTEGER, decimals=True), [], 3, Type.INTEGER, 6)
    assert evaluate(whole, {"N": 5}) == 1_000_000
    assert REAL_KINDS == ("real", "steps")
