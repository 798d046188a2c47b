"""What is listed value by value: domains, and constraints in extension (FORMAT.md, "One robot")."""

from __future__ import annotations

import re

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.xml import attribute
from robochoc.problem import INFINITE, Domain, Relation, Semantics

MAX_VALUES = 100_000
"""Of a domain."""
MAX_TUPLES = 1_000_000
"""Of a relation."""

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_RANGE = re.compile(r"([+-]?[0-9]{1,18})(?:\.\.([+-]?[0-9]{1,18}))?")


def integer(word: str) -> int:
    """The integer that `word` is. Raises `MistakeError`; digits are counted before Python reads them."""
    if not _INTEGER.fullmatch(word):
        raise MistakeError(f"'{shortened(word)}' is no integer", "at most 18 digits, and a sign")
    return int(word)


def check_count(element: etree._Element, name: str, found: int) -> None:
    """Raise `MistakeError` when the count in attribute `name` is there and wrong."""
    given = attribute(element, name)
    if given and int(given) != found:
        raise MistakeError(f"{name} is {given}, but there are {found}", f'write {name}="{found}" or leave it out')


def read_domain(element: etree._Element) -> Domain:
    """A domain from XCSP ranges, `1..4 7 9..12`, as ascending ranges that do not touch. Raises `MistakeError`."""
    name = attribute(element, "name")
    ranges: list[range] = []
    size = 0
    for word in (element.text or "").split():
        part = _range(word)
        size += len(part)
        if size > MAX_VALUES:
            raise MistakeError(f"domain {shortened(name)} has more than {MAX_VALUES} values", "make it smaller")
        ranges.append(part)
    if not ranges:
        raise MistakeError(f"domain {shortened(name)} has no value", "write ranges: 1..4 7 9..12")
    check_count(element, "nbValues", size)
    return Domain(name, _merged(sorted(ranges, key=lambda part: part.start)))


def _range(word: str) -> range:
    match = _RANGE.fullmatch(word)
    if not match:
        hint = "write ranges of integers of at most 18 digits: 1..4 7 9..12"
        raise MistakeError(f"'{shortened(word)}' is no range of integers", hint)
    first, last = int(match[1]), int(match[2] or match[1])
    if first > last:
        raise MistakeError(f"the range {word} is empty", f"write {last}..{first}")
    return range(first, last + 1)


def _merged(ranges: list[range]) -> tuple[range, ...]:
    """Neighbouring ranges put together. Raises `MistakeError` where two overlap."""
    merged = ranges[:1]
    for part in ranges[1:]:
        if part.start < merged[-1].stop:
            raise MistakeError(f"the value {part.start} stands twice in the domain", "let its ranges not overlap")
        if part.start == merged[-1].stop:
            merged[-1] = range(merged[-1].start, part.stop)
        else:
            merged.append(part)
    return tuple(merged)


def read_relation(element: etree._Element) -> Relation:
    """A relation from its tuples, `1 2|2 3` or, where soft, `5:1 2|3:2 2`. Raises `MistakeError`."""
    semantics = Semantics(attribute(element, "semantics"))
    default = attribute(element, "defaultCost")
    if (semantics is Semantics.SOFT) != bool(default):
        wrong = "a soft relation lacks its defaultCost" if not default else f"defaultCost in a {semantics} relation"
        raise MistakeError(wrong, "a soft relation has one, an integer or 'infinity'; no other has")
    words = [part for part in (element.text or "").split("|") if part.strip()]
    if len(words) > MAX_TUPLES:
        raise MistakeError(f"{len(words)} tuples are more than {MAX_TUPLES}", "write a predicate instead")
    costs: list[float] = []
    tuples: list[tuple[int, ...]] = []
    for word in words:
        values = word
        if semantics is Semantics.SOFT:
            price, colon, values = word.partition(":")
            if not colon:
                raise MistakeError(
                    f"the tuple '{shortened(word.strip())}' has no cost", "write cost:tuple, 5:1 2|3:2 2"
                )
            costs.append(_cost(price.strip()))
        tuples.append(tuple([integer(value) for value in values.split()]))
    check_count(element, "nbTuples", len(tuples))
    arity = _arity(element, tuples)
    return Relation(
        attribute(element, "name"), arity, semantics, tuple(tuples), tuple(costs), _cost(default) if default else 0
    )


def _arity(element: etree._Element, tuples: list[tuple[int, ...]]) -> int:
    """The given arity, or the tuples'. Raises `MistakeError` when some tuple has another, or stands twice."""
    given = attribute(element, "arity")
    if not given and not tuples:
        raise MistakeError("a relation without tuples lacks its arity", 'write arity="2"')
    arity = int(given) if given else len(tuples[0])
    if arity == 0:
        raise MistakeError("a relation of arity 0", "its tuples need a value for each variable of the scope")
    seen: set[tuple[int, ...]] = set()
    for values in tuples:
        shown = shortened(" ".join(map(str, values)))
        if len(values) != arity:
            hint = "separate values by a blank, and tuples by '|'"
            raise MistakeError(f"the tuple '{shown}' has {len(values)} values instead of {arity}", hint)
        if values in seen:
            raise MistakeError(f"the tuple '{shown}' stands twice", "delete one of them")
        seen.add(values)
    return arity


def _cost(word: str) -> float:
    if word == "infinity":
        return INFINITE
    cost = integer(word)
    if cost < 0:
        raise MistakeError(f"the cost {cost} is negative", "costs are 0 or more, or 'infinity'")
    return cost
