"""Terms whose value a table has, or a function of the user's, of which a table is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from robochoc.modelling.codes import BOOLEAN, NUMBER
from robochoc.modelling.extents import extent_of
from robochoc.modelling.meanings import UndefinedTermError
from robochoc.modelling.numbers import is_truth
from robochoc.modelling.places import ModelError, Place
from robochoc.modelling.terms import Term, Values


class Called(Term):
    """A function of the user's, of terms. What it returns says whether it is a condition or a number."""

    kind = None
    is_partial = True

    def __init__(self, function: Callable[..., object], arguments: tuple[Term, ...], place: Place) -> None:
        self.function, self.arguments, self.place = function, arguments, place
        self.extent = extent_of(arguments)

    def value(self, values: Values) -> object:
        """Return its value."""
        given = [one.value(values) for one in self.arguments]
        try:
            return self.function(*given)
        except ArithmeticError as error:
            raise UndefinedTermError from error
        except Exception as error:
            name = getattr(self.function, "__name__", "the function")
            shown = ", ".join(map(repr, given))
            raise ModelError(f"{name}({shown}): {type(error).__name__}: {error}", place=self.place) from error

    def __repr__(self) -> str:
        return f"{getattr(self.function, '__name__', 'function')}({', '.join(map(repr, self.arguments))})"


class Tabled(Term):
    """A table over terms: the value of each combination that it lists, and of all others."""

    def __init__(self, arguments: tuple[Term, ...], rows: Mapping[tuple[object, ...], object], default: object) -> None:
        self.arguments, self.rows, self.default = arguments, rows, default
        self.kind = BOOLEAN if is_truth(default) else NUMBER
        self.extent = extent_of(arguments)

    def value(self, values: Values) -> object:
        """Return its value."""
        return self.rows.get(tuple(one.value(values) for one in self.arguments), self.default)

    def __repr__(self) -> str:
        return f"table({', '.join(map(repr, self.arguments))})"
