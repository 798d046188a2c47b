"""The YAML file of a fleet that bids for RMF's tasks: its name, its robots, and the places that requests may name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.yaml_tree import Node, read_yaml, scalar_text
from robochoc.maps.file_content import as_input_errors, read_content

BYTES_MAX = 1 << 20
ROBOTS_MAX = 50
_FAR_M = 10**6
_LARGE = 10**9
_NAME_MAX = 100
_SPEED_MAX_MS = 100
_AXES = 2
_EXPECTED = "a fleet has the keys fleet, robots and places; see the page Open-RMF of the documentation"

Place = tuple[float, float]
"""The x and y of a place, in metres."""


class RobotSpec(NamedTuple):
    """A robot: its place at the start, and its speed in m/s."""

    at: Place
    speed_ms: float


class RmfFleet(NamedTuple):
    """The content of the file. `along_streets`: robots drive along the axes, not straight."""

    name: str
    robots: Mapping[str, RobotSpec]
    places: Mapping[str, Place]
    along_streets: bool = False

    def way_m(self, start: Place, end: Place) -> float:
        """Return the length of the way between two places, in metres."""
        x, y = abs(end[0] - start[0]), abs(end[1] - start[1])
        return x + y if self.along_streets else math.hypot(x, y)


def read_rmf_fleet(path: Path) -> RmfFleet:
    """Return the fleet in a file. Raises `InvalidInputError`."""
    with as_input_errors(path):
        try:
            text = read_content(path, BYTES_MAX).decode()
        except UnicodeDecodeError:
            raise MistakeError("is not text in UTF-8", "write the file as YAML") from None
        return read_yaml(text, _fleet, _EXPECTED)


def _fleet(root: Node) -> RmfFleet:
    if not root.is_mapping:
        raise MistakeError("is not a mapping", _EXPECTED, root.line)
    name, robots, places = (root.needed(key, "the fleet", _EXPECTED) for key in ("fleet", "robots", "places"))
    distance = root.get("distance")
    word = "straight" if distance is None else distance.scalar
    if distance is not None and word not in ("straight", "streets"):
        problem = f"'distance' is {shortened(scalar_text(word))!r}"
        raise MistakeError(problem, "write straight or streets", distance.line)
    found = RmfFleet(
        _text(name, "the fleet's name"),
        {_key(key, robots): _robot(node) for key, node in robots.named()},
        {_key(key, places): _place(node, "a place") for key, node in places.named()},
        along_streets=word == "streets",
    )
    for what, entries, node in (("robots", found.robots, robots), ("places", found.places, places)):
        if not entries:
            raise MistakeError(f"there are no {what}", f"write {what}: {{NAME: ...}}", node.line)
    if len(found.robots) > ROBOTS_MAX:
        raise MistakeError(f"there are {len(found.robots)} robots", f"write at most {ROBOTS_MAX}", robots.line)
    return found


def _key(key: object, node: Node) -> str:
    if not isinstance(key, str) or not key or not key.isprintable() or len(key) > _NAME_MAX:
        raise MistakeError(f"{shortened(repr(key))} is not a name", "write a text of at most 100 characters", node.line)
    return key


def _text(node: Node, what: str) -> str:
    if not node.is_scalar:
        raise MistakeError(f"{what} is not a text", "write one word", node.line)
    return _key(node.scalar, node)


def _robot(node: Node) -> RobotSpec:
    at, speed = node.needed("at", "a robot", "write at: [X, Y]"), node.get("speed")
    value = 1.0 if speed is None else _number(speed)
    if speed is not None and (value is None or not 0 < value <= _SPEED_MAX_MS):
        problem = f"'speed' is {shortened(scalar_text(speed.scalar))!r}"
        raise MistakeError(problem, f"write metres per second, up to {_SPEED_MAX_MS}", speed.line)
    return RobotSpec(_place(at, "'at'"), value or 1.0)


def _place(node: Node, what: str) -> Place:
    values = [_number(one) for one in node.items or ()]
    x, y = values if len(values) == _AXES else (None, None)
    if x is None or y is None or max(abs(x), abs(y)) > _FAR_M:
        raise MistakeError(f"{what} is not a place", f"expected [X, Y] in metres, within {_FAR_M:,}", node.line)
    return x, y


def _number(node: Node) -> float | None:
    value = node.scalar
    if isinstance(value, bool) or not isinstance(value, int | Fraction):
        return None
    return float(value) if -_LARGE <= value <= _LARGE else None
