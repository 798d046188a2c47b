"""What can be seen of the Authority: what it has granted, and every refusal, with its reason."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.observers.events import Event


class Granted(Event, frozen=True):
    """`who` was given `what`. `t` is Unix time: the Authority outlives runs."""

    who: str
    what: str
    origin: str = ""
    """Where the request came from, as `address:port`; empty where it was no network."""


class Refused(Event, frozen=True):
    """`who` claimed to be allowed `what`, and is not, because `why`. `t` is Unix time.

    `who` is what the other side said of itself, so it may be anybody's name, or `unknown`.
    """

    who: str
    what: str
    why: str
    origin: str = ""


AuthorityEvent = Granted | Refused
AuthorityObserver = Callable[[AuthorityEvent], None]


def unobserved(_event: AuthorityEvent) -> None:
    """The observer of an Authority that nobody watches."""
