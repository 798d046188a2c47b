"""A cache of solved networks in the user's cache folder.

The name of a file is the digest of the network and of the versions that determine the answer, so other versions use
other files. The file begins with the digest of its content and repeats its name: truncated, changed and misplaced files
are detected, removed and written again. Files are written under another name and then renamed, so concurrent runs see
only complete files. Nothing in them is executed or unpickled.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path

import msgspec

from robochoc.solver.encoding import Codes, Network
from robochoc.system.files import write_atomically

FORMAT = 1
"""The version of the file format and the encoding of networks."""
MAX_BYTES = 64 << 20
SUFFIX = ".solutions"
_DIGEST_BYTES = 32


class _Entry(msgspec.Struct, frozen=True, array_like=True):
    """`count` solutions with `width` codes each, four bytes for each code."""

    key: str
    width: int
    count: int
    codes: bytes


class SolutionCache:
    """The cache in `folder`, which is created when needed. Errors in reading and writing are ignored."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder

    @cached_property
    def folder(self) -> Path:
        """The folder of the cache files; determined on first use, because most robots need no solver."""
        return self._folder or cache_folder()

    @cached_property
    def _versions(self) -> tuple[int, str]:
        return FORMAT, _solver_version()

    def key(self, network: Network) -> str:
        """Return the key of `network`. Equal networks have equal keys, whatever their robot or team."""
        return _digest(msgspec.msgpack.encode((self._versions, network))).hex()

    def get(self, network: Network) -> tuple[Codes, ...] | None:
        """Return all solutions of `network`. None: they are not in the cache."""
        path = self._path(self.key(network))
        try:
            content = path.read_bytes()
        except OSError:
            return None
        solutions = _read(content, path.stem, len(network.domains))
        if solutions is None:
            with suppress(OSError):
                path.unlink()
        return solutions

    def put(self, network: Network, solutions: tuple[Codes, ...]) -> None:
        """Store all solutions of `network`, unless there are too many, or the folder is not writable."""
        key, width = self.key(network), len(network.domains)
        codes = array("i", (code for solution in solutions for code in solution)).tobytes()
        if len(codes) > MAX_BYTES:
            return
        body = msgspec.msgpack.encode(_Entry(key, width, len(solutions), codes))
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomically(self._path(key), _digest(body) + body)

    def files(self) -> Iterator[Path]:
        """Yield the cache's files."""
        with suppress(OSError):
            yield from sorted(path for path in self.folder.glob(f"*{SUFFIX}") if path.is_file())

    def clear(self) -> int:
        """Remove all files, and return their number. Raises `OSError` if a file cannot be removed."""
        gone = 0
        for path in self.files():
            path.unlink(missing_ok=True)
            gone += 1
        return gone

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"


def cache_folder() -> Path:
    """Return the user's cache folder (`~/.cache/robochoc` on Linux; `XDG_CACHE_HOME` is respected)."""
    from platformdirs import user_cache_path  # noqa: PLC0415 - only solvers have a cache

    return user_cache_path("robochoc")


def _read(content: bytes, key: str, width: int) -> tuple[Codes, ...] | None:
    """Return the solutions in a cache file. None: the file is invalid."""
    digest, body = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
    if _digest(body) != digest:
        return None
    try:
        entry = msgspec.msgpack.decode(body, type=_Entry)
    except (msgspec.MsgspecError, RecursionError):
        return None
    numbers = array("i")
    if entry.key != key or entry.width != width or len(entry.codes) != width * entry.count * numbers.itemsize:
        return None
    numbers.frombytes(entry.codes)
    flat = numbers.tolist()
    return tuple(tuple(flat[start : start + width]) for start in range(0, len(flat), width))


def _digest(content: bytes) -> bytes:
    import hashlib  # noqa: PLC0415 - start-up: most robots need no cache

    return hashlib.blake2b(content, digest_size=_DIGEST_BYTES).digest()


def _solver_version() -> str:
    """Return pycsp3's version without importing it (it patches built-in types) or package metadata (slow)."""
    from importlib.util import find_spec  # noqa: PLC0415 - start-up: the same

    found = find_spec("pycsp3")
    if found is None or found.origin is None:
        return "none"
    try:
        return Path(found.origin).with_name("version.txt").read_text(encoding="utf-8").strip()
    except OSError:
        return "unknown"
