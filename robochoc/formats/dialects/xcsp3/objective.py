"""Translate the objective of an XCSP3 instance, split into one cost function for each scope of its terms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp3.constraint_element import Element
from robochoc.formats.dialects.xcsp3.constraints import as_integers, extremum_of, items, number_of_values, weighted_sum
from robochoc.formats.dialects.xcsp3.document import ignore_remarks
from robochoc.formats.dialects.xcsp3.expressions import as_integer, compare, disjunction, times, total
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.formats.element_view import ElementView
from robochoc.model.expression import Apply, Constant, Expression, names

MAX_TOGETHER = 10_000
"""A list with more combinations of values gets auxiliary variables for its extremum or number of values."""

_BOUND = "the bound that the objective minimises or maximises"
_USED = "whether a value is used; the objective minimises the number of used values"
_NEW = "whether a variable has a value that no variable before it has; the objective maximises their number"


def post_objective(objectives: ElementView, posting: Posting) -> bool:
    """Post the costs in `<objectives>`. Return whether they are maximised.

    Raises:
        MistakeError: if there are several objectives, or an unsupported one.
    """
    ignore_remarks(objectives)
    view = objectives.one_of("minimize", "maximize")
    ignore_remarks(view)
    posting.line, posting.title = view.line, "objective"
    maximize = view.tag == "maximize"
    objective = _objective(Element(view, posting.variables), posting, maximize=maximize)
    worst = "min" if maximize else "max"
    for term in split_sum(objective):
        if isinstance(term, Apply) and term.operator == worst and posting.size(names(term)) > MAX_TOGETHER:
            posting.post_cost(_bounded_by(term, posting))
        else:
            posting.post_cost(term)
    return maximize


def _bounded_by(worst: Apply, posting: Posting) -> Expression:
    """Return a variable no better than any argument of `worst`, and equal to `worst` in an optimal solution."""
    values: set[int] = set()
    for member in worst.arguments:
        values.update(posting.values_of(member))
    bound = posting.add_variable("objective", values, _BOUND)
    for member in worst.arguments:
        posting.post(compare("le" if worst.operator == "max" else "ge", member, bound))
    return bound


def _objective(element: Element, posting: Posting, *, maximize: bool) -> Expression:
    """Return the objective as one expression."""
    kind = element.attribute("type") or "expression"
    if kind == "expression":
        return as_integer(posting.term(element.text()))
    if kind == "sum" and element.view.has_children:
        return weighted_sum(element, posting)
    members = as_integers(items(element.only_list(), posting))
    if not members:
        raise MistakeError("the objective has no variables", "name them")
    match kind:
        case "sum":
            return total(members)
        case "product":
            return members[0] if len(members) == 1 else Apply("mul", tuple(members))
        case "minimum" | "maximum":
            return extremum_of(kind[:3], members)
        case "nValues":
            return _n_values_objective(members, posting, maximize=maximize)
        case _:
            raise MistakeError(f'an objective of type="{shortened(kind)}" is not supported', "write a sum")


def _n_values_objective(members: Sequence[Expression], posting: Posting, *, maximize: bool) -> Expression:
    """Return the number of different values of `members`; for many members, as a sum of auxiliary variables.

    In an optimal solution the sum equals this number; in other solutions the sum is equal or worse.
    """
    if posting.size({name for member in members for name in names(member)}) <= MAX_TOGETHER:
        return number_of_values(members)
    parts: list[Expression] = []
    if maximize:
        for number, member in enumerate(members):
            same_robot_as = next(iter(names(member)), None)
            is_new = posting.add_variable(f"{same_robot_as or 'value'}_is_new", (0, 1), _NEW, same_robot_as)
            for earlier in members[:number]:
                posting.post(disjunction([compare("eq", is_new, Constant(0)), compare("ne", member, earlier)]))
            parts.append(is_new)
        return total(parts)
    holders: dict[int, list[Expression]] = {}
    for member in members:
        for value in posting.values_of(member):
            holders.setdefault(value, []).append(member)
    for value in sorted(holders):
        if len(holders[value]) == 1:
            parts.append(as_integer(compare("eq", holders[value][0], Constant(value))))
            continue
        is_used = posting.add_variable(f"uses_{value}".replace("-", "minus_"), (0, 1), _USED)
        for member in holders[value]:
            posting.post(disjunction([compare("ne", member, Constant(value)), compare("eq", is_used, Constant(1))]))
        parts.append(is_used)
    return total(parts)


def split_sum(expression: Expression) -> list[Expression]:
    """Split `expression` into a sum of terms, one for each set of variables.

    The last term is the sum of the terms without variables, if there are any.
    """
    by_scope: dict[frozenset[str], list[Expression]] = {}
    for factor, term in _terms(as_integer(expression), 1):
        by_scope.setdefault(frozenset(names(term)), []).append(times(Constant(factor), term))
    fixed = by_scope.pop(frozenset(), [])
    return [*map(_added, by_scope.values()), *([_added(fixed)] if fixed else [])]


def _added(parts: Sequence[Expression]) -> Expression:
    return total(parts)


def _terms(expression: Expression, factor: int) -> Iterator[tuple[int, Expression]]:
    """Yield the terms of a sum with their factors."""
    match expression:
        case Apply("add", arguments):
            for argument in arguments:
                yield from _terms(argument, factor)
        case Apply("sub", (one, other)):
            yield from _terms(one, factor)
            yield from _terms(other, -factor)
        case Apply("neg", (one,)):
            yield from _terms(one, -factor)
        case Apply("mul", (Constant(value), one)) | Apply("mul", (one, Constant(value))):
            yield from _terms(one, factor * value)
        case Constant(value):
            yield 1, Constant(factor * value)
        case _:
            yield factor, expression
