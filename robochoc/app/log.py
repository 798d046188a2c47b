"""What the application tells besides its pages: to the terminal, and to the file of errors (`faults.keep_faults`)."""

from __future__ import annotations

import logging

from robochoc.app.sketch.edits import EditError
from robochoc.app.texts import say

TOLD = logging.getLogger("robochoc.app")
"""Says in the terminal what users must know, even when no page is open."""
FAULTS = logging.getLogger("robochoc.app.faults")
"""Keeps what went wrong unforeseen, with all that is known of it."""


def words(error: Exception) -> str:
    """Return what somebody in front of the page is told of an error."""
    if isinstance(error, EditError):
        return say(error.key, **error.named)
    if isinstance(error, OSError):
        return say("app.disk", why=error.strerror or type(error).__name__)
    return say("app.fault")


def noted(error: Exception, doing: str) -> str:
    """Keep an error in the file of errors; return what somebody in front of the page is told.

    Args:
        error: The error.
        doing: The work that it has ended, for the file.
    """
    FAULTS.error("%s: %s", doing, type(error).__name__, exc_info=error)
    return words(error)
