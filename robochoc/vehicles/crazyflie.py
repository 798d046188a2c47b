"""The sink and the source `crazyflie:FILE`, for Crazyflies by radio, or simulated Crazyflies by UDP."""

from __future__ import annotations

from robochoc.vehicles.fleet_sink import FleetSink
from robochoc.vehicles.fleet_source import FleetSource
from robochoc.vehicles.kinds import VehicleKind, require_library

require_library("cflib")


class CrazyflieSink(FleetSink):
    """Flies decisions with Crazyflies."""

    kind = VehicleKind.CRAZYFLIE


class CrazyflieSource(FleetSource):
    """Reads reports of Crazyflies."""

    kind = VehicleKind.CRAZYFLIE
