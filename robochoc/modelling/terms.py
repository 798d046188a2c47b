"""Terms: expressions over variables, written with Python's operators and stored as typed trees.

`value` evaluates a term as Python would, with exact numbers: `//` and `%` round down. `modelling/translation.py`
translates terms into the expressions of XML files.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, NoReturn

from robochoc.modelling.codes import BOOLEAN, NUMBER, DomainCodes, ValueKind, kind_of
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine, is_called_by_cpmpy
from robochoc.modelling.numbers import Exact, exact, is_number, is_truth, shown
from robochoc.modelling.operators import OPERATORS, PARTIAL, UndefinedTermError
from robochoc.system.suggestions import did_you_mean

MAX_DEPTH = 200
MAX_TERMS = 1_000_000

Values = Mapping["ModelVariable", object]
"""The user's values of variables."""


class TermSize(NamedTuple):
    """The depth of a term, and the number of its subterms. A subterm is counted each time that it occurs."""

    depth: int
    terms: int


_ALONE = TermSize(0, 1)
"""The size of a variable or a constant."""


class Term:
    """A number, a truth value or a symbol that depends on variables.

    Numbers support `+ - * // % ** abs()` and comparisons; `==` and `!=` compare any two terms of the same kind.
    Conditions support `& | ~ ^` and `implies`; where a number is expected, a condition counts as 0 or 1.
    """

    __array_priority__ = -1.0
    """NumPy scalars (priority -1000000) leave operators to a term; NumPy arrays (priority 0) apply them elementwise."""
    kind: ValueKind | None = NUMBER
    """The kind of the term's values. None: unknown until the values are computed."""
    arguments: tuple[Term, ...] = ()
    size: TermSize = _ALONE

    @cached_property
    def variables(self) -> tuple[ModelVariable, ...]:
        """The distinct variables, in order of appearance."""
        return tuple(dict.fromkeys(_leaves(self)))

    @cached_property
    def is_partial(self) -> bool:
        """True if the term can be undefined: it contains a division, a power, an element or a function call."""
        return any(one.is_partial for one in self.arguments)

    def value(self, values: Values) -> object:
        """Return the term's value. Raises `UndefinedTermError` if the term is undefined, as in a division by zero."""
        raise NotImplementedError

    def implies(self, other: object) -> Term:
        """Return the condition that `other` holds whenever this condition holds."""
        return Operation("implies", condition(self), condition(other))

    def is_in(self, values: Iterable[object]) -> Term:
        """Return the condition that the value of this term is one of `values`."""
        equations = [condition(self == value) for value in values]
        members = [one.arguments[1] for one in equations]
        if len(members) > 1 and all(isinstance(one, ConstantTerm) for one in members):
            return Operation("in", self, *members)
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
        if isinstance(factor, ConstantTerm):
            return linear(((exact(factor.given), self),))
        return Operation("mul", number(self), number(factor))

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Term:
        if isinstance(other, Term) or not is_number(other):
            raise ModelTypeError("'/' requires a number as divisor", "write // for the quotient, rounded down")
        if exact(other) == 0:
            raise ModelError("division by zero")
        return linear(((Fraction(1) / exact(other), self),))

    def __floordiv__(self, other: object) -> Term:
        return Operation("floordiv", number(self), number(other))

    def __rfloordiv__(self, other: object) -> Term:
        return Operation("floordiv", number(other), number(self))

    def __mod__(self, other: object) -> Term:
        return Operation("mod", number(self), number(other))

    def __rmod__(self, other: object) -> Term:
        return Operation("mod", number(other), number(self))

    def __pow__(self, other: object) -> Term:
        return Operation("pow", number(self), number(other))

    def __rpow__(self, other: object) -> Term:
        return Operation("pow", number(other), number(self))

    def __abs__(self) -> Term:
        return Operation("abs", number(self))

    def __eq__(self, other: object) -> Term:  # type: ignore[override] # a condition, not a truth value
        return _equation("eq", self, other)

    def __ne__(self, other: object) -> Term:  # type: ignore[override] # the same
        return _equation("ne", self, other)

    def __hash__(self) -> int:
        return object.__hash__(self)

    def __lt__(self, other: object) -> Term:
        return Operation("lt", number(self), number(other))

    def __le__(self, other: object) -> Term:
        return Operation("le", number(self), number(other))

    def __gt__(self, other: object) -> Term:
        return Operation("gt", number(self), number(other))

    def __ge__(self, other: object) -> Term:
        return Operation("ge", number(self), number(other))

    def __and__(self, other: object) -> Term:
        return _flat("and", (self, other))

    def __rand__(self, other: object) -> Term:
        return _flat("and", (other, self))

    def __or__(self, other: object) -> Term:
        return _flat("or", (self, other))

    def __ror__(self, other: object) -> Term:
        return _flat("or", (other, self))

    def __xor__(self, other: object) -> Term:
        return Operation("xor", condition(self), condition(other))

    __rxor__ = __xor__

    def __invert__(self) -> Term:
        term = condition(self)
        if isinstance(term, Operation) and term.operator in _OPPOSITES:
            return Operation(_OPPOSITES[term.operator], *term.arguments)
        return Operation("not", term)

    def __bool__(self) -> NoReturn:
        self._refuse_cpmpy()
        raise ModelTypeError(
            f"{self!r} has no truth value before the problem is solved",
            "write & | ~ for and, or, not; .implies() for if; .is_in() for in; (1 < x) & (x < 3) for 1 < x < 3;"
            " all_of, any_of, minimum, maximum for all, any, min, max",
        )

    def __float__(self) -> NoReturn:
        raise ModelTypeError(
            f"{self!r} has no value before the problem is solved",
            "write robochoc.function(math.sqrt, x) for math.sqrt(x)",
        )

    def __iter__(self) -> NoReturn:
        self._refuse_cpmpy()
        raise ModelTypeError(f"{self!r} is one term, not a list of terms", "put it in a list")

    def _refuse_cpmpy(self) -> None:
        """Raise `ModelTypeError` if a function of CPMpy received this term."""
        if is_called_by_cpmpy():
            hint = "use robochoc.all_different, minimum, maximum, element, all_of, any_of"
            raise ModelTypeError(f"a function of CPMpy cannot use {self!r}, a term of robochoc", hint)

    def __deepcopy__(self, memo: dict[int, object]) -> Term:
        """Return a copy. The deepest subterms are copied first, since recursion could exceed Python's limit."""
        waiting = [self]
        while waiting:
            below = [one for one in waiting[-1].arguments if id(one) not in memo]
            waiting += below
            if not below and id(term := waiting.pop()) not in memo:
                made = memo[id(term)] = object.__new__(type(term))
                vars(made).update(copy.deepcopy(vars(term), memo))
        copied: Term = memo[id(self)]  # type: ignore[assignment] # memo holds objects
        return copied


class ModelVariable(Term):
    """A decision of a robot, created by `ModelRobot.variable`.

    Attributes:
        name: The variable's name in the team.
        codes: The variable's domain.
        owner: The name of the variable's robot.
        place: The line that created the variable.
        joins: The event with which its robot joins. None: the robot belongs to the team from the beginning.
    """

    def __init__(self, name: str, codes: DomainCodes, owner: str, place: SourceLine, joins: object = None) -> None:
        self.name, self.codes, self.owner, self.place, self.joins = name, codes, owner, place, joins
        self.kind = codes.kind
        self.domain_name = ""

    @property
    def domain(self) -> tuple[object, ...]:
        """The values in the domain."""
        return tuple(self.codes.value(code) for code in self.codes)

    def value(self, values: Values) -> object:
        """Return the value of the term for these `values` of variables."""
        return values[self]

    def __repr__(self) -> str:
        return self.name


class ConstantTerm(Term):
    """A constant."""

    def __init__(self, given: object) -> None:
        self.given, self.kind = given, kind_of(given)

    def value(self, values: Values) -> object:  # noqa: ARG002 - see Term
        """Return the value of the term for these `values` of variables."""
        return self.given

    def __repr__(self) -> str:
        return repr(self.given)


class Linear(Term):
    """A weighted sum: pairs of a factor and a term, and a constant.

    A long `sum(...)` creates an intermediate sum for each term, so equal terms are merged only on demand.
    """

    def __init__(self, pairs: tuple[tuple[Exact, Term], ...], constant: Exact = 0) -> None:
        self.pairs, self.constant = pairs, constant

    @cached_property
    def parts(self) -> tuple[tuple[Exact, Term], ...]:
        """Each distinct term with its factor; partial terms stay even with factor 0, as they can be undefined."""
        merged: dict[Term, Exact] = {}
        for factor, term in self.pairs:
            merged[term] = merged.get(term, 0) + factor
        return tuple((factor, term) for term, factor in merged.items() if factor or term.is_partial)

    @property
    def size(self) -> TermSize:  # type: ignore[override] # computed on demand, since sums grow
        """The size of a sum of the distinct terms."""
        return size_of(self.arguments)

    @cached_property
    def arguments(self) -> tuple[Term, ...]:  # type: ignore[override] # computed once
        """The distinct terms."""
        return tuple(term for _, term in self.parts)

    def value(self, values: Values) -> object:
        """Return the value of the term for these `values` of variables."""
        total = self.constant
        for factor, term in self.parts:
            total += factor * exact(term.value(values))
        return total

    def __repr__(self) -> str:
        words = [f"{_FACTORS.get(factor, f'{shown(factor)}*')}{term!r}" for factor, term in self.parts]
        return f"({' + '.join([*words, *([shown(self.constant)] if self.constant else [])])})".replace("+ -", "- ")


class Operation(Term):
    """An operator of `MEANINGS`, applied to terms."""

    def __init__(self, operator: str, *arguments: Term) -> None:
        self.operator, self.arguments = operator, arguments
        self.kind = OPERATORS[operator].gives
        self.size = size_of(arguments)

    @cached_property
    def is_partial(self) -> bool:
        """True if the operation can be undefined."""
        return self.operator in PARTIAL or any(one.is_partial for one in self.arguments)

    def value(self, values: Values) -> object:
        """Return the value of the term for these `values` of variables."""
        meaning = OPERATORS[self.operator]
        if meaning.lazy is not None:
            return meaning.lazy(*(lambda one=one: one.value(values) for one in self.arguments))
        return meaning.compute(*(one.value(values) for one in self.arguments))

    def __repr__(self) -> str:
        return OPERATORS[self.operator].text([repr(one) for one in self.arguments])


class FunctionCall(Term):
    """A call of a Python function with terms as arguments: a condition or a number, depending on the results."""

    kind = None
    is_partial = True

    def __init__(self, function: Callable[..., object], arguments: tuple[Term, ...], place: SourceLine) -> None:
        self.function, self.arguments, self.place = function, arguments, place
        self.size = size_of(arguments)

    def value(self, values: Values) -> object:
        """Return the value of the term for these `values` of variables."""
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


class TableTerm(Term):
    """A table over terms: values for the listed combinations, and a default value for all others."""

    def __init__(self, arguments: tuple[Term, ...], rows: Mapping[tuple[object, ...], object], default: object) -> None:
        self.arguments, self.rows, self.default = arguments, rows, default
        self.kind = BOOLEAN if is_truth(default) else NUMBER
        self.size = size_of(arguments)

    def value(self, values: Values) -> object:
        """Return the value of the term for these `values` of variables."""
        return self.rows.get(tuple(one.value(values) for one in self.arguments), self.default)

    def __repr__(self) -> str:
        return f"table({', '.join(map(repr, self.arguments))})"


_FACTORS: dict[Exact, str] = {1: "", -1: "-"}
_OPPOSITES = {"eq": "ne", "ne": "eq", "lt": "ge", "ge": "lt", "gt": "le", "le": "gt"}


def any_of(*conditions: object) -> Term:
    """Return the condition that at least one of `conditions` holds. They are separate arguments or one list."""
    return _flat("or", listed) if (listed := in_one_list(conditions)) else ConstantTerm(given=False)


def all_of(*conditions: object) -> Term:
    """Return the condition that all `conditions` hold. They are separate arguments or one list."""
    return _flat("and", listed) if (listed := in_one_list(conditions)) else ConstantTerm(given=True)


def in_one_list(arguments: tuple[object, ...]) -> list[object]:
    """Return the elements of the only argument if it is a list or another iterable, otherwise the arguments."""
    only = arguments[0] if len(arguments) == 1 else arguments
    return list(only) if isinstance(only, Iterable) and not isinstance(only, (Term, str)) else list(arguments)


def term_of(value: object) -> Term:
    """Return `value` as a term."""
    return value if isinstance(value, Term) else ConstantTerm(value)


def number(value: object) -> Term:
    """Return `value` as a number. Raises `ModelTypeError`."""
    term = term_of(value)
    if term.kind not in {NUMBER, BOOLEAN, None}:
        raise ModelTypeError(f"{term!r} is {term.kind}, not a number", "it supports only == and !=")
    return term


def condition(value: object) -> Term:
    """Return `value` as a condition. Raises `ModelTypeError`."""
    term = term_of(value)
    if term.kind not in {BOOLEAN, None}:
        raise ModelTypeError(f"{term!r} is {term.kind}, not a condition", "compare it with a value")
    return term


def linear(parts: Iterable[tuple[Exact, Term]]) -> Term:
    """Return a sum of terms multiplied by factors; nested sums are merged."""
    pairs: tuple[tuple[Exact, Term], ...] = ()
    constant: Exact = 0
    for factor, term in parts:
        match number(term):
            case ConstantTerm(given=given):
                constant += factor * exact(given)
            case Linear(pairs=inner, constant=more):
                constant += factor * more
                pairs += inner if factor == 1 else tuple((factor * times, one) for times, one in inner)
            case other:
                pairs += ((factor, other),)
    return Linear(pairs, constant)


def _leaves(term: Term) -> Iterator[ModelVariable]:
    waiting = [term]
    while waiting:
        one = waiting.pop()
        if isinstance(one, ModelVariable):
            yield one
        waiting += reversed(one.arguments)


def _operand(value: object) -> Term:
    if not isinstance(value, Term) and not is_number(value):
        raise ModelTypeError(f"{value!r} is not a number", "only numbers can be added and multiplied")
    return term_of(value)


def _flat(operator: str, conditions: Iterable[object]) -> Term:
    found: list[Term] = []
    for one in map(condition, conditions):
        found += one.arguments if isinstance(one, Operation) and one.operator == operator else [one]
    return found[0] if len(found) == 1 else Operation(operator, *found)


def _equation(operator: str, left: Term, given: object) -> Term:
    right = term_of(given)
    kinds = {left.kind, right.kind} - {None}
    if not kinds <= {NUMBER, BOOLEAN} and len(kinds) > 1:
        one, other = left.kind, right.kind
        raise ModelTypeError(f"{left!r} is {one}, and {right!r} is {other}", "they are never equal: compare one kind")
    for variable, constant in ((left, right), (right, left)):
        if isinstance(variable, ModelVariable) and isinstance(constant, ConstantTerm):
            _check_known(variable, constant.given)
    return Operation(operator, left, right)


def _check_known(variable: ModelVariable, value: object) -> None:
    """Raise `ModelError` if the variable is compared with a text that is not in its domain, probably a typo."""
    if isinstance(value, str) and variable.codes.symbolic and variable.codes.code(value) is None:
        shown = " ".join(map(str, variable.domain[:20]))
        raise ModelError(
            f"{variable!r} has no value {value!r}", did_you_mean(value, variable.domain, f"its values: {shown}")
        )


def size_of(arguments: Iterable[Term]) -> TermSize:
    """Return the size of a term with these arguments. Raises `ModelError` if the term is too deep or too large."""
    depth, terms = 0, 1
    for one in arguments:
        depth = max(depth, one.size.depth)
        terms += one.size.terms
    if depth >= MAX_DEPTH:
        hint = "replace a part of it by a variable, or the term by a Python function"
        raise ModelError(f"a term has more than {MAX_DEPTH} levels", hint)
    if terms > MAX_TERMS:
        hint = "a subterm used twice doubles the size at each step: replace it by a variable"
        raise ModelError(f"a term has more than {MAX_TERMS:,} subterms", hint)
    return TermSize(depth + 1, terms)
