"""The Authority's registry: enrolled names and their certificates. One JSON file, safe between processes.

A change reads the file, and replaces it, while it holds the lock (flock(2)) of a file beside it: `robochoc authority
enrol` and a running master do not lose each other's changes. Readers take no lock: they see the old file or the new
one, and what they have read is kept until the file is another.
"""

from __future__ import annotations

import fcntl
import os
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


class AuthorityError(RobochocError):
    """The Authority's folder is not there, or what is in it cannot be used."""


class Role(StrEnum):
    """The role in which a name takes part."""

    ROBOT = "robot"
    OBSERVER = "observer"
    MASTER = "master"


class Right(StrEnum):
    """A right besides taking part in the role. It has to be given."""

    SNIFF = "sniff"  # follow runs: have the master's journal, with what robots say to each other


class EnrolmentState(StrEnum):
    """The state of an enrolment."""

    INVITED = "invited"  # it has a token that works
    IN_FORCE = "in force"
    EXPIRED = "expired"  # its last certificate, or its token unused
    REVOKED = "revoked"


class Invitation(msgspec.Struct, frozen=True):
    """The token of a name: the digest of its secret, and until when (Unix time) it works."""

    digest: str
    expires: float
    used: bool = False


class Issued(msgspec.Struct, frozen=True):
    """A certificate that was given: its serial number (hexadecimal), and when (Unix time) it expires."""

    serial: str
    expires: float


class EnrolledName(msgspec.Struct, frozen=True):
    """The Authority's record of one name. Expired certificates are forgotten."""

    name: str
    role: Role
    invitation: Invitation | None = None
    certificates: tuple[Issued, ...] = ()
    """In force, unless they have expired."""
    withdrawn: tuple[Issued, ...] = ()
    """Revoked, or replaced by those of a new key."""
    revoked: bool = False
    may: tuple[Right, ...] = ()

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
        """Return whether no certificate in this name can exist."""
        return not self.certificates and not self.withdrawn

    def expires(self, now: float) -> float:
        """Return when (Unix time) its token, if it is invited, or its last certificate expires; 0 if it has neither."""
        token = self.invitation.expires if self.invitation and not self.invitation.used else 0
        if self.state(now) == EnrolmentState.INVITED:
            return token
        return max((one.expires for one in self.certificates), default=token)

    def since(self, now: float) -> EnrolledName:
        """Return the same, without the certificates that have expired."""
        certificates = tuple(one for one in self.certificates if now < one.expires)
        withdrawn = tuple(one for one in self.withdrawn if now < one.expires)
        return msgspec.structs.replace(self, certificates=certificates, withdrawn=withdrawn)


class _Content(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file."""

    members: dict[str, EnrolledName]
    version: Literal[1] = 1


class Registry:
    """The registry in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: tuple[tuple[int, ...], dict[str, EnrolledName]] = ((), {})

    def members(self) -> Mapping[str, EnrolledName]:
        """Return all names, as they stand now. Raises `AuthorityError`."""
        path = self._folder / _FILE
        try:
            status = path.stat()
            seen = (status.st_ino, status.st_mtime_ns, status.st_size)
            known = self._known
            if known[0] != seen:
                known = (seen, msgspec.json.decode(path.read_bytes(), type=_Content).members)
                # What was read may be newer than `seen`; then the next call reads it again.
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
        """Yield the entries for an exclusive change.

        They are written at the end, unless that raises.
        """
        with locked(self._folder):
            members = dict(self.members())
            before = dict(members)
            yield members
            if members != before:
                content = msgspec.json.format(msgspec.json.encode(_Content(members)))
                write_atomically(self._folder / _FILE, content, PRIVATE)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Exclude all other processes and threads from `folder` for the duration."""
    descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, PRIVATE)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
