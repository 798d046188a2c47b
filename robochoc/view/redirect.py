"""A file that leads a browser to a secret address, as Jupyter does it.

All users of a machine can read command lines, and the environment of some processes. So the browser is given the path
of a file with mode 0600, in a folder with mode 0700, and the file holds the address.
"""

from __future__ import annotations

import os
from html import escape
from typing import Self

from robochoc.system.temporary_files import PrivateFolder

_PAGE = """\
<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>robochoc</title>
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={url}">
</head><body><p><a href="{url}">The page is here.</a></p></body></html>
"""


class RedirectFile:
    """A file that leads a browser to `url`, until it is closed. Raises `OSError` if it cannot be written."""

    def __init__(self, url: str) -> None:
        self._folder = PrivateFolder()
        try:
            file = self._folder.path / "page.html"
            with os.fdopen(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w", encoding="utf-8") as page:
                page.write(_PAGE.format(url=escape(url)))
        except BaseException:
            self.close()
            raise
        self.url = file.as_uri()
        """The URL for the browser: `file://...`, which is no secret."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the file. Does nothing the second time."""
        self._folder.close()
