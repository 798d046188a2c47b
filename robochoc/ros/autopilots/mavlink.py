"""`mavlink:FILE` as a sink and as a source: vehicles whose autopilots speak MAVLink, such as PX4."""

from __future__ import annotations

from robochoc.ros.autopilots.installed import require
from robochoc.ros.autopilots.kinds import Kind
from robochoc.ros.autopilots.sink import FleetSink
from robochoc.ros.autopilots.source import FleetSource

require("mavsdk")


class MavlinkSink(FleetSink):
    """Flies decisions with vehicles that speak MAVLink."""

    kind = Kind.MAVLINK


class MavlinkSource(FleetSource):
    """Reports of vehicles that speak MAVLink."""

    kind = Kind.MAVLINK
