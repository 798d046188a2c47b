"""Splits predicates over many variables into small tables, for solvers that accept only tables.

A predicate with too many combinations of values is split along its expression: the value of a subexpression becomes an
additional variable, and a table relates it to the subexpression's variables. Sums in comparisons are added up term by
term (Trick, "A dynamic programming approach for consistency and propagation for knapsack constraints", Annals of OR
118, 2003): each partial sum is a variable, and partial sums share one value if the remaining terms cannot change the
outcome. Every additional variable is determined by the others, so the number of solutions stays the same.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field

from robochoc.model.constraint import Constraint, Predicate
from robochoc.model.expression import (
    OPERATORS,
    Apply,
    Constant,
    Expression,
    Name,
    UndefinedValueError,
    compile_expression,
    names,
    with_arguments,
)
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.expression.tree import BOUND
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

SMALL = 256
"""The maximum number of combinations of values for which parts are joined in one table."""
MAX_COMBINATIONS = 1_000_000
"""The maximum number of evaluated combinations of values for one table."""
MAX_TRIED = 3_000_000
"""The maximum number of evaluated combinations of values for all split predicates of a problem."""
LARGEST = BOUND >> 20
"""The maximum of intermediate results, so that sums in any order stay within the bounds of expressions."""

Row = tuple[int, ...]
_COMPARISONS = {"le": "le", "ge": "ge", "lt": "le", "gt": "ge", "eq": "eq", "ne": "ne"}
_STRICT = {"lt": -1, "gt": 1}
_MAY_BE_UNDEFINED = {"div", "mod", "pow"}


@dataclass
class Split:
    """Tables that together are equivalent to a predicate: the scope and the allowed rows of each table.

    Attributes:
        tables: The tables.
        domains: The values of all variables in scopes, in ascending order: given and additional variables.
        prefix: The beginning of the names of additional variables.
        budget: The number of combinations of values that may still be evaluated.
    """

    domains: dict[str, Sequence[int]]
    prefix: str
    budget: int
    tables: list[tuple[tuple[str, ...], tuple[Row, ...]]] = field(default_factory=list)
    _made: dict[Expression, Name] = field(default_factory=dict)
    _further: int = 0

    # Boolean expressions

    def require(self, expression: Expression) -> None:
        """Add tables that are equivalent to a Boolean expression."""
        if isinstance(expression, Apply) and expression.operator == "and":
            for part in expression.arguments:
                self.require(part)
        elif self._size(expression) <= SMALL:
            self._allow(expression)
        elif isinstance(expression, Apply) and expression.operator in _COMPARISONS and len(expression.arguments) == 2:  # noqa: PLR2004
            self._compare(expression.operator, *expression.arguments)
        else:
            self._allow(self._reduced(expression))

    def _allow(self, expression: Expression) -> None:
        scope = names(expression) or tuple(self.domains)[:1]
        rows = tuple([row for row, value in self._worth(expression, scope) if value])
        self.tables.append((scope, rows))

    # Sums

    def _compare(self, operator: str, left: Expression, right: Expression) -> None:
        """Add tables that are equivalent to a comparison, rewritten as a sum of terms compared with zero."""
        terms: dict[Expression, int] = {}
        target = -collect_terms(left, 1, terms) - collect_terms(right, -1, terms) + _STRICT.get(operator, 0)
        kept = [(term, factor) for term, factor in terms.items() if factor or _may_be_undefined(term)]
        reduced = [_times(self._reduced(term), factor) for term, factor in kept]
        window = _Window(_COMPARISONS[operator], target)
        if not reduced and window.state(0, 0, 0) is None:
            self.tables.append((tuple(self.domains)[:1], ()))
        before = len(self.tables), dict(self.domains), self.budget
        try:
            self._add_up(reduced, window)
        except NotSplitError:
            del self.tables[before[0] :]
            _, self.domains, self.budget = before
            # With the largest terms first, few partial sums can be completed.
            ends = {term: self._ends(term) for term in reduced}
            self._add_up(sorted(reduced, key=lambda term: ends[term].low - ends[term].high), window)

    def _add_up(self, reduced: Sequence[Expression], window: _Window) -> None:
        """Add tables that restrict the sum of terms over few variables to a window."""
        ends = [self._ends(term) for term in reduced]
        state: Name | None = None
        place = 0
        while place < len(reduced):
            group, after = self._group(reduced, place, state)
            if state and after == len(reduced) and window.operator == "eq":
                self._complete(state, group, window.target)
                return
            low = sum(end.low for end in ends[after:])
            high = sum(end.high for end in ends[after:])
            scope = (*((state.name,) if state else ()), *names(group)) or tuple(self.domains)[:1]
            total = Apply("add", (state, group)) if state else group
            found = ((row, window.state(value, int(low), int(high))) for row, value in self._worth(total, scope))
            rows = [(row, value) for row, value in found if value is not None]
            if after == len(reduced):
                self.tables.append((scope, tuple(row for row, _ in rows)))
            else:
                state = self._variable(scope, rows)
            place = after

    def _complete(self, state: Name, group: Expression, target: int) -> None:
        """Add the table for `state` + `group` = `target`: for each partial sum, the matching rows."""
        scope = names(group)
        fitting: dict[int, list[Row]] = {}
        for row, value in self._worth(group, scope):
            fitting.setdefault(target - value, []).append(row)
        rows = [(total, *row) for total in self.domains[state.name] for row in fitting.get(total, ())]
        self.budget -= len(rows)
        self.tables.append(((state.name, *scope), tuple(rows)))

    def _group(self, terms: Sequence[Expression], place: int, state: Name | None) -> tuple[Expression, int]:
        """Return the sum of the terms from `place` that fit into one table with `state`, and the index after them."""
        before = [state] if state else []
        after = place + 1
        while after < len(terms) and self._size(*before, *terms[place : after + 1]) <= SMALL:
            after += 1
        return _folded("add", terms[place:after]), after

    # Values

    def _reduced(self, expression: Expression) -> Expression:
        """Return an equal expression over few variables, including additional ones."""
        if not isinstance(expression, Apply) or self._size(expression) <= SMALL:
            return expression
        operator = expression.operator
        if operator == "if" and _may_be_undefined(expression):
            raise NotSplitError  # the other argument may be undefined
        parts = [self._reduced(part) for part in expression.arguments]
        if OPERATORS[operator].variadic and not OPERATORS[operator].takes_all:
            first, *others = parts
            together = [first]
            for part in others:
                if self._size(*together, part) > SMALL:
                    together = [self._named(_folded(operator, together))]
                together.append(part)
            return _folded(operator, together) if self._size(*together) <= SMALL else self._joined(operator, together)
        return self._joined(operator, parts)

    def _joined(self, operator: str, parts: Sequence[Expression]) -> Expression:
        """Return `operator` applied to `parts`; the widest parts become variables until it is narrow enough."""
        chosen = list(parts)
        widest_first = sorted(range(len(parts)), key=lambda place: -self._size(parts[place]))
        for place in widest_first:
            if self._size(*chosen) <= SMALL:
                break
            chosen[place] = self._named(chosen[place])
        return Apply(operator, tuple(chosen))

    def _named(self, expression: Expression) -> Expression:
        """Return a variable with the value of `expression`."""
        if not isinstance(expression, Apply):
            return expression
        if expression not in self._made:
            scope = names(expression) or tuple(self.domains)[:1]
            self._made[expression] = self._variable(scope, list(self._worth(expression, scope)))
        return self._made[expression]

    def _variable(self, scope: tuple[str, ...], rows: Iterable[tuple[Row, int]]) -> Name:
        """Return an additional variable, whose value is determined by `scope`."""
        name = f"{self.prefix}{self._further}"
        self._further += 1
        table = tuple([(*row, value) for row, value in rows])
        self.domains[name] = sorted({row[-1] for row in table})
        self.tables.append(((*scope, name), table))
        return Name(name)

    def _worth(self, expression: Expression, scope: tuple[str, ...]) -> Iterable[tuple[Row, int]]:
        """Yield all combinations of values of `scope`, each with the value of `expression`, if it is defined."""
        size = math.prod(len(self.domains[name]) for name in scope)
        self.budget -= size
        if size > MAX_COMBINATIONS or self.budget < 0:
            raise NotSplitError
        value = compile_expression(expression, scope)
        for row in itertools.product(*(self.domains[name] for name in scope)):
            try:
                yield row, int(value(row))
            except UndefinedValueError:
                continue

    def _size(self, *expressions: Expression) -> int:
        scope = dict.fromkeys(name for expression in expressions for name in names(expression))
        return math.prod(len(self.domains[name]) for name in scope)

    def _ends(self, expression: Expression) -> Interval:
        limits = {
            name: Interval(min(self.domains[name], default=0), max(self.domains[name], default=0))
            for name in names(expression)
        }
        return bounds(expression, limits)


class NotSplitError(RobochocError):
    """The tables would still be too large."""


def split(
    constraint: Constraint, domains: Mapping[str, Sequence[int]], prefix: str, budget: int = MAX_TRIED
) -> Split | None:
    """Return a hard predicate as small tables. None: this is not possible.

    Args:
        constraint: The predicate.
        domains: The values of its variables, in ascending order.
        prefix: The beginning of the names of additional variables, and of no other names.
        budget: The maximum number of evaluated combinations of values.
    """
    definition = constraint.definition
    if not isinstance(definition, Predicate):
        return None
    given = {name: list(domains[name]) for name in constraint.variables}
    actual: dict[str, Expression] = {
        formal: Name(term) if isinstance(term, str) else Constant(term)
        for formal, term in zip(definition.parameters, constraint.parameters, strict=True)
    }
    result = Split(dict(given), prefix, budget)
    if any(not values for values in given.values()):
        return None
    try:
        body = with_arguments(definition.body, actual)
        if largest_value(body, {name: Interval(values[0], values[-1]) for name, values in given.items()}) > LARGEST:
            return None
        result.require(body)
    except NotSplitError:
        return None
    return result


@dataclass(frozen=True)
class _Window:
    """The partial sums that must be distinguished to compare the whole sum with `target`.

    Partial sums share one state if the comparison is true, or false, whatever the rest is.
    """

    operator: str
    target: int

    def state(self, value: int, low: int, high: int) -> int | None:
        """Return the state of a partial sum if the rest is from `low` to `high`. None: the comparison must be false."""
        least, most = value + low, value + high
        match self.operator:
            case "le":
                return None if least > self.target else max(value, self.target - high)
            case "ge":
                return None if most < self.target else min(value, self.target - low)
            case "eq":
                return value if least <= self.target <= most else None
            case _:
                if least == most == self.target:
                    return None
                return value if least <= self.target <= most else self.target - low + 1


def collect_terms(expression: Expression, factor: int, terms: dict[Expression, int]) -> int:
    """Add the terms of `factor` times `expression` to `terms`, and return its constant part."""
    match expression:
        case Constant(value):
            return factor * value
        case Apply("add" | "sub" | "neg" as operator, arguments):
            signs = {"add": [1] * len(arguments), "sub": [1, -1], "neg": [-1]}[operator]
            return sum(collect_terms(part, sign * factor, terms) for part, sign in zip(arguments, signs, strict=True))
        case Apply("mul", arguments):
            fixed = math.prod(one.value for one in arguments if isinstance(one, Constant))
            others = [one for one in arguments if not isinstance(one, Constant)]
            if len(others) <= 1:
                return collect_terms(others[0] if others else Constant(1), factor * fixed, terms)
        case _:
            pass
    terms[expression] = terms.get(expression, 0) + factor
    return 0


def _folded(operator: str, parts: Sequence[Expression]) -> Expression:
    return parts[0] if len(parts) == 1 else Apply(operator, tuple(parts))


def _times(term: Expression, factor: int) -> Expression:
    return term if factor == 1 else Apply("mul", (Constant(factor), term))


def _may_be_undefined(expression: Expression) -> bool:
    return isinstance(expression, Apply) and (
        expression.operator in _MAY_BE_UNDEFINED or any(map(_may_be_undefined, expression.arguments))
    )


def largest_value(expression: Expression, limits: Mapping[str, Interval]) -> float:
    """Return a bound on the absolute values of all intermediate results."""
    if not isinstance(expression, Apply):
        return 0
    parts = [largest_value(part, limits) for part in expression.arguments]
    ends = [bounds(part, limits) for part in expression.arguments]
    sizes = [max(abs(end.low), abs(end.high)) for end in ends]
    own = bounds(expression, limits)
    if expression.operator == "mul":
        sizes.append(math.prod(max(1, size) for size in sizes))
    if expression.operator == "add":
        sizes.append(sum(sizes))
    return max(*parts, *sizes, abs(own.low), abs(own.high))
