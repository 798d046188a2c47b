"""CPMpy's expressions as ours. CPMpy is looked at by the names of its operators, and never imported."""

from __future__ import annotations

import itertools
import numbers
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.xcsp3.kinds import distinct
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.formats.dialects.xcsp3.terms import (
    FALSE,
    TRUE,
    as_integer,
    compare,
    every,
    inside,
    plus,
    some,
    times,
    total,
)
from robochoc.model.expression import Apply, Constant, Expression, Name

COMPARISONS = {"==": "eq", "!=": "ne", "<": "lt", "<=": "le", ">": "gt", ">=": "ge"}
_GLOBALS = ("alldifferent", "allequal", "table", "negative_table", "cumulative", "xor", "ite", "indomain")
_FUNCTIONS = ("min", "max", "abs", "element", "count", "nvalue", "div", "mod", "pow", "mul")
NATIVE = frozenset((*_GLOBALS, *_FUNCTIONS))
"""CPMpy's global constraints and functions that are translated here. It decomposes the others itself."""


def integer_of(value: object) -> int:
    """Return an integer of Python or NumPy. Raises `MistakeError` for anything else."""
    if isinstance(value, numbers.Integral):
        return int(value)
    if type(value).__name__ == "bool_":
        return int(bool(value))
    if isinstance(value, float) and value.is_integer():
        return int(value)
    raise MistakeError(f"the number {value}", "CPMpy models have integers here: scale the others")


def is_variable(term: object) -> bool:
    """Return whether `term` is a variable of CPMpy, and no negation of one."""
    return hasattr(term, "lb") and hasattr(term, "ub") and not hasattr(term, "_bv")


class Translation:
    """Translates expressions over the variables of `posting`.

    A division by zero makes the comparison around it false, as in CPMpy: what must hold for an expression to have a
    value is collected until the comparison is made.
    """

    def __init__(self, posting: Posting) -> None:
        self.posting = posting
        self._conditions: list[Expression] = []

    def take_conditions(self) -> list[Expression]:
        """Return what must hold for the integers so far to have values, and forget it."""
        found, self._conditions = self._conditions, []
        return found

    def integer(self, term: Any) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        """Return `term` as an integer. Raises `MistakeError` for what has no counterpart."""
        if not hasattr(term, "name"):
            return Constant(integer_of(term))
        if is_variable(term):
            return Name(self.posting.names[term.name])
        if hasattr(term, "_bv"):
            return Apply("sub", (Constant(1), self.integer(~term)))
        make = _INTEGERS.get(term.name)
        return make(self, term.args) if make else as_integer(self.boolean(term))

    def integers(self, terms: Iterable[Any]) -> list[Expression]:
        """Return all of `terms` as integers."""
        return [self.integer(term) for term in (terms.flat if hasattr(terms, "flat") else terms)]

    def boolean(self, term: Any) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        """Return `term` as a Boolean. Raises `MistakeError` for what has no counterpart."""
        if not hasattr(term, "name"):
            return TRUE if bool(term) else FALSE
        if is_variable(term):
            return compare("ne", self.integer(term), Constant(0))
        if hasattr(term, "_bv"):
            return compare("eq", self.integer(~term), Constant(0))
        if term.name == "boolval":
            return TRUE if bool(term.args[0]) else FALSE
        outside, self._conditions = self._conditions, []
        make = _BOOLEANS.get(term.name)
        if make:
            found = make(self, term.args)
        elif term.name in _INTEGERS:
            found = compare("ne", self.integer(term), Constant(0))
        else:
            raise MistakeError(f"CPMpy's '{term.name}' has no counterpart", "write it otherwise")
        conditions, self._conditions = self._conditions, outside
        return _guarded(conditions, found)

    def booleans(self, terms: Iterable[Any]) -> list[Expression]:
        """Return all of `terms` as Booleans."""
        return [self.boolean(term) for term in (terms.flat if hasattr(terms, "flat") else terms)]

    def sum_is(self, one: Expression, other: Expression, result: Expression) -> Expression:
        """Return that two integers add up to a third."""
        return compare("eq", plus(one, other), result)

    def has_value_if(self, condition: Expression) -> None:
        """Note what must hold for the expression in hand to have a value."""
        self._conditions.append(condition)

    def quotient(self, operator: str, terms: Sequence[Any]) -> Expression:
        """Return a quotient or a remainder."""
        dividend, divisor = self.integers(terms)
        if not isinstance(divisor, Constant) or divisor.value == 0:
            self.has_value_if(compare("ne", divisor, Constant(0)))
        return Apply(operator, (dividend, divisor))

    def power(self, terms: Sequence[Any]) -> Expression:
        """Return a power."""
        base, exponent = self.integers(terms)
        if not isinstance(exponent, Constant) or exponent.value < 0:
            self.has_value_if(compare("ge", exponent, Constant(0)))
        return Apply("pow", (base, exponent))

    def element(self, terms: Sequence[Any]) -> Expression:
        """Return the member of a list that an index chooses."""
        members, index = self.integers(terms[0]), self.integer(terms[1])
        self.has_value_if(inside(index, range(len(members))))
        chosen = (
            times(as_integer(compare("eq", index, Constant(place))), member) for place, member in enumerate(members)
        )
        return total([part for part in chosen if part != Constant(0)])

    def table(self, terms: Sequence[Any]) -> Expression:
        """Return that a list has one of some tuples of values."""
        members = self.integers(terms[0])
        rows = [[Constant(integer_of(value)) for value in row] for row in terms[1]]
        return some([every([compare("eq", *pair) for pair in zip(members, row, strict=True)]) for row in rows])

    def pairs(self, terms: Iterable[Any]) -> Iterable[tuple[Expression, Expression]]:
        """Return the pairs of members of a list."""
        return itertools.combinations(self.integers(terms), 2)


def _guarded(conditions: Sequence[Expression], found: Expression) -> Expression:
    """Return `found`, and false where a condition does not hold: then `found` is not looked at."""
    if not conditions:
        return found
    value = as_integer(found)
    for condition in reversed(conditions):
        value = Apply("if", (condition, value, Constant(0)))
    return compare("ne", value, Constant(0))


def _compared(operator: str) -> Callable[[Translation, Sequence[Any]], Expression]:
    return lambda t, args: compare(operator, *t.integers(args))


def _best(operator: str) -> Callable[[Translation, Sequence[Any]], Expression]:
    def make(translation: Translation, terms: Sequence[Any]) -> Expression:
        members = translation.integers(terms)
        return members[0] if len(members) == 1 else Apply(operator, tuple(members))

    return make


def _negated(expression: Expression) -> Expression:
    return Apply("not", (expression,))


def _domain(translation: Translation, terms: Sequence[Any]) -> Expression:
    return inside(translation.integer(terms[0]), [integer_of(value) for value in terms[1]])


_INTEGERS: dict[str, Callable[[Translation, Sequence[Any]], Expression]] = {
    "sum": lambda t, args: total(t.integers(args)),
    "wsum": lambda t, args: total(list(map(times, t.integers(args[0]), t.integers(args[1])))),
    "sub": lambda t, args: Apply("sub", tuple(t.integers(args))),
    "mul": lambda t, args: times(*t.integers(args)),
    "-": lambda t, args: Apply("neg", tuple(t.integers(args))),
    "div": lambda t, args: t.quotient("div", args),
    "mod": lambda t, args: t.quotient("mod", args),
    "pow": lambda t, args: t.power(args),
    "abs": lambda t, args: Apply("abs", tuple(t.integers(args))),
    "min": _best("min"),
    "max": _best("max"),
    "element": lambda t, args: t.element(args),
    "count": lambda t, args: total([as_integer(compare("eq", one, t.integer(args[1]))) for one in t.integers(args[0])]),
    "nvalue": lambda t, args: distinct(t.integers(args)),
}

_BOOLEANS: dict[str, Callable[[Translation, Sequence[Any]], Expression]] = {
    **{name: _compared(operator) for name, operator in COMPARISONS.items()},
    "and": lambda t, args: every(t.booleans(args)),
    "or": lambda t, args: some(t.booleans(args)),
    "->": lambda t, args: some([_negated(t.boolean(args[0])), t.boolean(args[1])]),
    "not": lambda t, args: _negated(t.boolean(args[0])),
    "xor": lambda t, args: compare(
        "eq", Apply("mod", (total([as_integer(one) for one in t.booleans(args)]), Constant(2))), Constant(1)
    ),
    "ite": lambda t, args: every(
        [
            some([_negated(t.boolean(args[0])), t.boolean(args[1])]),
            some([t.boolean(args[0]), t.boolean(args[2])]),
        ]
    ),
    "alldifferent": lambda t, args: every([compare("ne", *pair) for pair in t.pairs(args)]),
    "allequal": lambda t, args: every([compare("eq", *pair) for pair in itertools.pairwise(t.integers(args))]),
    "table": lambda t, args: t.table(args),
    "negative_table": lambda t, args: _negated(t.table(args)),
    "indomain": _domain,
}
