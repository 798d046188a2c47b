"""Tables of costs in DPOP: how they are joined, projected, stored and sent (see `dpop`).

An axis belongs to a robot, an index on it to one of the robot's values, or to several values that the table does not
distinguish (`CoarseTable`). Costs are integers, or `inf` if a hard
constraint is broken; they are added up as the narrowest integers that can hold the sums, or in float64, which is
exact below 2^53. Stored and sent tables contain unsigned integers, as narrow as the costs allow; the largest number
represents `inf`. The memory that an operation needs is known before: `bytes_of`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Literal, NamedTuple, cast, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from robochoc.protocols.wording import cost_text
from robochoc.solver.errors import TooLargeError
from robochoc.system.plain_text import counted
from robochoc.system.stored_arrays import empty_array, is_on_disk, release_pages

Array = NDArray[np.float64]
Codes = NDArray[np.unsignedinteger[Any]]
Table = Array | Codes
Places = NDArray[np.intp]
Width = Literal[1, 2, 4, 8]
"""The number of bytes of one cost."""

BLOCK = 1 << 17
"""The number of cells of a join that are made at a time, small enough for the processor's cache."""
TEMPORARY = 32
"""The maximum bytes for each of these cells: sums, a table's costs as they are added, and the least of them."""
SMALL = 1 << 12
"""The maximum number of cells of a table that is converted once, not again for each block; and of a join of floats."""
LONGEST = 16
"""The number of blocks that may form one block if a single axis needs it."""
PIECE = 1 << 22
"""The maximum number of bytes of a table in one message, 4 MiB: half a frame on the network."""
RESIDENT = 1 << 25
"""The number of bytes of a table on the disk after which its pages in memory are released."""
_WIDTHS: tuple[Width, ...] = (1, 2, 4, 8)


class Projection(NamedTuple):
    """The minimum cost for each combination of the others' values, and this robot's first value that attains it."""

    costs: Codes
    choices: Codes


class CoarseTable(NamedTuple):
    """A table that does not distinguish all values of some robots, for a join that does.

    Attributes:
        costs: The table.
        places: For each axis of `costs`, the index on it for each index on the axis of the join. None: the same
            indices, or a single one.
    """

    costs: Table
    places: tuple[Places | None, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the table in the join."""
        return tuple(
            [
                length if places is None else len(places)
                for length, places in zip(self.costs.shape, self.places, strict=True)
            ]
        )

    def part(self, index: Sequence[slice | int]) -> CoarseTable:
        """Return the part at `index`: for each axis of the join all indices, one of them, or a slice of one."""
        found: list[slice | int] = []
        kept: list[Places | None] = []
        for at, places in zip(index, self.places, strict=True):
            whole = at == slice(None)
            if places is None or whole:
                found.append(at)
            elif isinstance(at, slice):
                found.append(slice(int(places[at.start]), int(places[at.start]) + 1))
            else:
                found.append(int(places[at]))
            if isinstance(at, slice):
                kept.append(places if whole else None)
        return CoarseTable(self.costs[tuple(found)], tuple(kept))

    def leading(self, place: Sequence[int]) -> CoarseTable:
        """Return the part at these indices on the first axes after this robot's."""
        leading = [index if length > 1 else 0 for index, length in zip(place, self.shape[1:], strict=False)]
        return self.part([slice(None), *leading, *[slice(None)] * (len(self.places) - 1 - len(leading))])

    def aligned(self, axes: Sequence[str], onto: Sequence[str]) -> CoarseTable:
        """Return the result of the function `aligned`."""
        places = dict(zip(axes, self.places, strict=True))
        return CoarseTable(aligned(self.costs, axes, onto), tuple([places.get(name) for name in onto]))

    def expanded(self) -> Table:
        """Return the table with all indices of the join."""
        table = self.costs
        for axis, places in enumerate(self.places):
            if places is not None:
                table = table.take(places, axis)
        return table


def coarse(table: Table, places: Sequence[Places | None]) -> Table | CoarseTable:
    """Return `table` with other indices; small tables are expanded at once."""
    if all(one is None for one in places):
        return table
    found = CoarseTable(table, tuple(places))
    return found if math.prod(found.shape) > SMALL else found.expanded()


class Extent(NamedTuple):
    """The size of a table: its number of cells, and `width`, the number of bytes of a cost."""

    cells: int
    width: int


def width_of(dearest: int) -> Width:
    """Return the number of bytes for each cost in a table whose largest finite cost is `dearest`."""
    return next(width for width in _WIDTHS if dearest < _top(width))


class Result(NamedTuple):
    """The size of a table that results from a join: its `shape`, and the number of bytes of each cost (`width`).

    `own` is the number of this robot's values in the join.
    """

    shape: Sequence[int]
    own: int
    width: int


def bytes_of(results: Sequence[Result], inputs: Sequence[Extent]) -> int:
    """Return the peak size of all arrays while tables are made from `inputs` and sent, without allocating anything."""
    stored, block, sending = 0, 0, 0
    for shape, own, width in results:
        cells = math.prod(shape)
        stored += cells * (width + _choice(own).itemsize)
        block = max(block, own * math.prod(shape[_stepped(shape, own) :]))
        sending = max(sending, cells * width + min(cells * width, PIECE))
    joining = sum(one.cells * one.width for one in inputs) + block * TEMPORARY
    return stored + max(joining, sending)


@overload
def aligned(table: Table, axes: Sequence[str], onto: Sequence[str]) -> Table: ...


@overload
def aligned(table: Table | CoarseTable, axes: Sequence[str], onto: Sequence[str]) -> Table | CoarseTable: ...


def aligned(table: Table | CoarseTable, axes: Sequence[str], onto: Sequence[str]) -> Table | CoarseTable:
    """Return a view of `table` with an axis for each robot in `onto`, of length 1 if the table has no such axis.

    `axes` are the robots of the table's axes; robots that are not in `onto` have a single value.
    """
    if isinstance(table, CoarseTable):
        return table.aligned(axes, onto)
    kept = [name for name in axes if name in onto]
    table = table[tuple([slice(None) if name in onto else 0 for name in axes])]
    table = table.transpose([kept.index(name) for name in onto if name in kept])
    return table[tuple([slice(None) if name in kept else np.newaxis for name in onto])]


def project(
    shape: Sequence[int],
    charges: Sequence[float],
    tables: Sequence[Table | CoarseTable],
    dearest: int,
    *,
    on_disk: bool = False,
) -> Projection:
    """Add up `charges`, the costs of this robot's values, and `tables`; then minimise over its values.

    `tables` have this robot's axis first, then the axes of `shape` (see `aligned`); no finite sum is above `dearest`.
    The join is larger than the result by this robot's axis. It is never in memory as a whole, but is made block by
    block: a block has one index on each leading axis of `shape`, and all indices on the others. The result is on the
    disk if `on_disk`.

    Raises:
        TooLargeError: if there is no space on the disk.
    """
    width = width_of(dearest)
    result = Projection(
        empty_table(shape, f"<u{width}", on_disk=on_disk), empty_table(shape, _choice(len(charges)), on_disk=on_disk)
    )
    split = _stepped(shape, len(charges))
    steps: list[list[Table | CoarseTable]] = [[] for _ in shape[:split]]
    fixed: Array = np.array(charges, np.float64).reshape(-1, *(1 for _ in shape[split:]))
    for table in sorted(tables, key=lambda table: [length > 1 for length in table.shape[split + 1 :]]):
        varying = [axis for axis, length in enumerate(table.shape[1 : split + 1]) if length > 1]
        if varying:
            steps[varying[-1]].append(table)
        else:
            fixed = np.add(fixed, _floats(_part(table, [0] * split)))
    codes = _Codes.least(len(charges), dearest, sum(map(len, steps)), math.prod(shape) * len(charges))
    numbers = codes.first(fixed)
    del fixed
    _Join(result, steps, codes, numbers).fill((), None)
    return result


class _Codes:
    """Numbers for a cost and the value that attains it, so that a single minimum finds the cheapest and first value.

    The number is `cost * many + value`, where `many` is the number of this robot's values. Any number from `infinite`
    on is an infinite cost. If no integer type can hold these numbers, or there are few, they are floats for costs
    alone.
    """

    def __init__(self, kind: str, many: int, infinite: int) -> None:
        self.kind = np.dtype(kind)
        self.many = many
        self.infinite = infinite
        self.exact = self.kind.kind == "u"

    @classmethod
    def least(cls, many: int, dearest: int, added: int, cells: int) -> _Codes:
        """Return the narrowest numbers for costs up to `dearest`, for sums of a block and `added` tables.

        For few `cells`, conversions would take longer than the sums.
        """
        infinite = (dearest + 1) * many
        largest = infinite * (added + 1)
        kinds = [f"=u{width}" for width in _WIDTHS if largest <= _top(width)] if cells > SMALL else []
        return cls(kinds[0] if kinds else "=f8", many, infinite)

    def first(self, costs: Array) -> Table:
        """Return numbers for `costs`, whose first axis belongs to this robot."""
        if not self.exact:
            return costs
        places = np.arange(self.many, dtype=self.kind).reshape(-1, *(1 for _ in costs.shape[1:]))
        numbers: Codes = np.ascontiguousarray(self.further(costs))
        np.add(numbers, places, out=numbers, where=numbers < self.infinite)
        return numbers

    def further(self, table: Table | CoarseTable) -> Any:  # noqa: ANN401 - integers or floats
        """Return numbers for the costs in `table`, to be added to numbers with values."""
        if isinstance(table, CoarseTable):
            return CoarseTable(self.further(table.costs), table.places)
        if not self.exact:
            return _floats(table)
        if table.dtype.kind == "u":
            broken = table == _top(table.itemsize) if table.max() == _top(table.itemsize) else None
            numbers = np.multiply(table, self.kind.type(self.many), dtype=self.kind, casting="unsafe")
        else:
            broken = np.isinf(table)
            numbers = np.where(broken, 0, table).astype(self.kind)
            numbers *= self.kind.type(self.many)
        if broken is not None:
            np.copyto(numbers, self.kind.type(self.infinite), where=broken)
        return numbers

    def part(self, table: Table | CoarseTable, place: Sequence[int]) -> Any:  # noqa: ANN401 - integers or floats
        """Return numbers for the part of `table` at these indices on the first axes after this robot's."""
        if isinstance(table, CoarseTable):
            return CoarseTable.expanded(self.further(table.leading(place)))
        return self.further(_part(table, place))

    def store(self, numbers: Any, costs: Codes, choices: Codes) -> None:  # noqa: ANN401 - integers or floats
        """Store the costs and values of the least of `numbers`, a row for each of this robot's values."""
        least = numbers.min(axis=0)
        if not self.exact:
            choices[...] = numbers.argmin(axis=0)
            infinite = np.isinf(least)
            np.copyto(costs, least, where=~infinite, casting="unsafe")
        else:
            infinite = least >= self.infinite if least.max() >= self.infinite else None
            found = least // self.kind.type(self.many)
            np.copyto(costs, found, casting="unsafe")
            found *= self.kind.type(self.many)
            np.subtract(least, found, out=least)
            np.copyto(choices, least, casting="unsafe")
        if infinite is not None:
            costs[infinite] = _top(costs.itemsize)
            choices[infinite] = 0


class _Join:
    """A join that is made block by block, and its projection, the `result`.

    `steps`: for each leading axis, the tables that have this axis and no later leading axis. `fixed`: the sum of all
    tables without leading axes. A sum of tables is made again only if an index on one of their leading axes changes.
    """

    def __init__(
        self, result: Projection, steps: Sequence[Sequence[Table | CoarseTable]], codes: _Codes, fixed: Table
    ) -> None:
        self._result = result
        self._codes = codes
        self._fixed = fixed
        self._joined = np.empty((codes.many, *result.costs.shape[len(steps) :]), codes.kind)
        self._small = [[codes.further(table) for table in tables if _stored(table).size <= SMALL] for tables in steps]
        self._large = [[table for table in tables if _stored(table).size > SMALL] for tables in steps]
        tables: list[NDArray[Any]] = [*result, *(_stored(table) for some in self._large for table in some)]
        self._on_disk = [table for table in tables if is_on_disk(table)]
        self._resident = 0

    def fill(self, place: tuple[int, ...], added: Any) -> None:  # noqa: ANN401 - integers or floats, or None
        """Compute all blocks with the indices `place` on the first axes; `added` is the sum of their tables so far."""
        costs, choices = self._result
        depth = len(place)
        if depth == len(self._small):
            np.add(self._fixed, 0 if added is None else added, out=self._joined)
            rows = self._joined.reshape(self._codes.many, -1)
            here: tuple[Any, ...] = (*place, ...)
            self._codes.store(rows, costs[here].reshape(-1), choices[here].reshape(-1))
            self._resident += rows.size
            if self._resident >= RESIDENT:
                self._resident = 0
                for table in self._on_disk:
                    release_pages(table)
            return
        after = [0] * (len(self._small) - depth - 1)
        for index in range(costs.shape[depth]):
            full = (*place, index, *after)
            total = added
            for table in self._small[depth]:
                block = _part(table, full)
                total = block if total is None else total + block
            for large in self._large[depth]:
                block = self._codes.part(large, full)
                total = block if total is None else total + block
            self.fill((*place, index), total)


def place_type(sizes: Iterable[int]) -> np.dtype[np.unsignedinteger[Any]]:
    """Return the narrowest little-endian type for indices of values of robots with these numbers of values."""
    return np.min_scalar_type(max(sizes) - 1).newbyteorder("<")


def are_all_infinite(costs: Codes) -> bool:
    """Return whether all costs are `inf`."""
    return all(part.min() == _top(costs.itemsize) for part in _parts(costs))


def packed_costs(costs: Codes) -> Iterator[tuple[Width, bytes]]:
    """Yield `costs` in pieces for messages, with as few bytes per cost as the largest cost needs."""
    width = width_of(_max_finite(costs))
    flat = costs.reshape(-1)
    step = PIECE // width
    for start in range(0, flat.size, step):
        # The code of `inf` is all ones, and so are its lowest bytes.
        piece = flat[start : start + step].astype(f"<u{width}", copy=False)
        # A piece of a table on the disk is encoded from there.
        yield width, cast("bytes", piece.data.cast("B")) if is_on_disk(piece) else piece.tobytes()


class IncomingTable:
    """A table of this `shape` that arrives in pieces; `dearest` is an upper bound on its finite costs.

    Memory, or space `on_disk`, is allocated when the first piece arrives; check `bytes_of` before that.
    """

    def __init__(self, shape: Sequence[int], dearest: int, *, on_disk: bool = False) -> None:
        self._shape = shape
        self._on_disk = on_disk
        self._dearest = dearest
        self._left = math.prod(shape)
        self._costs: Codes | None = None

    @property
    def complete(self) -> bool:
        """True if the whole table has arrived."""
        return not self._left

    @property
    def costs(self) -> Codes:
        """The costs that have arrived so far. Raises `ValueError` before the first piece."""
        if self._costs is None:
            raise ValueError("no piece of the table has arrived")
        return self._costs

    def add(self, width: Width, piece: bytes) -> None:
        """Append the next piece. Raises `ValueError` if the bytes do not fit, `TooLargeError` if the disk is full."""
        if width > width_of(self._dearest) or (self._costs is not None and width != self._costs.itemsize):
            raise ValueError(f"a piece of the table has {width} bytes a cost, not as many as the other pieces")
        if len(piece) % width or not 0 < len(piece) // width <= self._left:
            lack = f"the table lacks {self._left:,} costs"
            raise ValueError(f"{len(piece):,} bytes with {width} a cost do not fit, as {lack}")
        codes = np.frombuffer(piece, f"<u{width}")
        if _max_finite(codes) > self._dearest:
            raise ValueError(f"a cost is {_max_finite(codes):,}, above the announced maximum of {self._dearest:,}")
        if self._costs is None:
            self._costs = empty_table(self._shape, codes.dtype, on_disk=self._on_disk)
        start = self._costs.size - self._left
        self._costs.reshape(-1)[start : start + codes.size] = codes
        release_pages(self._costs)
        self._left -= codes.size


def _stored(table: Table | CoarseTable) -> Table:
    """Return the array in which `table` is stored."""
    return table.costs if isinstance(table, CoarseTable) else table


def expanded(table: Table | CoarseTable) -> Table:
    """Return `table` with all indices of the join."""
    return table.expanded() if isinstance(table, CoarseTable) else table


class IncomingTables:
    """Tables that arrive in pieces, one table after the other."""

    def __init__(self, tables: Sequence[IncomingTable]) -> None:
        self.tables = tables

    @property
    def complete(self) -> bool:
        """True if all tables have arrived."""
        return self.tables[-1].complete

    @property
    def costs(self) -> Codes:
        """The costs of the first table."""
        return self.tables[0].costs

    def add(self, width: Width, piece: bytes) -> None:
        """Append the next piece to the first incomplete table. Raises errors as `IncomingTable.add`."""
        next((table for table in self.tables if not table.complete), self.tables[-1]).add(width, piece)


def _part(table: Table | CoarseTable, place: Sequence[int]) -> Table:
    """Return the part of `table` at these indices on the first axes after this robot's."""
    if isinstance(table, CoarseTable):
        return table.leading(place).expanded()
    steps = [index if length > 1 else 0 for index, length in zip(place, table.shape[1:], strict=False)]
    index: tuple[slice | int, ...] = (slice(None), *steps)
    return table[index]


def _floats(table: Table) -> Array:
    """Return the costs in `table` as floats."""
    costs = table.astype(np.float64, copy=False)
    if table.dtype.kind == "u":
        np.copyto(costs, np.inf, where=table == _top(table.itemsize))
    return costs


def part_of(table: Table | CoarseTable, index: Sequence[slice | int]) -> Table | CoarseTable:
    """Return the part of `table` at `index`: for each axis of the join all indices, one of them, or a slice of one."""
    return table.part(index) if isinstance(table, CoarseTable) else table[tuple(index)]


def costs_for(table: Table | CoarseTable, value: int) -> Array:
    """Return, as floats, the part of `table` at one index of its first axis; all of it if the axis has length 1."""
    if isinstance(table, CoarseTable):
        rest = [slice(None)] * (len(table.places) - 1)
        return _floats(table.part([value if table.shape[0] > 1 else 0, *rest]).expanded())
    return _floats(table[value : value + 1] if len(table) > 1 else table).reshape(table.shape[1:])


def place_at(table: NDArray[Any], places: Sequence[int]) -> tuple[int, ...]:
    """Return the index in `table` for `places` on the axes that it is aligned to; an axis of length 1 has one entry."""
    return tuple([place if length > 1 else 0 for place, length in zip(places, table.shape, strict=True)])


def cost_of(table: Table | CoarseTable, places: Sequence[int]) -> float:
    """Return the cost in `table` for `places` on the axes that it is aligned to."""
    if isinstance(table, CoarseTable):
        mapped = zip(places, table.places, strict=True)
        return cost_of(table.costs, [place if there is None else int(there[place]) for place, there in mapped])
    return cost_at(table, place_at(table, places))


def cost_at(table: Table, at: tuple[int, ...]) -> float:
    """Return the cost in one cell of `table`."""
    return math.inf if table.dtype.kind == "u" and table[at] == _top(table.itemsize) else float(table[at])


def _max_finite(costs: Codes) -> int:
    """Return the largest finite cost; 0 if there is none."""
    one = costs.dtype.type(1)
    # The code of `inf` plus one is 0.
    return max(0, max((int((part + one).max()) for part in _parts(costs)), default=0) - 1)


def _parts(costs: Codes) -> Iterator[Codes]:
    """Yield all of `costs` in parts of a block."""
    flat = costs.reshape(-1)
    for start in range(0, flat.size, BLOCK):
        yield flat[start : start + BLOCK]
        if start % RESIDENT < BLOCK:
            release_pages(costs)


def empty_table(shape: Sequence[int], kind: DTypeLike, *, on_disk: bool) -> NDArray[Any]:
    """Return a new array whose content is undefined. Raises `TooLargeError` if there is no space on the disk."""
    try:
        return empty_array(shape, kind, on_disk=on_disk)
    except OSError as error:
        size = math.prod(shape) * np.dtype(kind).itemsize
        raise TooLargeError(
            f"a table of {size:,} bytes cannot be stored in the folder for temporary files: {error.strerror or error}"
            " (free space there, or choose another folder by the environment variable TMPDIR)"
        ) from None


def release(*tables: NDArray[Any]) -> None:
    """Remove the pages of those tables that are on the disk from the memory."""
    for table in tables:
        release_pages(table)


def blocks_of(shape: Sequence[int]) -> Iterator[tuple[Any, ...]]:
    """Yield an index for each block of a table of this `shape`."""
    for place in itertools.product(*map(range, shape[: _stepped(shape, 1)])):
        yield (*place, ...)


def _stepped(shape: Sequence[int], own: int) -> int:
    """Return the number of leading axes to iterate over, so that the remaining axes form a block."""
    split, cells, most = len(shape), own, BLOCK * LONGEST
    while split and cells * shape[split - 1] <= most:
        split -= 1
        cells *= shape[split]
        most = BLOCK
    return split


def _choice(own: int) -> np.dtype[np.unsignedinteger[Any]]:
    return np.min_scalar_type(own - 1)


def _top(width: int) -> int:
    return (1 << 8 * width) - 1


def piece_in_words(costs: bytes, width: Width) -> str:
    """Return a piece of a table in words: `a piece of my table: 16 costs, from 17 to 24`.

    Raises:
        ValueError: if the bytes are not whole cells.
    """
    cells = np.frombuffer(costs, f"<u{width}")
    finite = cells[cells != np.iinfo(cells.dtype).max]
    piece = f"a piece of my table: {counted(len(cells), 'cost')}"
    if len(finite):
        piece += f", from {cost_text(int(finite.min()))} to {cost_text(int(finite.max()))}"
    infinite = len(cells) - len(finite)
    return f"{piece}, and {infinite:,} infinite" if infinite else piece


def cells_of(costs: bytes, width: Width) -> list[float]:
    """Return the costs in a piece of a table. Raises `ValueError` if the bytes are not whole cells."""
    cells = np.frombuffer(costs, f"<u{width}")
    top = _top(width)
    return [math.inf if cell == top else cell for cell in cells.tolist()]
