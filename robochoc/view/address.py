"""Addresses of pages that are served here: on the loopback interface of this machine alone."""

from __future__ import annotations

from secrets import token_urlsafe
from socket import create_server, socket

_LOOPBACK = "127.0.0.1"
_SECRET_BYTES = 18


def loopback_socket(port: int = 0) -> socket:
    """Return a socket that listens on the loopback interface; port 0 is any free one.

    Raises `OSError` if it is taken.
    """
    return create_server((_LOOPBACK, port))


def url_of(listener: socket, path: str = "") -> str:
    """Return the URL of `path` for a browser of this machine."""
    return f"http://{_LOOPBACK}:{listener.getsockname()[1]}/{path}"


def secret_path() -> str:
    """Return an unguessable path, as other users may use this machine, too."""
    return token_urlsafe(_SECRET_BYTES)
