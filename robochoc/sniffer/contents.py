"""The contents of a trace's messages, packed: a million of them take as much memory as in transit."""

from __future__ import annotations

from array import array
from typing import Any

import msgspec

from robochoc.sniffer.columns import longs


class Contents:
    """The contents of messages, by their numbers. Rows are stored in pages of 4 MiB, so growing copies nothing."""

    _LARGEST = 1 << 22

    def __init__(self) -> None:
        self._pages: list[bytearray] = [bytearray()]
        self._page: array[int] = longs()
        self._end: array[int] = longs()
        self._encode = msgspec.msgpack.Encoder().encode
        self._decode = msgspec.msgpack.Decoder().decode

    def append(self, content: dict[str, Any]) -> None:
        """Append the content of the next message."""
        packed = self._packed(content)
        page = self._pages[-1]
        if len(page) + len(packed) > self._LARGEST and page:
            page = bytearray()
            self._pages.append(page)
        page += packed
        self._page.append(len(self._pages) - 1)
        self._end.append(len(page))

    def __getitem__(self, number: int) -> dict[str, Any]:
        page = self._page[number]
        first = self._end[number - 1] if number and self._page[number - 1] == page else 0
        content: dict[str, Any] = self._decode(memoryview(self._pages[page])[first : self._end[number]])
        return content

    def _packed(self, content: dict[str, Any]) -> bytes:
        try:
            return self._encode(content)
        except (msgspec.MsgspecError, OverflowError, TypeError, ValueError, RecursionError):
            return self._encode({name: str(value)[:1000] for name, value in content.items()})
