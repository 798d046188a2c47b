"""The types of `NavigateToPose` and of ROS 2's actions, written by hand from the published definitions (Jazzy).

A request or response over DDS begins with the id of the client and the number of the call; `with_header` adds them.
"""

from dataclasses import dataclass, field, fields
from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl.types import array, float32, int8, int16, int32, int64, sequence, uint8, uint16, uint32, uint64

from tests.support.dds_peer import PoseStamped, Time

_ACTION = "nav2_msgs.action.dds_.NavigateToPose"


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces.msg.dds_.Duration_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class UUID(IdlStruct, typename="unique_identifier_msgs.msg.dds_.UUID_"):
    uuid: array[uint8, 16] = field(default_factory=lambda: [0] * 16)  # type: ignore[type-arg, valid-type, assignment]


@dataclass
class Goal(IdlStruct, typename=f"{_ACTION}_Goal_"):
    pose: PoseStamped = field(default_factory=PoseStamped)
    behavior_tree: str = ""


@dataclass
class Result(IdlStruct, typename=f"{_ACTION}_Result_"):
    error_code: uint16 = 0


@dataclass
class Feedback(IdlStruct, typename=f"{_ACTION}_Feedback_"):
    current_pose: PoseStamped = field(default_factory=PoseStamped)
    navigation_time: Duration = field(default_factory=Duration)
    estimated_time_remaining: Duration = field(default_factory=Duration)
    number_of_recoveries: int16 = 0
    distance_remaining: float32 = 0.0


@dataclass
class FeedbackMessage(IdlStruct, typename=f"{_ACTION}_FeedbackMessage_"):
    goal_id: UUID = field(default_factory=UUID)
    feedback: Feedback = field(default_factory=Feedback)


@dataclass
class SendGoalRequest(IdlStruct, typename=f"{_ACTION}_SendGoal_Request_"):
    goal_id: UUID = field(default_factory=UUID)
    goal: Goal = field(default_factory=Goal)


@dataclass
class SendGoalResponse(IdlStruct, typename=f"{_ACTION}_SendGoal_Response_"):
    accepted: bool = False
    stamp: Time = field(default_factory=Time)


@dataclass
class GetResultRequest(IdlStruct, typename=f"{_ACTION}_GetResult_Request_"):
    goal_id: UUID = field(default_factory=UUID)


@dataclass
class GetResultResponse(IdlStruct, typename=f"{_ACTION}_GetResult_Response_"):
    status: int8 = 0
    result: Result = field(default_factory=Result)


@dataclass
class GoalInfo(IdlStruct, typename="action_msgs.msg.dds_.GoalInfo_"):
    goal_id: UUID = field(default_factory=UUID)
    stamp: Time = field(default_factory=Time)


@dataclass
class CancelRequest(IdlStruct, typename="action_msgs.srv.dds_.CancelGoal_Request_"):
    goal_info: GoalInfo = field(default_factory=GoalInfo)


@dataclass
class CancelResponse(IdlStruct, typename="action_msgs.srv.dds_.CancelGoal_Response_"):
    return_code: int8 = 0
    goals_canceling: sequence[GoalInfo] = field(default_factory=list)  # type: ignore[type-arg, assignment]


_WITH_HEADER: dict[str, type[Any]] = {}
SERVICES: dict[str, tuple[type[Any], type[Any]]] = {
    "send_goal": (SendGoalRequest, SendGoalResponse),
    "cancel_goal": (CancelRequest, CancelResponse),
    "get_result": (GetResultRequest, GetResultResponse),
}


def with_header(kind: type[Any]) -> type[Any]:
    """Return the type of the same fields after a header, as rmw_cyclonedds has it; once for each type."""
    name = kind.__idl_typename__.replace(".", "::")
    if name in _WITH_HEADER:
        return _WITH_HEADER[name]
    types = {one.name: kind.__annotations__[one.name] for one in fields(kind)}
    both = {"guid": uint64, "seq": int64, **types}
    _WITH_HEADER[name] = make_idl_struct(name.rpartition("::")[2], name, both, dataclassify=True)
    return _WITH_HEADER[name]
