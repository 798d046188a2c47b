"""The folder for temporary files, and temporary files and folders that leave no trace.

On first use, Python's `tempfile` tests folders by creating a named file, which remains if the process is killed at that
moment. So this module finds the folder, and passes it to `tempfile` each time.
"""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
import threading
import weakref
from pathlib import Path
from typing import IO

_VARIABLES = ("TMPDIR", "TEMP", "TMP")
_FOLDERS = ("/tmp", "/var/tmp", "/usr/tmp")  # noqa: S108 - candidates; no file has a fixed name there


def temporary_folder() -> Path:
    """Return the folder for temporary files: the first writable folder in the search order of `tempfile`.

    Raises:
        FileNotFoundError: if no folder is writable.
    """
    chosen = filter(None, (tempfile.tempdir, *map(os.environ.get, _VARIABLES)))
    for folder in map(Path, (*chosen, *_FOLDERS, os.curdir)):
        if folder.is_dir() and os.access(folder, os.W_OK | os.X_OK):
            return folder.absolute()
    raise FileNotFoundError(f"no folder for temporary files among {', '.join((*_VARIABLES, *_FOLDERS))}")


def unnamed_file(*, buffered: bool = True) -> IO[bytes]:
    """Open a new unnamed binary file for writing and reading. It is deleted when all its descriptors are closed.

    Args:
        buffered: True if written bytes may be buffered in this process.

    Raises:
        OSError: if no folder for temporary files is writable.
    """
    return tempfile.TemporaryFile(buffering=-1 if buffered else 0, dir=temporary_folder())


class PrivateFolder:
    """A new folder that only this user can read. It is removed by `close`, or at the latest when this process ends.

    Ctrl-C and SIGTERM may interrupt any line in the main thread. `tempfile.TemporaryDirectory` leaves a folder behind
    if it is interrupted between creation and registration, or during removal. This class registers the removal first,
    and removes the folder in a thread, which signals do not interrupt. Forked processes do not remove the folder.

    Raises:
        OSError: if the folder cannot be created.
    """

    def __init__(self) -> None:
        self.path = temporary_folder() / f"robochoc-{secrets.token_hex(16)}"
        self._owner = os.getpid()
        self._remove = weakref.finalize(self, _remove, self.path, self._owner)
        self.path.mkdir(mode=0o700)

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the folder and its content. A second call has no effect."""
        if self._remove.alive:
            remover = threading.Thread(target=_remove, args=(self.path, self._owner))
            try:
                remover.start()
            except RuntimeError:  # no further thread can be started
                self._remove()
            else:
                remover.join()
                self._remove.detach()  # last: the end of the process does not wait for a thread that has hardly started


def _remove(folder: Path, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
