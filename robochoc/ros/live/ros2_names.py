"""ROS 2 names for both DDS and zenoh: the domain, and the DDS name of a type."""

from __future__ import annotations

import os
import re

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.ros.interfaces import full_name
from robochoc.ros.live.transport import ErrorClass
from robochoc.ros.waypoint_types import short_kind

DOMAIN_MAX = 232
"""The largest domain number with DDS ports."""
_DOMAIN = re.compile(r"\d{1,9}", re.ASCII)


def domain_id(failed: ErrorClass) -> int:
    """Return the domain in `ROS_DOMAIN_ID`; 0 if it is not set. Raises `failed`."""
    given = os.environ.get("ROS_DOMAIN_ID", "").strip()
    if not given:
        return 0
    if not _DOMAIN.fullmatch(given) or int(given) > DOMAIN_MAX:
        shown = shortened(on_one_line(given))
        raise failed(f"ROS_DOMAIN_ID is {shown!r}: set it to a whole number from 0 to {DOMAIN_MAX}")
    return int(given)


def dds_type_name(kind: str) -> str:
    """Return `geometry_msgs::msg::dds_::PoseStamped_` for `geometry_msgs/PoseStamped`, in either spelling.

    `kind` may also be a service, or a message of a service or an action.
    """
    package, namespace, name = full_name(short_kind(kind)).split("/")
    return f"{package}::{namespace}::dds_::{name}_"
