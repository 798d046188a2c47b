"""The content of a block in a journal: its entries in columns, as msgpack (docs/guides/journal.md).

Most entries belong to four kinds. For each of their fields, the values are stored together, which compresses best.
Other entries are stored one by one. Each block can be read without the previous blocks.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, compress
from math import isfinite
from operator import sub
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from robochoc.journal.entries import JournalEntry
from robochoc.journal.events import Decided, Received, Sent, Settled
from robochoc.system.errors import RobochocError
from robochoc.system.garbage import collection_paused

SENT, RECEIVED, SETTLED, DECIDED, OTHER = range(5)
"""The kinds of entries in `_Block.kinds`."""
NANOSECONDS = 1_000_000_000
_LARGEST = 2**63
_TOO_LARGE = "a count is too large"
_ONLY = [bytes(kind == other for other in range(256)) for kind in range(OTHER)]
"""For each kind of timed entries, a translation of kinds to 1 for this kind, and 0 for all others."""
_OTHERS, _NO_MESSAGES = bytes([OTHER]), bytes([SETTLED, DECIDED, OTHER])

_Index = Annotated[int, Meta(ge=0)]


class BlockError(RobochocError, ValueError):
    """Raised if the content of a block cannot be decoded to entries."""


class _Block(msgspec.Struct, array_like=True, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Columns, each in the order of the entries. Texts are stored once, in `words`, and referred to by their index.

    A shape is a message's type with the names of its fields. The `values` are stored one after the other. `actors` are
    the robots of the entries (senders or receivers), `partners` the other robots of messages, `says` the messages'
    shapes.
    """

    words: list[str]
    shapes: list[Annotated[list[_Index], Meta(min_length=1)]]
    kinds: bytes
    scale: Literal[0, 1, 1_000_000_000]
    times: list[int] | bytes
    clocks: list[int]
    actors: list[_Index]
    partners: list[_Index]
    says: list[_Index]
    values: list[Any]
    sizes: list[int]
    checks: list[int]
    assignments: list[dict[str, int]]
    others: list[JournalEntry]


class _Numbering(dict[Any, int]):
    """Numbers keys from 0 on, in the order of their first use."""

    def __missing__(self, key: object) -> int:
        self[key] = number = len(self)
        return number


_encode = msgspec.msgpack.Encoder().encode
_json = msgspec.json.Encoder(decimal_format="number").encode


def columns_of(entries: Iterable[JournalEntry], *, exact: bool) -> bytes:
    """Return the content of a block with `entries`. Unless `exact`, times are rounded to nanoseconds, like clocks.

    Raises `TypeError`, `ValueError`, `OverflowError` or `RecursionError` for entries that `entries_of` would reject:
    robots on other machines may report anything, and later entries must not be lost with them.
    """
    columns = _Columns()
    columns.add(entries)
    columns.check()
    return columns.packed(exact=exact)


class _Columns:
    """Columns to which entries are added."""

    def __init__(self) -> None:
        self.words, self.shapes = _Numbering(), _Numbering()
        self.kinds = bytearray()
        self.times: list[float] = []
        self.clocks: list[int] = []
        self.actors: list[int] = []
        self.partners: list[int] = []
        self.says: list[int] = []
        self.values: list[Any] = []
        self.sizes: list[int] = []
        self.checks: list[int] = []
        self.checked: list[int] = []
        self.assignments: list[dict[str, int]] = []
        self.others: list[JournalEntry] = []

    def add(self, entries: Iterable[JournalEntry]) -> None:
        """Add `entries`. This loop dominates the cost of a journal, so it compares exact types and makes few calls."""
        kinds, times, clocks, actors = self.kinds.append, self.times.append, self.clocks.append, self.actors.append
        partners, says, words, shapes = self.partners.append, self.says.append, self.words, self.shapes
        values, sizes = self.values.extend, self.sizes.append
        checked: dict[str, int] = {}
        checks, totals = self.checks.append, self.checked.append
        last: dict[str, Any] | None = None
        kind, shape = "", 0
        for entry in entries:
            if type(entry) is Sent:
                kinds(SENT)
                actors(words[entry.sender])
                partners(words[entry.receiver])
                content = entry.content
                if content is not last or entry.type != kind:  # a message to several robots has one content
                    last, kind = content, entry.type
                    shape = shapes[kind, *content]
                says(shape)
                values(content.values())
                sizes(entry.bytes)
            elif type(entry) is Received:
                kinds(RECEIVED)
                actors(words[entry.receiver])
                partners(words[entry.sender])
                says(shapes[entry.type,])
            elif type(entry) is Settled:
                kinds(SETTLED)
                robot, done = entry.robot, entry.checks
                actors(words[robot])
                checks(done - checked.get(robot, 0))
                checked[robot] = done
                totals(done)
            elif type(entry) is Decided:
                kinds(DECIDED)
                actors(words[entry.robot])
                self.assignments.append(entry.assignment)
            else:
                kinds(OTHER)
                self.others.append(entry)
                continue
            times(entry.t)
            clocks(entry.clock)

    def check(self) -> None:
        """Raise an exception if the entries could not be read back."""
        _json(self.values)
        _int64s(self.clocks)
        _int64s(self.checked)
        _finite(entry.t for entry in self.others)

    def packed(self, *, exact: bool) -> bytes:
        """Return all columns as msgpack."""
        shapes = [[self.words[word] for word in shape] for shape in self.shapes]  # may add words
        scale, times = _scaled(self.times, exact=exact)
        return _encode(
            _Block(
                words=list(self.words),
                shapes=shapes,
                kinds=bytes(self.kinds),
                scale=scale,
                times=times,
                clocks=_steps(self.clocks),
                actors=self.actors,
                partners=self.partners,
                says=self.says,
                values=self.values,
                sizes=self.sizes,
                checks=self.checks,
                assignments=self.assignments,
                others=self.others,
            )
        )


def _scaled(times: Iterable[float], *, exact: bool) -> tuple[Literal[0, 1, 1_000_000_000], list[int] | bytes]:
    """Return times as a scale and the differences between integers of 1 / scale, or as doubles with the scale 0."""
    times = array("d", times)
    if all(map(float.is_integer, times)) and _fit_in_steps(times, 1):
        return 1, _steps(map(int, times))
    if not exact and all(map(isfinite, times)) and _fit_in_steps(times, NANOSECONDS):
        return 1_000_000_000, _steps([round(t * NANOSECONDS) for t in times])
    doubles = array("d", [t if isfinite(t) else 0.0 for t in times])  # an untrusted clock may return NaN
    if sys.byteorder == "big":
        doubles.byteswap()
    return 0, doubles.tobytes()


def _fit_in_steps(times: Sequence[float], scale: int) -> bool:
    """Return whether the differences between `times`, in units of 1 / `scale`, fit into 64 bits."""
    return max(map(abs, times), default=0) * scale < _LARGEST // 2


def _steps(numbers: Iterable[int]) -> list[int]:
    """Return the difference of each number from the previous one."""
    numbers = list(numbers)
    return list(map(sub, numbers, [0, *numbers]))


_decode = msgspec.msgpack.Decoder(_Block).decode


def entries_of(content: bytes) -> list[JournalEntry]:
    """Return the entries in a block with `content`.

    Raises:
        BlockError: if `content` does not have the form written by `columns_of`.
    """
    try:
        with collection_paused():
            block = _decode(content)
            _json(block.values)  # msgpack may contain what messages cannot: keys that are not texts, and extensions
            return _EntryDecoder(block).entries()
    except (msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError, LookupError) as error:
        raise BlockError(str(error)) from error


class _EntryDecoder:
    """Decodes the entries of a block. Raises `ValueError` or `LookupError` if columns are inconsistent."""

    def __init__(self, block: _Block) -> None:
        sent, received, settled, decided, others = map(block.kinds.count, range(5))
        timed = len(block.kinds) - others
        _fit(block.actors, timed)
        _fit(block.clocks, timed)
        _fit(block.partners, sent + received)
        _fit(block.says, sent + received)
        _fit(block.sizes, sent)
        _fit(block.checks, settled)
        _fit(block.assignments, decided)
        _fit(block.others, others)
        if sent + received + settled + decided != timed:
            raise ValueError("a kind of entries is unknown")
        self._block = block
        self._actors = [block.words[place] for place in block.actors]
        self._shapes = [_message_shape(shape, block.words) for shape in block.shapes]
        self._times, self._clocks = _times(block), _int64s(accumulate(block.clocks))
        _fit(self._times, timed)
        _finite((*self._times, *(entry.t for entry in block.others)))

    def entries(self) -> list[JournalEntry]:
        """Return all entries. Each kind is decoded by itself, with few calls per entry."""
        kinds = self._block.kinds
        decoded = map(iter, (self._sent(), self._received(), self._settled(), self._decided(), self._block.others))
        return list(map(next, map([*decoded].__getitem__, kinds)))

    def _columns(self, kind: int, *columns: Iterable[Any]) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of one kind of entries from columns of all timed entries."""
        chosen = self._block.kinds.translate(_ONLY[kind], _OTHERS)
        return zip(*(compress(column, chosen) for column in columns), strict=True)

    def _messages(self, kind: int) -> tuple[list[str], list[tuple[str, tuple[str, ...]]]]:
        """Return the other robots of messages of one kind, and their shapes."""
        block = self._block
        chosen = block.kinds.translate(_ONLY[kind], _NO_MESSAGES)
        partners = [self._block.words[place] for place in compress(block.partners, chosen)]
        return partners, [self._shapes[place] for place in compress(block.says, chosen)]

    def _sent(self) -> list[JournalEntry]:
        block = self._block
        partners, shapes = self._messages(SENT)
        if sum(len(fields) for _, fields in shapes) != len(block.values):
            raise ValueError("the number of values differs from the number of the messages' fields")
        values = iter(block.values)
        contents = [dict(zip(fields, values, strict=False)) for _, fields in shapes]  # `values` continues in the next
        return [
            Sent(t=t, sender=actor, receiver=partner, type=kind, content=content, bytes=size, clock=clock)
            for (t, actor, clock), partner, (kind, _), content, size in zip(
                self._columns(SENT, self._times, self._actors, self._clocks), partners, shapes, contents, block.sizes,
                strict=True,
            )
        ]  # fmt: skip

    def _received(self) -> list[JournalEntry]:
        partners, shapes = self._messages(RECEIVED)
        rows = self._columns(RECEIVED, self._times, self._actors, self._clocks)
        return [
            Received(t=t, sender=partner, receiver=actor, type=kind, clock=clock)
            for (t, actor, clock), partner, (kind, _) in zip(rows, partners, shapes, strict=True)
        ]

    def _settled(self) -> list[JournalEntry]:
        checked: dict[str, int] = {}
        found: list[JournalEntry] = []
        rows = self._columns(SETTLED, self._times, self._actors, self._clocks)
        for (t, actor, clock), more in zip(rows, self._block.checks, strict=True):
            checked[actor] = checks = checked.get(actor, 0) + more
            found.append(Settled(t=t, robot=actor, clock=clock, checks=checks))
            if not -_LARGEST <= checks < _LARGEST:
                raise ValueError(_TOO_LARGE)
        return found

    def _decided(self) -> list[JournalEntry]:
        rows = self._columns(DECIDED, self._times, self._actors, self._clocks)
        return [
            Decided(t=t, robot=actor, assignment=assignment, clock=clock)
            for (t, actor, clock), assignment in zip(rows, self._block.assignments, strict=True)
        ]


def _fit(column: Sequence[object], count: int) -> None:
    if len(column) != count:
        raise ValueError(f"a column has {len(column)} items, not {count}")


def _message_shape(shape: Sequence[int], words: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """Return the type of a message, and the names of its fields."""
    name, *fields = (words[place] for place in shape)
    if len({*fields}) < len(fields):
        raise ValueError(f"a message of type {name!r} has two fields with the same name")
    return name, tuple(fields)


def _times(block: _Block) -> Sequence[float]:
    """Return the times of the entries of the four kinds, in the runtime's unit."""
    if isinstance(block.times, bytes):
        if block.scale:
            raise ValueError("times are doubles, but have a scale")
        doubles = array("d")
        doubles.frombytes(block.times)
        if sys.byteorder == "big":
            doubles.byteswap()
        return doubles
    if not block.scale:
        raise ValueError("times are whole numbers, but have no scale")
    return [number / block.scale for number in _int64s(accumulate(block.times))]


def _finite(times: Iterable[float]) -> None:
    if not all(map(isfinite, times)):
        raise ValueError("a time is not a number")


def _int64s(numbers: Iterable[int]) -> list[int]:
    """Return `numbers`. Raises `ValueError` if a number does not fit into 64 bits."""
    numbers = list(numbers)
    if numbers and not (min(numbers) >= -_LARGEST and max(numbers) < _LARGEST):
        raise ValueError(_TOO_LARGE)
    return numbers
