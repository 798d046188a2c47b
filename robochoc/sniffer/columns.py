"""Growing columns of numbers, which can be sent to a page, and the packed contents of messages."""

from __future__ import annotations

import sys
from array import array
from bisect import bisect_right
from collections.abc import Iterable
from typing import Any, TypeAlias

import msgspec

NOT_YET = 0xFFFFFFFF
"""The value that stands for a missing step or message in columns of 4-byte unsigned integers."""

Column: TypeAlias = "array[float] | array[int]"


def floats() -> array[float]:
    """Return an empty column of 8-byte floats."""
    return array("d")


def longs() -> array[int]:
    """Return an empty column of 4-byte unsigned integers."""
    return array("I")


def shorts() -> array[int]:
    """Return an empty column of 2-byte unsigned integers."""
    return array("H")


def packed_columns(parts: Iterable[Column]) -> bytes:
    """Return the bytes of the columns one after the other, little-endian."""
    return b"".join(map(_little_endian, parts))


def _little_endian(column: Column) -> bytes:
    if sys.byteorder == "big":
        column = column[:]
        column.byteswap()
    return column.tobytes()


class Contents:
    """The packed contents of messages, by message number, in pages of 4 MiB that are never copied.

    They need as much memory as the messages had bytes on the network.
    """

    _LARGEST = 1 << 22

    def __init__(self) -> None:
        self._pages: list[bytearray] = [bytearray()]
        self._first = [0]
        """The first message of each page."""
        self._end: array[int] = longs()
        self._encode = msgspec.msgpack.Encoder().encode
        self._decode = msgspec.msgpack.Decoder().decode

    def extend(self, contents: Iterable[dict[str, Any]]) -> None:
        """Append the contents of the next messages."""
        encode, page, ends = self._encode, self._pages[-1], self._end
        for content in contents:
            try:
                packed = encode(content)
            except (msgspec.MsgspecError, OverflowError, TypeError, ValueError, RecursionError):
                packed = encode({name: str(value)[:1000] for name, value in content.items()})
            if len(page) + len(packed) > self._LARGEST and page:
                page = bytearray()
                self._pages.append(page)
                self._first.append(len(ends))
            page += packed
            ends.append(len(page))

    def __getitem__(self, number: int) -> dict[str, Any]:
        content: dict[str, Any] = self._decode(self.packed(number))
        return content

    def packed(self, number: int) -> bytes:
        """Return the content of a message as msgpack."""
        page = bisect_right(self._first, number) - 1
        start = self._end[number - 1] if number > self._first[page] else 0
        return bytes(self._pages[page][start : self._end[number]])
