"""The Authority's registry: enrolled names and their certificates, in a JSON file that processes can share.

A change reads and replaces the file while it holds a lock (flock(2)) on another file in the folder, so that `robochoc
authority enrol` and a running master do not overwrite each other's changes. Readers need no lock: they see the old or
the new file, and cache its content until the file changes.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Literal

import msgspec

from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically

PRIVATE = 0o600
_FILE, _LOCK = "registry.json", "lock"
_RETRY_S = 0.02


class AuthorityError(RobochocError):
    """The Authority's folder is missing, or its content is unusable."""


class Role(StrEnum):
    """The role of a name."""

    ROBOT = "robot"
    OBSERVER = "observer"
    MASTER = "master"


class Right(StrEnum):
    """A right in addition to those of the role, which must be granted."""

    SNIFF = "sniff"  # to follow runs: receive the master's journal with the robots' messages


class EnrolmentState(StrEnum):
    """The state of an enrolment."""

    INVITED = "invited"  # the name has a valid token
    IN_FORCE = "in force"
    EXPIRED = "expired"  # the name's last certificate or unused token has expired
    REVOKED = "revoked"


class Invitation(msgspec.Struct, frozen=True):
    """The token of a name: the digest of the token's secret, and the expiry (Unix time)."""

    digest: str
    expires: float
    used: bool = False


class Issued(msgspec.Struct, frozen=True):
    """An issued certificate: its serial number (hexadecimal), and its expiry (Unix time)."""

    serial: str
    expires: float


class EnrolledName(msgspec.Struct, frozen=True):
    """The Authority's record of a name. Expired certificates are removed."""

    name: str
    role: Role
    invitation: Invitation | None = None
    certificates: tuple[Issued, ...] = ()
    """The certificates in force, unless they have expired."""
    withdrawn: tuple[Issued, ...] = ()
    """Certificates that were revoked, or replaced by certificates for a new key."""
    revoked: bool = False
    may: tuple[Right, ...] = ()
    hosts: tuple[str, ...] = ()
    """The host names and addresses of a standby master, which its certificate contains."""

    def state(self, now: float) -> EnrolmentState:
        """Return the state of this name at Unix time `now`."""
        if self.invitation and not self.invitation.used and now < self.invitation.expires:
            return EnrolmentState.INVITED
        if self.revoked:
            return EnrolmentState.REVOKED
        return (
            EnrolmentState.IN_FORCE if any(now < one.expires for one in self.certificates) else EnrolmentState.EXPIRED
        )

    @property
    def never_certified(self) -> bool:
        """True if no certificate of this name can exist."""
        return not self.certificates and not self.withdrawn

    def expires(self, now: float) -> float:
        """Return the expiry (Unix time) of the token if invited, else of the last certificate; 0 if there is none."""
        token = self.invitation.expires if self.invitation and not self.invitation.used else 0
        if self.state(now) == EnrolmentState.INVITED:
            return token
        return max((one.expires for one in self.certificates), default=token)

    def without_expired(self, now: float) -> EnrolledName:
        """Return the record without expired certificates."""
        certificates = tuple(one for one in self.certificates if now < one.expires)
        withdrawn = tuple(one for one in self.withdrawn if now < one.expires)
        return msgspec.structs.replace(self, certificates=certificates, withdrawn=withdrawn)


class _Content(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of the file."""

    members: dict[str, EnrolledName]
    version: Literal[1] = 1


class Registry:
    """Reads and changes the registry in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: tuple[tuple[int, ...], dict[str, EnrolledName]] = ((), {})

    def members(self) -> Mapping[str, EnrolledName]:
        """Return the present records of all names. Raises `AuthorityError`."""
        path = self._folder / _FILE
        try:
            status = path.stat()
            seen = (status.st_ino, status.st_mtime_ns, status.st_size)
            known = self._known
            if known[0] != seen:
                known = (seen, msgspec.json.decode(path.read_bytes(), type=_Content).members)
                # The content may be newer than `seen`; the next call then reads the file again.
                self._known = known
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise AuthorityError(f"{path} cannot be read: {error.strerror}") from error
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise AuthorityError(f"{path} is not a registry of this version: {error}") from error
        return known[1]

    @contextmanager
    def change(self) -> Iterator[dict[str, EnrolledName]]:
        """Yield the records for an exclusive change, which is written after the block unless the block raises."""
        with locked(self._folder):
            members = dict(self.members())
            before = dict(members)
            yield members
            if members != before:
                content = msgspec.json.format(msgspec.json.encode(_Content(members)))
                write_atomically(self._folder / _FILE, content, PRIVATE)


@contextmanager
def locked(folder: Path, wait_s: float | None = None) -> Iterator[None]:
    """Lock `folder` against all other processes and threads during the block.

    Raises `TimeoutError` if the folder is still locked after `wait_s` seconds (None: wait without a limit).
    """
    descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, PRIVATE)
    try:
        if wait_s is None:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        else:
            _lock_within(descriptor, time.monotonic() + wait_s)
        yield
    finally:
        os.close(descriptor)


def _lock_within(descriptor: int, until: float) -> None:
    """Lock an open file. Raises `TimeoutError` if it is still locked at `until`, on the monotonic clock."""
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= until:
                raise TimeoutError from None
            time.sleep(_RETRY_S)
        else:
            return
