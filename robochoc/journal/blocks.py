"""The frame of a journal: blocks chained by checksums, which reveal missing, duplicate, moved and altered blocks.

docs/guides/journal.md describes every byte. The checksum is BLAKE2b (RFC 7693), the compression zlib (RFC 1950).
"""

from __future__ import annotations

import struct
import zlib
from hashlib import blake2b

from robochoc.journal.entries import JournalError
from robochoc.system.errors import RobochocError

MAGIC = b"\x89RJL\r\n\x1a\n"
"""The first bytes of a journal. Like those of PNG (RFC 2083), they are destroyed by transfers in text mode."""
FORMAT = 1
"""The version of the frame, and of the columns inside."""
MAX_BLOCK_BYTES = 64 * 2**20
"""The maximum number of uncompressed bytes in a block."""
LEVEL = 4
"""The compression level of zlib. Level 1 makes ABT messages 7-13 % longer at half the cost, 6 makes 3-7 % at twice."""
_PREAMBLE = struct.Struct("<8sHH")
_FRAME = struct.Struct("<II16s")
_DIGEST = 16
_LARGEST_PACKED = MAX_BLOCK_BYTES + MAX_BLOCK_BYTES // 1000 + 64
"""An upper bound on the compressed size of the largest block."""

PREAMBLE = _PREAMBLE.pack(MAGIC, FORMAT, 0)


class JournalDamagedError(RobochocError):
    """Raised if the journal cannot be read beyond some position. The message contains the position and the reason."""


class JournalTruncatedError(JournalDamagedError):
    """Raised if only the end of the journal is missing. The rest is undamaged."""


def _digest(before: bytes, packed: bytes, size: int) -> bytes:
    """Return the checksum of a block, computed from the previous checksum, the block's lengths, and its content."""
    lengths = struct.pack("<II", len(packed), size)
    return blake2b(before + lengths + packed, digest_size=_DIGEST).digest()


BEGINNING = blake2b(PREAMBLE, digest_size=_DIGEST).digest()
"""The checksum that precedes the first block."""


def frame_block(content: bytes, before: bytes) -> tuple[bytes, bytes]:
    """Return the block with `content`, of at most `MAX_BLOCK_BYTES` bytes, and its checksum.

    `before` is the checksum of the previous block, or `BEGINNING` for the first block.
    """
    packed = zlib.compress(content, LEVEL)
    digest = _digest(before, packed, len(content))
    return _FRAME.pack(len(packed), len(content), digest) + packed, digest


class BlockReader:
    """Reads the blocks of a journal from pieces of its bytes."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._place = 0
        self._before = b""

    def feed(self, content: bytes) -> None:
        """Append the next bytes."""
        self._buffer += content

    @property
    def rest(self) -> str:
        """The damage if no more bytes follow; empty if there is no damage."""
        return f"byte {self._place:,}: it ends within a block" if self._buffer or not self._before else ""

    @property
    def place(self) -> str:
        """The start of the next block, in words."""
        return f"byte {self._place:,}"

    def next(self) -> bytes | None:
        """Return the content of the next block, or None if the block is not yet complete.

        Raises:
            JournalError: if the bytes are not a journal of this version.
            JournalDamagedError: if a block is damaged.
        """
        if not self._before and not self._read_preamble():
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
        content = self._decompressed(packed, size)
        del buffer[:end]
        self._before = digest
        self._place += end
        return content

    def _read_preamble(self) -> bool:
        """Return whether the preamble is complete."""
        if len(self._buffer) < _PREAMBLE.size:
            if not MAGIC.startswith(self._buffer[: len(MAGIC)]):
                raise JournalError("it is not a journal")
            return False
        magic, version, _ = _PREAMBLE.unpack_from(self._buffer)
        if magic != MAGIC:
            raise JournalError("it is not a journal")
        if version != FORMAT:
            raise JournalError(f"it has the format {version}, but this robochoc reads format {FORMAT}")
        self._before = blake2b(self._buffer[: _PREAMBLE.size], digest_size=_DIGEST).digest()
        self._place = _PREAMBLE.size
        del self._buffer[: _PREAMBLE.size]
        return True

    def _decompressed(self, packed: bytes, size: int) -> bytes:
        unpacker = zlib.decompressobj()
        try:
            content = unpacker.decompress(packed, size + 1)
        except zlib.error as error:
            raise JournalDamagedError(f"{self.place}: a block cannot be decompressed: {error}") from error
        if len(content) != size or not unpacker.eof or unpacker.unused_data:
            raise JournalDamagedError(f"{self.place}: a block does not have the length that it claims")
        return content
