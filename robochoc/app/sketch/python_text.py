"""Python expressions as text: operators on `PythonText` objects return the text of the operation.

So a rule in the palette is defined only once: applied to the variables of a model, it returns a constraint; applied to
`PythonText`, it returns the line of Python that defines the constraint.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import Protocol, Self

_PLAIN = re.compile(r"[A-Za-z0-9_. -]*")
"""Matches texts without characters that must be escaped."""


class Operand(Protocol):
    """An operand in a rule: a term of a model, or Python text."""

    def __add__(self, other: object, /) -> Operand: ...
    def __sub__(self, other: object, /) -> Operand: ...
    def __mul__(self, other: object, /) -> Operand: ...
    def __floordiv__(self, other: object, /) -> Operand: ...
    def __mod__(self, other: object, /) -> Operand: ...
    def __abs__(self, /) -> Operand: ...
    def __lt__(self, other: object, /) -> Operand: ...
    def __le__(self, other: object, /) -> Operand: ...
    def __gt__(self, other: object, /) -> Operand: ...
    def __ge__(self, other: object, /) -> Operand: ...
    def __and__(self, other: object, /) -> Operand: ...
    def is_in(self, values: Iterable[object], /) -> Operand:
        """Return the condition that this operand is one of `values`."""


class Binding(IntEnum):
    """The precedence of an expression in Python, lowest first."""

    COMPARISON = 1
    AND = 2
    SUM = 3
    PRODUCT = 4
    ATOM = 5


class PythonText:
    """A Python expression as text."""

    def __init__(self, text: str, binding: Binding = Binding.ATOM) -> None:
        self.text, self.binding = text, binding

    def __str__(self) -> str:
        return self.text

    def __add__(self, other: object) -> PythonText:
        return self._with(" + ", other, Binding.SUM)

    def __sub__(self, other: object) -> PythonText:
        return self._with(" - ", other, Binding.SUM)

    def __mul__(self, other: object) -> PythonText:
        return self._with(" * ", other, Binding.PRODUCT)

    def __floordiv__(self, other: object) -> PythonText:
        return self._with(" // ", other, Binding.PRODUCT)

    def __mod__(self, other: object) -> PythonText:
        return self._with(" % ", other, Binding.PRODUCT)

    def __abs__(self) -> PythonText:
        return PythonText(f"abs({self.text})")

    def __lt__(self, other: object) -> PythonText:
        return self._with(" < ", other, Binding.COMPARISON)

    def __le__(self, other: object) -> PythonText:
        return self._with(" <= ", other, Binding.COMPARISON)

    def __gt__(self, other: object) -> PythonText:
        return self._with(" > ", other, Binding.COMPARISON)

    def __ge__(self, other: object) -> PythonText:
        return self._with(" >= ", other, Binding.COMPARISON)

    def __eq__(self, other: object) -> PythonText:  # type: ignore[override] # a text, not a truth value
        return self._with(" == ", other, Binding.COMPARISON)

    def __ne__(self, other: object) -> PythonText:  # type: ignore[override] # the same
        return self._with(" != ", other, Binding.COMPARISON)

    def __and__(self, other: object) -> PythonText:
        return self._with(" & ", other, Binding.AND)

    def __hash__(self) -> int:
        return hash(self.text)

    def is_in(self, values: Iterable[object]) -> PythonText:
        """Return the text of the condition that this expression is one of `values`."""
        return PythonText(f"{self.within(Binding.ATOM)}.is_in({python_literal([*values])})")

    @classmethod
    def call(cls, function: str, *arguments: object) -> Self:
        """Return the text of a function call."""
        return cls(f"{function}({', '.join(map(python_literal, arguments))})")

    def _with(self, operator: str, other: object, binding: Binding) -> PythonText:
        right = other if isinstance(other, PythonText) else PythonText(python_literal(other))
        tighter = Binding(min(binding + 1, Binding.ATOM))
        left = binding if binding is not Binding.COMPARISON else tighter  # avoids a chained comparison
        return PythonText(f"{self.within(left)}{operator}{right.within(tighter)}", binding)

    def within(self, least: Binding) -> str:
        """Return the text for use in an operation with precedence `least`, in parentheses if necessary."""
        return self.text if self.binding >= least else f"({self.text})"


class Each(PythonText):
    """An expression that is evaluated for each element `a` of `over`."""

    def __init__(self, text: str, over: str) -> None:
        super().__init__(text)
        self.over = over


def text_with(parts: Sequence[str | PythonText], between: str = ".") -> str:
    """Return a string literal made of several parts; an f-string if some parts are expressions."""
    if not any(isinstance(part, PythonText) for part in parts):
        return python_literal(between.join(map(str, parts)))
    literal = [part for part in parts if isinstance(part, str)]
    holes = (
        f"{{{part}}}" if isinstance(part, PythonText) else part.replace("{", "{{").replace("}", "}}") for part in parts
    )
    text = between.join(holes)
    return f'f"{text}"' if all(map(_PLAIN.fullmatch, literal)) else f"f{text!r}"


def python_literal(value: object) -> str:
    """Return a value or a list of values as a Python literal. Quotes in texts are escaped."""
    match value:
        case PythonText():
            return value.text
        case str():
            return f'"{value}"' if _PLAIN.fullmatch(value) else repr(value)
        case list():
            return f"[{', '.join(map(python_literal, value))}]"
        case tuple():
            return f"({', '.join(map(python_literal, value))}{',' * (len(value) == 1)})"
        case _:
            return repr(value)
