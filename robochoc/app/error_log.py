"""Unexpected errors: a sentence on the page, a line in the terminal, and the traceback in the error log.

Browsers can send anything to a page, and a disk can be full: in neither case should users see a traceback.
"""

from __future__ import annotations

import logging
import sys
from contextlib import suppress
from logging.handlers import RotatingFileHandler
from pathlib import Path

from nicegui import app, ui

from robochoc.app.log import ERROR_LOG, USER_LOG, error_text
from robochoc.app.texts import say
from robochoc.system.plain_text import on_one_line

ERRORS = "errors.log"
MOST_BYTES = 1 << 20
"""The size at which a new error log is started, in bytes; the previous one is kept."""
MOST_CHARACTERS = 10_000
"""The maximum length of one entry."""
_OF_SERVERS = ("nicegui", "socketio", "socketio.server", "engineio", "engineio.server", "asyncio", "uvicorn")
_OF_SERVERS_ALSO = ("uvicorn.error", "uvicorn.access", "uvicorn.asgi")


def log_errors_to(folder: Path) -> None:
    """Write unexpected errors to the error log in `folder`, and show them on the pages where they occur."""
    log_file = _LogFile(
        folder / ERRORS, maxBytes=MOST_BYTES, backupCount=1, encoding="utf-8", delay=True, errors="replace"
    )
    log_file.setFormatter(_PlainFormatter("%(asctime)s %(name)s %(message)s"))
    terminal = _Terminal(folder / ERRORS)
    for name in (*_OF_SERVERS, *_OF_SERVERS_ALSO):
        logger = logging.getLogger(name)
        logger.handlers[:] = [] if name in _OF_SERVERS_ALSO or "." in name else [log_file, terminal]
        logger.propagate = "." in name
    ERROR_LOG.handlers[:] = [log_file, terminal]
    USER_LOG.handlers[:] = [terminal]
    ERROR_LOG.propagate = USER_LOG.propagate = False
    app.on_exception(notify)


def notify(error: Exception) -> None:
    """Show an error on the page where it occurred, if the page is still open."""
    with suppress(RuntimeError):  # the page is closed
        ui.notify(error_text(error), type="negative")


class _PlainFormatter(logging.Formatter):
    """Formats an error without control characters, and shortens long errors."""

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        if len(text) > MOST_CHARACTERS:
            text = f"{text[: MOST_CHARACTERS // 2]}\n...\n{text[-MOST_CHARACTERS // 2 :]}"
        return "\n".join(on_one_line(line) for line in text.splitlines())


class _LogFile(RotatingFileHandler):
    """The file of the error log. Errors while writing are ignored."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - of logging
        """Ignore the error: the disk is full, or the folder no longer exists."""


class _Terminal(logging.Handler):
    """Prints the path of the error log once, and each message of `USER_LOG`."""

    def __init__(self, file: Path) -> None:
        super().__init__(logging.ERROR)
        self._file, self._is_path_printed = file, False

    def emit(self, record: logging.LogRecord) -> None:
        """Print a line."""
        if record.name == USER_LOG.name:
            line = on_one_line(record.getMessage())
        elif self._is_path_printed:
            return
        else:
            self._is_path_printed = True
            line = say("app.fault-kept", file=self._file)
        with suppress(OSError, ValueError):  # standard error is closed
            print(line, file=sys.stderr, flush=True)  # noqa: T201 - a message for the terminal
