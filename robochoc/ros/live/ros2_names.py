"""Names of ROS 2 that hold whatever carries its messages: the domain, and a type's name in DDS and zenoh."""

from __future__ import annotations

import os
import re

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.ros.live.transport import Failed
from robochoc.ros.waypoint_types import short_kind

DOMAIN_MAX = 232
"""DDS has no ports for more domains."""
_DOMAIN = re.compile(r"\d{1,9}", re.ASCII)


def domain_id(failed: Failed) -> int:
    """Return the domain that `ROS_DOMAIN_ID` names, 0 if it names none. Raises `failed`."""
    given = os.environ.get("ROS_DOMAIN_ID", "").strip()
    if not given:
        return 0
    if not _DOMAIN.fullmatch(given) or int(given) > DOMAIN_MAX:
        shown = shortened(on_one_line(given))
        raise failed(f"ROS_DOMAIN_ID must be a whole number from 0 to {DOMAIN_MAX}, and is {shown!r}")
    return int(given)


def dds_type_name(kind: str) -> str:
    """Return `geometry_msgs::msg::dds_::PoseStamped_` for `geometry_msgs/PoseStamped`, in either spelling."""
    package, _, name = short_kind(kind).partition("/")
    return f"{package}::msg::dds_::{name}_"
