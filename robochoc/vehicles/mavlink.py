"""`mavlink:FILE` as a sink and as a source: vehicles whose autopilots speak MAVLink, such as PX4."""

from __future__ import annotations

from robochoc.vehicles.fleet_sink import FleetSink
from robochoc.vehicles.fleet_source import FleetSource
from robochoc.vehicles.installed import require
from robochoc.vehicles.kinds import Kind

require("mavsdk")


class MavlinkSink(FleetSink):
    """Flies decisions with vehicles that speak MAVLink."""

    kind = Kind.MAVLINK


class MavlinkSource(FleetSource):
    """Reports of vehicles that speak MAVLink."""

    kind = Kind.MAVLINK
