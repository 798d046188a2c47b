"""The folder for temporary files, found without a trace, and what is put there and removed again.

Python's `tempfile`, when it is first used, tries folders out with a named file. A process that is killed in that moment
leaves the file. So the folder is found here, and given to `tempfile` each time.
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
_FOLDERS = ("/tmp", "/var/tmp", "/usr/tmp")  # noqa: S108 - a list to choose from; nothing is put there by this name


def temporary_folder() -> Path:
    """Return the folder for temporary files: the first that can be written to, in the order that `tempfile` has.

    Raises:
        FileNotFoundError: if there is none.
    """
    chosen = filter(None, (tempfile.tempdir, *map(os.environ.get, _VARIABLES)))
    for folder in map(Path, (*chosen, *_FOLDERS, os.curdir)):
        if folder.is_dir() and os.access(folder, os.W_OK | os.X_OK):
            return folder.absolute()
    raise FileNotFoundError(f"no folder for temporary files among {', '.join((*_VARIABLES, *_FOLDERS))}")


def unnamed_file(*, buffered: bool = True) -> IO[bytes]:
    """Open a new file without a name, to write and read bytes. It is gone when all who have it have closed it.

    Args:
        buffered: Whether written bytes may wait in this process.

    Raises:
        OSError: if no folder for temporary files can be written to.
    """
    return tempfile.TemporaryFile(buffering=-1 if buffered else 0, dir=temporary_folder())


class PrivateFolder:
    """A new folder that only this user can read. It is removed by `close`, at the latest when this process ends.

    Ctrl-C and SIGTERM may interrupt any line of the main thread; `tempfile.TemporaryDirectory` leaves a folder behind
    that they meet between its making and its noting, or half removed. Here its removal is noted first, and done in a
    thread, which they do not interrupt. A process that was forked does not remove it.

    Raises:
        OSError: if it cannot be created.
    """

    def __init__(self) -> None:
        self.path = temporary_folder() / f"robochoc-{secrets.token_hex(16)}"
        self._remove = weakref.finalize(self, _remove, self.path, os.getpid())
        self.path.mkdir(mode=0o700)

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the folder with all that is in it. Does nothing the second time."""
        if self._remove.alive:
            remover = threading.Thread(target=self._remove)
            try:
                remover.start()
            except RuntimeError:  # no further thread can be had
                self._remove()
            else:
                remover.join()


def _remove(folder: Path, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
