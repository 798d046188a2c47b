"""The objective of an XCSP3 instance, split into one cost function for each scope of its terms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp3.document import attribute, line
from robochoc.formats.dialects.xcsp3.kinds import as_integers, best, distinct, items, weighted
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.formats.dialects.xcsp3.template import Element
from robochoc.formats.dialects.xcsp3.terms import as_integer, compare, times, total
from robochoc.model.expression import Apply, Constant, Expression, names

MAX_TOGETHER = 10_000
"""The maximum of a list with more combinations of values becomes a variable of its own, at least each of them."""


def post_objective(objectives: etree._Element, posting: Posting) -> bool:
    """Post the costs that `<objectives>` asks to minimise or to maximise. Return whether to maximise.

    Raises:
        MistakeError: if there are several, or one that has no counterpart.
    """
    if len(objectives) != 1:
        raise MistakeError(f"{len(objectives)} objectives have no counterpart", "one has", line(objectives))
    (xml,) = objectives
    if xml.tag not in {"minimize", "maximize"}:
        raise MistakeError(f"<{xml.tag}> in <objectives>", "expected <minimize> or <maximize>", line(xml))
    posting.line, posting.title = line(xml), "objective"
    objective = _objective(Element(xml, posting.variables), posting)
    maximize = bool(xml.tag == "maximize")
    worst = "min" if maximize else "max"
    for term in split(objective):
        if isinstance(term, Apply) and term.operator == worst and posting.size(names(term)) > MAX_TOGETHER:
            posting.post_cost(_bounded_by(term, posting))
        else:
            posting.post_cost(term)
    return maximize


def _bounded_by(worst: Apply, posting: Posting) -> Expression:
    """Return a variable that is no better than any argument of `worst`, and in the best solution equal to it."""
    values: set[int] = set()
    for member in worst.arguments:
        values.update(posting.values_of(member))
    bound = posting.add_variable("objective", values)
    for member in worst.arguments:
        posting.post(compare("le" if worst.operator == "max" else "ge", member, bound))
    return bound


def _objective(element: Element, posting: Posting) -> Expression:
    """Return what is minimised or maximised, as one expression."""
    kind = attribute(element.xml, "type") or "expression"
    if kind == "expression":
        return as_integer(posting.term(element.text()))
    if kind == "sum" and len(element.xml):
        return weighted(element, posting)
    element.refuse("coeffs")
    members = as_integers(items(element.whole(), posting))
    if not members:
        raise MistakeError("an objective without variables", "name them")
    match kind:
        case "sum":
            return total(members)
        case "product":
            return members[0] if len(members) == 1 else Apply("mul", tuple(members))
        case "minimum" | "maximum":
            return best(kind[:3], members)
        case "nValues":
            return distinct(members)
        case _:
            raise MistakeError(f'an objective of type="{shortened(kind)}" has no counterpart', "write a sum")


def split(expression: Expression) -> list[Expression]:
    """Return terms whose sum is `expression`, one for each set of variables that stand together in its terms."""
    by_scope: dict[frozenset[str], list[Expression]] = {}
    for factor, term in _terms(as_integer(expression), 1):
        by_scope.setdefault(frozenset(names(term)), []).append(times(Constant(factor), term))
    fixed = sum(part.value for part in by_scope.pop(frozenset(), []) if isinstance(part, Constant))
    return [*map(_added, by_scope.values()), *([Constant(fixed)] if fixed else [])]


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
