"""Compute what rows of `sfb` prove to the robot that receives them (`Message.proves`): they hold others' costs.

A row holds what each value of each robot from the receiver on has to pay by what is chosen above it (see `sfb_bounds`
and `sfb_bits` for its form).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.model.disclosure import FINITE, INFINITE, Hearing, Pays, Proof, Total, View, partial_assignment
from robochoc.model.message import Value

MOST_ROWS = 2_000
"""For messages with more rows no rule says what they prove: it would take too long."""
_SIZES = (1, 2, 4, 8)
_COST, _VALUES = 1, 2


def costs_prove(content: bytes, count: int, ceiling: int, hearing: Hearing) -> Iterator[Proof]:
    """Yield what rows of costs prove. Raises `ValueError` if `content` is not of that form."""
    rank, domains = _known(hearing)
    largest = max(2 * ceiling, *map(len, domains))
    size = next(size for size in _SIZES if largest < 1 << 8 * size - (size == _SIZES[-1]))
    columns = _VALUES + rank + sum(map(len, domains[rank:]))
    if len(content) != count * columns * size:
        raise ValueError(f"{len(content)} bytes are not {count} rows")
    for start in range(0, len(content), columns * size):
        cells = [
            int.from_bytes(content[start + at * size : start + (at + 1) * size], "little") for at in range(columns)
        ]
        view = _view(cells[_VALUES : _VALUES + rank], hearing, domains)
        yield Total(view, cells[_COST])
        at = _VALUES + rank
        for robot, values in zip(hearing.order[rank:], domains[rank:], strict=True):
            for value in values:
                cost = INFINITE if cells[at] >= ceiling else cells[at]
                yield Pays(robot, value, view, cost, cost)
                at += 1


def bits_prove(content: bytes, count: int, hearing: Hearing) -> Iterator[Proof]:
    """Yield what rows of bits prove. Raises `ValueError` if `content` is not of that form."""
    rank, domains = _known(hearing)
    largest = max(map(len, domains))
    size = 1 if largest <= 1 << 8 else 2 if largest <= 1 << 16 else 4
    length = rank * size + (sum(len(values) + 1 for values in domains[rank:]) + 7) // 8
    if len(content) != count * length:
        raise ValueError(f"{len(content)} bytes are not {count} rows")
    for start in range(0, len(content), length):
        row = content[start : start + length]
        places = [int.from_bytes(row[at * size : (at + 1) * size], "little") for at in range(rank)]
        view = _view(places, hearing, domains)
        yield from partial_assignment(list(view), list(view.values()))
        left = int.from_bytes(row[rank * size :], "little")
        for robot, values in zip(hearing.order[rank:], domains[rank:], strict=True):
            for value in values:
                least, most = (0.0, FINITE) if left & 1 else (INFINITE, INFINITE)
                yield Pays(robot, value, view, least, most)
                left >>= 1
            left >>= 1


def _known(hearing: Hearing) -> tuple[int, list[Sequence[Value]]]:
    """Return the receiver's rank, and all robots' values, which it has been told."""
    domains = [hearing.values(robot) for robot in hearing.order]
    known = [values for values in domains if values is not None]
    if len(known) < len(domains):
        raise ValueError("rows come before all robots' values")
    return hearing.order.index(hearing.receiver), known


def _view(places: Sequence[int], hearing: Hearing, domains: Sequence[Sequence[Value]]) -> View:
    return {robot: values[at] for robot, values, at in zip(hearing.order, domains, places, strict=False)}
