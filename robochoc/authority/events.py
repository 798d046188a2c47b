"""Events of the Authority: grants, and refusals with their reasons."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.journal.events import Granted, Refused

__all__ = ["AuthorityEvent", "AuthorityObserver", "Granted", "Refused", "unobserved"]

AuthorityEvent = Granted | Refused
AuthorityObserver = Callable[[AuthorityEvent], None]


def unobserved(_event: AuthorityEvent) -> None:
    """Ignore an event; this is the default observer of an Authority."""
