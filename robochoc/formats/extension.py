"""Domains, and constraints in extension (docs/reference/format.md, "One robot")."""

from __future__ import annotations

import re
from collections.abc import Callable

from lxml import etree

from robochoc.formats.costs import read_cost
from robochoc.formats.definitions import (
    MAX_VALUES,
    check_domain,
    check_relation,
    check_tuple_count,
)
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.symbols import SymbolTable, codes_of
from robochoc.formats.xml import attribute
from robochoc.model.problem import INFINITE, CostUnits, Domain, Relation, Semantics

__all__ = ["MAX_VALUES", "check_count", "integer", "read_domain", "read_relation"]

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_NUMERIC = re.compile(r"[-+.0-9]+$")
_RANGE = re.compile(r"([+-]?[0-9]{1,18})(?:\.\.([+-]?[0-9]{1,18}))?")


def integer(word: str) -> int:
    """Return the integer that `word` is. Raises `MistakeError`; digits are counted before Python reads them."""
    if not _INTEGER.fullmatch(word):
        raise MistakeError(f"'{shortened(word)}' is no integer", "at most 18 digits, and a sign")
    return int(word)


def check_count(element: etree._Element, name: str, found: int) -> None:
    """Raise `MistakeError` when the count in attribute `name` is there and wrong."""
    given = attribute(element, name)
    if given and int(given) != found:
        raise MistakeError(f"{name} is {given}, but there are {found}", f'write {name}="{found}" or leave it out')


def read_domain(element: etree._Element, table: SymbolTable) -> Domain:
    """Return a domain from XCSP ranges, `1..4 7 9..12`, as ascending ranges that do not touch; or from symbols.

    The symbols of a symbolic domain are those of the `table` so far. Raises `MistakeError`.
    """
    name, words = attribute(element, "name"), (element.text or "").split()
    if attribute(element, "type") == "symbolic":
        codes = codes_of(words, table)
        domain = Domain(name, tuple(range(code, code + 1) for code in codes), table.names)
    else:
        domain = Domain(name, tuple(sorted(map(_range, words), key=lambda part: part.start)))
    check_domain(domain)
    check_count(element, "nbValues", len(domain))
    return domain


def _range(word: str) -> range:
    match = _RANGE.fullmatch(word)
    if not match:
        hint = "write ranges of integers of at most 18 digits: 1..4 7 9..12"
        raise MistakeError(f"'{shortened(word)}' is no range of integers", hint)
    first, last = int(match[1]), int(match[2] or match[1])
    if first > last:
        raise MistakeError(f"the range {word} is empty", f"write {last}..{first}")
    return range(first, last + 1)


def read_relation(element: etree._Element, units: CostUnits, code: Callable[[str], int]) -> Relation:
    """Return a relation from its tuples, `1 2|2 3` or, where soft, `5:1 2|3:2 2`; costs count in `units`.

    A cost holds for the tuples that follow, until the next one. `code` returns the code of a symbol. Raises
    `MistakeError`.
    """
    semantics = Semantics(attribute(element, "semantics"))
    words = [part for part in (element.text or "").split("|") if part.strip()]
    check_tuple_count(len(words))
    costs: list[float] = []
    if semantics == Semantics.SOFT:
        words, costs = _priced(words, units)
    rows = [word.split() for word in words]
    symbolic = tuple(place for place, word in enumerate(rows[0] if rows else ()) if not _NUMERIC.match(word))
    tuples = [_values(row, symbolic, code) for row in rows]
    check_count(element, "nbTuples", len(tuples))
    name, arity = attribute(element, "name"), _arity(element, tuples)
    default = _default_cost(attribute(element, "defaultCost"), semantics, units)
    relation = Relation(name, arity, semantics, tuple(tuples), tuple(costs), default, symbolic)
    check_relation(relation)
    return relation


def _values(row: list[str], symbolic: tuple[int, ...], code: Callable[[str], int]) -> tuple[int, ...]:
    """Return a tuple's values; in `symbolic` columns the codes of symbols."""
    if not symbolic:
        return tuple([integer(word) for word in row])
    for place in symbolic:
        if place < len(row) and _NUMERIC.match(row[place]):
            message = f"'{shortened(row[place])}' in a column of symbols"
            raise MistakeError(message, "a column holds symbols or integers, as the first tuple does")
    return tuple([code(word) if place in symbolic else integer(word) for place, word in enumerate(row)])


def _priced(words: list[str], units: CostUnits) -> tuple[list[str], list[float]]:
    """Return the tuples without their costs, and the cost of each."""
    tuples, costs = [], []
    cost: float | None = None
    for word in words:
        price, colon, values = word.rpartition(":")
        if colon:
            cost = read_cost(price.strip(), units)
        elif cost is None:
            raise MistakeError(f"the tuple '{shortened(word.strip())}' has no cost", "write cost:tuple, 5:1 2|3:2 2")
        tuples.append(values)
        costs.append(cost)
    return tuples, costs


def _default_cost(given: str, semantics: Semantics, units: CostUnits) -> float:
    if semantics == Semantics.SOFT:
        return read_cost(given, units) if given else INFINITE
    if given:
        hint = 'write semantics="soft", or delete it: supports and conflicts forbid, and cost nothing'
        raise MistakeError(f"defaultCost in a {semantics} relation", hint)
    return 0


def _arity(element: etree._Element, tuples: list[tuple[int, ...]]) -> int:
    """Return the given arity, or the first tuple's. Raises `MistakeError` where there is neither."""
    given = attribute(element, "arity")
    if not given and not tuples:
        raise MistakeError("a relation without tuples lacks its arity", 'write arity="2"')
    return int(given) if given else len(tuples[0])
