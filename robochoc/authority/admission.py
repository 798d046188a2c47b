"""Who is admitted: what the master asks an Authority. And an Authority for one run on one machine, in memory."""

from __future__ import annotations

import time
from collections.abc import Iterable
from datetime import timedelta
from pathlib import Path
from typing import Protocol

from robochoc.authority.certificates import MASTER, ca_certificate, leaf_certificate, moment, new_key
from robochoc.authority.identity import Identity
from robochoc.authority.registry import Right, Role

_LIFETIME = timedelta(hours=24)


class Admission(Protocol):
    """Who may take part, and who may not any more. `Authority` is one."""

    def names(self, role: Role | None = None, right: Right | None = None, *, invited: bool = False) -> tuple[str, ...]:
        """Who has a certificate in force now (in the role `role`, with the right `right`), sorted.

        Also, if `invited`, who has a token and never had a certificate: whoever comes in that name has the new one.
        """

    def is_revoked(self, who: str | int) -> bool:
        """Whether `who` is to be turned away."""


class Household:
    """An Authority for robots that one process starts on its own machine: no folder, no tokens, nothing to clean up."""

    def __init__(self, robots: Iterable[str]) -> None:
        self._key = new_key()
        self._now = time.time()
        self._certificate = ca_certificate(self._key, moment(self._now))
        self._robots = tuple(sorted(robots))
        self._turned_away: set[str] = set()
        self._sniffers: set[str] = set()

    def identity(self, name: str) -> Identity:
        """A new identity of the robot `name`."""
        return self._identity(name, None)

    def master_identity(self, hosts: tuple[str, ...]) -> Identity:
        """A new identity of the master, who is reached at `hosts`."""
        return self._identity(MASTER, hosts)

    def names(
        self,
        role: Role | None = None,
        right: Right | None = None,
        *,
        invited: bool = False,  # noqa: ARG002 - there are no tokens
    ) -> tuple[str, ...]:
        """All robots that were not revoked; of these, who has the right."""
        there = tuple(n for n in self._robots if n not in self._turned_away) if role in {None, Role.ROBOT} else ()
        return there if right is None else tuple(n for n in there if n in self._sniffers)

    def is_revoked(self, who: str | int) -> bool:
        """Whether `who` is none of the household, or was revoked."""
        return who not in self._robots or who in self._turned_away

    def enrol(self, name: str, *, sniffs: bool = False) -> None:
        """Let `name` take part from now on, as well; and have the right to sniff, or not."""
        self._turned_away.discard(name)
        (self._sniffers.add if sniffs else self._sniffers.discard)(name)
        self._robots = tuple(sorted({*self._robots, name}))

    def revoke(self, name: str) -> None:
        """Turn `name` away from now on."""
        self._turned_away.add(name)

    def _identity(self, name: str, hosts: tuple[str, ...] | None) -> Identity:
        key = new_key()
        times = (moment(self._now), moment(self._now + _LIFETIME.total_seconds()))
        certificate = leaf_certificate((self._certificate, self._key), key.public_key(), name, hosts, times)
        return Identity(Path(), name, key, certificate, self._certificate)
