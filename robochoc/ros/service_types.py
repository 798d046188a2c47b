"""The definitions of the services that are offered: they are in no list of message types."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

DECIDE_REQUEST = """\
string team
string changes
float64 timeout
"""
DECIDE_RESPONSE = """\
bool success
string message
string verdict
string cost
string[] variables
int64[] values
string[] withdrawn
string result
"""

SERVICE_TYPES: Mapping[str, str] = MappingProxyType(
    {
        "robochoc_msgs/Decide_Request": DECIDE_REQUEST,
        "robochoc_msgs/Decide_Response": DECIDE_RESPONSE,
        # ROS 2 gives a structure without fields this one.
        "std_srvs/Trigger_Request": "uint8 structure_needs_at_least_one_member\n",
        "std_srvs/Trigger_Response": "bool success\nstring message\n",
    }
)
"""The two halves of each service, as the definitions of messages."""
