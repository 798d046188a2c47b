"""Terms: what users write with operators over variables, as a tree that knows its kinds and its meaning.

`value` computes a term as Python would, in exact numbers: `//` and `%` round down. `modelling/translation.py` says the
same in the language of files.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import NoReturn

from robochoc.modelling.codes import BOOLEAN, NUMBER, Codes, Kind, kind_of
from robochoc.modelling.extents import ALONE, Extent, extent_of
from robochoc.modelling.meanings import MEANINGS, PARTIAL
from robochoc.modelling.numbers import Exact, exact, is_number, shown
from robochoc.modelling.places import ModelError, ModelTypeError, Place
from robochoc.system.suggestions import did_you_mean

Values = Mapping["Variable", object]
"""The users' values of variables."""


class Term:
    """A number, a truth value or a symbol that depends on variables.

    Numbers take `+ - * // % ** abs()` and comparisons; `==` and `!=` compare anything of one kind. Conditions take
    `& | ~ ^` and `implies`; where a number is expected they count as 0 or 1.
    """

    __array_priority__ = -1.0
    """NumPy's scalars (-1000000) leave operators to a term, its arrays (0) do not."""
    kind: Kind | None = NUMBER
    """What it is. None: only its values say."""
    arguments: tuple[Term, ...] = ()
    extent: Extent = ALONE

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """The distinct variables, in the order in which they appear."""
        return tuple(dict.fromkeys(_leaves(self)))

    @cached_property
    def is_partial(self) -> bool:
        """Whether the term may have no value: it divides, has a power or an element, or calls a function."""
        return any(one.is_partial for one in self.arguments)

    def value(self, values: Values) -> object:
        """Return the term's value. Raises `UndefinedTermError` where it has none: a division by zero."""
        raise NotImplementedError

    def implies(self, other: object) -> Term:
        """Return the condition that `other` holds where this one does."""
        return Applied("implies", condition(self), condition(other))

    def is_in(self, values: Iterable[object]) -> Term:
        """Return the condition that this has one of `values`."""
        equations = [condition(self == value) for value in values]
        members = [one.arguments[1] for one in equations]
        if len(members) > 1 and all(isinstance(one, Constant) for one in members):
            return Applied("in", self, *members)
        return any_of(equations)

    def __add__(self, other: object) -> Term:
        return linear(((1, self), (1, _operand(other))))

    def __radd__(self, other: object) -> Term:
        return linear(((1, _operand(other)), (1, self)))

    def __sub__(self, other: object) -> Term:
        return linear(((1, self), (-1, _operand(other))))

    def __rsub__(self, other: object) -> Term:
        return linear(((1, _operand(other)), (-1, self)))

    def __neg__(self) -> Term:
        return linear(((-1, self),))

    def __pos__(self) -> Term:
        return number(self)

    def __mul__(self, other: object) -> Term:
        factor = _operand(other)
        if isinstance(factor, Constant):
            return linear(((exact(factor.given), self),))
        return Applied("mul", number(self), number(factor))

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Term:
        if isinstance(other, Term) or not is_number(other):
            raise ModelTypeError("'/' divides by a number only", "write // for the quotient, rounded down")
        if exact(other) == 0:
            raise ModelError("a division by zero")
        return linear(((Fraction(1) / exact(other), self),))

    def __floordiv__(self, other: object) -> Term:
        return Applied("floordiv", number(self), number(other))

    def __rfloordiv__(self, other: object) -> Term:
        return Applied("floordiv", number(other), number(self))

    def __mod__(self, other: object) -> Term:
        return Applied("mod", number(self), number(other))

    def __rmod__(self, other: object) -> Term:
        return Applied("mod", number(other), number(self))

    def __pow__(self, other: object) -> Term:
        return Applied("pow", number(self), number(other))

    def __rpow__(self, other: object) -> Term:
        return Applied("pow", number(other), number(self))

    def __abs__(self) -> Term:
        return Applied("abs", number(self))

    def __eq__(self, other: object) -> Term:  # type: ignore[override] # a condition, not a truth value
        return _equation("eq", self, other)

    def __ne__(self, other: object) -> Term:  # type: ignore[override] # the same
        return _equation("ne", self, other)

    def __hash__(self) -> int:
        return object.__hash__(self)

    def __lt__(self, other: object) -> Term:
        return Applied("lt", number(self), number(other))

    def __le__(self, other: object) -> Term:
        return Applied("le", number(self), number(other))

    def __gt__(self, other: object) -> Term:
        return Applied("gt", number(self), number(other))

    def __ge__(self, other: object) -> Term:
        return Applied("ge", number(self), number(other))

    def __and__(self, other: object) -> Term:
        return _flat("and", (self, other))

    def __rand__(self, other: object) -> Term:
        return _flat("and", (other, self))

    def __or__(self, other: object) -> Term:
        return _flat("or", (self, other))

    def __ror__(self, other: object) -> Term:
        return _flat("or", (other, self))

    def __xor__(self, other: object) -> Term:
        return Applied("xor", condition(self), condition(other))

    __rxor__ = __xor__

    def __invert__(self) -> Term:
        term = condition(self)
        if isinstance(term, Applied) and term.operator in _OPPOSITES:
            return Applied(_OPPOSITES[term.operator], *term.arguments)
        return Applied("not", term)

    def __bool__(self) -> NoReturn:
        raise ModelTypeError(
            f"{self!r} has no truth value yet: it gets one when the problem is solved",
            "write & | ~ and .implies() for and, or, not and if; (1 < x) & (x < 3) for 1 < x < 3; .is_in() for in;"
            " all_of, any_of, minimum and maximum for all, any, min and max",
        )

    def __iter__(self) -> NoReturn:
        raise ModelTypeError(f"{self!r} is one term, no list of them")

    def __deepcopy__(self, memo: dict[int, object]) -> Term:
        """Return a copy. What is deepest is copied first: Python does not call itself as deep as terms may be."""
        waiting = [self]
        while waiting:
            below = [one for one in waiting[-1].arguments if id(one) not in memo]
            waiting += below
            if not below and id(term := waiting.pop()) not in memo:
                made = memo[id(term)] = object.__new__(type(term))
                vars(made).update(copy.deepcopy(vars(term), memo))
        copied: Term = memo[id(self)]  # type: ignore[assignment] # what is there is its copy
        return copied


class Variable(Term):
    """A decision of a robot. `Robot.variable` makes it.

    Attributes:
        name: Its name in the team.
        codes: Its domain.
        owner: The name of its robot.
        place: Where it was made.
        joins: The event with which its robot joins. None: it is there from the beginning.
    """

    def __init__(self, name: str, codes: Codes, owner: str, place: Place, joins: object = None) -> None:
        self.name, self.codes, self.owner, self.place, self.joins = name, codes, owner, place, joins
        self.kind = codes.kind
        self.domain_name = ""

    @property
    def domain(self) -> tuple[object, ...]:
        """The values of its domain."""
        return tuple(self.codes.value(code) for code in self.codes)

    def value(self, values: Values) -> object:
        """Return its value."""
        return values[self]

    def __repr__(self) -> str:
        return self.name


class Constant(Term):
    """A value that depends on nothing."""

    def __init__(self, given: object) -> None:
        self.given, self.kind = given, kind_of(given)

    def value(self, values: Values) -> object:  # noqa: ARG002 - see Term
        """Return its value."""
        return self.given

    def __repr__(self) -> str:
        return repr(self.given)


class Linear(Term):
    """A weighted sum: pairs of a factor and a term, and a constant.

    A long `sum(...)` makes one for each of its terms, so what equal terms add up to is computed when it is asked for.
    """

    def __init__(self, pairs: tuple[tuple[Exact, Term], ...], constant: Exact = 0) -> None:
        self.pairs, self.constant = pairs, constant

    @cached_property
    def parts(self) -> tuple[tuple[Exact, Term], ...]:
        """The factor of each distinct term; 0 only for terms that may have no value, since then the sum has none."""
        merged: dict[Term, Exact] = {}
        for factor, term in self.pairs:
            merged[term] = merged.get(term, 0) + factor
        return tuple((factor, term) for term, factor in merged.items() if factor or term.is_partial)

    @property
    def extent(self) -> Extent:  # type: ignore[override] # a sum grows; it is asked for once
        """The extent of a sum of these terms."""
        return extent_of(self.arguments)

    @cached_property
    def arguments(self) -> tuple[Term, ...]:  # type: ignore[override] # it is computed once
        """The distinct terms."""
        return tuple(term for _, term in self.parts)

    def value(self, values: Values) -> object:
        """Return its value."""
        total = self.constant
        for factor, term in self.parts:
            total += factor * exact(term.value(values))
        return total

    def __repr__(self) -> str:
        words = [f"{_FACTORS.get(factor, f'{shown(factor)}*')}{term!r}" for factor, term in self.parts]
        return f"({' + '.join([*words, *([shown(self.constant)] if self.constant else [])])})".replace("+ -", "- ")


class Applied(Term):
    """An operator of `MEANINGS`, applied to terms."""

    def __init__(self, operator: str, *arguments: Term) -> None:
        self.operator, self.arguments = operator, arguments
        self.kind = MEANINGS[operator].gives
        self.extent = extent_of(arguments)

    @cached_property
    def is_partial(self) -> bool:
        """Whether it may have no value."""
        return self.operator in PARTIAL or any(one.is_partial for one in self.arguments)

    def value(self, values: Values) -> object:
        """Return its value."""
        meaning = MEANINGS[self.operator]
        if meaning.lazy is not None:
            return meaning.lazy(*(lambda one=one: one.value(values) for one in self.arguments))
        return meaning.compute(*(one.value(values) for one in self.arguments))

    def __repr__(self) -> str:
        return MEANINGS[self.operator].text([repr(one) for one in self.arguments])


_FACTORS: dict[Exact, str] = {1: "", -1: "-"}
_OPPOSITES = {"eq": "ne", "ne": "eq", "lt": "ge", "ge": "lt", "gt": "le", "le": "gt"}


def any_of(conditions: Iterable[object]) -> Term:
    """Return the condition that one of `conditions` holds, or more."""
    return _flat("or", tuple(conditions)) if (conditions := list(conditions)) else Constant(given=False)


def all_of(conditions: Iterable[object]) -> Term:
    """Return the condition that all of `conditions` hold."""
    return _flat("and", tuple(conditions)) if (conditions := list(conditions)) else Constant(given=True)


def term_of(value: object) -> Term:
    """Return `value` as a term."""
    return value if isinstance(value, Term) else Constant(value)


def number(value: object) -> Term:
    """Return `value` as a number. Raises `ModelTypeError`."""
    term = term_of(value)
    if term.kind not in {NUMBER, BOOLEAN, None}:
        raise ModelTypeError(f"{term!r} is {term.kind}, no number", "it can be compared by == and != alone")
    return term


def condition(value: object) -> Term:
    """Return `value` as a condition. Raises `ModelTypeError`."""
    term = term_of(value)
    if term.kind not in {BOOLEAN, None}:
        raise ModelTypeError(f"{term!r} is {term.kind}, no condition", "compare it with something")
    return term


def linear(parts: Iterable[tuple[Exact, Term]]) -> Term:
    """Return a sum of terms times factors; sums in it are merged into one."""
    pairs: tuple[tuple[Exact, Term], ...] = ()
    constant: Exact = 0
    for factor, term in parts:
        match number(term):
            case Constant(given=given):
                constant += factor * exact(given)
            case Linear(pairs=inner, constant=more):
                constant += factor * more
                pairs += inner if factor == 1 else tuple((factor * times, one) for times, one in inner)
            case other:
                pairs += ((factor, other),)
    return Linear(pairs, constant)


def _leaves(term: Term) -> Iterator[Variable]:
    waiting = [term]
    while waiting:
        one = waiting.pop()
        if isinstance(one, Variable):
            yield one
        waiting += reversed(one.arguments)


def _operand(value: object) -> Term:
    if not isinstance(value, Term) and not is_number(value):
        raise ModelTypeError(f"{value!r} is no number", "only numbers are added and multiplied")
    return term_of(value)


def _flat(operator: str, conditions: Iterable[object]) -> Term:
    found: list[Term] = []
    for one in map(condition, conditions):
        found += one.arguments if isinstance(one, Applied) and one.operator == operator else [one]
    return found[0] if len(found) == 1 else Applied(operator, *found)


def _equation(operator: str, left: Term, given: object) -> Term:
    right = term_of(given)
    kinds = {left.kind, right.kind} - {None}
    if not kinds <= {NUMBER, BOOLEAN} and len(kinds) > 1:
        one, other = left.kind, right.kind
        raise ModelTypeError(f"{left!r} is {one}, and {right!r} is {other}", "they are never equal: compare one kind")
    for variable, constant in ((left, right), (right, left)):
        if isinstance(variable, Variable) and isinstance(constant, Constant):
            _check_known(variable, constant.given)
    return Applied(operator, left, right)


def _check_known(variable: Variable, value: object) -> None:
    """Raise `ModelError` where a text is compared that is no value of the variable: a slip of the pen."""
    if isinstance(value, str) and variable.codes.symbolic and variable.codes.code(value) is None:
        shown = " ".join(map(str, variable.domain[:20]))
        raise ModelError(
            f"{variable!r} has no value {value!r}", did_you_mean(value, variable.domain, f"it has {shown}")
        )
