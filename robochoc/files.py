"""Files that are whole or not there, also when the program is killed while it writes."""

from __future__ import annotations

import errno
import os
import secrets
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
    target = path.resolve()
    complete = _written_unnamed(target, content, mode) or _written_named(target, content, mode)
    try:
        complete.replace(target)
    except BaseException:
        complete.unlink(missing_ok=True)
        raise


def _stream_to(path: Path) -> int | None:
    """The standard stream that goes to `path`: to replace the file would take away what was written there."""
    for stream in (1, 2):
        with suppress(OSError):
            if os.path.samestat(path.stat(), os.fstat(stream)):
                return stream
    return None


def _written_unnamed(target: Path, content: bytes, mode: int) -> Path | None:
    """The complete file beside `target`, named at the last moment; None where the system cannot do that."""
    if not hasattr(os, "O_TMPFILE"):
        return None
    try:
        descriptor = os.open(target.parent, os.O_TMPFILE | os.O_WRONLY, mode)
    except OSError as error:
        if error.errno in _NO_UNNAMED:
            return None
        raise
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        complete = _beside(target)
        try:
            # Only with a folder's descriptor does Python ask the kernel to follow the link in /proc.
            os.link(f"/proc/self/fd/{descriptor}", complete, src_dir_fd=descriptor, follow_symlinks=True)
        except OSError:
            return None
    return complete


def _written_named(target: Path, content: bytes, mode: int) -> Path:
    complete = _beside(target)
    try:
        with os.fdopen(os.open(complete, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode), "wb") as file:
            file.write(content)
    except BaseException:
        complete.unlink(missing_ok=True)
        raise
    return complete


def _beside(target: Path) -> Path:
    """A hidden name in the same folder that nobody has; short enough whatever `target` is called."""
    return target.with_name(f".{secrets.token_hex(8)}.part")
