"""Events of the Authority: what it has granted, and every refusal, with its reason."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.journal.events import Granted, Refused

__all__ = ["AuthorityEvent", "AuthorityObserver", "Granted", "Refused", "unobserved"]

AuthorityEvent = Granted | Refused
AuthorityObserver = Callable[[AuthorityEvent], None]


def unobserved(_event: AuthorityEvent) -> None:
    """Ignore an event: the default observer of an Authority."""
