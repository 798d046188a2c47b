"""Checks that constraints compute no numbers that are too large, for all values of their variables.

Expressions are evaluated within +-2**63 (`model/expression`). Beyond that range, a constraint would be violated and a
cost would be infinite, which the author did not intend. Costs have at most 18 digits, so that they stay within 64 bits
when they are converted to the team's unit and normalised (`model/costs.py`). Interval arithmetic finds possible
excesses; if there are few value combinations, all of them are tried, and only actual excesses count.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

from robochoc.model.constraint import Constraint, Domain, Function, Predicate, Relation
from robochoc.model.constraint import Term as Actual
from robochoc.model.expression import (
    Apply,
    Constant,
    ExcessiveValueError,
    Expression,
    Name,
    UndefinedValueError,
    compile_expression,
    text,
)
from robochoc.model.expression.bounds import Excess, Interval, bounds, excess
from robochoc.model.expression.tree import BOUND
from robochoc.model.team_edits import shortened
from robochoc.system.errors import RobochocError

MAX_COST = 10**18 - 1
"""The largest cost, in the team's unit."""
MAX_TRIED = 4096
"""The maximum number of value combinations tried to confirm an excess."""
_MAX_DIGITS = 25


class MagnitudeError(RobochocError, ValueError):
    """Raised if a constraint computes numbers that are too large.

    Attributes:
        message: The expression and the bound that it reaches.
        hint: A suggestion to the user.
    """

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class Magnitudes:
    """Checks constraints over variables with known domains. Equal applications of one definition are checked once.

    Args:
        domains: The domains of the variables.
        places: The decimal places of the team's costs.
        max_cost: The largest cost, in the team's unit.
    """

    def __init__(self, domains: Mapping[str, Domain], places: int = 0, max_cost: int = MAX_COST) -> None:
        self._domains = domains
        self._places = places
        self._max_cost = max_cost // 10**places
        self._known: dict[object, tuple[Predicate | Function, Excess | None]] = {}

    def check(self, constraint: Constraint) -> None:
        """Raise `MagnitudeError` if `constraint` computes numbers that are too large for some of its values.

        A constraint over a variable whose domain is unknown or empty is not checked.
        """
        definition, terms = constraint.definition, constraint.parameters
        if isinstance(definition, Relation) or len(terms) != len(definition.parameters):
            return
        if not all(isinstance(term, int) or self._domains.get(term) for term in terms):
            return
        first = {term: place for place, term in reversed(list(enumerate(terms)))}
        key = (
            id(definition),
            tuple(
                term if isinstance(term, int) else (first[term], self._domains[term].ranges, self._domains[term].real)
                for term in terms
            ),
        )
        if key not in self._known:
            self._known[key] = definition, self._excess(definition, terms)
        _, found = self._known[key]
        if found:
            raise self._error(constraint, definition, found)

    def _excess(self, definition: Predicate | Function, terms: Sequence[Actual]) -> Excess | None:
        limits = dict(zip(definition.parameters, map(self._interval, terms), strict=True))
        found = excess(definition.body, limits)
        if found is None and isinstance(definition, Function):
            interval = bounds(definition.body, limits)
            found = Excess(definition.body, interval) if self._is_excessive_cost(definition, *interval) else None
        if found is None or not self._is_confirmed(definition, terms):
            return None
        return found

    def _is_excessive_cost(self, function: Function, *costs: float) -> bool:
        most = self._max_cost * 10**function.places
        return any(abs(cost) > most for cost in costs)

    def _is_confirmed(self, definition: Predicate | Function, terms: Sequence[Actual]) -> bool:
        """Return whether trying all values finds a too large result. True if there are too many values to try."""
        names = tuple(dict.fromkeys(term for term in terms if isinstance(term, str)))
        if math.prod(len(self._domains[name]) for name in names) > MAX_TRIED:
            return True
        if any(self._domains[name].real for name in names):
            return True  # other grids have other values
        body = compile_expression(definition.body, definition.parameters)
        for row in itertools.product(*(self._domains[name] for name in names)):
            values = dict(zip(names, row, strict=True))
            try:
                result = body([values[term] if isinstance(term, str) else term for term in terms])
            except ExcessiveValueError:
                return True
            except UndefinedValueError:
                continue
            if isinstance(definition, Function) and self._is_excessive_cost(definition, result):
                return True
        return False

    def _interval(self, term: Actual) -> Interval:
        if isinstance(term, int):
            return Interval(term, term)
        return extent(self._domains[term])

    def _error(self, constraint: Constraint, definition: Predicate | Function, found: Excess) -> MagnitudeError:
        actual = dict(zip(definition.parameters, constraint.parameters, strict=True))
        shown = shortened(text(_renamed(found.part, actual)))
        low, high = found.interval
        reached = _in_digits(high if high >= -low else low)
        if max(-low, high) > BOUND:
            message = f"'{shown}' may reach {reached}, beyond the limit of 2^63 (about 9.2 * 10^18)"
        else:
            unit = f" in units of 10^-{self._places}" if self._places else ""
            message = f"the cost '{shown}' may reach {reached}; costs have at most 18 digits{unit}"
        return MagnitudeError(message, "use smaller values or coefficients, or a relation (a table)")


def extent(domain: Domain) -> Interval:
    """Return the interval from the smallest to the largest value of a non-empty domain, on any grid if it is real."""
    if domain.real is not None:
        return Interval(domain.real.low, domain.real.high)
    return Interval(domain.ranges[0][0], domain.ranges[-1][-1])


def _renamed(expression: Expression, actual: Mapping[str, Actual]) -> Expression:
    match expression:
        case Name(name):
            term = actual[name]
            return Constant(term) if isinstance(term, int) else Name(term)
        case Apply(operator, arguments):
            return Apply(operator, tuple(_renamed(argument, actual) for argument in arguments))
        case Constant():
            return expression


def _in_digits(number: float) -> str:
    """Return a number with all its digits, or as a power of ten if the number is very long."""
    if number in {math.inf, -math.inf}:
        return f"{'-' if number < 0 else ''}10^1000 and more"
    digits = str(number)
    return (
        digits if len(digits) <= _MAX_DIGITS else f"about {'-' if number < 0 else ''}10^{len(digits.lstrip('-')) - 1}"
    )
