"""The kinds of vehicles in a fleet: the syntax of their links, and defaults for their size."""

from __future__ import annotations

import importlib.util
import re
from enum import StrEnum

from robochoc.system.lazy_dataclass import dataclass

_HOST = r"(?:[A-Za-z0-9._-]{1,253}|\[[0-9A-Fa-f:.]{2,45}\]):(?P<port>\d{1,5})"


@dataclass(frozen=True)
class VehicleRules:
    """The rules for fleet files with one kind of vehicles, and the default values of fields."""

    link: re.Pattern[str]
    links: str
    """The syntax of a link, for error messages."""
    example: str
    entries: tuple[str, ...]
    """The names of entries that other kinds do not have."""
    takeoff_m: float
    least_takeoff_m: float
    near_m: float
    distance_m: float
    renews_m: float
    """The distance to the last set point at which a vehicle gets the next one on its line, in metres."""
    connect_s: float
    """The longest time from a vehicle's first message until it has reported everything. 0: as for a silent vehicle."""
    alone: str
    """The behaviour of vehicles after the loss of the guard, for error messages."""


class VehicleKind(StrEnum):
    """A kind of vehicle; its value is the name of the sink."""

    MAVLINK = "mavlink"
    CRAZYFLIE = "crazyflie"

    @property
    def rules(self) -> VehicleRules:
        """Return the rules for fleets of this kind."""
        return _RULES[self]


_RULES = {
    VehicleKind.MAVLINK: VehicleRules(
        link=re.compile(
            rf"(?:udpin|udpout|tcpin|tcpout)://{_HOST}|serial:///dev/(?!.*\.\.)[A-Za-z0-9._/-]{{1,200}}:\d{{2,8}}",
            re.ASCII,
        ),
        links="udpin://0.0.0.0:14540, or udpout, tcpin, tcpout, or serial:///dev/ttyUSB0:57600",
        example="udpin://0.0.0.0:14540",
        entries=("origin",),
        takeoff_m=2.5,
        least_takeoff_m=0.5,
        near_m=0.5,
        distance_m=1.0,
        renews_m=2.0,  # ArduCopter brakes for each new set point
        connect_s=0.0,
        alone="vehicles follow their own failsafe",
    ),
    # A channel is 0 to 125, that is 2,400 to 2,525 MHz.
    VehicleKind.CRAZYFLIE: VehicleRules(
        link=re.compile(
            r"radio://(?:\d{1,2}|[0-9A-Fa-f]{10})/(?:\d{1,2}|1[01]\d|12[0-5])/(?:250K|1M|2M)/[0-9A-Fa-f]{10}"
            r"|udp://[A-Za-z0-9._-]{1,253}:(?P<port>\d{1,5})",
            re.ASCII,
        ),
        links="radio://0/80/2M/E7E7E7E701 (dongle, channel, rate, address), or udp://127.0.0.1:19850",
        example="radio://0/80/2M/E7E7E7E701",
        entries=("speed",),
        takeoff_m=0.5,
        least_takeoff_m=0.2,
        near_m=0.1,
        distance_m=0.4,
        renews_m=0.3,  # each set point is a radio command and a new trajectory
        connect_s=60.0,
        alone="vehicles fly to their targets, and hover there",
    ),
}


_RECEIVES = re.compile(r"(?P<transport>udp|tcp)in://(?P<host>.+):(?P<port>\d+)", re.ASCII)
_ALL_HOSTS = frozenset({"0.0.0.0", "[::]"})  # noqa: S104 - as it stands in links
_OWN_HOSTS = frozenset({"127.0.0.1", "localhost", "[::1]"})


def shared_port(url: str, other: str) -> str:
    """Return the port on which two links would both receive on this machine; empty if there is none.

    >>> shared_port("udpin://0.0.0.0:14540", "udpin://127.0.0.1:14540")
    '14540'
    """
    first, second = _RECEIVES.fullmatch(url), _RECEIVES.fullmatch(other)
    if not first or not second:
        return ""
    if (first["transport"], int(first["port"])) != (second["transport"], int(second["port"])):
        return ""
    hosts = {first["host"].lower(), second["host"].lower()}
    return first["port"] if len(hosts) == 1 or hosts & _ALL_HOSTS or hosts <= _OWN_HOSTS else ""


def address_of(url: str) -> str:
    """Return the part of a link that identifies the vehicle, without the dongle of a Crazyflie.

    >>> address_of("radio://1/80/2M/e7e7e7e701")
    'radio 80 2M E7E7E7E701'
    """
    scheme, _, rest = url.partition("://")
    if scheme != "radio":
        return url
    _, channel, rate, address = rest.split("/")
    return f"radio {int(channel)} {rate} {address.upper()}"


def require_library(library: str) -> None:
    """Raise `ModuleNotFoundError` if `library` is not installed. Only the guard process imports it."""
    if importlib.util.find_spec(library) is None:
        raise ModuleNotFoundError(f"No module named {library!r}", name=library)
