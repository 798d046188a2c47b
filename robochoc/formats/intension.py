"""What is said by an expression: predicates, predefined ones included, and topics (FORMAT.md, "One robot")."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import lru_cache

from lxml import etree

from robochoc.expression import Apply, Expression, ExpressionError, Name, Type, parse
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.xml import attribute, line
from robochoc.problem import Predicate, Topic

_OPERATORS = {"eq": "eq", "ne": "ne", "neq": "ne", "lt": "lt", "le": "le", "gt": "gt", "ge": "ge"}
_PARAMETER = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*")

PREDEFINED: dict[str, Predicate] = {
    name: Predicate(name, ("X", "Y"), Apply(operator, (Name("X"), Name("Y")))) for name, operator in _OPERATORS.items()
}
"""Predicates on two terms that every file may refer to without defining them; `neq` is Figure 2's name for `ne`."""


def read_predicate(element: etree._Element) -> Predicate:
    """A predicate from `int X int Y` and a Boolean functional expression. Raises `MistakeError`."""
    name = attribute(element, "name")
    parameters = _formal(element.findtext("parameters") or "")
    functional = element.find("expression/functional")
    body = (functional.text if functional is not None else None) or ""
    try:
        return Predicate(name, parameters, _body(body, parameters))
    except ExpressionError as error:
        below = body[: error.position].count("\n")
        start = line(element if functional is None else functional)
        raise _mistake(f"predicate {shortened(name)}", error, start + below) from None


def read_topic(element: etree._Element, variables: Collection[str]) -> Topic:
    """A topic, whose `x`, `y` and `z` are expressions over the robot's own `variables`. Raises `MistakeError`."""
    given: dict[str, Expression] = {}
    for axis in ("x", "y", "z"):
        body = element.get(axis)
        if body is not None:
            try:
                given[axis] = parse(body, variables, Type.INTEGER)
            except ExpressionError as error:
                raise _mistake(f"{axis} of the topic", error) from None
    kind = attribute(element, "type") or Topic.type
    return Topic(attribute(element, "name"), kind, given.get("x"), given.get("y"), given.get("z"))


def _formal(text: str) -> tuple[str, ...]:
    """The names in `int X int Y`. Raises `MistakeError`."""
    words = text.split()
    names = tuple(words[1::2])
    if len(words) % 2 or any(word != "int" for word in words[::2]):
        raise MistakeError(f"the parameters '{shortened(' '.join(words))}' cannot be read", "write int X int Y")
    seen: set[str] = set()
    for name in names:
        if not _PARAMETER.fullmatch(name):
            raise MistakeError(f"'{shortened(name)}' is no name for a parameter", "write int X int Y")
        if name in seen:
            raise MistakeError(f"two parameters are called '{shortened(name)}'", "rename one of them")
        seen.add(name)
    return names


@lru_cache(maxsize=256)
def _body(text: str, parameters: tuple[str, ...]) -> Expression:
    """The robots of a team mostly say the same: equal texts are parsed once and share one tree."""
    return parse(text, parameters, Type.BOOLEAN)


def _mistake(what: str, error: ExpressionError, number: int = 0) -> MistakeError:
    message = f"{what}: {error.message}, at character {error.position + 1}"
    return MistakeError(message, error.hint or "see FORMAT.md, 'Functional expressions'", number)
