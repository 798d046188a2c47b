"""An Authority with a clock of its own, and robots that it knows."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from robochoc.authority.authority import Authority
from robochoc.authority.certificates import new_key, read_certificate, signing_request
from robochoc.authority.events import AuthorityEvent, Refused
from robochoc.authority.identity import Identity, save

START = 1_800_000_000.0
HOUR = 3600


@dataclass
class Clock:
    """Time that passes when it is told to."""

    now: float = START

    def __call__(self) -> float:
        return self.now


@dataclass
class Seen:
    """An observer that remembers."""

    events: list[AuthorityEvent] = field(default_factory=list)

    def __call__(self, event: AuthorityEvent) -> None:
        self.events.append(event)

    @property
    def refusals(self) -> list[Refused]:
        return [event for event in self.events if isinstance(event, Refused)]


def identity_of(authority: Authority, name: str, folder: Path) -> Identity:
    """The identity of `name`, enrolled without a network."""
    key = new_key()
    certificate = authority.redeem(authority.enrol(name).secret, signing_request(key, name))
    save(folder, key, read_certificate(certificate), authority.certificate)
    return Identity.load(folder, authority.clock())
