"""Translate the constraints of XCSP3-core that become tables: extension, element, regular, mdd."""

from __future__ import annotations

import itertools
import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

from robochoc.formats.definitions import MAX_TUPLES
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.xcsp3.constraint_element import Element
from robochoc.formats.dialects.xcsp3.constraints import as_integers, items, split_rows
from robochoc.formats.dialects.xcsp3.expressions import (
    Xcsp3Condition,
    compare,
    conjunction,
    disjunction,
    integer,
    is_one_of,
    span,
)
from robochoc.formats.dialects.xcsp3.posting import Item, Posting
from robochoc.model.expression import Apply, Constant, Expression

MAX_WRITTEN_OUT = 100_000
"""The maximum number of tuples in the expansion of a table with `*`; a larger table becomes an expression."""
MAX_CASES = 9_000
"""The maximum number of tuples in a table with `*` that is not expanded."""

Row = tuple[int, ...]
Arcs = Mapping[str, Mapping[int, set[str]]]
"""The successors of each state by value."""


class Extensions:
    """Reads `<extension>`; constraints of one group share their table."""

    def __init__(self) -> None:
        self._tables: dict[object, tuple[Row, ...] | None] = {}

    def __call__(self, element: Element, posting: Posting) -> None:
        """Post a table of allowed or of forbidden tuples."""
        if element.attribute("type") not in {"", "ordinary", "starred", "extension"}:
            raise MistakeError("hybrid tables are not supported", "write ordinary tuples")
        allowed = element.has("supports") or not element.has("conflicts")
        scope = items(element.words("list"), posting)
        text = element.text("supports" if allowed else "conflicts")
        has_wildcards = "*" in text or ".." in text
        key = text, tuple(tuple(posting.domain(item)) for item in scope) if has_wildcards else len(scope)
        if key not in self._tables:
            try:
                self._tables[key] = tuple(_rows(text, scope, posting))
            except _TooWideError:
                self._tables[key] = None
        table = self._tables[key]
        if table is None:
            _post_cases(text, scope, posting, allowed=allowed)
            return
        posting.post_table(scope, table, allowed=allowed)


class _TooWideError(Exception):
    """The expansion of a table with `*` has too many tuples."""


def _rows(text: str, scope: Sequence[Item], posting: Posting) -> Iterator[Row]:
    """Yield the tuples in a text; `*` is any value of its variable, `1..3` one of three values."""
    if not text.startswith("("):
        if text and len(scope) != 1:
            raise MistakeError(
                f"the table has single values for {len(scope)} variables", "write tuples in parentheses: (1,2)(3,4)"
            )
        for word in text.split():
            yield from ((value,) for value in _cell(word, scope[0], posting))
        return
    number = "[+-]?[0-9]{1,18}"
    plain = _without_blanks(text)
    if re.fullmatch(rf"(?>\({number}(?:,{number}){{{len(scope) - 1}}}\))++", plain):
        flat = list(map(int, plain[1:-1].replace(")(", ",").split(",")))
        yield from zip(*(flat[place :: len(scope)] for place in range(len(scope))), strict=True)
        return
    made = 0
    for words in _cells(text, scope):
        cells = [_cell(word, item, posting) for word, item in zip(words, scope, strict=True)]
        made += math.prod(map(len, cells))
        if made > MAX_WRITTEN_OUT and any(len(cell) != 1 for cell in cells):
            raise _TooWideError
        yield from itertools.product(*cells)


def _cells(text: str, scope: Sequence[Item]) -> Iterator[list[str]]:
    """Yield the words of each tuple. Raises `MistakeError`."""
    for row in _without_blanks(text).removeprefix("(").removesuffix(")").split(")("):
        words = row.split(",")
        if len(words) != len(scope):
            what = f"the tuple ({shortened(row)}) has {len(words)} values"
            raise MistakeError(what, f"write {len(scope)} values")
        yield words


def _without_blanks(text: str) -> str:
    """Return `text` without blanks around commas and parentheses."""
    return re.sub(r"\s*([(),])\s*", r"\1", text)


def _post_cases(text: str, scope: Sequence[Item], posting: Posting, *, allowed: bool) -> None:
    """Post a table with `*` as an expression: one of its tuples matches, or none of them."""
    cases = []
    for words in _cells(text, scope):
        cells = zip(words, as_integers(scope), strict=True)
        cases.append(conjunction([is_one_of(item, _cell(word, item, posting)) for word, item in cells if word != "*"]))
        if len(cases) > MAX_CASES:
            raise MistakeError(f"a table with * has more than {MAX_CASES:,} tuples", "write it without *")
    if allowed:
        posting.post(disjunction(cases))
        return
    for case in cases:
        posting.post(Apply("not", (case,)))


def _cell(word: str, item: Item, posting: Posting) -> Sequence[int]:
    if word == "*":
        return posting.domain(item)
    if word in posting.symbols:
        return (posting.symbols[word],)
    if ".." in word:
        values = span(word)
        return [value for value in posting.domain(item) if value in values]
    return (integer(word),)


def element(element: Element, posting: Posting) -> None:
    """Post a condition on the member of a list or matrix at an index."""
    condition = (
        posting.condition(element.text("condition"))
        if element.has("condition")
        else Xcsp3Condition("eq", posting.term(element.text("value")))
    )
    if element.has("matrix"):
        _element_of_matrix(element, posting, condition)
        return
    members = as_integers(items(element.words("list"), posting))
    if not element.has("index"):
        posting.post(disjunction([condition.on(member) for member in members]))
        return
    if element.attribute("rank", "index") not in {"", "any"}:
        raise MistakeError("the attribute rank of <element> is not supported", "delete it")
    start = element.start_index()
    index = posting.term(element.text("index"))
    post_element(posting, [index], {(start + place,): member for place, member in enumerate(members)}, condition)


def _element_of_matrix(element: Element, posting: Posting, condition: Xcsp3Condition) -> None:
    rows = [as_integers(posting.term(word) for word in row) for row in element.matrix("matrix")]
    down = element.start_index("startRowIndex", "matrix")
    across = element.start_index("startColIndex", "matrix")
    indexes = items(element.words("index"), posting)
    if len(indexes) != 2:  # noqa: PLR2004 - of row and column
        raise MistakeError(f"the matrix has {len(indexes)} indexes", "write two: <index> i j </index>")
    cells: dict[Row, Expression] = {
        (down + i, across + j): member for i, row in enumerate(rows) for j, member in enumerate(row)
    }
    post_element(posting, indexes, cells, condition)


def post_element(
    posting: Posting, indexes: Sequence[Expression], cells: Mapping[Row, Expression], condition: Xcsp3Condition
) -> None:
    """Post `condition` on the cell at `indexes`: as a table if all cells are integers, else cell by cell.

    The comparison with an expression is posted cell by cell, too, since a table has no column for an expression.
    """
    operand = condition.operand
    if not isinstance(operand, Apply) and all(isinstance(cell, Constant) for cell in cells.values()):
        others = [] if isinstance(operand, tuple | Constant) else [operand]
        known = [set(posting.domain(index)) for index in indexes]
        rows: list[Row] = []
        for place, cell in cells.items():
            if not all(value in some_values for value, some_values in zip(place, known, strict=True)):
                continue
            value = cell.value if isinstance(cell, Constant) else 0
            for row in itertools.product(*(posting.domain(other) for other in others)):
                fixed = Xcsp3Condition(condition.operator, Constant(row[0])) if others else condition
                if fixed.with_constant(value):
                    rows.append((*place, *row))
            if len(rows) > MAX_TUPLES:
                raise MistakeError(f"<element> has more than {MAX_TUPLES:,} tuples", "split it")
        posting.post_table([*indexes, *others], rows, allowed=True)
        return
    for axis, index in enumerate(indexes):
        posting.post(is_one_of(index, {where[axis] for where in cells}))
    for where, chosen in cells.items():
        elsewhere = [compare("ne", index, Constant(number)) for index, number in zip(indexes, where, strict=True)]
        posting.post(disjunction([*elsewhere, condition.on(chosen)]))


def regular(element: Element, posting: Posting) -> None:
    """Post that an automaton accepts a list as a word."""
    start, final = element.text("start"), element.text("final").split()
    arcs = _arcs(element)
    states = {*arcs, *(state for by_value in arcs.values() for targets in by_value.values() for state in targets)}
    for state in [start, *final]:
        if state not in states:
            raise MistakeError(f"the state '{shortened(state)}' has no transition", suggestion(state, states, "states"))
    _post_paths(element, posting, arcs, start, set(final))


def mdd(element: Element, posting: Posting) -> None:
    """Post that a list is a path through a decision diagram from its root to an end."""
    arcs = _arcs(element)
    reached = {state for by_value in arcs.values() for states in by_value.values() for state in states}
    roots, ends = set(arcs) - reached, reached - set(arcs)
    if len(roots) != 1 or not ends:
        raise MistakeError(
            f"the decision diagram has {len(roots)} roots and {len(ends)} ends", "write one root and an end"
        )
    _post_paths(element, posting, arcs, roots.pop(), ends)


def _arcs(element: Element) -> Arcs:
    arcs: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    for row in split_rows(element.text("transitions")):
        if len(row) != 3:  # noqa: PLR2004 - from, value, to
            what = f"the transition ({shortened(','.join(row))}) is not valid"
            raise MistakeError(what, "write (state,value,state)")
        for value in span(row[1]):
            arcs[row[0]][value].add(row[2])
    return arcs


def _post_paths(element: Element, posting: Posting, arcs: Arcs, start: str, final: set[str]) -> None:
    """Post the paths from `start` to a state in `final` as a table."""
    scope = items(element.words("list"), posting)
    domains = [set(posting.domain(item)) for item in scope]
    useful = [final]
    for domain in reversed(domains):
        useful.append({s for s in arcs if any(v in domain and t & useful[-1] for v, t in arcs[s].items())})
    useful.reverse()
    words: dict[Row, set[str]] = {(): {start} & useful[0]}
    for step, domain in enumerate(domains):
        longer: dict[Row, set[str]] = {}
        for word, states in words.items():
            for state in states:
                for value, targets in arcs[state].items() if state in arcs else ():
                    going = targets & useful[step + 1]
                    if value in domain and going:
                        longer.setdefault((*word, value), set()).update(going)
            if len(longer) > MAX_WRITTEN_OUT:
                kind = element.kind
                raise MistakeError(f"<{kind}> has more than {MAX_WRITTEN_OUT:,} tuples", "split it")
        words = longer
    posting.post_table(scope, [word for word, states in words.items() if states], allowed=True)
