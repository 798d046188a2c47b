"""The sink and the source `mavlink:FILE`, for vehicles with MAVLink autopilots such as PX4."""

from __future__ import annotations

from robochoc.vehicles.fleet_sink import FleetSink
from robochoc.vehicles.fleet_source import FleetSource
from robochoc.vehicles.kinds import VehicleKind, require_library

require_library("mavsdk")


class MavlinkSink(FleetSink):
    """Flies decisions with MAVLink vehicles."""

    kind = VehicleKind.MAVLINK


class MavlinkSource(FleetSource):
    """Reads reports of MAVLink vehicles."""

    kind = VehicleKind.MAVLINK
