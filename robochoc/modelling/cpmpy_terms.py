"""Translates CPMpy's expressions. CPMpy's operators are recognised by name, so CPMpy is not imported.

A partial function (a quotient, an element of an array) has CPMpy's relational semantics: where it is undefined, the
nearest enclosing Boolean expression is false. `Translation.boolean` adds that condition. No CPMpy expression is
rewritten before the translation: negations stay where the user wrote them, and a global constraint without a
counterpart is decomposed in place.
"""

from __future__ import annotations

import itertools
import numbers
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.xcsp3.constraints import number_of_values
from robochoc.formats.dialects.xcsp3.expressions import (
    FALSE,
    TRUE,
    as_boolean,
    as_integer,
    compare,
    conjunction,
    disjunction,
    is_one_of,
    plus,
    times,
    total,
)
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.model.expression import Apply, Constant, Expression, Name, names
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.modelling.translation import may_be_undefined

COMPARISONS = {"==": "eq", "!=": "ne", "<": "lt", "<=": "le", ">": "gt", ">=": "ge"}


class VariableDefinition(NamedTuple):
    """A constraint that defines an auxiliary variable of a decomposition.

    Attributes:
        constraint: CPMpy's constraint.
        defined: The condition under which the arguments of the decomposed expression are defined.
    """

    constraint: Any
    defined: Expression


def integer_of(value: object) -> int:
    """Return an integer of Python or NumPy as a Python integer. Raises `MistakeError` for any other value."""
    if isinstance(value, numbers.Integral):
        return int(value)
    if type(value).__name__ == "bool_":
        return int(bool(value))
    if isinstance(value, float) and value.is_integer():
        return int(value)
    raise MistakeError(f"{value} is not an integer", "scale the numbers of the CPMpy model")


def is_variable(term: object) -> bool:
    """Return whether `term` is a CPMpy variable, and not a negation."""
    return hasattr(term, "lb") and hasattr(term, "ub") and not hasattr(term, "_bv")


class Translation:
    """Translates CPMpy expressions over the variables in `posting`.

    Args:
        posting: The variables.
        add_variable: Adds an auxiliary variable of a decomposition to `posting`, and returns it.

    Attributes:
        posting: The variables.
        definitions: The definitions of auxiliary variables that have not been posted yet.
    """

    def __init__(self, posting: Posting, add_variable: Callable[[Any], Expression]) -> None:
        self.posting = posting
        self.definitions: list[VariableDefinition] = []
        self._add_variable = add_variable
        self._names: dict[str, Expression] = {theirs: Name(ours) for theirs, ours in posting.names.items()}
        self._conditions: list[Expression] = []
        self._decompositions: dict[tuple[int, bool], tuple[Any, Any]] = {}

    @contextmanager
    def context(self) -> Iterator[list[Expression]]:
        """Collect the conditions under which the integers translated in this context are defined."""
        outside, self._conditions = self._conditions, []
        try:
            yield self._conditions
        finally:
            self._conditions = outside

    def integer(self, term: Any) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        """Return `term` as an integer expression. Raises `MistakeError` if it has no counterpart."""
        if not hasattr(term, "name"):
            return Constant(integer_of(term))
        if is_variable(term):
            if term.name not in self._names:
                self._names[term.name] = self._add_variable(term)
            return self._names[term.name]
        if hasattr(term, "_bv"):
            return Apply("sub", (Constant(1), self.integer(~term)))
        if term.name in _INTEGERS:
            return _INTEGERS[term.name](self, term.args)
        if hasattr(term, "decompose") and not term.is_bool():
            return self._decomposed_function(term)
        return as_integer(self.boolean(term))

    def integers(self, terms: Iterable[Any]) -> list[Expression]:
        """Return all `terms` as integer expressions."""
        return [self.integer(term) for term in (terms.flat if hasattr(terms, "flat") else terms)]

    def boolean(self, term: Any) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        """Return `term` as a Boolean expression, which is false where an integer in it is undefined.

        Raises:
            MistakeError: for an expression without a counterpart.
        """
        with self.context() as conditions:
            found = self._unguarded(term)
        return _guarded(conditions, found)

    def parts(self, term: Any) -> list[Expression]:  # noqa: ANN401 - CPMpy's expressions
        """Return Boolean expressions whose conjunction is `term`, for a constraint that must hold."""
        with self.context() as conditions:
            found = self._unguarded(term)
        return [*conditions, found]

    def _unguarded(self, term: Any) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        if not hasattr(term, "name"):
            return TRUE if bool(term) else FALSE
        if hasattr(term, "_bv"):
            return compare("eq", self.integer(~term), Constant(0))
        if term.name in _BOOLEANS:
            return _BOOLEANS[term.name](self, term.args)
        if hasattr(term, "decompose") and term.is_bool():
            return conjunction(self.booleans(self.decomposed(term)))
        if is_variable(term) or term.name in _INTEGERS or hasattr(term, "decompose"):
            return compare("ne", self.integer(term), Constant(0))
        raise MistakeError(f"CPMpy's '{term.name}' has no counterpart", "rewrite it with other operators")

    def booleans(self, terms: Iterable[Any]) -> list[Expression]:
        """Return all `terms` as Boolean expressions."""
        return [self.boolean(term) for term in (terms.flat if hasattr(terms, "flat") else terms)]

    def decomposed(self, term: Any, *, must_hold: bool = False) -> Any:  # noqa: ANN401 - CPMpy's expressions
        """Return CPMpy's decomposition of a global constraint or function, and record its definitions.

        The conditions under which the arguments are defined become conditions of the enclosing expression.

        Args:
            term: The global constraint or function.
            must_hold: True if `term` is a constraint that must hold. Its decomposition may then be smaller.
        """
        for argument in _leaves(term.args):
            self.integer(argument)
        key = id(term), must_hold
        if key not in self._decompositions:
            try:
                found, definitions = term.decompose_positive() if must_hold else term.decompose()
            except Exception as error:  # noqa: BLE001 - CPMpy's own exceptions, and CPMpy is not imported here
                raise MistakeError(f"CPMpy cannot decompose its '{term.name}'", str(error)) from None
            defined = _guarded(self._conditions, TRUE)
            self.definitions += [VariableDefinition(one, defined) for one in definitions]
            self._decompositions[key] = term, found
        return self._decompositions[key][1]

    def _decomposed_function(self, term: Any) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        if not term.is_total():
            raise MistakeError(f"CPMpy's '{term.name}' has no counterpart", "it is not defined everywhere")
        return self.integer(self.decomposed(term))

    def sum_is(self, one: Expression, other: Expression, result: Expression) -> Expression:
        """Return the condition that `one` + `other` = `result`."""
        return compare("eq", plus(one, other), result)

    def limits(self, expression: Expression) -> Interval:
        """Return an interval that contains the values of `expression`."""
        ends = {name: self.posting.domain(Name(name)) for name in names(expression)}
        return bounds(expression, {name: Interval(min(one), max(one)) for name, one in ends.items()})

    def has_value_if(self, condition: Expression) -> None:
        """Record a condition under which the current expression is defined."""
        if condition not in self._conditions:
            self._conditions.append(condition)

    def quotient(self, operator: str, terms: Sequence[Any]) -> Expression:
        """Return a quotient or a remainder."""
        dividend, divisor = self.integers(terms)
        low, high = self.limits(divisor)
        if low <= 0 <= high:
            self.has_value_if(compare("ne", divisor, Constant(0)))
        return Apply(operator, (dividend, divisor))

    def power(self, terms: Sequence[Any]) -> Expression:
        """Return a power."""
        base, exponent = self.integers(terms)
        if self.limits(exponent).low < 0:
            self.has_value_if(compare("ge", exponent, Constant(0)))
        return Apply("pow", (base, exponent))

    def element(self, terms: Sequence[Any]) -> Expression:
        """Return the element of an array at the given indexes."""
        indexes, cells = self.cells(terms)
        chosen = []
        for place, cell in cells.items():
            here = conjunction([compare("eq", *pair) for pair in zip(indexes, map(Constant, place), strict=True)])
            chosen.append(times(as_integer(here), cell))
        return total([part for part in chosen if part != Constant(0)])

    def cells(self, terms: Sequence[Any]) -> tuple[list[Expression], dict[tuple[int, ...], Expression]]:
        """Return the indexes of an element, and the elements of the array by position."""
        array, *others = terms
        shape = array.shape if hasattr(array, "shape") else (len(array),)
        members, indexes = self.integers(array), self.integers(others)
        for index, size in zip(indexes, shape, strict=True):
            low, high = self.limits(index)
            if low < 0 or high >= size:
                self.has_value_if(is_one_of(index, range(size)))
        return indexes, dict(zip(itertools.product(*map(range, shape)), members, strict=True))

    def table(self, terms: Sequence[Any]) -> Expression:
        """Return the condition that a list of terms equals one of a table's rows."""
        members = self.integers(terms[0])
        rows = [[Constant(integer_of(value)) for value in row] for row in terms[1]]
        return disjunction(
            [conjunction([compare("eq", *pair) for pair in zip(members, row, strict=True)]) for row in rows]
        )

    def pairs(self, terms: Iterable[Any]) -> Iterable[tuple[Expression, Expression]]:
        """Return all pairs of elements in a list."""
        return itertools.combinations(self.integers(terms), 2)


def _leaves(arguments: Any) -> Iterator[Any]:  # noqa: ANN401 - CPMpy's expressions, in lists of lists
    """Yield the expressions among the arguments of a global constraint or function."""
    if hasattr(arguments, "name"):
        yield arguments
    elif not isinstance(arguments, str) and isinstance(arguments, Iterable):
        for one in arguments.flat if hasattr(arguments, "flat") else arguments:
            yield from _leaves(one)


def _guarded(conditions: Sequence[Expression], found: Expression) -> Expression:
    """Return `found`, or false where a condition does not hold. `found` is not evaluated there.

    A condition may be undefined unless all previous conditions hold. Conditions that are always defined are evaluated
    together.
    """
    if not conditions:
        return found
    value = as_integer(found)
    for condition in reversed([one for one in conditions if may_be_undefined(one)]):
        value = Apply("if", (condition, value, Constant(0)))
    always = [one for one in conditions if not may_be_undefined(one)]
    if always:
        value = Apply("if", (conjunction(always), value, Constant(0)))
    return as_boolean(value)


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
    return is_one_of(translation.integer(terms[0]), [integer_of(value) for value in terms[1]])


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
    "nd_element": lambda t, args: t.element(args),
    "count": lambda t, args: total([as_integer(compare("eq", one, t.integer(args[1]))) for one in t.integers(args[0])]),
    "nvalue": lambda t, args: number_of_values(t.integers(args)),
}

_BOOLEANS: dict[str, Callable[[Translation, Sequence[Any]], Expression]] = {
    **{name: _compared(operator) for name, operator in COMPARISONS.items()},
    "boolval": lambda _, args: TRUE if bool(args[0]) else FALSE,
    "and": lambda t, args: conjunction(t.booleans(args)),
    "or": lambda t, args: disjunction(t.booleans(args)),
    "->": lambda t, args: disjunction([_negated(t.boolean(args[0])), t.boolean(args[1])]),
    "not": lambda t, args: _negated(t.boolean(args[0])),
    "xor": lambda t, args: compare(
        "eq", Apply("mod", (total([as_integer(one) for one in t.booleans(args)]), Constant(2))), Constant(1)
    ),
    "ite": lambda t, args: conjunction(
        [
            disjunction([_negated(t.boolean(args[0])), t.boolean(args[1])]),
            disjunction([t.boolean(args[0]), t.boolean(args[2])]),
        ]
    ),
    "alldifferent": lambda t, args: conjunction([compare("ne", *pair) for pair in t.pairs(args)]),
    "allequal": lambda t, args: conjunction([compare("eq", *pair) for pair in itertools.pairwise(t.integers(args))]),
    "table": lambda t, args: t.table(args),
    "negative_table": lambda t, args: _negated(t.table(args)),
    "indomain": _domain,
}

TRANSLATED = frozenset((*_INTEGERS, *_BOOLEANS))
"""CPMpy's names for the translated operators, global constraints and functions."""
