"""Addresses of pages served on this machine's loopback interface, and files that redirect browsers to them."""

from __future__ import annotations

import os
from html import escape
from secrets import token_urlsafe
from socket import create_server, socket
from typing import Self

from robochoc.system.temporary_files import PrivateFolder

_PAGE = """\
<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>robochoc</title>
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={url}">
</head><body><p><a href="{url}">The page is here.</a></p></body></html>
"""


_LOOPBACK = "127.0.0.1"
_SECRET_BYTES = 18


def loopback_socket(port: int = 0) -> socket:
    """Return a socket that listens on the loopback interface; port 0 selects any free port.

    Raises `OSError` if the port is in use.
    """
    return create_server((_LOOPBACK, port))


def url_of(listener: socket, path: str = "") -> str:
    """Return the URL of `path` for a browser on this machine."""
    return f"http://{_LOOPBACK}:{listener.getsockname()[1]}/{path}"


def secret_path() -> str:
    """Return an unguessable path, since this machine may have other users."""
    return token_urlsafe(_SECRET_BYTES)


class RedirectFile:
    """A file that redirects a browser to the secret `url`, like Jupyter's, until it is closed.

    All users of a machine can read command lines, and the environment of some processes. So the browser gets the path
    of a file that contains the address. The file has mode 0600, and its folder mode 0700.

    Raises `OSError` if the file cannot be written.
    """

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
        """The URL for the browser (`file://...`), which is not secret."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the file. A second call does nothing."""
        self._folder.close()
