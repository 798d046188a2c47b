"""Translate the constraints of XCSP3-core, other than tables and scheduling, to predicates with small scopes.

The meaning of each constraint is defined in "XCSP3-core" (Boussemart, Lecoutre, Audemard, Piette, arXiv 2009.00514). A
translation has the same solutions. It splits a constraint into predicates over few variables if possible, since the
work of a protocol grows with the size of scopes. Only large `circuit` constraints get auxiliary variables.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp3.constraint_element import Element, first_index
from robochoc.formats.dialects.xcsp3.expressions import (
    FALSE,
    TRUE,
    Xcsp3Condition,
    as_boolean,
    as_integer,
    compare,
    conjunction,
    disjunction,
    integer,
    is_one_of,
    plus,
    times,
    total,
    zip_equal,
)
from robochoc.formats.dialects.xcsp3.posting import MAX_ENUMERATED, MAX_NODES, Item, Posting
from robochoc.formats.dialects.xcsp3.variables import lists, values_of
from robochoc.model.expression import OPERATORS, Apply, Constant, Expression, Name, names

Vector = tuple[Expression, ...]
"""The members of a list that is compared as a unit."""
Row = tuple[int, ...]
"""The values of a vector."""
_PLACES = "the place of a node on the circle of a <circuit>"
_START = "the first node on the circle of a <circuit>"
ORDERS = ("lt", "le", "ge", "gt")


def intension(element: Element, posting: Posting) -> None:
    """Post that a Boolean expression is true."""
    text = element.text("function") if element.has("function") else element.text()
    posting.post(posting.expression(text))


def all_different(element: Element, posting: Posting) -> None:
    """Post that all values of a list differ, or all lists, or the values of each row and column of a matrix."""
    if element.has("matrix"):
        rows = [as_integers(posting.item(word) for word in row) for row in element.matrix("matrix")]
        groups = [vectors_of([group]) for group in (*rows, *map(list, zip(*rows, strict=True)))]
    else:
        groups = [vectors(element, posting)]
    excepted = excepted_rows(element, groups)
    for group in groups:
        for here, there in itertools.combinations(group, 2):
            posting.post(disjunction([different(here, there), *_is_one_of(here, excepted)]))


def all_equal(element: Element, posting: Posting) -> None:
    """Post that all values of a list are equal, or all lists."""
    members = vectors(element, posting)
    excepted = excepted_rows(element, [members])
    for one, other in itertools.combinations(members, 2) if excepted else itertools.pairwise(members):
        posting.post(disjunction([equal(one, other), *_is_one_of(one, excepted), *_is_one_of(other, excepted)]))


def ordered(element: Element, posting: Posting) -> None:
    """Post that values of a list are ordered, at given distances, or that lists are in lexicographic order."""
    operator = read_order(element)
    members = vectors(element, posting)
    if not element.has("lengths") or any(len(member) > 1 for member in members):
        _post_chain(operator, members, posting)
        return
    lengths = as_integers(items(element.words("lengths"), posting))
    if len(lengths) != len(members) - 1:
        what = f"<ordered> has {len(lengths)} lengths for {len(members)} values"
        raise MistakeError(what, f"write {len(members) - 1} lengths")
    for ((one,), (other,)), length in zip_equal(list(itertools.pairwise(members)), lengths):
        posting.post(compare(operator, plus(one, length), other))


def lex(element: Element, posting: Posting) -> None:
    """Post that lists, or the rows and the columns of a matrix, are in lexicographic order."""
    operator = read_order(element)
    if element.has("matrix"):
        rows = [tuple(as_integers(posting.item(word) for word in row)) for row in element.matrix("matrix")]
        groups = [rows, list(zip(*rows, strict=True))]
    else:
        members = [tuple(as_integers(items(words, posting))) for words in element.lists()]
        if element.has("limit"):
            members.append(tuple(as_integers(items(element.words("limit"), posting))))
        groups = [members]
    for group in groups:
        _post_chain(operator, group, posting)


def sum_of(element: Element, posting: Posting) -> None:
    """Post a condition on a sum of products."""
    posting.post(posting.condition(element.text("condition")).on(weighted_sum(element, posting)))


def weighted_sum(element: Element, posting: Posting) -> Expression:
    """Return the sum of the members of `<list>`, multiplied by `<coeffs>`."""
    members = as_integers(items(element.words("list"), posting))
    if not element.has("coeffs"):
        return total(members)
    coefficients = [posting.term(word) for word in element.words("coeffs")]
    return total(_products(coefficients, members, "<coeffs> and <list>"))


def count(element: Element, posting: Posting) -> None:
    """Post a condition on the number of members of a list with one of the given values."""
    members = as_integers(items(element.words("list"), posting))
    values = [posting.item(word) for word in element.words("values")]
    hits = [as_integer(_one_of(member, values)) for member in members]
    posting.post(posting.condition(element.text("condition")).on(total(hits)))


def n_values(element: Element, posting: Posting) -> None:
    """Post a condition on the number of different values of a list, or of different lists."""
    members = vectors(element, posting)
    excepted = excepted_rows(element, [members])
    posting.post(posting.condition(element.text("condition")).on(_number_of_values(members, excepted)))


def number_of_values(members: Sequence[Expression]) -> Expression:
    """Return the number of different values of `members`."""
    return _number_of_values([(member,) for member in members], [])


def _number_of_values(members: Sequence[Vector], excepted: Sequence[Row]) -> Expression:
    """Return the number of different `members` outside `excepted`: each counts unless an earlier one is equal."""
    _limit_pairs(members)
    first = []
    for number, member in enumerate(members):
        new = [different(member, earlier) for earlier in members[:number]]
        if excepted:
            new.append(Apply("not", (disjunction(_is_one_of(member, excepted)),)))
        first.append(as_integer(conjunction(new)) if new else Constant(1))
    return _sum_with_constants(first)


def cardinality(element: Element, posting: Posting) -> None:
    """Post conditions on the number of occurrences of each of the given values in a list."""
    members = as_integers(items(element.words("list"), posting))
    values = [posting.term(word) for word in element.words("values")]
    for value, word in zip_equal(values, element.words("occurs"), what="<values> and <occurs>"):
        number = total([as_integer(compare("eq", member, value)) for member in members])
        condition = (
            Xcsp3Condition("in", tuple(values_of([word]))) if ".." in word else Xcsp3Condition("eq", posting.term(word))
        )
        posting.post(condition.on(number))
    if element.is_true("closed", "values"):
        for member in members:
            posting.post(_one_of(member, values))


def extremum(operator: str) -> Callable[[Element, Posting], None]:
    """Return the function for a condition on the least or greatest value of a list, or on its index, or on both."""
    direct_operators = {"max": {"lt", "le"}, "min": {"gt", "ge"}}[operator]

    def post(element: Element, posting: Posting) -> None:
        members = as_integers(items(element.words("list"), posting))
        if element.has("index"):
            place = Xcsp3Condition("eq", posting.term(element.text("index")))
            _post_index(operator, members, place, element.start_index(), element.attribute("rank", "index"), posting)
            if not element.has("condition"):
                return
        condition = posting.condition(element.text("condition"))
        if condition.operator in direct_operators:
            for member in members:
                posting.post(condition.on(member))
        else:
            posting.post(condition.on(extremum_of(operator, members)))

    return post


def index_of_extremum(operator: str) -> Callable[[Element, Posting], None]:
    """Return the function for a condition on the index of the least or greatest value of a list."""

    def post(element: Element, posting: Posting) -> None:
        members = as_integers(items(element.only_list(), posting))
        condition = posting.condition(element.text("condition"))
        _post_index(operator, members, condition, element.start_index(), element.attribute("rank"), posting)

    return post


def extremum_of(operator: str, members: Sequence[Expression]) -> Expression:
    """Return the least or greatest of `members`. Raises `MistakeError` if there are none."""
    if not members:
        raise MistakeError("the list of a minimum or maximum is empty", "name its members")
    return members[0] if len(members) == 1 else Apply(operator, tuple(members))


def _post_index(
    operator: str, members: Sequence[Expression], condition: Xcsp3Condition, start: int, rank: str, posting: Posting
) -> None:
    """Post that `condition` holds for an index of the extremum: for any, for the first, or for the last one."""
    if rank not in {"", "any", "first", "last"}:
        raise MistakeError(f'rank="{shortened(rank)}" is not valid', "write any, first or last")
    weak, strict = {"max": ("ge", "gt"), "min": ("le", "lt")}[operator]

    def beats(here: int, there: int) -> Expression:
        is_strict = (rank == "first" and there < here) or (rank == "last" and there > here)
        return compare(strict if is_strict else weak, members[here], members[there])

    places = range(len(members))
    numbers = [Constant(start + place) for place in places]
    if condition.operator == "eq" and not isinstance(condition.operand, Constant | tuple):
        posting.post(is_one_of(condition.operand, [number.value for number in numbers]))
        for here, there in itertools.permutations(places, 2):
            posting.post(disjunction([compare("ne", condition.operand, numbers[here]), beats(here, there)]))
        return
    _limit_pairs(members)
    possible = [place for place in places if condition.with_constant(start + place) is not False]
    cases = []
    for here in possible:
        known = condition.with_constant(start + here) is not None
        others = [beats(here, there) for there in places if there != here]
        cases.append(conjunction([*([] if known else [condition.on(numbers[here])]), *others]))
    posting.post(disjunction(cases))


def channel(element: Element, posting: Posting) -> None:
    """Post that two lists are inverse functions, or that the only 1 of a list is at the index `<value>`.

    Two lists `x` and `y` are inverse functions if `x[i] = j` exactly where `y[j] = i`.
    """
    both = [as_integers(items(words, posting)) for words in element.lists()]
    starts = [first_index(one) for one in element.view.children("list")] or [0]
    if element.has("value"):
        if len(both) > 1:
            raise MistakeError("<channel> has two lists and a <value>", "write one <list>")
        (members,), (start,) = both, starts
        chosen = posting.term(element.text("value"))
        posting.post(is_one_of(chosen, range(start, start + len(members))))
        for place, member in enumerate(members, start):
            posting.post(Apply("iff", (compare("eq", member, Constant(1)), compare("eq", chosen, Constant(place)))))
            posting.post(is_one_of(member, (0, 1)))
        return
    if len(both) > 2:  # noqa: PLR2004 - one for each direction
        raise MistakeError(f"<channel> has {len(both)} lists", "write one or two lists")
    here, there = both[0], both[-1]
    if len(here) > len(there):
        raise MistakeError("the first list of <channel> is longer than the second", "exchange the lists")
    first, second = starts[0], starts[-1]
    for member in here:
        posting.post(is_one_of(member, range(second, second + len(there))))
    alike = len(here) == len(there)
    for member in there if alike else []:
        posting.post(is_one_of(member, range(first, first + len(here))))
    for (i, one), (j, other) in itertools.product(enumerate(here, first), enumerate(there, second)):
        forth, back = compare("eq", one, Constant(j)), compare("eq", other, Constant(i))
        posting.post(Apply("iff", (forth, back)) if alike else disjunction([Apply("not", (forth,)), back]))


def instantiation(element: Element, posting: Posting) -> None:
    """Post that variables have given values."""
    members, values = items(element.words("list"), posting), element.words("values")
    for member, word in zip_equal(members, values, what="<list> and <values>"):
        if word != "*":
            posting.post(compare("eq", as_integer(member), posting.item(word)))


def clause(element: Element, posting: Posting) -> None:
    """Post that at least one literal is true."""
    posting.post(disjunction([as_boolean(member) for member in items(element.only_list(), posting)]))


def precedence(element: Element, posting: Posting) -> None:
    """Post that each of the given values occurs in a list only after the value before it."""
    members = as_integers(items(element.only_list(), posting))
    if element.has("values"):
        numbers = values_of(element.words("values"))
        covered = element.is_true("covered", "values")
    else:
        numbers, covered = sorted({value for member in members for value in posting.domain(member)}), False
    values = [Constant(value) for value in numbers]
    for before, after in itertools.pairwise(values):
        for place, member in enumerate(members):
            earlier = [compare("eq", other, before) for other in members[:place]]
            posting.post(disjunction([compare("ne", member, after), *earlier]))
    if covered and values:
        posting.post(disjunction([compare("eq", member, values[-1]) for member in members]))


def knapsack(element: Element, posting: Posting) -> None:
    """Post conditions on the weight and on the profit of a list of numbers."""
    members = as_integers(items(element.words("list"), posting))
    conditions = [posting.condition(text) for text in element.texts("condition")]
    if element.has("limit"):
        conditions.insert(0, Xcsp3Condition("le", posting.term(element.text("limit"))))
    if len(conditions) != 2:  # noqa: PLR2004 - of weight and profit
        what = f"<knapsack> has {len(conditions)} conditions"
        raise MistakeError(what, "write one condition for weights and one for profits")
    for kind, condition in zip(("weights", "profits"), conditions, strict=True):
        factors = [posting.term(word) for word in element.words(kind)]
        posting.post(condition.on(total(_products(factors, members, f"<{kind}> and <list>"))))


def bin_packing(element: Element, posting: Posting) -> None:
    """Post conditions on the load of each bin."""
    bins = as_integers(items(element.words("list"), posting))
    sizes = [posting.term(word) for word in element.words("sizes")]
    start = element.start_index()
    if element.has("condition"):
        condition = posting.condition(element.text("condition"))
        used = sorted({value for item in bins for value in posting.domain(item)})
        conditions = dict.fromkeys(used, condition)
    else:
        conditions = dict(enumerate(_conditions_of_bins(element, posting), start))
        for item in bins:
            posting.post(is_one_of(item, conditions))
    for number, condition in conditions.items():
        hits = [as_integer(compare("eq", item, Constant(number))) for item in bins]
        posting.post(condition.on(total(_products(sizes, hits, "<sizes> and <list>"))))


def _conditions_of_bins(element: Element, posting: Posting) -> list[Xcsp3Condition]:
    """Return the condition on the load of each bin, in the order of the bins."""
    if element.has("conditions"):
        return posting.conditions(element.text("conditions"))
    for kind, operator in (("limits", "le"), ("loads", "eq")):
        if element.has(kind):
            return [Xcsp3Condition(operator, posting.term(word)) for word in element.words(kind)]
    raise MistakeError("<binPacking> has no condition", "write <condition>, <conditions>, <limits> or <loads>")


def circuit(element: Element, posting: Posting) -> None:
    """Post that the values of a list are successors of nodes on one circle, except nodes that follow themselves."""
    scope = items(element.only_list(), posting)
    starts = [first_index(one) for one in element.view.children("list")] or [0]
    size = Xcsp3Condition("eq", posting.term(element.text("size"))) if element.has("size") else None
    members = as_integers(scope)
    for one, other in itertools.combinations(members, 2):
        posting.post(compare("ne", one, other))
    own = {name for member in members for name in names(member)}
    if posting.size(own) > MAX_ENUMERATED or not (size is None or isinstance(size.operand, Constant)):
        _post_with_places(members, starts[0], size, posting)
        return

    def holds(row: Sequence[int]) -> bool:
        length = _circle([value - starts[0] for value in row])
        return length > 1 and (size is None or bool(size.with_constant(length)))

    posting.post_enumerated(element.kind, scope, holds)


def _circle(successors: Sequence[int]) -> int:
    """Return the length of the only circle in `successors`; 0 if there is none, or several."""
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


def _post_with_places(members: Sequence[Expression], start: int, size: Xcsp3Condition | None, posting: Posting) -> None:
    """Post that `members`, which all differ, have one circle, with auxiliary variables determined by them.

    These are the place of each node on the circle, counted from its first node (0 for nodes that follow themselves),
    and this first node, unless it is the same for all circles.
    """
    nodes = range(start, start + len(members))
    values = {node: set(posting.domain(member)) & set(nodes) for node, member in zip(nodes, members, strict=True)}
    same_robot_as = {node: next(iter(names(member)), None) for node, member in zip(nodes, members, strict=True)}
    for member in members:
        posting.post(is_one_of(member, nodes))
    fixed = [node for node in nodes if node not in values[node]]
    possible = range(start, fixed[0] + 1) if fixed else nodes
    first: Expression = Constant(start)
    if len(possible) > 1:
        first = posting.add_variable("first_node", possible, _START, same_robot_as[start])
    place = [
        posting.add_variable(
            f"{same_robot_as[node] or 'node'}_place", range(len(members)), _PLACES, same_robot_as[node]
        )
        for node in nodes
    ]
    for node, successor in zip(nodes, members, strict=True):
        here = place[node - start]
        if node in possible:
            posting.post(disjunction([_compare("le", first, node), _compare("eq", successor, node)]))
            posting.post(disjunction([_compare("ne", first, node), _compare("ne", successor, node)]))
            posting.post(disjunction([_compare("ne", first, node), _compare("eq", here, 0)]))
        posting.post(disjunction([_compare("ne", successor, node), _compare("eq", here, 0)]))
        for other in values[node] - {node}:
            leaves = _compare("ne", successor, other)
            next_place = plus(here, Constant(1))
            is_first = _compare("eq", first, other) if other in possible else FALSE
            posting.post(disjunction([leaves, is_first, compare("eq", place[other - start], next_place)]))
            if size is not None and other in possible:
                posting.post(disjunction([leaves, _compare("ne", first, other), size.on(next_place)]))


def _compare(operator: str, expression: Expression, value: int) -> Expression:
    """Return a comparison with `value`; TRUE or FALSE if `expression` is a constant."""
    if isinstance(expression, Constant):
        return TRUE if OPERATORS[operator].meaning(expression.value, value) else FALSE
    return compare(operator, expression, Constant(value))


def vectors(element: Element, posting: Posting) -> list[Vector]:
    """Return the vectors that a constraint compares: the single members of its only list, or several lists."""
    return vectors_of([as_integers(items(words, posting)) for words in element.lists()])


def vectors_of(lists: Sequence[Sequence[Expression]]) -> list[Vector]:
    """Return the single members of the only list, or several lists, as vectors. Raises `MistakeError`."""
    if len(lists) == 1:
        return [(member,) for member in lists[0]]
    found: list[Vector] = list(zip(*zip_equal(*lists), strict=True))
    if not found:
        raise MistakeError("the lists are empty", "name their members")
    return found


def excepted_rows(element: Element, groups: Sequence[Sequence[Vector]]) -> list[Row]:
    """Return the rows of values in `<except>`. Raises `MistakeError`."""
    if not element.has("except"):
        return []
    width = max((len(member) for group in groups for member in group), default=1)
    text = element.text("except")
    rows: list[Row] = (
        [(value,) for value in values_of(text.split())]
        if text[:1] != "("
        else [tuple(map(integer, row)) for row in split_rows(text)]
    )
    for row in rows:
        if len(row) != width:
            raise MistakeError(f"a tuple in <except> has {len(row)} values", f"write tuples of {width} values")
    return rows


def equal(one: Vector, other: Vector) -> Expression:
    """Return an expression that is true if two vectors are equal."""
    return conjunction([compare("eq", *pair) for pair in zip(one, other, strict=True)])


def different(one: Vector, other: Vector) -> Expression:
    """Return an expression that is true if two vectors differ."""
    return disjunction([compare("ne", *pair) for pair in zip(one, other, strict=True)])


def items(words: Iterable[str], posting: Posting) -> list[Item]:
    """Return the members named by the words of a list."""
    return [posting.item(word) for word in words]


def as_integers(members: Iterable[Item]) -> list[Expression]:
    """Return the members of a list as integers."""
    return [as_integer(member) for member in members]


def read_order(element: Element) -> str:
    """Return the operator of an ordered constraint. Raises `MistakeError`."""
    operator = element.text("operator")
    if operator not in ORDERS:
        raise MistakeError(f"the operator '{shortened(operator)}' is not valid", f"write one of {' '.join(ORDERS)}")
    return operator


def _limit_pairs(members: Sequence[object]) -> None:
    """Raise `MistakeError` if one expression over all pairs of `members` would be too large, before it is built."""
    pairs = len(members) * (len(members) - 1) // 2
    if pairs > MAX_NODES:
        message = f"the constraint compares {len(members):,} members of a list in pairs: {pairs:,} comparisons"
        raise MistakeError(message, f"split it into constraints of at most {MAX_NODES:,} comparisons")


def _products(factors: Sequence[Expression], members: Sequence[Expression], what: str) -> list[Expression]:
    return [times(factor, member) for factor, member in zip_equal(factors, members, what=what)]


def _is_one_of(member: Vector, rows: Sequence[Row]) -> list[Expression]:
    """Return expressions of which one is true if `member` is one of `rows`."""
    if len(member) == 1:
        return [is_one_of(member[0], [value for (value,) in rows])] if rows else []
    return [equal(member, tuple(map(Constant, row))) for row in rows]


def _one_of(member: Expression, values: Sequence[Expression]) -> Expression:
    constants = [value.value for value in values if isinstance(value, Constant)]
    others = [compare("eq", member, value) for value in values if isinstance(value, Name)]
    if len(constants) + len(others) != len(values):
        raise MistakeError("the values contain an expression", "write integers or variables")
    return disjunction([*([is_one_of(member, constants)] if constants else []), *others])


def _sum_with_constants(parts: Sequence[Expression]) -> Expression:
    fixed = sum(part.value for part in parts if isinstance(part, Constant))
    return total([*(part for part in parts if not isinstance(part, Constant)), Constant(fixed)])


def _post_chain(operator: str, members: Sequence[Vector], posting: Posting) -> None:
    """Post that `members` are in lexicographic order."""
    for one, other in itertools.pairwise(members):
        posting.post(_lexicographic(operator, list(zip_equal(one, other))))


def _lexicographic(operator: str, pairs: Sequence[tuple[Expression, Expression]]) -> Expression:
    if not pairs:
        raise MistakeError("a list is empty", "name its members")
    _limit_pairs(pairs)
    strict = {"le": "lt", "ge": "gt"}.get(operator, operator)
    *before, last = pairs
    cases = []
    for place, pair in enumerate(before):
        alike = [compare("eq", *earlier) for earlier in before[:place]]
        cases.append(conjunction([*alike, compare(strict, *pair)]))
    cases.append(conjunction([*(compare("eq", *pair) for pair in before), compare(operator, *last)]))
    return disjunction(cases)


def split_rows(text: str) -> list[list[str]]:
    """Return the words of each list in parentheses, without blanks."""
    return [[word.strip() for word in row] for row in lists(text)]
