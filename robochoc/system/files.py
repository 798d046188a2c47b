"""Files that are whole or not there, also when the program is killed while it writes."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

_NO_UNNAMED = {errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL}
"""How file systems and kernels say that they know no unnamed files."""


def write_atomically(path: Path, content: bytes, mode: int = 0o666) -> None:
    """Write `content` to `path`; whoever looks sees the old file or the whole new one.

    It is written beside `path` and then renamed. Where Linux allows it the file has no name until it is complete, so
    that not even SIGKILL leaves a trace. Devices, pipes, and what standard output or error already go to (such as
    `/dev/stdout`) are written to as they are; symbolic links are followed. The file has the permissions `mode`, less
    the umask, from its first byte on: secrets take 0o600. Raises `OSError`; nothing is left behind then.
    """
    stream = _stream_to(path)
    if stream is not None:
        with os.fdopen(os.dup(stream), "wb") as open_already:
            open_already.write(content)
        return
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    os.close(_replaced(resolved(path), content, mode))


class AppendableFile:
    """A file that takes the place of `path` once its `beginning` is written, and then grows.

    Whoever looks sees the old file, or the beginning and whatever was appended since. Otherwise as
    `write_atomically`. Raises `OSError`. Processes forked meanwhile have the descriptor too, but nothing is buffered.
    """

    def __init__(self, path: Path, beginning: bytes, mode: int = 0o666) -> None:
        self._size = 0
        self._torn = False
        stream = _stream_to(path)
        self._own = stream is None and not (path.exists() and not path.is_file())
        if self._own:
            self._descriptor = _replaced(resolved(path), beginning, mode)
            self._size = len(beginning)
            return
        self._descriptor = os.open(path, os.O_WRONLY) if stream is None else os.dup(stream)
        try:
            self.append(beginning)
        except BaseException:
            self.close()
            raise

    def append(self, content: bytes) -> None:
        """Write all of `content` behind what is there. Raises `OSError`; of a file of our own nothing is added then.

        Whoever was interrupted by a signal's exception may append the same again: it is written in the same place.
        """
        if not self._own:
            self._stream(content)
            return
        done = 0
        try:
            while done < len(content):
                done += os.pwrite(self._descriptor, memoryview(content)[done:], self._size + done)
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise
        self._size += done

    def _stream(self, content: bytes) -> None:
        if self._torn:
            raise OSError(errno.EIO, "an interrupt came between two bytes")
        self._torn = True  # where it stopped is not known any more
        _write_all(self._descriptor, content)
        self._torn = False

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)


class PendingFile:
    """A file that takes the place of `path` when it is complete: write to `stream`, then `keep` or `discard` it.

    Whoever looks meanwhile sees the old file. Where Linux allows it the new one has no name until then, so that not
    even SIGKILL leaves a trace. Symbolic links are followed; what is no file (devices, pipes, and what standard output
    goes to) is refused. Raises `OSError`.
    """

    def __init__(self, path: Path, mode: int = 0o666) -> None:
        self._target = resolved(path)
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if _stream_to(path) is not None or (path.exists() and not path.is_file()):
            raise OSError(errno.ENOTSUP, "is no file that could be replaced", str(path))
        self._named: Path | None = None
        descriptor = _unnamed(self._target, mode)
        if descriptor is None:
            self._named = _beside(self._target)
            descriptor = os.open(self._named, os.O_CREAT | os.O_EXCL | os.O_RDWR, mode)
        self.stream = os.fdopen(descriptor, "w+b")

    def keep(self) -> None:
        """Put the file in its place. Raises `OSError`; nothing is left behind then."""
        try:
            self.stream.flush()
            if self._named is None:
                self._named = _linked(self.stream.fileno(), self._target) or self._copied()
            self._named.replace(self._target)
        except BaseException:
            self.discard()
            raise
        self._named = None
        self.stream.close()

    def discard(self) -> None:
        """Leave nothing behind. Does nothing when that has been done, or the file has been kept."""
        with suppress(OSError):  # what is still buffered may not fit
            self.stream.close()
        if self._named is not None:
            self._named.unlink(missing_ok=True)
            self._named = None

    def _copied(self) -> Path:
        """Return the same once more, with a name: for systems that give none to what had none."""
        import shutil  # noqa: PLC0415 - start-up: seldom needed

        self._named = _beside(self._target)
        mode = os.fstat(self.stream.fileno()).st_mode & 0o777
        self.stream.seek(0)
        with os.fdopen(os.open(self._named, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode), "wb") as copy:
            shutil.copyfileobj(self.stream, copy)
        return self._named


def resolved(path: Path) -> Path:
    """Return `path` as an absolute one, without symbolic links; the file need not be there.

    Raises `OSError` where the links lead in a circle. (`Path.resolve` raises `RuntimeError` then, or nothing, as the
    version of Python has it.)
    """
    try:
        path.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise
    return Path(os.path.realpath(path))


def _replaced(target: Path, content: bytes, mode: int) -> int:
    """Put a new file with `content` where `target` is; its descriptor, open for writing."""
    descriptor, complete = _written_unnamed(target, content, mode) or _written_named(target, content, mode)
    try:
        complete.replace(target)
    except BaseException:
        complete.unlink(missing_ok=True)
        os.close(descriptor)
        raise
    return descriptor


def _stream_to(path: Path) -> int | None:
    """Return the standard stream that goes to `path`: to replace the file would take away what was written there."""
    for stream in (1, 2):
        with suppress(OSError):
            if os.path.samestat(path.stat(), os.fstat(stream)):
                return stream
    return None


def _written_unnamed(target: Path, content: bytes, mode: int) -> tuple[int, Path] | None:
    """Return the complete file beside `target`, named at the last moment; None where the system cannot do that."""
    descriptor = _unnamed(target, mode)
    if descriptor is None:
        return None
    try:
        _write_all(descriptor, content)
        complete = _linked(descriptor, target)
    except BaseException:
        os.close(descriptor)
        raise
    if complete is None:
        os.close(descriptor)
        return None
    return descriptor, complete


def _unnamed(target: Path, mode: int) -> int | None:
    """Return a descriptor of an unnamed file in the folder of `target`. None: the system has no unnamed files."""
    if not hasattr(os, "O_TMPFILE"):
        return None
    try:
        return os.open(target.parent, os.O_TMPFILE | os.O_RDWR, mode)
    except OSError as error:
        if error.errno in _NO_UNNAMED:
            return None
        raise


def _linked(descriptor: int, target: Path) -> Path | None:
    """Return a hidden name beside `target` for the file that has none; None where the system cannot do that."""
    complete = _beside(target)
    try:
        # Only with a folder's descriptor does Python ask the kernel to follow the link in /proc.
        os.link(f"/proc/self/fd/{descriptor}", complete, src_dir_fd=descriptor, follow_symlinks=True)
    except OSError:
        return None
    return complete


def _written_named(target: Path, content: bytes, mode: int) -> tuple[int, Path]:
    complete = _beside(target)
    descriptor = os.open(complete, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode)
    try:
        _write_all(descriptor, content)
    except BaseException:
        complete.unlink(missing_ok=True)
        os.close(descriptor)
        raise
    return descriptor, complete


def _write_all(descriptor: int, content: bytes) -> None:
    left = memoryview(content)
    while left:
        left = left[os.write(descriptor, left) :]


def _beside(target: Path) -> Path:
    """Return a hidden name in the same folder that nobody has; short enough whatever `target` is called."""
    import secrets  # noqa: PLC0415 - start-up: who only reads needs no names

    return target.with_name(f".{secrets.token_hex(8)}.part")
