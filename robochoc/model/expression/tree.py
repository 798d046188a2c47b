"""The tree that a functional expression is, and its canonical text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

BOUND = 2**63
"""No result may lie beyond +-BOUND: it is undefined instead."""


class Type(StrEnum):
    """The type of an expression's value. Names (formal parameters, variables) are integers."""

    INTEGER = "integer"
    BOOLEAN = "Boolean"


@dataclass(frozen=True, slots=True)
class Constant:
    """An integer literal."""

    value: int


@dataclass(frozen=True, slots=True)
class Name:
    """A formal parameter of a predicate, or a variable."""

    name: str


@dataclass(frozen=True, slots=True)
class Apply:
    """An operator (under its XCSP 2.1 name) applied to arguments."""

    operator: str
    arguments: tuple[Expression, ...]


Expression = Constant | Name | Apply


class UndefinedValueError(ArithmeticError):
    """The expression has no value here: a division by zero, a negative exponent, or a result out of bounds."""


def text(expression: Expression) -> str:
    """Return `expression` in XCSP 2.1's functional form, which `parse` reads back: `ne(abs(sub(X,Y)),1)`."""
    match expression:
        case Constant(value):
            return str(value)
        case Name(name):
            return name
        case Apply(operator, arguments):
            return f"{operator}({','.join(text(argument) for argument in arguments)})"


def names(expression: Expression) -> tuple[str, ...]:
    """Return the distinct names in `expression`, in the order in which they appear."""
    return tuple(dict.fromkeys(_every_name(expression)))


def _every_name(expression: Expression) -> Iterator[str]:
    match expression:
        case Name(name):
            yield name
        case Apply(_, arguments):
            for argument in arguments:
                yield from _every_name(argument)
        case Constant():
            pass
