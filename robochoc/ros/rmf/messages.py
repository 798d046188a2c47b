"""RMF's task messages as values. Times and durations are in nanoseconds. Received messages are untrusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Annotated, Any

import msgspec

from robochoc.robots.sink import Fields

_SECOND_NS = 10**9
_INTEGER_MIN, _INTEGER_MAX = -(2**63), 2**64 - 1
REQUEST_CHARACTERS_MAX = 64 * 1024
"""The maximum length of a request for a task, in characters of JSON."""
_Name = Annotated[str, msgspec.Meta(max_length=256)]
_Json = Annotated[str, msgspec.Meta(max_length=REQUEST_CHARACTERS_MAX)]
_Errors = Annotated[tuple[_Json, ...], msgspec.Meta(max_length=100)]


class CommandType(IntEnum):
    """The type of a `DispatchCommand`."""

    AWARD = 1
    REMOVE = 2


class TaskStatus(IntEnum):
    """The status of a task in `DispatchStates`."""

    QUEUED = 1
    SELECTED = 2
    DISPATCHED = 3
    FAILED = 4
    CANCELED = 5


class ResponseType(IntEnum):
    """The type of an `ApiResponse`."""

    ACKNOWLEDGE = 1
    RESPONDING = 2


class ApiRequest(msgspec.Struct, frozen=True):
    """A request of a user, such as for a new task, as JSON."""

    json_msg: _Json
    request_id: _Name


class ApiResponse(msgspec.Struct, frozen=True):
    """The answer to the request `request_id`."""

    type: int
    json_msg: str
    request_id: str


class BidNotice(msgspec.Struct, frozen=True):
    """The dispatcher asks all fleets for bids for a task. `dry_run`: the task is not awarded on these bids."""

    request: _Json
    task_id: _Name
    time_window: int
    dry_run: bool = False


class BidProposal(msgspec.Struct, frozen=True):
    """A fleet's bid: its costs without and with the task, the robot, and the time at which the task is finished."""

    fleet_name: _Name = ""
    expected_robot_name: _Name = ""
    prev_cost: float = 0.0
    new_cost: float = 0.0
    finish_time: int = 0

    @property
    def added_cost(self) -> float:
        """The cost that the task adds."""
        return self.new_cost - self.prev_cost

    @property
    def is_valid(self) -> bool:
        """True if it has a fleet, and finite costs."""
        return bool(self.fleet_name) and math.isfinite(self.prev_cost) and math.isfinite(self.new_cost)


class BidResponse(msgspec.Struct, frozen=True):
    """A fleet's answer to a `BidNotice`, with a proposal, or errors only. Without a proposal, the fleet is unknown."""

    task_id: _Name
    has_proposal: bool
    proposal: BidProposal = BidProposal()
    errors: _Errors = ()


class DispatchCommand(msgspec.Struct, frozen=True):
    """The dispatcher awards a task to a fleet, or removes it. Other fleets drop their bids for the task."""

    fleet_name: _Name
    task_id: _Name
    dispatch_id: Annotated[int, msgspec.Meta(ge=0)]
    timestamp: int
    type: int


class DispatchAck(msgspec.Struct, frozen=True):
    """A fleet's answer to the command `dispatch_id`."""

    dispatch_id: int
    success: bool
    errors: _Errors = ()


class Assignment(msgspec.Struct, frozen=True):
    """The fleet and robot of a task, if there is one."""

    is_assigned: bool = False
    fleet_name: str = ""
    expected_robot_name: str = ""


class DispatchState(msgspec.Struct, frozen=True):
    """The state of a task at the dispatcher."""

    task_id: str
    status: int
    assignment: Assignment = Assignment()
    errors: tuple[str, ...] = ()


class DispatchStates(msgspec.Struct, frozen=True):
    """The tasks that are being dispatched, and those that were recently dispatched or given up."""

    active: tuple[DispatchState, ...]
    finished: tuple[DispatchState, ...]


class TaskStateUpdate(msgspec.Struct, frozen=True):
    """The state of a task at a fleet, as JSON (the schema task_state_update of rmf_api_msgs)."""

    data: str


Message = (
    ApiRequest
    | ApiResponse
    | BidNotice
    | BidResponse
    | DispatchCommand
    | DispatchAck
    | DispatchStates
    | TaskStateUpdate
)
TOPICS: Mapping[type[Message], tuple[str, str]] = MappingProxyType(
    {
        ApiRequest: ("/task_api_requests", "rmf_task_msgs/ApiRequest"),
        ApiResponse: ("/task_api_responses", "rmf_task_msgs/ApiResponse"),
        BidNotice: ("/rmf_task/bid_notice", "rmf_task_msgs/BidNotice"),
        BidResponse: ("/rmf_task/bid_response", "rmf_task_msgs/BidResponse"),
        DispatchCommand: ("/rmf_task/dispatch_request", "rmf_task_msgs/DispatchCommand"),
        DispatchAck: ("/rmf_task/dispatch_ack", "rmf_task_msgs/DispatchAck"),
        DispatchStates: ("/dispatch_states", "rmf_task_msgs/DispatchStates"),
        TaskStateUpdate: ("/task_state_update", "std_msgs/String"),
    }
)
"""The topic and the ROS type of each message, as in RMF's dispatcher and fleet adapters."""
_CLASSES = {topic: kind for kind, (topic, _) in TOPICS.items()}
_TIMES = {"time_window", "finish_time", "timestamp"}


def fields_of(message: Message, *, as_json: bool = False) -> dict[str, Any]:
    """Return the fields of a message for a sink. `as_json`: times have the form of rosbridge."""
    fields: dict[str, Any] = msgspec.to_builtins(message)
    return _with_json_times(fields) if as_json else fields


def message_of(topic: str, fields: Fields) -> Message | None:
    """Return the message with these fields on an RMF topic; None if it is malformed, too long, or of another topic."""
    kind = _CLASSES.get(topic)
    if kind is None or not _is_sendable(fields):
        return None
    try:
        return msgspec.convert(_with_integer_times(fields), kind)
    except (msgspec.ValidationError, RecursionError):
        return None


def _is_sendable(value: object) -> bool:
    """Return whether all texts and integers in a value can be sent again: otherwise no answer is possible."""
    match value:
        case str():
            return _is_text(value)
        case int():
            return _INTEGER_MIN <= value <= _INTEGER_MAX
        case Mapping():
            return all(map(_is_sendable, value.values()))
        case list() | tuple():
            return all(map(_is_sendable, value))
        case _:
            return True


def _is_text(value: str) -> bool:
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return "\0" not in value


def _with_json_times(fields: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in fields.items():
        if name in _TIMES:
            found[name] = dict(zip(("sec", "nanosec"), divmod(value, _SECOND_NS), strict=True))
        else:
            found[name] = _with_json_times(value) if isinstance(value, Mapping) else value
    return found


def _with_integer_times(fields: Fields) -> dict[str, Any]:
    """Return `fields` with times as integers; those of rosbridge are objects."""
    found: dict[str, Any] = {}
    for name, value in fields.items():
        match value:
            case {"sec": int(seconds), "nanosec": int(rest)} if name in _TIMES:
                found[name] = seconds * _SECOND_NS + rest
            case Mapping():
                found[name] = _with_integer_times(value)
            case _:
                found[name] = value
    return found
