"""What goes wrong unforeseen: a sentence on the page, a line in the terminal, and all that is known of it in a file.

Whoever knows the address can send anything to a page, and a disk can be full: neither may end in a traceback.
"""

from __future__ import annotations

import logging
import sys
from contextlib import suppress
from logging.handlers import RotatingFileHandler
from pathlib import Path

from nicegui import app, ui

from robochoc.app.log import FAULTS, TOLD, words
from robochoc.app.texts import say
from robochoc.system.plain_text import on_one_line

ERRORS = "errors.log"
MOST_BYTES = 1 << 20
"""A longer file of errors is begun anew; the one before it is kept."""
MOST_CHARACTERS = 10_000
"""Of one error."""
_OF_SERVERS = ("nicegui", "socketio", "socketio.server", "engineio", "engineio.server", "asyncio", "uvicorn")
_OF_SERVERS_ALSO = ("uvicorn.error", "uvicorn.access", "uvicorn.asgi")


def keep_faults(folder: Path) -> None:
    """Keep in `folder` what goes wrong unforeseen, and tell it where it happens."""
    kept = _Kept(folder / ERRORS, maxBytes=MOST_BYTES, backupCount=1, encoding="utf-8", delay=True, errors="replace")
    kept.setFormatter(_Plain("%(asctime)s %(name)s %(message)s"))
    terminal = _Terminal(folder / ERRORS)
    for name in (*_OF_SERVERS, *_OF_SERVERS_ALSO):
        logger = logging.getLogger(name)
        logger.handlers[:] = [] if name in _OF_SERVERS_ALSO or "." in name else [kept, terminal]
        logger.propagate = "." in name
    FAULTS.handlers[:] = [kept, terminal]
    TOLD.handlers[:] = [terminal]
    FAULTS.propagate = TOLD.propagate = False
    app.on_exception(tell)


def tell(error: Exception) -> None:
    """Tell an error on the page where it happened, if it still is there."""
    with suppress(RuntimeError):  # it is not
        ui.notify(words(error), type="negative")


class _Plain(logging.Formatter):
    """Writes an error so that nothing in it can steer a terminal, and not all of a long one."""

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        if len(text) > MOST_CHARACTERS:
            text = f"{text[: MOST_CHARACTERS // 2]}\n...\n{text[-MOST_CHARACTERS // 2 :]}"
        return "\n".join(on_one_line(line) for line in text.splitlines())


class _Kept(RotatingFileHandler):
    """The file of errors. Where it cannot be written, nothing is."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - of logging
        """Go on: the disk is full, or the folder is gone."""


class _Terminal(logging.Handler):
    """Says in the terminal where errors are kept, once; and what `TOLD` says, each time."""

    def __init__(self, file: Path) -> None:
        super().__init__(logging.ERROR)
        self._file, self._told = file, False

    def emit(self, record: logging.LogRecord) -> None:
        """Say it."""
        if record.name == TOLD.name:
            line = on_one_line(record.getMessage())
        elif self._told:
            return
        else:
            self._told = True
            line = say("app.fault-kept", file=self._file)
        with suppress(OSError, ValueError):  # nobody reads it
            print(line, file=sys.stderr, flush=True)  # noqa: T201 - the terminal is where it is told
