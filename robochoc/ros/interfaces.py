"""The services and actions that robochoc offers or calls: their definitions, and the messages that these consist of.

Definitions have the form of `.srv` and `.action` files: the parts are separated by lines of `---`. ROS 2 derives a
request and a response from each service. From each action, it derives the services `SendGoal` and `GetResult`, and the
message `FeedbackMessage` (design.ros2.org, "Actions"). Definitions without comments are from the public packages
`std_srvs`, `action_msgs` (rcl_interfaces), `nav2_msgs` (navigation2) and `crazyflie_interfaces` (crazyswarm2).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import Literal, NamedTuple

Namespace = Literal["msg", "srv", "action"]
"""The folder of a definition in its package. It is part of the name of a type in ROS 2."""

CANCEL_GOAL = "action_msgs/CancelGoal"
"""The type of the service that cancels goals, for all actions."""
EMPTY = "uint8 structure_needs_at_least_one_member\n"
"""The field that ROS 2 adds to a structure without fields."""

_DECIDE_REQUEST = """\
string team
string changes
float64 timeout
---
"""
_DECIDE_ANSWER = """\
bool success
string message
string verdict
string cost
string[] variables
int64[] values
string[] withdrawn
string result
"""
DECIDE_SERVICE = _DECIDE_REQUEST + _DECIDE_ANSWER
DECIDE_ACTION = f"""\
{_DECIDE_REQUEST}{_DECIDE_ANSWER}---
string team
string state
float64 elapsed
uint64 messages
uint32 robots
uint32 decided
string cost
string[] variables
int64[] values
"""
_GROUP_HEIGHT = "uint8 group_mask\nfloat32 height\nbuiltin_interfaces/Duration duration\n---\n"
_SERVICES: Mapping[str, str] = MappingProxyType(
    {
        "action_msgs/CancelGoal": (
            "action_msgs/GoalInfo goal_info\n---\nint8 return_code\naction_msgs/GoalInfo[] goals_canceling\n"
        ),
        "crazyflie_interfaces/GoTo": (
            "uint8 group_mask\nbool relative\ngeometry_msgs/Point goal\nfloat32 yaw\n"
            "builtin_interfaces/Duration duration\n---\n"
        ),
        "crazyflie_interfaces/Land": _GROUP_HEIGHT,
        "crazyflie_interfaces/Takeoff": _GROUP_HEIGHT,
        "robochoc_msgs/Decide": DECIDE_SERVICE,
        "std_srvs/Trigger": "---\nbool success\nstring message\n",
    }
)

_NAVIGATE_RESULTS: Mapping[str, str] = MappingProxyType(
    {
        "humble": "std_msgs/Empty result\n",
        "iron": "uint16 error_code\n",
        "jazzy": "uint16 error_code\n",
    }
)
"""The result of `NavigateToPose` in older distributions of ROS 2. Later ones also have the error as text."""
_TRACKING_ERRORS = frozenset({"humble", "iron", "jazzy", "kilted"})
"""The distributions without tracking errors in the feedback of `NavigateToPose`."""
DISTRIBUTION = "jazzy"
"""The distribution of ROS 2 that is assumed if `ROS_DISTRO` is not set."""


class _Part(NamedTuple):
    namespace: Namespace
    text: str


def distribution() -> str:
    """Return the distribution of the robots' ROS 2, which `ROS_DISTRO` names."""
    return os.environ.get("ROS_DISTRO", "").strip() or DISTRIBUTION


def part_definition(kind: str) -> str:
    """Return the definition of a message that a service or action consists of; empty for other types."""
    part = _parts(distribution()).get(kind)
    return part.text if part else ""


def part_kinds() -> tuple[str, ...]:
    """Return the names of all messages that services and actions consist of."""
    return tuple(_parts(distribution()))


def namespace_of(kind: str) -> Namespace:
    """Return the namespace of a type, a service, an action, or one of their messages, named `package/Type`."""
    parts = _parts(distribution())
    part = parts.get(kind) or parts.get(f"{kind}_Request")
    return part.namespace if part else "msg"


def full_name(kind: str) -> str:
    """Return the name of a type in ROS 2, such as `std_srvs/srv/Trigger` for `std_srvs/Trigger`."""
    return kind.replace("/", f"/{namespace_of(kind)}/", 1)


def _actions(ros: str) -> Mapping[str, str]:
    """Return the definitions of all actions in the distribution `ros`."""
    result = _NAVIGATE_RESULTS.get(ros, "uint16 error_code\nstring error_msg\n")
    errors = "" if ros in _TRACKING_ERRORS else "float32 position_tracking_error\nfloat32 heading_tracking_error\n"
    return {
        "robochoc_msgs/Decide": DECIDE_ACTION,
        "nav2_msgs/NavigateToPose": (
            f"geometry_msgs/PoseStamped pose\nstring behavior_tree\n---\n{result}---\n"
            "geometry_msgs/PoseStamped current_pose\n"
            "builtin_interfaces/Duration navigation_time\n"
            "builtin_interfaces/Duration estimated_time_remaining\n"
            f"int16 number_of_recoveries\nfloat32 distance_remaining\n{errors}"
        ),
    }


@cache
def _parts(ros: str) -> Mapping[str, _Part]:
    """Return the messages of all services and actions in the distribution `ros`, by name."""
    found: dict[str, _Part] = {}
    for kind, text in _SERVICES.items():
        halves = zip(("Request", "Response"), _split(text), strict=True)
        found |= {f"{kind}_{half}": _Part("srv", part) for half, part in halves}
    for kind, text in _actions(ros).items():
        found |= {f"{kind}_{part}": _Part("action", fields) for part, fields in _action_parts(kind, text)}
    return found


def _action_parts(kind: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield the names and definitions of the messages of an action."""
    goal, result, feedback = _split(text)
    uuid = "unique_identifier_msgs/UUID goal_id\n"
    yield "Goal", goal
    yield "Result", result
    yield "Feedback", feedback
    yield "SendGoal_Request", _with_field(uuid, "goal", f"{kind}_Goal", goal)
    yield "SendGoal_Response", "bool accepted\nbuiltin_interfaces/Time stamp\n"
    yield "GetResult_Request", uuid
    yield "GetResult_Response", _with_field("int8 status\n", "result", f"{kind}_Result", result)
    yield "FeedbackMessage", _with_field(uuid, "feedback", f"{kind}_Feedback", feedback)


def _with_field(text: str, name: str, kind: str, definition: str) -> str:
    """Return `text` with one more field, followed by the definition of its type, as in a recording."""
    return f"{text}{kind} {name}\n{'=' * 80}\nMSG: {kind}\n{definition}"


def _split(text: str) -> list[str]:
    """Return the definitions of the parts of a service or action."""
    return [part.lstrip("\n") or EMPTY for part in text.split("---\n")]
