"""The application's logs: messages in the terminal, and the error log (`error_log.log_errors_to`).

This module is separate from `error_log`, because the processes of jobs use it and must not load NiceGUI.
"""

from __future__ import annotations

import logging

from robochoc.app.sketch.edits import EditError
from robochoc.app.texts import say

USER_LOG = logging.getLogger("robochoc.app")
"""Messages that users must see in the terminal, even if no page is open."""
ERROR_LOG = logging.getLogger("robochoc.app.error_log")
"""Unexpected errors, with their tracebacks."""


def error_text(error: Exception) -> str:
    """Return the text that a page shows for an error."""
    if isinstance(error, EditError):
        return say(error.key, **error.named)
    if isinstance(error, OSError):
        return say("app.disk", why=error.strerror or type(error).__name__)
    return say("app.fault")


def log_error(error: Exception, doing: str) -> str:
    """Write an error to the error log, and return the text that a page shows.

    Args:
        error: The error.
        doing: A description of the failed work, for the log.
    """
    ERROR_LOG.error("%s: %s", doing, type(error).__name__, exc_info=error)
    return error_text(error)
