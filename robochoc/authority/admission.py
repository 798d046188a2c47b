"""The master's interface to an Authority, and an Authority in memory for one run on one machine."""

from __future__ import annotations

import time
from collections.abc import Iterable
from datetime import timedelta
from pathlib import Path
from typing import Protocol

from robochoc.authority.certificates import MASTER, ca_certificate, leaf_certificate, new_key, utc_time
from robochoc.authority.identity import Identity
from robochoc.authority.registry import Right, Role

_LIFETIME = timedelta(hours=24)


class Admission(Protocol):
    """Decides which names may take part; implemented by `Authority`."""

    def names(self, role: Role | None = None, right: Right | None = None, *, invited: bool = False) -> tuple[str, ...]:
        """Return the sorted names that have a certificate in force now.

        Args:
            role: Return only names in this role.
            right: Return only names with this right.
            invited: Include names that have a token and never had a certificate.
        """

    def is_revoked(self, who: str | int) -> bool:
        """Return whether the name, or the certificate with this serial number, is refused."""


class InMemoryAuthority:
    """An Authority without a folder and tokens, for robots started by one process on its own machine."""

    def __init__(self, robots: Iterable[str]) -> None:
        self._key = new_key()
        self._now = time.time()
        self._certificate = ca_certificate(self._key, utc_time(self._now))
        self._robots = tuple(sorted(robots))
        self._revoked: set[str] = set()
        self._sniffers: set[str] = set()

    def identity(self, name: str) -> Identity:
        """Return a new identity for the robot `name`."""
        return self._identity(name, None)

    def master_identity(self, hosts: tuple[str, ...]) -> Identity:
        """Return a new identity for the master at `hosts`."""
        return self._identity(MASTER, hosts)

    def standby_identity(self, name: str, hosts: tuple[str, ...]) -> Identity:
        """Return a new identity for the standby master `name` at `hosts`."""
        return self._identity(name, hosts)

    def names(
        self,
        role: Role | None = None,
        right: Right | None = None,
        *,
        invited: bool = False,  # noqa: ARG002 - there are no tokens
    ) -> tuple[str, ...]:
        """Return all robots that were not revoked; with `right`, only those with this right."""
        there = tuple(n for n in self._robots if n not in self._revoked) if role in {None, Role.ROBOT} else ()
        return there if right is None else tuple(n for n in there if n in self._sniffers)

    def is_revoked(self, who: str | int) -> bool:
        """Return whether the name is unknown, or was revoked."""
        return who not in self._robots or who in self._revoked

    def enrol(self, name: str, *, sniffs: bool = False) -> None:
        """Admit `name`, with or without the right to sniff."""
        self._revoked.discard(name)
        (self._sniffers.add if sniffs else self._sniffers.discard)(name)
        self._robots = tuple(sorted({*self._robots, name}))

    def revoke(self, name: str) -> None:
        """Revoke `name`."""
        self._revoked.add(name)

    def _identity(self, name: str, hosts: tuple[str, ...] | None) -> Identity:
        key = new_key()
        times = (utc_time(self._now), utc_time(self._now + _LIFETIME.total_seconds()))
        certificate = leaf_certificate((self._certificate, self._key), key.public_key(), name, hosts, times)
        return Identity(Path(), name, key, certificate, self._certificate)
