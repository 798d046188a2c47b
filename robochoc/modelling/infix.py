"""Expressions in infix notation, for people: `V1 ≠ V2`, `|V1 - V2| ≥ 2`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.expression.tree import DECIMAL, SYMBOLIC
from robochoc.model.expression.tree import text as expression_text

_SIGNS = {
    "add": "+", "sub": "-", "mul": "·", "div": "/", "mod": "mod", "pow": "^",
    "eq": "=", "ne": "≠", "lt": "<", "le": "≤", "gt": ">", "ge": "≥", "and": "and", "or": "or", "xor": "xor",
    "iff": "⇔",
}  # fmt: skip
"""Infix operators."""

_FORMS = {"abs": "|{0}|", "dist": "|{0} - {1}|", "neg": "-{0}", "sqr": "{0}²"}
_WORDED = frozenset({"not", "in"})
_CLOSED = frozenset({"abs", "not", "min", "max", "imp", "if"})
"""Operators whose arguments need no parentheses."""


class Infix:
    """Converts expressions to infix notation, with parameters replaced by arguments.

    Args:
        given: The argument for each parameter.
        symbolic: The parameters whose values are symbols.
        symbols: The names of the team's symbols, by their codes.
    """

    def __init__(self, given: Mapping[str, str | int], symbolic: Sequence[str], symbols: Sequence[str]) -> None:
        self._given, self._symbolic, self._symbols = given, frozenset(symbolic), symbols

    def text(self, expression: Expression, *, inner: bool = False) -> str:
        """Return the text of an expression. An `inner` expression is in parentheses if necessary."""
        match expression:
            case Constant(value):
                return str(value)
            case Name(name):
                actual = self._given.get(name, name)
                return self._symbol(actual) if isinstance(actual, int) and name in self._symbolic else str(actual)
            case Apply(operator, (Constant(), Constant())) if operator == DECIMAL:
                return expression_text(expression)
            case Apply(operator, arguments):
                said = self._applied(operator, arguments)
                return f"({said})" if inner and operator in _SIGNS else said

    def _applied(self, operator: str, arguments: Sequence[Expression]) -> str:
        named = operator in SYMBOLIC and any(isinstance(one, Name) and one.name in self._symbolic for one in arguments)
        inner = operator not in _CLOSED
        parts = [
            self._symbol(one.value) if named and isinstance(one, Constant) else self.text(one, inner=inner)
            for one in arguments
        ]
        if operator in _FORMS:
            return _FORMS[operator].format(*parts)
        if operator in _WORDED:
            return self.worded(operator, parts)
        return f" {_SIGNS[operator]} ".join(parts) if operator in _SIGNS else f"{operator}({', '.join(parts)})"

    def _symbol(self, code: int) -> str:
        return self._symbols[code] if 0 <= code < len(self._symbols) else str(code)

    def worded(self, operator: str, parts: Sequence[str]) -> str:
        """Return the text of `not` or `in` with the texts of its arguments."""
        return f"not {parts[0]}" if operator == "not" else f"{parts[0]} is one of {', '.join(parts[1:])}"
