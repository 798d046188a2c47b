"""The fields of RMF's task messages, and their topics, after the public packages rmf_task_msgs and rmf_task_ros2."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

_PROPOSAL = """\
string fleet_name
string expected_robot_name
float64 prev_cost
float64 new_cost
builtin_interfaces/Time finish_time
"""
_ASSIGNMENT = """\
bool is_assigned
string fleet_name
string expected_robot_name
"""
_STATE = """\
string task_id
int8 status
rmf_task_msgs/Assignment assignment
string[] errors
"""


def _with(text: str, **parts: str) -> str:
    """Return a definition together with the definitions of the types of its fields."""
    return "".join([text, *(f"{'=' * 80}\nMSG: rmf_task_msgs/{name}\n{part}" for name, part in parts.items())])


RMF_TYPES: Mapping[str, str] = MappingProxyType(
    {
        "rmf_task_msgs/ApiRequest": "string json_msg\nstring request_id\n",
        "rmf_task_msgs/ApiResponse": "uint8 type\nstring json_msg\nstring request_id\n",
        "rmf_task_msgs/BidNotice": (
            "string request\nstring task_id\nbuiltin_interfaces/Duration time_window\nbool dry_run\n"
        ),
        "rmf_task_msgs/BidResponse": _with(
            "string task_id\nbool has_proposal\nrmf_task_msgs/BidProposal proposal\nstring[] errors\n",
            BidProposal=_PROPOSAL,
        ),
        "rmf_task_msgs/DispatchAck": "uint64 dispatch_id\nbool success\nstring[] errors\n",
        "rmf_task_msgs/DispatchCommand": (
            "string fleet_name\nstring task_id\nuint64 dispatch_id\nbuiltin_interfaces/Time timestamp\nuint8 type\n"
        ),
        "rmf_task_msgs/DispatchStates": _with(
            "rmf_task_msgs/DispatchState[] active\nrmf_task_msgs/DispatchState[] finished\n",
            DispatchState=_STATE,
            Assignment=_ASSIGNMENT,
        ),
    }
)
"""The definitions of the messages, without constants and default values, which are not sent."""
