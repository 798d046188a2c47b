"""The folder for temporary files, found without a trace.

Python's `tempfile`, when it is first used, tries folders out with a named file. A process that is killed in that moment
leaves the file. So the folder is found here, and given to `tempfile` each time.
"""

from __future__ import annotations

import os
import tempfile
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
