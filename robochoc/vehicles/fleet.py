"""The fleet file: the vehicle of each drone, the vehicle's link, and the limits for flights.

`mavlink:FILE` and `crazyflie:FILE` refer to such a file, in YAML (docs/guides/autopilots.md). The whole file is checked
when it is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path

import msgspec

from robochoc.flight.layout import Point
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.settings_file import check_mapping, decimal, number_at, read_settings
from robochoc.formats.yaml_tree import Node, scalar_text
from robochoc.system.errors import RobochocError
from robochoc.vehicles.frames import FAR_M, LATITUDE_MAX, GpsPlace
from robochoc.vehicles.kinds import VehicleKind, address_of, shared_port

VEHICLES_MAX = 64
_PORTS = range(1, 65_536)
_EXPECTED = "see the page Autopilots of the documentation for the entries of a fleet file"
_CORNERS, _AXES = 2, 3


class FleetError(RobochocError):
    """The fleet file is invalid. The message has the file name, the line, and the expected content."""


class AtEnd(StrEnum):
    """The final command to vehicles when a run ends, for any reason."""

    LAND = "land"
    HOLD = "hold"


class Fence(msgspec.Struct, frozen=True):
    """A box that vehicles must not leave, given by its lowest and its highest corner, in metres."""

    low: Point
    high: Point

    def contains(self, place: Point, margin_m: float = 0.0) -> bool:
        """Return whether `place` is in the box, or outside by at most `margin_m` along each axis."""
        sides = zip(self.low, place, self.high, strict=True)
        return all(low - margin_m <= at <= high + margin_m for low, at, high in sides)

    def covers(self, place: Point, margin_m: float = 0.0) -> bool:
        """Return whether `place` is in the box or, like some places on the ground, directly below the box."""
        x, y, z = place
        return self.contains((x, y, max(z, self.low[2])), margin_m)

    def __str__(self) -> str:
        return f"{point_text(self.low)} to {point_text(self.high)}"


class VehicleLink(msgspec.Struct, frozen=True):
    """The link to a vehicle, in its library's syntax, and the place of the vehicle's origin in the team's frame."""

    url: str
    at: Point = (0.0, 0.0, 0.0)


class Fleet(msgspec.Struct, frozen=True):
    """The content of a fleet file."""

    vehicles: Mapping[str, VehicleLink]
    """The links, by drone name."""
    fence: Fence
    origin: GpsPlace | None = None
    """The place of the team's origin on the earth. None: places are relative to the vehicles' own origins."""
    takeoff_m: float = 2.5
    """The height of a take-off above the vehicle's place."""
    near_m: float = 0.5
    """A vehicle within this distance of a place has reached it."""
    end: AtEnd = AtEnd.LAND
    patience_s: float = 10.0
    """The time without messages after which a vehicle counts as lost."""
    time_s: float = 120.0
    """The longest time for flying a decision."""
    kind: VehicleKind = VehicleKind.MAVLINK
    speed_ms: float = 1.0
    """The highest speed, in m/s, for kinds of vehicles that need a limit."""
    distance_m: float = 1.0
    """The distance that vehicles keep from each other, between their centres."""
    downwash: float = 1.0
    """The vertical distance between vehicles, as a multiple of `distance_m`."""

    @property
    def connect_s(self) -> float:
        """The longest time from a vehicle's first message until it has reported everything, in seconds."""
        return max(self.patience_s, self.kind.rules.connect_s)

    @property
    def tolerance_m(self) -> float:
        """The largest deviation with which a vehicle still counts as on its line, in metres."""
        return min(self.near_m, self.distance_m / 4)


def read_fleet(path: Path, kind: VehicleKind = VehicleKind.MAVLINK) -> Fleet:
    """Return the fleet in the file at `path`. Raises `FleetError`."""
    hint = f"name a fleet file, as in {kind}:fleet.yaml"
    if path == Path():  # --ros mavlink, without a place
        raise FleetError(f"{kind}: the fleet file is missing; {hint}")
    return read_settings(path, lambda root: _fleet(root, kind), "a fleet file", _EXPECTED, hint, FleetError)


def _fleet(root: Node, kind: VehicleKind) -> Fleet:
    rules = kind.rules
    check_mapping(root, "a fleet file")
    vehicles, box = (root.needed(key, f"a fleet file of {kind}", _EXPECTED) for key in ("vehicles", "fence"))
    end, place = root.get("end"), root.get("origin") if "origin" in rules.entries else None
    origin = _origin(place) if place else None
    fleet = Fleet(
        _vehicles(vehicles, kind, origin),
        _fence(box),
        origin,
        takeoff_m=number_at(root, "takeoff", rules.takeoff_m, rules.least_takeoff_m, 100),
        near_m=number_at(root, "near", rules.near_m, 0.05, 10),
        end=_end(end) if end else AtEnd.LAND,
        patience_s=number_at(root, "patience", 10, 1, 600),
        time_s=number_at(root, "time", 120, 1, 3_600),
        kind=kind,
        speed_ms=number_at(root, "speed", 1.0, 0.1, 5) if "speed" in rules.entries else 1.0,
        distance_m=number_at(root, "distance", rules.distance_m, 0.1, 100),
        downwash=number_at(root, "downwash", 1, 1, 10),
    )
    low, high = fleet.fence.low[2], fleet.fence.high[2]
    if fleet.takeoff_m > high - low:
        line = (root.get("takeoff") or box).line
        raise MistakeError(
            f"a take-off to {fleet.takeoff_m:g} m would leave the fence, which is {high - low:g} m high",
            "raise the fence, or lower 'takeoff'",
            line,
        )
    return fleet


def _vehicles(node: Node, kind: VehicleKind, origin: GpsPlace | None) -> dict[str, VehicleLink]:
    found: dict[str, VehicleLink] = {}
    names: dict[str, str] = {}
    check_mapping(node, "'vehicles'")
    for key, entry in node.named():
        name = scalar_text(key)
        link = _link(entry, name, kind, origin)
        address = address_of(link.url)
        if address in names:
            problem = f"{shortened(name)} and {shortened(names[address])} have the same link"
            raise MistakeError(problem, "each vehicle needs its own link", entry.line)
        for other, its in found.items():
            if port := shared_port(link.url, its.url):
                problem = f"{shortened(name)} and {shortened(other)} both receive at port {port} of this machine"
                raise MistakeError(problem, "only one of them would get messages: give each its own port", entry.line)
        names[address] = name
        found[name] = link
    if not 0 < len(found) <= VEHICLES_MAX:
        raise MistakeError(f"{len(found)} vehicles", f"a fleet has 1 to {VEHICLES_MAX}", node.line)
    return found


def _link(node: Node, name: str, kind: VehicleKind, origin: GpsPlace | None) -> VehicleLink:
    if not node.is_mapping:
        return VehicleLink(_url(node, name, kind))
    link = node.needed("link", f"vehicle {shortened(name)}", f"as in link: {kind.rules.example}")
    at = node.get("at")
    if at is None:
        return VehicleLink(_url(link, name, kind))
    if origin:
        raise MistakeError("'at' is for vehicles without GPS", "delete it, or 'origin'", at.line)
    return VehicleLink(_url(link, name, kind), _point(at, "'at'"))


def _url(node: Node, name: str, kind: VehicleKind) -> str:
    text = node.scalar
    found = kind.rules.link.fullmatch(text) if isinstance(text, str) else None
    if isinstance(text, str) and found and (found["port"] is None or int(found["port"]) in _PORTS):
        return text
    raise MistakeError(
        f"the link of {shortened(name)}, {shortened(scalar_text(text))!r}, is not valid",
        f"expected {kind.rules.links}",
        node.line,
    )


def _fence(node: Node) -> Fence:
    corners = [_point(one, "a corner of the fence") for one in node.items or ()]
    if len(corners) != _CORNERS:
        raise MistakeError("'fence' is not a box", "expected two corners, as in [[0, 0, 0], [6, 6, 6]]", node.line)
    low_x, low_y, low_z = (min(pair) for pair in zip(*corners, strict=True))
    high_x, high_y, high_z = (max(pair) for pair in zip(*corners, strict=True))
    return Fence((low_x, low_y, low_z), (high_x, high_y, high_z))


def _origin(node: Node) -> GpsPlace:
    values = [decimal(one) for one in node.items or ()]
    latitude, longitude, altitude = values if len(values) == _AXES else (None, None, None)
    if latitude is None or longitude is None or altitude is None:
        raise MistakeError(
            "'origin' is not a place", "expected [latitude, longitude, metres above sea level], in degrees", node.line
        )
    if abs(latitude) > LATITUDE_MAX or abs(longitude) > 180 or not -500 <= altitude <= 9_000:  # noqa: PLR2004
        limits = f"latitudes within {LATITUDE_MAX:g}, longitudes within 180 degrees, -500 to 9,000 m"
        raise MistakeError("'origin' is outside the limits", f"expected {limits}", node.line)
    return GpsPlace(latitude, longitude, altitude)


def _end(node: Node) -> AtEnd:
    for how in AtEnd:
        if node.scalar == how.value:
            return how
    raise MistakeError(f"'end' is {shortened(scalar_text(node.scalar))!r}", f"expected {' or '.join(AtEnd)}", node.line)


def _point(node: Node, what: str) -> Point:
    values = [decimal(one) for one in node.items or ()]
    x, y, z = values if len(values) == _AXES else (None, None, None)
    if x is None or y is None or z is None or max(abs(x), abs(y), abs(z)) > FAR_M:
        raise MistakeError(f"{what} is not a place", f"expected [x, y, z] in metres, within {FAR_M:,g}", node.line)
    return x, y, z


def point_text(place: Point) -> str:
    """Return a place as text, in metres: `3, 1, 2.5`."""
    return ", ".join(f"{round(at, 2):g}" for at in place)
