"""`mavlink:FILE` as a sink and as a source: vehicles whose autopilots speak MAVLink, such as PX4."""

from __future__ import annotations

from robochoc.vehicles.fleet_sink import FleetSink
from robochoc.vehicles.fleet_source import FleetSource
from robochoc.vehicles.kinds import VehicleKind, require_library

require_library("mavsdk")


class MavlinkSink(FleetSink):
    """Flies decisions with vehicles that speak MAVLink."""

    kind = VehicleKind.MAVLINK


class MavlinkSource(FleetSource):
    """Reports of vehicles that speak MAVLink."""

    kind = VehicleKind.MAVLINK
