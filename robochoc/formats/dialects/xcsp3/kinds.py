"""The constraint kinds of XCSP3-core, each as what we have: small predicates where it can be split, else tables.

What a kind means is told in "XCSP3-core" (Boussemart, Lecoutre, Audemard, Piette, arXiv 2009.00514). A split is exact:
it has the same solutions, and no further variables. All of them are over few variables where that can be had, as what
a protocol pays for is the size of scopes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp3.posting import Item, Posting
from robochoc.formats.dialects.xcsp3.template import Element
from robochoc.formats.dialects.xcsp3.terms import (
    Condition,
    as_boolean,
    as_integer,
    compare,
    every,
    inside,
    plus,
    some,
    times,
    total,
)
from robochoc.formats.dialects.xcsp3.variables import lists, values_of
from robochoc.model.expression import Apply, Constant, Expression, Name

ORDERS = ("lt", "le", "ge", "gt")


def intension(element: Element, posting: Posting) -> None:
    """A Boolean expression is true."""
    text = element.text("function") if element.has("function") else element.text()
    posting.post(posting.expression(text))


def all_different(element: Element, posting: Posting) -> None:
    """All values of a list differ, or lists do; of a matrix those of each row and each column."""
    if element.has("matrix"):
        rows = [[posting.item(word) for word in row] for row in element.matrix("matrix")]
        groups = [*rows, *map(list, zip(*rows, strict=True))]
    elif element.count("list") > 1:
        members = [items(words, posting) for words in element.every("list")]
        for one, other in itertools.combinations(members, 2):
            pairs = zip(as_integers(one), as_integers(other), strict=True)
            posting.post(some([compare("ne", left, right) for left, right in pairs]))
        return
    else:
        groups = [items(element.whole(), posting)]
    spared = values_of(element.words("except")) if element.has("except") else []
    for group in groups:
        for here, there in itertools.combinations(as_integers(group), 2):
            posting.post(some([compare("ne", here, there), *([inside(here, spared)] if spared else [])]))


def all_equal(element: Element, posting: Posting) -> None:
    """All values of a list are equal."""
    element.refuse("except")
    for one, other in itertools.pairwise(as_integers(items(element.whole(), posting))):
        posting.post(compare("eq", one, other))


def ordered(element: Element, posting: Posting) -> None:
    """Values of a list follow each other in an order, with given distances."""
    members = as_integers(items(element.words("list"), posting))
    lengths = (
        as_integers(items(element.words("lengths"), posting))
        if element.has("lengths")
        else [Constant(0)] * len(members)
    )
    operator = order_of(element)
    for (one, other), length in zip(itertools.pairwise(members), lengths, strict=False):
        posting.post(compare(operator, plus(one, length), other))


def lex(element: Element, posting: Posting) -> None:
    """Lists follow each other in the lexicographic order; of a matrix rows and columns do."""
    operator = order_of(element)
    if element.has("matrix"):
        rows = [as_integers([posting.item(word) for word in row]) for row in element.matrix("matrix")]
        groups = [rows, list(map(list, zip(*rows, strict=True)))]
    else:
        groups = [[as_integers(items(words, posting)) for words in element.every("list")]]
        if element.has("limit"):
            groups[0].append(as_integers(items(element.words("limit"), posting)))
    for group in groups:
        for one, other in itertools.pairwise(group):
            posting.post(_lexicographic(operator, one, other))


def sum_of(element: Element, posting: Posting) -> None:
    """A condition on a sum of products."""
    posting.post(posting.condition(element.text("condition")).on(weighted(element, posting)))


def weighted(element: Element, posting: Posting) -> Expression:
    """Return the sum that `<list>` and `<coeffs>` mean."""
    members = as_integers(items(element.words("list"), posting))
    coefficients = [posting.term(word) for word in element.words("coeffs")] if element.has("coeffs") else []
    if coefficients and len(coefficients) != len(members):
        raise MistakeError(f"{len(members)} terms, but {len(coefficients)} coefficients", "write one for each")
    return total(list(map(times, coefficients, members)) if coefficients else members)


def count(element: Element, posting: Posting) -> None:
    """A condition on how many of a list have one of some values."""
    members = as_integers(items(element.words("list"), posting))
    values = [posting.item(word) for word in element.words("values")]
    hits = [as_integer(_one_of(member, values)) for member in members]
    posting.post(posting.condition(element.text("condition")).on(total(hits)))


def n_values(element: Element, posting: Posting) -> None:
    """A condition on how many different values a list has."""
    members = as_integers(items(element.words("list"), posting))
    spared = values_of(element.words("except")) if element.has("except") else []
    posting.post(posting.condition(element.text("condition")).on(distinct(members, spared)))


def distinct(members: Sequence[Expression], spared: Sequence[int] = ()) -> Expression:
    """Return the number of different values of `members`: each counts unless an earlier one has its value."""
    first = []
    for number, member in enumerate(members):
        new = [compare("ne", member, earlier) for earlier in members[:number]]
        if spared:
            new.append(Apply("not", (inside(member, spared),)))
        first.append(as_integer(every(new)) if new else Constant(1))
    return _sum_with_constants(first)


def cardinality(element: Element, posting: Posting) -> None:
    """How often each of some values stands in a list."""
    members = as_integers(items(element.words("list"), posting))
    values = [posting.term(word) for word in element.words("values")]
    occurrences = element.words("occurs")
    if len(values) != len(occurrences):
        raise MistakeError(f"{len(values)} values, but {len(occurrences)} occurrences", "write one for each")
    for value, word in zip(values, occurrences, strict=True):
        number = total([as_integer(compare("eq", member, value)) for member in members])
        condition = Condition("in", tuple(values_of([word]))) if ".." in word else Condition("eq", posting.term(word))
        posting.post(condition.on(number))
    if element.attribute("closed", "values") == "true":
        for member in members:
            posting.post(_one_of(member, values))


def extremum(operator: str) -> Callable[[Element, Posting], None]:
    """Return the kind: a condition on the least, or the greatest, value of a list."""
    easy = {"max": {"lt", "le"}, "min": {"gt", "ge"}}[operator]

    def post(element: Element, posting: Posting) -> None:
        members = as_integers(items(element.words("list"), posting))
        condition = posting.condition(element.text("condition"))
        if condition.operator in easy:
            for member in members:
                posting.post(condition.on(member))
        else:
            posting.post(condition.on(best(operator, members)))

    return post


def best(operator: str, members: Sequence[Expression]) -> Expression:
    """Return the least, or the greatest, of some integers."""
    return members[0] if len(members) == 1 else Apply(operator, tuple(members))


def channel(element: Element, posting: Posting) -> None:
    """Two lists say the same in two ways: `x[i] = j` if and only if `y[j] = i`."""
    both = [as_integers(items(words, posting)) for words in element.every("list")] or [
        as_integers(items(element.whole(), posting))
    ]
    if any(element.attribute("startIndex", "list", place) not in {"", "0"} for place in range(len(both))):
        raise MistakeError("a channel with another startIndex than 0", "count from 0")
    if element.has("value"):
        chosen = posting.term(element.text("value"))
        posting.post(inside(chosen, range(len(both[0]))))
        for place, member in enumerate(both[0]):
            posting.post(Apply("iff", (compare("eq", member, Constant(1)), compare("eq", chosen, Constant(place)))))
            posting.post(inside(member, (0, 1)))
        return
    here, there = both[0], both[-1]
    if len(here) > len(there):
        raise MistakeError("a channel whose first list is the longer one", "exchange them")
    for member in here:
        posting.post(inside(member, range(len(there))))
    alike = len(here) == len(there)
    for member in there if alike else []:
        posting.post(inside(member, range(len(here))))
    for (i, one), (j, other) in itertools.product(enumerate(here), enumerate(there)):
        forth, back = compare("eq", one, Constant(j)), compare("eq", other, Constant(i))
        posting.post(Apply("iff", (forth, back)) if alike else some([Apply("not", (forth,)), back]))


def instantiation(element: Element, posting: Posting) -> None:
    """Variables have given values."""
    members, values = items(element.words("list"), posting), element.words("values")
    if len(members) != len(values):
        raise MistakeError(f"{len(members)} variables, but {len(values)} values", "write one for each")
    for member, word in zip(members, values, strict=True):
        if word != "*":
            posting.post(compare("eq", as_integer(member), posting.item(word)))


def clause(element: Element, posting: Posting) -> None:
    """One of some literals is true."""
    posting.post(some([as_boolean(member) for member in items(element.whole(), posting)]))


def precedence(element: Element, posting: Posting) -> None:
    """Each of some values stands in a list only behind the value before it."""
    if element.attribute("covered", "values") == "true" or not element.has("values"):
        raise MistakeError("<precedence> without values, or covered, has no counterpart", "write its values")
    members = as_integers(items(element.words("list"), posting))
    values = [Constant(value) for value in values_of(element.words("values"))]
    for before, after in itertools.pairwise(values):
        for place, member in enumerate(members):
            earlier = [compare("eq", other, before) for other in members[:place]]
            posting.post(some([compare("ne", member, after), *earlier]))


def knapsack(element: Element, posting: Posting) -> None:
    """Conditions on the weight and on the profit of a list of numbers."""
    members = as_integers(items(element.words("list"), posting))
    conditions = [posting.condition(text) for text in element.texts("condition")]
    if element.has("limit"):
        conditions.insert(0, Condition("le", posting.term(element.text("limit"))))
    if len(conditions) != 2:  # noqa: PLR2004 - of weight and profit
        raise MistakeError("a knapsack without two conditions", "of its weight, and of its profit")
    for kind, condition in zip(("weights", "profits"), conditions, strict=True):
        factors = [posting.term(word) for word in element.words(kind)]
        posting.post(condition.on(total(_products(factors, members))))


def bin_packing(element: Element, posting: Posting) -> None:
    """Conditions on the load of each bin."""
    bins = as_integers(items(element.words("list"), posting))
    sizes = [posting.term(word) for word in element.words("sizes")]
    if len(bins) != len(sizes):
        raise MistakeError(f"{len(bins)} items, but {len(sizes)} sizes", "write one for each")
    if element.has("condition"):
        condition = posting.condition(element.text("condition"))
        used = sorted({value for item in bins for value in posting.domain(item)})
        conditions = dict.fromkeys(used, condition)
    elif element.has("limits") or element.has("loads"):
        kind, operator = ("limits", "le") if element.has("limits") else ("loads", "eq")
        words = element.words(kind)
        conditions = {place: Condition(operator, posting.term(word)) for place, word in enumerate(words)}
        for item in bins:
            posting.post(inside(item, range(len(words))))
    else:
        raise MistakeError("a <binPacking> without condition, limits or loads", "write one of them")
    for number, condition in conditions.items():
        hits = [as_integer(compare("eq", item, Constant(number))) for item in bins]
        posting.post(condition.on(total(_products(sizes, hits))))


def items(words: Iterable[str], posting: Posting) -> list[Item]:
    """Return what the words of a list stand for."""
    return [posting.item(word) for word in words]


def as_integers(members: Iterable[Item]) -> list[Expression]:
    """Return the members of a list as integers."""
    return [as_integer(member) for member in members]


def order_of(element: Element) -> str:
    """Return the operator of an ordered constraint. Raises `MistakeError`."""
    operator = element.text("operator")
    if operator not in ORDERS:
        raise MistakeError(f"the operator '{shortened(operator)}'", f"expected one of {' '.join(ORDERS)}")
    return operator


def _products(factors: Sequence[Expression], members: Sequence[Expression]) -> list[Expression]:
    if len(factors) != len(members):
        raise MistakeError(f"{len(members)} terms, but {len(factors)} factors", "write one for each")
    return list(map(times, factors, members))


def _one_of(member: Expression, values: Sequence[Expression]) -> Expression:
    constants = [value.value for value in values if isinstance(value, Constant)]
    others = [compare("eq", member, value) for value in values if isinstance(value, Name)]
    if len(constants) + len(others) != len(values):
        raise MistakeError("an expression among values", "write integers or variables")
    return some([*([inside(member, constants)] if constants else []), *others])


def _sum_with_constants(parts: Sequence[Expression]) -> Expression:
    fixed = sum(part.value for part in parts if isinstance(part, Constant))
    return total([*(part for part in parts if not isinstance(part, Constant)), Constant(fixed)])


def _lexicographic(operator: str, one: Sequence[Expression], other: Sequence[Expression]) -> Expression:
    if len(one) != len(other) or not one:
        raise MistakeError("lists of different lengths in <lex>", "give them one length")
    strict = {"le": "lt", "ge": "gt"}.get(operator, operator)
    *before, (left, right) = zip(one, other, strict=True)
    cases = []
    for place, (here, there) in enumerate(before):
        alike = [compare("eq", *pair) for pair in before[:place]]
        cases.append(every([*alike, compare(strict, here, there)]))
    cases.append(every([*(compare("eq", *pair) for pair in before), compare(operator, left, right)]))
    return some(cases)


def rows_of(text: str) -> list[list[str]]:
    """Return the words of lists in parentheses, without blanks."""
    return [[word.strip() for word in row] for row in lists(text)]
