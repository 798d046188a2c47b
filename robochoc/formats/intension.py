"""Read what is stated by an expression: predicates, predefined ones included, and topics.

docs/reference/format.md, "One robot".
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from lxml import etree

from robochoc.formats.definitions import PREDEFINED, check_formal, expression_mistake, parsed
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.xml import attribute, line
from robochoc.model.expression import Expression, ExpressionError, SymbolNames, Type, parse
from robochoc.model.problem import Function, Predicate, Topic

__all__ = ["PREDEFINED", "read_function", "read_predicate", "read_topic"]


def read_predicate(element: etree._Element, code: Callable[[str], int]) -> Predicate:
    """Return a predicate from `int X symbol Y` and a Boolean functional expression. Raises `MistakeError`.

    `code` returns the code of a symbol.
    """
    return Predicate(attribute(element, "name"), *_stated(element, Type.BOOLEAN, code))


def read_function(element: etree._Element, code: Callable[[str], int]) -> Function:
    """Return a function from `int X symbol Y` and an integer functional expression. Raises `MistakeError`.

    `code` returns the code of a symbol.
    """
    return Function(attribute(element, "name"), *_stated(element, Type.INTEGER, code))


def read_topic(element: etree._Element, variables: Collection[str], symbolic: Collection[str] = ()) -> Topic:
    """Return a topic, whose `x`, `y` and `z` are expressions over the robot's own `variables`, the `symbolic` excepted.

    Raises `MistakeError`.
    """
    given: dict[str, Expression] = {}
    for axis in ("x", "y", "z"):
        body = element.get(axis)
        if body is not None:
            try:
                symbols = SymbolNames(symbolic, _no_symbol) if symbolic else None
                given[axis] = parse(body, variables, Type.INTEGER, symbols)
            except ExpressionError as error:
                raise expression_mistake(f"{axis} of the topic", error) from None
    kind = attribute(element, "type") or Topic.type
    return Topic(attribute(element, "name"), kind, given.get("x"), given.get("y"), given.get("z"))


def _no_symbol(word: str) -> int:
    raise ValueError(f"unknown name '{shortened(word)}'")


def _stated(
    element: etree._Element, wanted: Type, code: Callable[[str], int]
) -> tuple[tuple[str, ...], Expression, tuple[str, ...]]:
    """Return the formal parameters of a predicate or function, its body, and the parameters that are symbols."""
    parameters, symbolic = _formal(element.findtext("parameters") or "")

    def known(word: str) -> int:
        try:
            return code(word)
        except MistakeError as mistake:
            raise ValueError(mistake.message) from None

    functional = element.find("expression/functional")
    body = (functional.text if functional is not None else None) or ""
    try:
        if symbolic:
            return parameters, parse(body, parameters, wanted, SymbolNames(symbolic, known)), symbolic
        return parameters, parsed(body, parameters, wanted), ()
    except ExpressionError as error:
        below = body[: error.position].count("\n")
        start = line(element if functional is None else functional)
        what = f"{element.tag} {shortened(attribute(element, 'name'))}"
        raise expression_mistake(what, error, start + below) from None


def _formal(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names in `int X symbol Y`, and those that are symbols. Raises `MistakeError`."""
    words = text.split()
    names = tuple(words[1::2])
    if len(words) % 2 or not {*words[::2]} <= {"int", "symbol"}:
        hint = "write int X int Y, and symbol X for what takes symbols"
        raise MistakeError(f"the parameters '{shortened(' '.join(words))}' cannot be read", hint)
    check_formal(names)
    return names, tuple(name for kind, name in zip(words[::2], names, strict=True) if kind == "symbol")
