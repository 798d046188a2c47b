"""`crazyflie:FILE` as a sink and as a source: Crazyflies, by radio, or simulated ones by UDP."""

from __future__ import annotations

from robochoc.ros.autopilots.installed import require
from robochoc.ros.autopilots.kinds import Kind
from robochoc.ros.autopilots.sink import FleetSink
from robochoc.ros.autopilots.source import FleetSource

require("cflib")


class CrazyflieSink(FleetSink):
    """Flies decisions with Crazyflies."""

    kind = Kind.CRAZYFLIE


class CrazyflieSource(FleetSource):
    """Reports of Crazyflies."""

    kind = Kind.CRAZYFLIE
