"""Predicates as comparisons of sums for solvers, instead of tables that would be too large.

A predicate on two tasks in a job shop, `or(le(add(x,50),y),le(add(y,61),x))`, would have as many rows as the square of
the horizon. Solvers handle its comparisons quickly. They receive only comparisons of sums with a constant, joined by
`and` and `or`, without products and negative numbers, for which ACE computes wrong results.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Literal, assert_never

from robochoc.model.constraint import Constraint, Predicate
from robochoc.model.expression import Apply, Constant, Expression, Name, with_arguments
from robochoc.model.expression.bounds import Interval
from robochoc.solver.splitting import collect_terms, largest_value
from robochoc.system.lazy_dataclass import dataclass

LARGEST = 2**29
"""The maximum of all intermediate results, so that solvers with 32-bit integers stay correct."""
MAX_PARTS = 1000
"""The maximum number of comparisons in one predicate."""

Operand = str | int
"""A variable: its name, or its position in a network."""
Sign = Literal["le", "eq", "ne"]
_NEGATED = {"le": "gt", "lt": "ge", "ge": "lt", "gt": "le", "eq": "ne", "ne": "eq"}


@dataclass(frozen=True)
class LinearComparison:
    """A sum of variables, each times a factor that is not 0, compared with `bound`."""

    terms: tuple[tuple[Operand, int], ...]
    sign: Sign
    bound: int


@dataclass(frozen=True)
class Junction:
    """A conjunction (`every`) or disjunction of formulas."""

    every: bool
    parts: tuple[Formula, ...]


Formula = LinearComparison | Junction
TRUE, FALSE = Junction(every=True, parts=()), Junction(every=False, parts=())


class _NotLinearError(Exception):
    """The predicate does not consist of comparisons of sums."""


def linear(constraint: Constraint, domains: Mapping[str, Sequence[int]]) -> Formula | None:
    """Return a hard predicate as comparisons of sums. None: this is not possible.

    Args:
        constraint: The predicate.
        domains: The values of its variables, in ascending order.
    """
    definition = constraint.definition
    if not isinstance(definition, Predicate) or not all(domains[name] for name in constraint.variables):
        return None
    actual: dict[str, Expression] = {
        formal: Name(term) if isinstance(term, str) else Constant(term)
        for formal, term in zip(definition.parameters, constraint.parameters, strict=True)
    }
    body = with_arguments(definition.body, actual)
    limits = {name: Interval(domains[name][0], domains[name][-1]) for name in constraint.variables}
    try:
        formula = _truth(body, positive=True)
    except _NotLinearError:
        return None
    if largest_value(body, limits) > LARGEST or len(list(comparisons(formula))) > MAX_PARTS:
        return None
    most = max(abs(domains[name][place]) for name in constraint.variables for place in (0, -1))
    return formula if is_small(formula, most) else None


def is_small(formula: Formula, most: int) -> bool:
    """Return whether all sums in `formula`, with numbers up to `most`, are small on both sides of each comparison."""
    return all(
        sum(abs(factor) for _, factor in one.terms) * most + abs(one.bound) <= LARGEST for one in comparisons(formula)
    )


def comparisons(formula: Formula) -> list[LinearComparison]:
    """Return all comparisons in `formula`."""
    if isinstance(formula, LinearComparison):
        return [formula]
    return list(itertools.chain.from_iterable(map(comparisons, formula.parts)))


def conjuncts(formula: Formula) -> tuple[Formula, ...]:
    """Return formulas whose conjunction is equivalent to `formula`."""
    return formula.parts if isinstance(formula, Junction) and formula.every else (formula,)


def operands(formula: Formula) -> tuple[Operand, ...]:
    """Return the variables in `formula`, each once."""
    return tuple(dict.fromkeys(name for one in comparisons(formula) for name, _ in one.terms))


def renamed(
    formula: Formula, names: Mapping[Operand, Operand], fixed: Mapping[Operand, int], shift: int = 0
) -> Formula:
    """Return `formula` over other variables, simplified.

    Args:
        formula: The formula.
        names: The new names of variables. Other variables keep their names.
        fixed: The values of variables that are left out.
        shift: The amount by which a variable in the result is smaller than the variable in `formula`.
    """
    match formula:
        case LinearComparison(terms, sign, bound):
            rest = bound - sum(factor * fixed[name] for name, factor in terms if name in fixed)
            left = tuple((names.get(name, name), factor) for name, factor in terms if name not in fixed)
            return compared(left, sign, rest - shift * sum(factor for _, factor in left))
        case Junction(every, parts):
            return joined([renamed(part, names, fixed, shift) for part in parts], every=every)
        case never:
            assert_never(never)


def compared(terms: tuple[tuple[Operand, int], ...], sign: Sign, bound: int) -> Formula:
    """Return a comparison, or a constant truth value if it has no terms."""
    if terms:
        return LinearComparison(terms, sign, bound)
    holds = {"le": bound >= 0, "eq": bound == 0, "ne": bound != 0}[sign]
    return TRUE if holds else FALSE


def joined(parts: Sequence[Formula], *, every: bool) -> Formula:
    """Return a junction of `parts`, without nested junctions of the same kind."""
    flat: list[Formula] = []
    for part in parts:
        flat += part.parts if isinstance(part, Junction) and part.every == every else [part]
    if (FALSE if every else TRUE) in flat:
        return FALSE if every else TRUE
    return flat[0] if len(flat) == 1 else Junction(every, tuple(flat))


def holds(formula: Formula, values: Mapping[Operand, int]) -> bool:
    """Return whether `formula` is true for `values`."""
    return renamed(formula, {}, values) == TRUE


def _truth(expression: Expression, *, positive: bool) -> Formula:
    """Return a Boolean expression, or its negation, as a formula."""
    match expression:
        case Apply("not", (part,)):
            return _truth(part, positive=not positive)
        case Apply("and" | "or" as operator, parts):
            return joined([_truth(part, positive=positive) for part in parts], every=(operator == "and") == positive)
        case Apply("imp", (condition, consequence)):
            sides = [_truth(condition, positive=not positive), _truth(consequence, positive=positive)]
            return joined(sides, every=not positive)
        case Apply("iff" | "xor" as operator, (left, right)):
            same = (operator == "iff") == positive
            both = joined([_truth(left, positive=True), _truth(right, positive=same)], every=True)
            neither = joined([_truth(left, positive=False), _truth(right, positive=not same)], every=True)
            return joined([both, neither], every=False)
        case Apply(operator, (left, right)) if operator in _NEGATED:
            return _compared(left, operator if positive else _NEGATED[operator], right)
        case _:
            raise _NotLinearError


def _compared(left: Expression, operator: str, right: Expression) -> Formula:
    """Return a comparison of two expressions as a formula."""
    if operator in {"ge", "gt"}:
        return _compared(right, {"ge": "le", "gt": "lt"}[operator], left)
    if operator == "ne":
        return (
            joined([_compared(left, "lt", right), _compared(right, "lt", left)], every=False)
            if any(map(_is_piecewise, (left, right)))
            else _sum_compared(left, "ne", right)
        )
    if operator == "eq" and any(map(_is_piecewise, (left, right))):
        return joined([_compared(left, "le", right), _compared(right, "le", left)], every=True)
    for one in (left, right):
        pieces = _pieces(one)
        if pieces is not None:
            # A maximum is at most a number if all arguments are, and at least a number if any argument is.
            smallest_first = pieces[0] == "min"
            every = (one is left) != smallest_first
            sides = [(piece, right) if one is left else (left, piece) for piece in pieces[1]]
            return joined([_compared(a, operator, b) for a, b in sides], every=every)
    return _sum_compared(left, operator, right)


def _is_piecewise(expression: Expression) -> bool:
    return _pieces(expression) is not None


def _pieces(expression: Expression) -> tuple[str, tuple[Expression, ...]] | None:
    """Return "max" or "min" and the arguments if `expression` is a maximum or minimum; None if it is a sum."""
    match expression:
        case Apply("min" | "max" as operator, parts):
            return operator, parts
        case Apply("abs", (part,)):
            return "max", (part, Apply("neg", (part,)))
        case Apply("dist", (left, right)):
            return "max", (Apply("sub", (left, right)), Apply("sub", (right, left)))
        case _:
            return None


def _sum_compared(left: Expression, operator: str, right: Expression) -> Formula:
    terms: dict[Expression, int] = {}
    bound = -collect_terms(left, 1, terms) - collect_terms(right, -1, terms)
    left_over = {term: factor for term, factor in terms.items() if factor or not isinstance(term, Name)}
    if not all(isinstance(term, Name) for term in left_over):
        raise _NotLinearError
    named: tuple[tuple[Operand, int], ...] = tuple(
        (term.name, factor) for term, factor in left_over.items() if isinstance(term, Name)
    )
    sign: Sign = "eq" if operator == "eq" else "ne" if operator == "ne" else "le"
    return compared(named, sign, bound - 1 if operator == "lt" else bound)
