"""Mappings from waypoints to messages of the ROS types of topics.

Some types are built in. Packages add others in the entry point group `robochoc.waypoints`. The name of an entry is the
ROS type, such as `mavros_msgs/PositionTarget`; its value is a function from a `Waypoint` to the fields of a message, or
a `WaypointMapping`, which can also define a type that no distribution of ROS has.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType
from typing import cast

from robochoc.flight.layout import Point
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, Waypoint
from robochoc.system.errors import RobochocError
from robochoc.system.installed import entry_point_names, entry_points_named, load_entry_point
from robochoc.system.lazy_dataclass import dataclass

GROUP = "robochoc.waypoints"

_SPELLING = re.compile(r"([A-Za-z]\w*)/(?:msg/)?([A-Za-z]\w*)", re.ASCII)
UPRIGHT: Fields = {"w": 1.0}
"""The orientation of an upright robot that faces along x."""


class NoMappingError(RobochocError):
    """Waypoints cannot be converted to the type of a topic. The message lists the known types."""


@dataclass(frozen=True)
class WaypointMapping:
    """Converts waypoints to the fields of messages of one ROS type.

    `definition` is the text of the type's `.msg` file, for a type that no distribution of ROS has. If types of its
    fields are of this kind, their definitions follow, each after a line of 80 `=` and a line `MSG: package/Type`, as in
    a recording.
    """

    fields: Callable[[Waypoint], Fields]
    definition: str = ""


def short_kind(kind: str) -> str:
    """Return `geometry_msgs/PoseStamped` for both spellings of this type. Other texts are returned unchanged."""
    found = _SPELLING.fullmatch(kind.strip())
    return f"{found[1]}/{found[2]}" if found else kind


def kinds() -> tuple[str, ...]:
    """Return all built-in and installed types of waypoints, sorted."""
    return tuple(sorted({*_BUILT_IN, *map(short_kind, entry_point_names(GROUP))}))


@cache
def mapping_for(kind: str) -> WaypointMapping | None:
    """Return the mapping to the type `kind`, in either spelling; None if there is no mapping.

    Raises:
        NoMappingError: The mapping of an installed package is broken.
    """
    short = short_kind(kind)
    if short in _BUILT_IN:
        return WaypointMapping(_BUILT_IN[short], _DEFINITIONS.get(short, ""))
    namesakes = [
        entry
        for name in entry_point_names(GROUP)
        if short_kind(name) == short
        for entry in entry_points_named(GROUP, name)
    ]
    if not namesakes:
        return None
    found = load_entry_point(namesakes[0], namesakes, _fault)
    if found.broken:
        raise NoMappingError(on_one_line(f"{namesakes[0].value}, the mapping of waypoints to {kind}, {found.broken}"))
    if isinstance(found.what, WaypointMapping):
        return found.what
    return WaypointMapping(cast("Callable[[Waypoint], Fields]", found.what))


def mapping_of(topic: str, robot: str, kind: str) -> WaypointMapping:
    """Return the mapping for the `topic` of a `robot`. Raises `NoMappingError`."""
    found = mapping_for(kind)
    if found is None:
        subject = f"topic {topic!r} of {robot}" if robot else f"topic {topic!r}"
        problem = f"{subject} has the type {kind!r}, to which waypoints cannot be converted"
        known = f"known types: {', '.join(kinds())}; packages may add others ({GROUP}){_suggestion(kind)}"
        raise NoMappingError(on_one_line(f"{problem}: {known}"))
    return found


def _suggestion(kind: str) -> str:
    """Return the known type with the most similar name, as the end of an error message; empty if there is none."""
    import difflib  # noqa: PLC0415 - start-up: only needed for errors

    near = difflib.get_close_matches(kind, kinds(), 1)
    return f"; did you mean {near[0]!r}?" if near else ""


def definition_of(kind: str) -> str:
    """Return the definition of `kind` in an installed package; empty if there is none."""
    try:
        found = mapping_for(kind)
    except NoMappingError:
        return ""
    return found.definition if found else ""


def _fault(found: object) -> str:
    return "" if isinstance(found, WaypointMapping) or callable(found) else "is not a function or WaypointMapping"


def point(at: Point) -> Fields:
    """Return the fields of a `geometry_msgs/Point`, or a `Vector3`."""
    return {"x": at[0], "y": at[1], "z": at[2]}


def header(waypoint: Waypoint) -> Fields:
    """Return the fields of a `std_msgs/Header`."""
    return {"stamp": waypoint.stamp, "frame_id": waypoint.frame}


def _pose(waypoint: Waypoint) -> Fields:
    return _pose_at(waypoint.at)


def _pose_at(at: Point) -> Fields:
    return {"position": point(at), "orientation": UPRIGHT}


def _transform(waypoint: Waypoint) -> Fields:
    return {"translation": point(waypoint.at), "rotation": UPRIGHT}


def _with_header(part: str, make: Callable[[Waypoint], object]) -> Callable[[Waypoint], Fields]:
    return lambda waypoint: {"header": header(waypoint), part: make(waypoint)}


def _point(waypoint: Waypoint) -> Fields:
    return point(waypoint.at)


def _transform_stamped(waypoint: Waypoint) -> Fields:
    child = waypoint.topic.removeprefix("/")
    return {"header": header(waypoint), "child_frame_id": child, "transform": _transform(waypoint)}


def _transforms(waypoint: Waypoint) -> Fields:
    return {"transforms": [_transform_stamped(waypoint)]}


def _path(waypoint: Waypoint) -> Fields:
    """Return the straight path from the previous goal, if there is one, through all stops."""
    places = [*([] if waypoint.before is None else [waypoint.before]), *waypoint.way]
    stops = [{"header": header(waypoint), "pose": _pose_at(at)} for at in places]
    return {"header": header(waypoint), "poses": stops}


def _odometry(waypoint: Waypoint) -> Fields:
    return {
        "header": header(waypoint),
        "child_frame_id": waypoint.topic.removeprefix("/"),
        "pose": {"pose": _pose(waypoint)},
    }


def _trajectory(waypoint: Waypoint) -> Fields:
    name = waypoint.topic.removeprefix("/")
    return {
        "header": header(waypoint),
        "joint_names": [name],
        "points": [{"transforms": [_transform(waypoint)], "velocities": [{}], "accelerations": [{}]}],
    }


def _text(waypoint: Waypoint) -> Fields:
    """Return the waypoint as JSON on one line, for programs without ROS messages."""
    place = dict(zip("xyz", waypoint.at, strict=True))
    fields = {"frame": waypoint.frame, "stamp": waypoint.stamp, **place, "lands": waypoint.lands}
    stops = [{**dict(zip("xyz", stop.at, strict=True)), "task": stop.task} for stop in waypoint.stops]
    return {"data": json.dumps({**fields, "stops": stops} if stops else fields)}


_BUILT_IN: Mapping[str, Callable[[Waypoint], Fields]] = MappingProxyType(
    {
        "geometry_msgs/PoseStamped": _with_header("pose", _pose),
        "geometry_msgs/Pose": _pose,
        "geometry_msgs/PoseWithCovarianceStamped": _with_header("pose", lambda waypoint: {"pose": _pose(waypoint)}),
        "geometry_msgs/PointStamped": _with_header("point", _point),
        "geometry_msgs/Point": _point,
        "geometry_msgs/Vector3Stamped": _with_header("vector", _point),
        "geometry_msgs/Vector3": _point,
        "geometry_msgs/TransformStamped": _transform_stamped,
        "geometry_msgs/Transform": _transform,
        "geometry_msgs/Point32": _point,
        "geometry_msgs/Pose2D": lambda waypoint: {"x": waypoint.at[0], "y": waypoint.at[1]},
        "geometry_msgs/PoseArray": _with_header("poses", lambda waypoint: [*map(_pose_at, waypoint.way)]),
        "nav_msgs/Odometry": _odometry,
        "nav_msgs/Path": _path,
        "std_msgs/Float32": lambda waypoint: {"data": waypoint.at[2]},
        "std_msgs/Float64": lambda waypoint: {"data": waypoint.at[2]},
        "std_msgs/Float64MultiArray": lambda waypoint: {"data": [*waypoint.at]},
        "std_msgs/String": _text,
        "tf2_msgs/TFMessage": _transforms,
        "trajectory_msgs/MultiDOFJointTrajectory": _trajectory,
    }
)
_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {"tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n"}
)
"""Definitions of ROS 1 types that are missing in rosbags."""
