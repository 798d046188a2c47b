"""The address of a master: `HOST:PORT`. Its enrolment service listens one port higher."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Sequence
from typing import NamedTuple

from robochoc.system.errors import RobochocError

DEFAULT_PORT = 7447
"""Zenoh's default port."""
LOOPBACK = "127.0.0.1"
_LARGEST_PORT = 65_534
_BRACKETED = re.compile(r"\[([^]]*)](?::(.+))?")
_HOST = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?")


class AddressError(RobochocError, ValueError):
    """Raised for a text that is not the address of a master."""


class Address(NamedTuple):
    """A host name or address, and a port. The enrolment service of the master listens one port higher."""

    host: str
    port: int = DEFAULT_PORT

    @classmethod
    def parse(cls, text: str) -> Address:
        """Parse an address of the form `HOST`, `HOST:PORT` or `[IPv6]:PORT`. Raises `AddressError`."""
        host, port = text, ""
        if found := _BRACKETED.fullmatch(text):
            host, port = found[1], found[2] or ""
        elif text.count(":") <= 1:
            host, _, port = text.partition(":")
        if not _is_host(host) or (port and not (port.isdecimal() and 0 < int(port) <= _LARGEST_PORT)):
            raise AddressError(f"{text!r} is not of the form HOST:PORT, such as 192.168.1.14:{DEFAULT_PORT}")
        return cls(host, int(port) if port else DEFAULT_PORT)

    @classmethod
    def parse_all(cls, text: str) -> tuple[Address, ...]:
        """Parse addresses that are separated by commas. Raises `AddressError`."""
        return tuple(cls.parse(part.strip()) for part in text.split(","))

    @property
    def enrolment_port(self) -> int:
        """The port for redeeming tokens."""
        return self.port + 1

    @property
    def anywhere(self) -> bool:
        """Return whether the address means all addresses of a machine. Robots cannot connect to such an address."""
        try:
            return ipaddress.ip_address(self.host).is_unspecified
        except ValueError:
            return False

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def check_different(places: Sequence[Address]) -> None:
    """Raise `AddressError` if an address is repeated."""
    twice = next((place for place in places if places.count(place) > 1), None)
    if twice:
        raise AddressError(f"{twice} is given twice: remove one")


def _is_host(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return _HOST.fullmatch(host) is not None
    return True
