"""Writing files so that they are either complete or missing, even if the program is killed during a write.

A new file is written in the same folder, and then replaces the old file. If Linux supports it, the new file has no
name until then, so not even SIGKILL leaves a partial file.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robochoc.system.posix import IS_POSIX
from robochoc.system.streams import BackgroundWriter

MAX_AHEAD = 64 << 20
"""The maximum number of bytes buffered for the reader of a pipe."""
READER_PATIENCE_S = 5.0
"""How long closing a pipe waits for a reader that reads nothing, in seconds."""
_BINARY: int = getattr(os, "O_BINARY", 0)
"""The flag without which Windows writes each line feed as two bytes."""
_HIDDEN = (".part", ".new", ".old")
"""The endings of hidden files and folders while they are being written."""
_NO_UNNAMED = {errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL}
"""The errors raised by file systems and kernels that do not support unnamed files."""


@contextmanager
def errors_naming(path: Path) -> Iterator[None]:
    """Add the file name `path` to system errors that contain no file name, or that of a hidden temporary file.

    For example, a write fails on a full disk, but the error does not contain the name of the file.

    Raises:
        OSError: the error raised inside, with a `filename`.
    """
    try:
        yield
    except OSError as error:
        named = os.fsdecode(error.filename) if isinstance(error.filename, str | bytes) else ""
        if not named or any(part.startswith(".") and part.endswith(_HIDDEN) for part in Path(named).parts):
            error.filename = str(path)
        raise


class PendingFile:
    """A file that replaces `path` when it is complete: write to `stream`, then call `keep` or `discard`.

    Until then, readers see the old file. Symbolic links are followed.

    Args:
        path: The file to be replaced. It need not exist.
        mode: The permissions of the new file from its first byte on, minus the umask. Secrets need 0o600.

    Raises:
        OSError: if the file cannot be written, or `path` is a folder, a device, a pipe, or the target of the standard
            output or error.
    """

    def __init__(self, path: Path, mode: int = 0o666) -> None:
        self._target = resolved(path)
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if _is_stream(path):
            raise OSError(errno.ENOTSUP, "is not a regular file and cannot be replaced", str(path))
        self._path = path
        self._named: Path | None = None
        with errors_naming(path):
            descriptor = _unnamed(self._target, mode)
            if descriptor is None:
                self._named = _beside(self._target)
                descriptor = os.open(self._named, os.O_CREAT | os.O_EXCL | os.O_RDWR | _BINARY, mode)
        self.stream = os.fdopen(descriptor, "w+b")

    def keep(self) -> None:
        """Replace `path` by the file. Raises `OSError` after deleting the file if an error occurs."""
        try:
            with errors_naming(self._path):
                self.stream.flush()
                if self._named is None:
                    self._named = _linked(self.stream.fileno(), self._target) or self._copied()
                if not IS_POSIX:
                    self.stream.close()  # open files cannot be renamed
                self._named.replace(self._target)
        except BaseException:
            self.discard()
            raise
        self._named = None
        self.stream.close()

    def discard(self) -> None:
        """Delete the file, unless it has already been kept or discarded."""
        with suppress(OSError):  # buffered bytes may not fit on the disk
            self.stream.close()
        if self._named is not None:
            self._named.unlink(missing_ok=True)
            self._named = None

    def _copied(self) -> Path:
        """Copy the file to a named one, which becomes the `stream`, if the system cannot name an unnamed file."""
        import shutil  # noqa: PLC0415 - start-up: rarely needed

        self._named = _beside(self._target)
        mode = os.fstat(self.stream.fileno()).st_mode & 0o777
        copy = os.fdopen(os.open(self._named, os.O_CREAT | os.O_EXCL | os.O_RDWR | _BINARY, mode), "w+b")
        self.stream.seek(0)
        with self.stream as original:
            self.stream = copy
            shutil.copyfileobj(original, copy)
        copy.flush()
        return self._named


def write_atomically(path: Path, content: bytes | Iterable[bytes], mode: int = 0o666) -> None:
    """Write `content`, which may come in pieces, to `path`. Readers see the old file or the complete new one.

    Devices, pipes, and targets of standard output or error (such as `/dev/stdout`) are written directly.

    Args:
        path: The file to be replaced. It need not exist.
        content: The new content.
        mode: The permissions of the new file, as in `PendingFile`.

    Raises:
        OSError: if the file cannot be written. No partial file remains.
    """
    pieces = [content] if isinstance(content, bytes) else content
    if _is_stream(path):
        with errors_naming(path), os.fdopen(_open_stream(path), "wb") as stream:
            stream.writelines(pieces)
        return
    file = PendingFile(path, mode)
    try:
        with errors_naming(path):
            file.stream.writelines(pieces)
    except BaseException:
        file.discard()
        raise
    file.keep()


class AppendableFile:
    """A file that replaces `path` with its `beginning`, and to which more bytes can be appended.

    Readers see the old file, or the beginning with the bytes appended so far. Devices, pipes and streams are written
    directly, without waiting for their readers; only these are buffered. Processes forked meanwhile inherit the
    descriptor.

    Args:
        path: The file to be replaced. It need not exist.
        beginning: The first bytes of the file.
        mode: The permissions of the new file, as in `PendingFile`.

    Raises:
        OSError: if the file cannot be written. No partial file remains.
    """

    def __init__(self, path: Path, beginning: bytes, mode: int = 0o666) -> None:
        self._size = 0
        self._torn = False
        self._stream: BackgroundWriter | None = None
        if _is_stream(path):
            self._descriptor = _open_stream(path)
            self._stream = BackgroundWriter(self._descriptor, MAX_AHEAD)
            self._append_first(beginning)
            return
        file = PendingFile(path, mode)
        try:
            self._descriptor = os.dup(file.stream.fileno())
            self._append_first(beginning)
            if not IS_POSIX:
                os.close(self._descriptor)  # open files cannot be renamed
        except BaseException:
            file.discard()
            raise
        copied = file.stream
        file.keep()
        if not IS_POSIX:
            self._descriptor = os.open(resolved(path), os.O_WRONLY | _BINARY)
        elif file.stream is not copied:  # a copy has replaced the unnamed file
            os.close(self._descriptor)
            self._descriptor = os.open(resolved(path), os.O_WRONLY)

    def append(self, content: bytes) -> None:
        """Append all of `content`. After an interrupt by a signal, the same content may be appended again.

        Raises:
            OSError: if the content cannot be written. A regular file is then unchanged.
        """
        if self._stream:
            self._append_to_stream(self._stream, content)
            return
        done = 0
        try:
            while done < len(content):
                done += _write_at(self._descriptor, memoryview(content)[done:], self._size + done)
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise
        self._size += done

    def close(self) -> None:
        """Close the file.

        Raises:
            OSError: if the file is a stream whose reader did not read everything.
        """
        if self._stream is None:
            os.close(self._descriptor)
            return
        try:
            if not self._stream.finish(READER_PATIENCE_S):
                raise OSError(errno.ETIMEDOUT, f"its reader has not read any data for {READER_PATIENCE_S:g} s")
        finally:
            self._stream.close()

    def _append_first(self, beginning: bytes) -> None:
        try:
            self.append(beginning)
        except BaseException:
            self.close()
            raise

    def _append_to_stream(self, stream: BackgroundWriter, content: bytes) -> None:
        if self._torn:
            raise OSError(errno.EIO, "an interrupt has left a partial write")
        self._torn = True  # after an interrupt, it is unknown which part was written
        fits = stream.write(content)
        self._torn = False
        if not fits:
            raise OSError(errno.ENOBUFS, f"its reader is more than {MAX_AHEAD >> 20} MiB behind")


def _write_at(descriptor: int, content: memoryview, place: int) -> int:
    """Write at the offset `place` in a file, and return the number of bytes written."""
    if IS_POSIX:
        return os.pwrite(descriptor, content, place)
    os.lseek(descriptor, place, os.SEEK_SET)
    return os.write(descriptor, content)


def resolved(path: Path) -> Path:
    """Return the absolute `path` without symbolic links. The file need not exist.

    If links are circular, `Path.resolve` raises `RuntimeError` or no error, depending on the version of Python.

    Raises:
        OSError: if the links are circular.
    """
    try:
        path.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise
    return Path(os.path.realpath(path))


def _is_stream(path: Path) -> bool:
    """Return whether `path` is written directly: a device, a pipe, or the target of a standard stream."""
    return _standard_stream(path) is not None or (path.exists() and not path.is_file())


def _open_stream(path: Path) -> int:
    """Return a descriptor for writing to the stream at `path`."""
    stream = _standard_stream(path)
    return os.open(path, os.O_WRONLY | _BINARY) if stream is None else os.dup(stream)


def _standard_stream(path: Path) -> int | None:
    """Return the standard stream whose target is `path`, if any. Replacing that file would lose its earlier output."""
    for stream in (1, 2):
        with suppress(OSError):
            if os.path.samestat(path.stat(), os.fstat(stream)):
                return stream
    return None


def _unnamed(target: Path, mode: int) -> int | None:
    """Return a descriptor of an unnamed file in the folder of `target`, or None if the system has no unnamed files."""
    if not hasattr(os, "O_TMPFILE"):
        return None
    try:
        return os.open(target.parent, os.O_TMPFILE | os.O_RDWR, mode)
    except OSError as error:
        if error.errno in _NO_UNNAMED:
            return None
        raise


def _linked(descriptor: int, target: Path) -> Path | None:
    """Give an unnamed file a new hidden name next to `target`. Return None if the system cannot do that."""
    complete = _beside(target)
    try:
        # Python asks the kernel to follow the link in /proc only if a folder's descriptor is given.
        os.link(f"/proc/self/fd/{descriptor}", complete, src_dir_fd=descriptor, follow_symlinks=True)
    except OSError:
        return None
    return complete


def _beside(target: Path) -> Path:
    """Return an unused, short, hidden file name in the same folder."""
    import secrets  # noqa: PLC0415 - start-up: only writers need names

    return target.with_name(f".{secrets.token_hex(8)}.part")
