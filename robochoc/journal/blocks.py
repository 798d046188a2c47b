"""A journal's frame: blocks in a chain of checksums, so that none can be missing, doubled, in a wrong place or altered.

docs/guides/journal.md has every byte of it. The checksum is BLAKE2b (RFC 7693), the compression zlib's (RFC 1950).
"""

from __future__ import annotations

import struct
import zlib
from hashlib import blake2b

from robochoc.journal.entries import JournalError
from robochoc.system.errors import RobochocError

MAGIC = b"\x89RJL\r\n\x1a\n"
"""The first bytes of a journal; transfers that take it for text destroy them, as PNG's (RFC 2083)."""
FORMAT = 1
"""The version of the frame, and of the columns within."""
MAX_BLOCK_BYTES = 64 * 2**20
"""No block holds more bytes, uncompressed."""
LEVEL = 4
"""zlib's. Level 1 packs ABT's messages 7 to 13 % worse, level 6 3 to 7 % better, at about half and twice the cost."""
_PREAMBLE = struct.Struct("<8sHH")
_FRAME = struct.Struct("<II16s")
_DIGEST = 16
_LARGEST_PACKED = MAX_BLOCK_BYTES + MAX_BLOCK_BYTES // 1000 + 64
"""More than zlib makes of the largest block."""

PREAMBLE = _PREAMBLE.pack(MAGIC, FORMAT, 0)


class JournalDamagedError(RobochocError):
    """The journal is unreadable from this place on. The message has the place and the reason."""


class JournalTruncatedError(JournalDamagedError):
    """Only the end is missing. The rest is undamaged."""


def _digest(before: bytes, packed: bytes, size: int) -> bytes:
    """Return the checksum of a block: of the one before, its lengths, and what it holds."""
    lengths = struct.pack("<II", len(packed), size)
    return blake2b(before + lengths + packed, digest_size=_DIGEST).digest()


BEGINNING = blake2b(PREAMBLE, digest_size=_DIGEST).digest()
"""The checksum before the first block's."""


def frame_block(content: bytes, before: bytes) -> tuple[bytes, bytes]:
    """Return the block that holds `content`, whose length is at most `MAX_BLOCK_BYTES`, and its checksum.

    `before` is the checksum of the block before it, `BEGINNING` for the first.
    """
    packed = zlib.compress(content, LEVEL)
    digest = _digest(before, packed, len(content))
    return _FRAME.pack(len(packed), len(content), digest) + packed, digest


class BlockReader:
    """Takes a journal apart, as its bytes come."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._place = 0
        self._before = b""

    def feed(self, content: bytes) -> None:
        """Append the next bytes."""
        self._buffer += content

    @property
    def rest(self) -> str:
        """Return the damage if no more bytes follow. Empty: none."""
        return f"byte {self._place:,}: it ends within a block" if self._buffer or not self._before else ""

    @property
    def place(self) -> str:
        """Return where the next block begins, in words."""
        return f"byte {self._place:,}"

    def next(self) -> bytes | None:
        """Return the content of the next block. None: it is not complete yet.

        Raises:
            JournalError: if it is not a journal of this version.
            JournalDamagedError: if a block is not as it was written.
        """
        if not self._before and not self._begin():
            return None
        buffer = self._buffer
        if len(buffer) < _FRAME.size:
            return None
        length, size, digest = _FRAME.unpack_from(buffer)
        if size > MAX_BLOCK_BYTES or length > _LARGEST_PACKED:
            raise JournalDamagedError(f"{self.place}: a block claims to have {max(size, length):,} bytes")
        end = _FRAME.size + length
        if len(buffer) < end:
            return None
        packed = bytes(memoryview(buffer)[_FRAME.size : end])
        if _digest(self._before, packed, size) != digest:
            raise JournalDamagedError(f"{self.place}: the checksum of a block is wrong")
        content = self._unpacked(packed, size)
        del buffer[:end]
        self._before = digest
        self._place += end
        return content

    def _begin(self) -> bool:
        """Return whether the preamble is there."""
        if len(self._buffer) < _PREAMBLE.size:
            if not MAGIC.startswith(self._buffer[: len(MAGIC)]):
                raise JournalError("it is not a journal")
            return False
        magic, version, _ = _PREAMBLE.unpack_from(self._buffer)
        if magic != MAGIC:
            raise JournalError("it is not a journal")
        if version != FORMAT:
            raise JournalError(f"it is a journal of format {version}, and this robochoc reads format {FORMAT}")
        self._before = blake2b(self._buffer[: _PREAMBLE.size], digest_size=_DIGEST).digest()
        self._place = _PREAMBLE.size
        del self._buffer[: _PREAMBLE.size]
        return True

    def _unpacked(self, packed: bytes, size: int) -> bytes:
        unpacker = zlib.decompressobj()
        try:
            content = unpacker.decompress(packed, size + 1)
        except zlib.error as error:
            raise JournalDamagedError(f"{self.place}: a block cannot be unpacked: {error}") from error
        if len(content) != size or not unpacker.eof or unpacker.unused_data:
            raise JournalDamagedError(f"{self.place}: a block has another length than it claims")
        return content
