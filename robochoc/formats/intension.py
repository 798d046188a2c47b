"""Read what is stated by an expression: predicates, predefined ones included, and topics.

docs/reference/format.md, "One robot".
"""

from __future__ import annotations

from collections.abc import Collection

from lxml import etree

from robochoc.formats.definitions import PREDEFINED, check_formal, expression_mistake, parsed
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.xml import attribute, line
from robochoc.model.expression import Expression, ExpressionError, Type, parse
from robochoc.model.problem import Function, Predicate, Topic

__all__ = ["PREDEFINED", "read_function", "read_predicate", "read_topic"]


def read_predicate(element: etree._Element) -> Predicate:
    """Return a predicate from `int X int Y` and a Boolean functional expression. Raises `MistakeError`."""
    return Predicate(attribute(element, "name"), *_stated(element, Type.BOOLEAN))


def read_function(element: etree._Element) -> Function:
    """Return a function from `int X int Y` and an integer functional expression. Raises `MistakeError`."""
    return Function(attribute(element, "name"), *_stated(element, Type.INTEGER))


def read_topic(element: etree._Element, variables: Collection[str]) -> Topic:
    """Return a topic, whose `x`, `y` and `z` are expressions over the robot's own `variables`.

    Raises `MistakeError`.
    """
    given: dict[str, Expression] = {}
    for axis in ("x", "y", "z"):
        body = element.get(axis)
        if body is not None:
            try:
                given[axis] = parse(body, variables, Type.INTEGER)
            except ExpressionError as error:
                raise expression_mistake(f"{axis} of the topic", error) from None
    kind = attribute(element, "type") or Topic.type
    return Topic(attribute(element, "name"), kind, given.get("x"), given.get("y"), given.get("z"))


def _stated(element: etree._Element, wanted: Type) -> tuple[tuple[str, ...], Expression]:
    """Return the formal parameters and the body of a predicate or function."""
    parameters = _formal(element.findtext("parameters") or "")
    functional = element.find("expression/functional")
    body = (functional.text if functional is not None else None) or ""
    try:
        return parameters, parsed(body, parameters, wanted)
    except ExpressionError as error:
        below = body[: error.position].count("\n")
        start = line(element if functional is None else functional)
        what = f"{element.tag} {shortened(attribute(element, 'name'))}"
        raise expression_mistake(what, error, start + below) from None


def _formal(text: str) -> tuple[str, ...]:
    """Return the names in `int X int Y`. Raises `MistakeError`."""
    words = text.split()
    names = tuple(words[1::2])
    if len(words) % 2 or any(word != "int" for word in words[::2]):
        raise MistakeError(f"the parameters '{shortened(' '.join(words))}' cannot be read", "write int X int Y")
    check_formal(names)
    return names
