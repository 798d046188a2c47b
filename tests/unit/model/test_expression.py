"""Functional expressions: docs/reference/format.md, "Functional expressions"; Figure 2."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robochoc.model.expression import (
    ALIASES,
    OPERATORS,
    Apply,
    Constant,
    Expression,
    ExpressionError,
    Name,
    Type,
    UndefinedValueError,
    compile_expression,
    evaluate,
    names,
    parse,
    text,
)
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.growth import steps_of
from tests.support.random_expressions import NAMES, NUMBERS, TRUTHS, small_or_huge

FIGURE_2 = "and( (neq(X, Y) , neq( abs(minus(X , Y) ) , abs(minus(i-j) ) ) ) )"
LIMIT = 2**63


ENVIRONMENTS = st.fixed_dictionaries(dict.fromkeys(NAMES, small_or_huge()))


def oracle(expression: Expression, values: Mapping[str, int]) -> int | None:
    """What XCSP 2.1 says, in a third way: None is undefined, and spreads."""
    if isinstance(expression, Constant):
        return expression.value
    if isinstance(expression, Name):
        return values[expression.name]
    if expression.operator == "if":
        condition = oracle(expression.arguments[0], values)
        return None if condition is None else oracle(expression.arguments[1 if condition else 2], values)
    arguments = [oracle(argument, values) for argument in expression.arguments]
    known = [argument for argument in arguments if argument is not None]
    return applied(expression.operator, known) if len(known) == len(arguments) else None


def applied(operator: str, arguments: list[int]) -> int | None:
    result = arguments[0]
    if len(arguments) == 1:
        simple = {"neg": -result, "abs": abs(result), "not": int(not result), "sqr": result * result}[operator]
        return simple if simple <= LIMIT else None
    if operator in {"eq", "iff"}:
        return int(min(arguments) == max(arguments))
    if operator == "in":
        return int(result in arguments[1:])
    for other in arguments[1:]:
        step = folded(operator, result, other)
        if step is None or abs(step) > LIMIT:
            return None
        result = step
    return result


def folded(operator: str, x: int, y: int) -> int | None:
    if operator in {"div", "mod"}:
        if y == 0:
            return None
        quotient = math.floor(abs(x) // abs(y)) * (1 if x * y >= 0 else -1)
        return quotient if operator == "div" else x - quotient * y
    if operator == "pow":
        if y < 0 or (abs(x) > 1 and y > 64):
            return None
        return math.prod([x] * y) if y <= 64 else x ** (2 + y % 2)
    simple = {"add": x + y, "sub": x - y, "mul": x * y, "min": min(x, y), "max": max(x, y), "dist": abs(x - y)}
    truth = {"ne": x != y, "lt": x < y, "le": x <= y, "gt": x > y, "ge": x >= y}
    logic = {"and": x and y, "or": x or y, "xor": x != y, "imp": not x or y}
    return int({**simple, **truth, **logic}[operator])


def value(expression: Expression, values: Mapping[str, int]) -> int | None:
    try:
        return evaluate(expression, values)
    except UndefinedValueError:
        return None


def compiled_value(expression: Expression, values: Mapping[str, int]) -> int | None:
    try:
        return compile_expression(expression, list(values))(list(values.values()))
    except UndefinedValueError:
        return None


@examples(100, slow=3000)
@given(st.one_of(NUMBERS, TRUTHS), ENVIRONMENTS)
def test_evaluate_compiled_and_plain_python_agree(expression: Expression, values: dict[str, int]) -> None:
    expected = oracle(expression, values)
    assert value(expression, values) == expected
    assert compiled_value(expression, values) == expected


@settings(deadline=None)
@given(st.one_of(NUMBERS.map(lambda e: (e, Type.INTEGER)), TRUTHS.map(lambda e: (e, Type.BOOLEAN))))
def test_what_is_written_is_read_back(pair: tuple[Expression, Type]) -> None:
    expression, kind = pair
    assert parse(text(expression), NAMES, kind) == expression


def test_every_operator_is_generated_and_has_two_implementations() -> None:
    for operator, row in OPERATORS.items():
        arguments = tuple(Constant(1) for _ in row.takes)
        expression = Apply(operator, arguments)
        assert compile_expression(expression, ())(()) == evaluate(expression, {}) == oracle(expression, {})


def test_figure_2_as_it_stands() -> None:
    expression = parse(FIGURE_2, ("X", "Y", "i", "j"), Type.BOOLEAN)
    assert text(expression) == "and(ne(X,Y),ne(abs(sub(X,Y)),abs(sub(i,j))))"
    for x, y, i, j in [(1, 2, 1, 3), (1, 3, 1, 3), (2, 2, 1, 3), (3, 1, 3, 1), (4, 1, 3, 1)]:
        holds = x != y and abs(x - y) != abs(i - j)
        assert bool(evaluate(expression, {"X": x, "Y": y, "i": i, "j": j})) == holds


@looped(
    ("written", "canonical"),
    [
        ("minus(i-j)", "sub(i,j)"),
        ("sub((i-j))", "sub(i,j)"),
        ("dist(i-j)", "dist(i,j)"),
        ("plus(i+j)", "add(i,j)"),
        ("mul(i*j)", "mul(i,j)"),
        ("minus(i-j-1)", "sub(sub(i,j),1)"),
        ("i-j-1", "sub(sub(i,j),1)"),
        ("i+2*j", "add(i,mul(2,j))"),
        ("(i+2)*j", "mul(add(i,2),j)"),
        ("((i))", "i"),
        ("-3", "-3"),
        ("i--3", "sub(i,-3)"),
        ("abs((i))", "abs(i)"),
        ("max( ((i, j, 3)) )", "max(i,j,3)"),
        ("add((i)+j, (j))", "add(add(i,j),j)"),
        ("if(lt(i,j), i, j)", "if(lt(i,j),i,j)"),
    ],
)
def test_loose_forms(written: str, canonical: str) -> None:
    assert text(parse(written, ("i", "j"), Type.INTEGER)) == canonical


@looped(
    ("operator", "arguments", "expected"),
    [
        ("div", (7, 2), 3),
        ("div", (-7, 2), -3),
        ("div", (7, -2), -3),
        ("div", (-7, -2), 3),
        ("mod", (7, 2), 1),
        ("mod", (-7, 2), -1),
        ("mod", (7, -2), 1),
        ("mod", (-7, -2), -1),
        ("div", (1, 0), None),
        ("mod", (1, 0), None),
        ("pow", (2, -1), None),
        ("pow", (0, 0), 1),
        ("pow", (-2, 63), -(2**63)),
        ("pow", (2, 64), None),
        ("pow", (3, 10**17), None),
        ("pow", (-1, 10**17), 1),
        ("pow", (-1, 10**17 + 1), -1),
        ("pow", (0, 10**17), 0),
        ("mul", (10**17, 10**17), None),
        ("mul", (10**17, 10**17, 0), None),
    ],
)
def test_meaning_at_the_edges(operator: str, arguments: tuple[int, ...], expected: int | None) -> None:
    expression = Apply(operator, tuple(map(Constant, arguments)))
    assert value(expression, {}) == expected
    assert compiled_value(expression, {}) == expected


def test_all_arguments_are_evaluated_but_if_chooses() -> None:
    undefined = "eq(div(1,0),1)"
    for written in [f"or(eq(0,0),{undefined})", f"and(eq(0,1),{undefined})", f"eq(if({undefined},1,1),1)"]:
        expression = parse(written, (), Type.BOOLEAN)
        assert value(expression, {}) is compiled_value(expression, {}) is None
    chosen = parse("if(eq(0,0),1,div(1,0))", (), Type.INTEGER)
    assert value(chosen, {}) == compiled_value(chosen, {}) == 1


def test_names_in_order() -> None:
    assert names(parse("add(Y,X,Y,3)", ("X", "Y"), Type.INTEGER)) == ("Y", "X")


@looped(
    ("written", "position", "fragments"),
    [
        ("nee(X,Y)", 0, ["unknown operator 'nee'", "did you mean 'ne"]),
        ("eq(X,Z)", 5, ["unknown name 'Z'", "X Y"]),
        ("eq(X)", 0, ["'eq' takes 2 arguments or more, not 1", "write eq(X, ...)"]),
        ("ne(X,Y,1)", 0, ["'ne' takes 2 arguments, not 3"]),
        ("and(eq(X,Y))", 0, ["'and' takes 2 arguments or more"]),
        ("neq(X-Y)", 0, ["'neq' takes 2 arguments", "write neq(sub(X,Y), ...)"]),
        ("eq(minus(X*Y),0)", 3, ["'minus' takes 2 arguments", "write minus(mul(X,Y), ...)"]),
        ("X", 0, ["must be Boolean", "compare it"]),
        ("eq(eq(X,Y),1)", 3, ["must be integer", "if(..., 1, 0)"]),
        ("eq(eq(X,Y)+1,1)", 3, ["an operand of '+' must be integer"]),
        ("and(X,eq(X,Y))", 4, ["argument 1 of 'and' must be Boolean"]),
        ("eq(X,-Y)", 5, ["write neg(...)"]),
        ("eq(X,Y", 2, ["'(' has no matching ')'"]),
        ("eq(X,Y))", 7, ["')' has no matching '('"]),
        ("eq(X,Y) X", 8, ["unexpected 'X' after the end"]),
        ("eq(X Y)", 5, ["expected ',' or ')'"]),
        ("eq((X,Y),1)", 5, ["expected one term in parentheses, found a list"]),
        ("eq(X,Y),eq(X,Y)", 7, ["expected one expression, found a list"]),
        ("eq(X;Y)", 4, ["unexpected character ';'"]),
        ("X != Y", 2, ["unknown sign '!='", "write ne(X, Y)"]),
        ("X == Y", 2, ["unknown sign '=='", "write eq(X, Y)"]),
        ("eq(X, Y) <=> eq(Y, X)", 9, ["unknown sign '<=>'", "write iff(A, B)"]),
        ("eq(X, Y) -> eq(Y, X)", 9, ["unknown sign '->'", "write imp(A, B)"]),
        ("!eq(X, Y)", 0, ["unknown sign '!'", "write not(A)"]),
        ("eq(X**2, Y)", 4, ["unknown sign '**'", "write pow(X, Y)"]),
        ("eq(X, Y) and eq(Y, X)", 9, ["unexpected 'and'", "write and(A, B)"]),
        ("not (X or Y)", 7, ["expected ',' or ')', found 'or'", "write or(A, B)"]),
        ("((X mod Y))", 4, ["expected ')', found 'mod'", "write mod(X, Y)"]),
        ("not X", 0, ["unknown name 'not'", "write not(A)"]),
        ("X in Y", 2, ["unexpected 'in'", "write in(X, set(1, 2))"]),
        ("eq(X,)", 5, ["expected a term"]),
        ("", 0, ["expected a term, found the end"]),
        ("eq(X,1234567890123456789)", 5, ["an integer has 19 digits"]),
        ("eq(X," + "9" * 5000 + ")", 5, ["an integer has 5000 digits"]),
        ("__import__('os')", 0, ["unknown operator"]),
    ],
)
def test_errors_say_what_where_and_what_next(written: str, position: int, fragments: list[str]) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(written, ("X", "Y"), Type.BOOLEAN)
    assert caught.value.position == position
    assert caught.value.hint
    for fragment in fragments:
        assert fragment in str(caught.value)


@looped(
    "written",
    [
        "(" * 60_000,
        "(" * 30_000 + "X" + ")" * 30_000,
        "abs(" * 15_000 + "X" + ")" * 15_000,
        "not(" * 65 + "eq(X,X)" + ")" * 65,
        "eq(" + "+".join("X" * 1000) + ",1)",
        "eq(" + "*".join("X" * 30_000) + ",1)",
        "eq(add(" + ",".join("X" * 10_001) + "),1)",
        "eq(X," + " " * 100_000 + "1)",
        "-" * 60_000,
        "X" * 65_000,
        "X" * 100_000,
    ],
)
def test_deep_and_huge_texts_are_refused_quickly(written: str) -> None:
    caught: list[ExpressionError] = []

    def refused() -> None:
        with pytest.raises(ExpressionError) as refusal:
            parse(written, ("X",), Type.BOOLEAN)
        caught.append(refusal.value)

    assert steps_of(refused) < 1000 + 20 * len(written)
    assert len(str(caught[0])) < 300


GARBAGE = st.one_of(
    st.text(max_size=60),
    st.text(string.printable, max_size=60),
    st.lists(st.sampled_from([*OPERATORS, *ALIASES, *"()()(),,+-*XYi", " ", "12"]), max_size=25).map("".join),
)


@examples(100, slow=3000)
@given(GARBAGE, st.sampled_from(Type))
def test_garbage_is_an_expression_or_an_expression_error(written: str, wanted: Type) -> None:
    try:
        expression = parse(written, NAMES, wanted)
    except ExpressionError:
        return
    assert parse(text(expression), NAMES, wanted) == expression
