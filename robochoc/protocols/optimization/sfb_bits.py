"""The bounds in `sfb` for problems without costs: bits instead of numbers.

Without costs the ceiling is 1. So an entry in a vector is 0 if the value is consistent with the chosen values, and 1 if
not. Here the entry is a bit, 1 if consistent and 0 if not: the vectors of all robots below are one integer, with a
field for each robot. Choosing a value takes one AND of integers. The test for an empty field, which raises the bound to
1, takes one subtraction for all fields together. The rows are the same as those of `sfb_bounds` for the same team, in
the same order. A row takes fewer bytes, so more rows fit into a message.

A row is a pair: the indices of the values of all robots above, and the integer. The lowest field of the integer belongs
to the robot that extends the row next. A field has a bit for each value, the first value lowest, and above these a bit
that is 0, which stops a borrow (Lamport, "Multiple byte processing with full-word instructions", CACM 18, 1975).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from robochoc.protocols.message import Value
from robochoc.protocols.optimization.run_lengths import Columns, RunLengths
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.local_problem import AllowedValues, LocalProblem, steps_of

Row = tuple[bytes, int]
Domain = tuple[Value, ...]

CEILING = 1
"""The ceiling without costs."""


class _NAry(NamedTuple):
    """The values that an n-ary constraint rules out for its lowest robot.

    Attributes:
        others: The ranks of the other robots above, each with the steps of its values: the sum of one step of each
            robot is an index in `ruled_out`.
        own: The code of each value of this robot.
        ruled_out: The bits that each code of this robot rules out.
    """

    others: Sequence[tuple[int, Sequence[int]]]
    own: Sequence[int]
    ruled_out: Sequence[Sequence[int]]


class ForwardBits:
    """The values that remain for the robots below after the choices of the robot of `problem`.

    `domains` are the values of all robots. See `ForwardBounds`, which has the same methods.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder, domains: RunLengths[Domain]) -> None:
        self.rank = order.rank[problem.agent]
        self.most = 0
        self._above = domains.counted(0, self.rank)
        self._own = len(domains[self.rank])
        below = [(len(domain), count) for domain, count in domains.counted(self.rank + 1, len(domains))]
        columns = Columns([(size + 1, count) for size, count in below])
        self._bits = columns.total
        self._lowest, self._guards = _lowest_and_guards(below)
        self._full = self._guards - self._lowest
        largest = max(map(len, domains.distinct))
        self._place_bytes = 1 if largest <= 1 << 8 else 2 if largest <= 1 << 16 else 4
        self._left = [self._full] * self._own
        self._n_ary: list[_NAry] = []
        ranks = [(order.rank[name], name) for name in problem.neighbours]
        above = {name: domains[rank] for rank, name in ranks if rank < self.rank}
        for rank, name in ranks:
            if rank <= self.rank:
                continue
            for table in problem.allowed({**above, name: domains[rank]}, lowest=name):
                ruled_out = _ruled_out(table, columns.start(rank - self.rank - 1))
                *others, _, own = table.codes
                if others:
                    steps = steps_of(others, table.sizes[:-1])
                    ranked = [(order.rank[one], row) for one, row in zip(table.agents, steps, strict=False)]
                    self._n_ary.append(_NAry(ranked, own, ruled_out))
                else:
                    (outs,) = ruled_out
                    self._left = [left & ~outs[code] for left, code in zip(self._left, own, strict=True)]

    def count_up_to(self, ceiling: int) -> None:
        """Check the `ceiling`. Raises `ValueError` if there are costs."""
        if ceiling != CEILING:
            raise ValueError(f"received costs of up to {ceiling - 1}, but the problem has no costs")

    def nothing(self, charges: Sequence[Sequence[float]]) -> list[Row]:
        """Return the empty partial assignment, with all values of all robots: `charges` are all 0."""
        field = sum(1 << place for place, charge in enumerate(charges[0]) if charge < math.inf)
        return [(b"", self._full << self._own + 1 | field)]

    def read(self, content: bytes, count: int) -> list[Row]:
        """Return the `count` partial assignments in `content`. Raises `ValueError` if it has another form."""
        chosen = self.rank * self._place_bytes
        length = chosen + _bytes(self._bits + self._own + 1)
        if count < 1 or len(content) != count * length:
            raise ValueError(f"{len(content)} bytes cannot contain {count} partial assignments")
        _refuse_places(content, length, self._place_bytes, self._above)
        full = self._full << self._own + 1 | (1 << self._own) - 1
        rows = []
        for start in range(0, len(content), length):
            left = int.from_bytes(content[start + chosen : start + length], "little")
            if left | full != full:
                raise ValueError("a partial assignment contains values that do not exist")
            rows.append((content[start : start + chosen], left))
        return rows

    @property
    def width(self) -> int:
        """The number of bytes of an extended partial assignment."""
        return (self.rank + 1) * self._place_bytes + _bytes(self._bits)

    def below(self, rows: list[Row], upper_bound: int) -> list[Row]:
        """Return the `rows` with a lower bound below `upper_bound`: all rows, until there is a solution."""
        return rows if upper_bound else []

    def least(self, rows: list[Row]) -> int:  # noqa: ARG002 - as `ForwardBounds`
        """Return the minimum lower bound of `rows`."""
        return 0

    def packed(self, rows: list[Row]) -> bytes:
        """Return `rows` as the bytes of a message."""
        size = _bytes(self._bits)
        return b"".join([chosen + left.to_bytes(size, "little") for chosen, left in rows])

    def extended(self, rows: list[Row], upper_bound: int) -> list[Row]:
        """Return all extensions of `rows` by a value of this robot that leave each robot below a value.

        Extensions that leave the most values to the other robots come first.
        """
        if not upper_bound:
            return []
        lowest, guards, own_bits, shift = self._lowest, self._guards, (1 << self._own) - 1, self._own + 1
        named = [place.to_bytes(self._place_bytes, "little") for place in range(self._own)]
        found: list[tuple[int, Row]] = []
        for chosen, fields in rows:
            left, own = fields >> shift, fields & own_bits
            tables = [(one.own, one.ruled_out[self._chosen(chosen, one.others)]) for one in self._n_ary]
            while own:
                value = (own & -own).bit_length() - 1
                own &= own - 1
                after = left & self._left[value]
                for codes, ruled_out in tables:
                    after &= ~ruled_out[codes[value]]
                if ((after | guards) - lowest) & guards == guards:
                    found.append((-after.bit_count(), (chosen + named[value], after)))
        found.sort(key=_count)
        return [row for _, row in found]

    def completed(self, rows: list[Row]) -> tuple[int, list[int]]:
        """Return the cost and the values of the first extension of `rows`, for all robots but this one."""
        size = self._place_bytes
        for chosen, own in rows:
            if own:
                places = [int.from_bytes(chosen[at : at + size], "little") for at in range(0, len(chosen), size)]
                return 0, [*places, (own & -own).bit_length() - 1]
        return CEILING, []

    def _chosen(self, chosen: bytes, others: Sequence[tuple[int, Sequence[int]]]) -> int:
        size = self._place_bytes
        return sum([steps[int.from_bytes(chosen[rank * size : (rank + 1) * size], "little")] for rank, steps in others])


def _ruled_out(table: AllowedValues, start: int) -> list[list[int]]:
    """Return the values that each code of this robot rules out, for a robot whose field begins at `start`.

    The lists are those of the combinations of the other robots' codes, in the order of `itertools.product`. The values
    that are ruled out are bits of the field. Equal lists are one object: tables may be large.
    """
    *_, lowest, own = table.codes
    firsts = [own.index(code) for code in range(max(own, default=-1) + 1)]
    fields = [0] * table.sizes[-1]
    for place, code in enumerate(lowest):
        fields[code] |= 1 << start + place
    known: dict[tuple[int, ...], list[int]] = {}
    found = []
    for row in range(0, len(table.masks), len(fields)):
        masks = tuple(table.masks[row : row + len(fields)])
        if masks not in known:
            known[masks] = [
                sum([field for field, mask in zip(fields, masks, strict=True) if not mask >> first & 1])
                for first in firsts
            ]
        found.append(known[masks])
    return found


def _lowest_and_guards(sizes: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Return the lowest bits, and the bits above the values, of all fields.

    `sizes` are the numbers of values, each with the number of its successive fields.
    """
    parts: list[tuple[int, int, int]] = []  # the lowest bits, the guards, and the number of bits
    for size, count in sizes:
        lowest = ((1 << (size + 1) * count) - 1) // ((1 << size + 1) - 1)
        parts.append((lowest, lowest << size, (size + 1) * count))
    while len(parts) > 1:  # neighbours are joined, so that there are few long integers
        odd = parts[len(parts) & ~1 :]
        pairs = zip(parts[::2], parts[1::2], strict=False)
        parts = [(one[0] | two[0] << one[2], one[1] | two[1] << one[2], one[2] + two[2]) for one, two in pairs] + odd
    return (parts[0][0], parts[0][1]) if parts else (0, 0)


def _bytes(bits: int) -> int:
    return (bits + 7) // 8


def _count(found: tuple[int, Row]) -> int:
    return found[0]


def _refuse_places(content: bytes, length: int, size: int, above: Sequence[tuple[Domain, int]]) -> None:
    """Raise `ValueError` if a row of `length` bytes has a place, of `size` bytes, that is not in its robot's domain.

    `above` are the domains of the robots above, each with the number of its successive robots.
    """
    first = 0
    for domain, robots in above:
        end = first + robots * size
        if size > 1:
            columns = range(first, end, size)
            wrong = any(_largest(content, at, size, length) >= len(domain) for at in columns)
        else:  # the bytes of all rows or of all robots at once, whichever takes fewer steps
            rows = len(content) // length
            if rows < robots:
                parts = [content[at + first : at + end] for at in range(0, len(content), length)]
            else:
                parts = [content[at::length] for at in range(first, end)]
            known = bytes(range(len(domain)))
            wrong = any(part.translate(None, known) for part in parts)
        if wrong:
            raise ValueError("a partial assignment contains values that do not exist")
        first = end


def _largest(content: bytes, first: int, size: int, length: int) -> int:
    """Return the largest number of `size` bytes at offset `first` in the rows of `length` bytes."""
    starts = range(first, len(content), length)
    return max(int.from_bytes(content[start : start + size], "little") for start in starts)
