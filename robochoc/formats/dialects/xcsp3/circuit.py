"""The constraint kind circuit of XCSP3-core: a table, or predicates over auxiliary variables."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from robochoc.formats.dialects.xcsp3.kinds import as_integers, items
from robochoc.formats.dialects.xcsp3.posting import MAX_TRIED, Posting
from robochoc.formats.dialects.xcsp3.template import Element, first_index
from robochoc.formats.dialects.xcsp3.terms import FALSE, TRUE, Condition, compare, inside, plus, some
from robochoc.model.expression import OPERATORS, Constant, Expression, names

_PLACES = "the place of a node on the circle of a <circuit>"
_START = "the first node on the circle of a <circuit>"


def circuit(element: Element, posting: Posting) -> None:
    """The values of a list are successors: all nodes but those that follow themselves lie on one circle."""
    scope = items(element.whole(), posting)
    starts = [first_index(one) for one in element.view.children("list")] or [0]
    size = Condition("eq", posting.term(element.text("size"))) if element.has("size") else None
    members = as_integers(scope)
    for one, other in itertools.combinations(members, 2):
        posting.post(compare("ne", one, other))
    own = {name for member in members for name in names(member)}
    if posting.size(own) > MAX_TRIED or not (size is None or isinstance(size.operand, Constant)):
        _post_with_places(members, starts[0], size, posting)
        return

    def holds(row: Sequence[int]) -> bool:
        length = _circle([value - starts[0] for value in row])
        return length > 1 and (size is None or bool(size.with_constant(length)))

    posting.post_tried(element.kind, scope, holds)


def _circle(successors: Sequence[int]) -> int:
    """Return the length of the one circle among `successors`; 0 where there is none, or several."""
    places = range(len(successors))
    moving = [place for place in places if successors[place] != place]
    if not moving or any(value not in places for value in successors):
        return 0
    seen: list[int] = []
    place = moving[0]
    while place not in seen:
        seen.append(place)
        place = successors[place]
    return len(seen) if place == moving[0] and len(seen) == len(moving) else 0


def _post_with_places(members: Sequence[Expression], start: int, size: Condition | None, posting: Posting) -> None:
    """Post that `members`, which differ, have one circle, by auxiliary variables that they determine.

    These are the place of each node on the circle, counted from its first node (0 for nodes that follow themselves),
    and that first node, unless all circles have the same one.
    """
    nodes = range(start, start + len(members))
    values = {node: set(posting.domain(member)) & set(nodes) for node, member in zip(nodes, members, strict=True)}
    beside = {node: next(iter(names(member)), None) for node, member in zip(nodes, members, strict=True)}
    for member in members:
        posting.post(inside(member, nodes))
    fixed = [node for node in nodes if node not in values[node]]
    possible = range(start, fixed[0] + 1) if fixed else nodes
    first: Expression = Constant(start)
    if len(possible) > 1:
        first = posting.add_variable("first_node", possible, _START, beside[start])
    place = [
        posting.add_variable(f"{beside[node] or 'node'}_place", range(len(members)), _PLACES, beside[node])
        for node in nodes
    ]
    for node, successor in zip(nodes, members, strict=True):
        here = place[node - start]
        if node in possible:
            posting.post(some([_compare("le", first, node), _compare("eq", successor, node)]))
            posting.post(some([_compare("ne", first, node), _compare("ne", successor, node)]))
            posting.post(some([_compare("ne", first, node), _compare("eq", here, 0)]))
        posting.post(some([_compare("ne", successor, node), _compare("eq", here, 0)]))
        for other in values[node] - {node}:
            leaves = _compare("ne", successor, other)
            next_place = plus(here, Constant(1))
            is_first = _compare("eq", first, other) if other in possible else FALSE
            posting.post(some([leaves, is_first, compare("eq", place[other - start], next_place)]))
            if size is not None and other in possible:
                posting.post(some([leaves, _compare("ne", first, other), size.on(next_place)]))


def _compare(operator: str, expression: Expression, value: int) -> Expression:
    """Return a comparison with `value`; TRUE or FALSE where `expression` is a constant, too."""
    if isinstance(expression, Constant):
        return TRUE if OPERATORS[operator].meaning(expression.value, value) else FALSE
    return compare(operator, expression, Constant(value))
