"""`crazyflie:FILE` as a sink and as a source: Crazyflies, by radio, or simulated ones by UDP."""

from __future__ import annotations

from robochoc.vehicles.fleet_sink import FleetSink
from robochoc.vehicles.fleet_source import FleetSource
from robochoc.vehicles.installed import require
from robochoc.vehicles.kinds import Kind

require("cflib")


class CrazyflieSink(FleetSink):
    """Flies decisions with Crazyflies."""

    kind = Kind.CRAZYFLIE


class CrazyflieSource(FleetSource):
    """Reports of Crazyflies."""

    kind = Kind.CRAZYFLIE
