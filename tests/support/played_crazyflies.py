"""A played server of Crazyswarm2 over DDS, with types written by hand from `crazyflie_interfaces`.

Run as `python -m tests.support.played_crazyflies dds:DOMAIN DRONES`; DRONES is a JSON object with the manner of each
drone, such as `{"/cf1": "flies"}`; a drone that is "mute" answers nothing. It prints "ready", then a line of JSON for
each call, `["/cf1", "go_to", [1.0, 2.0, 0.5], 2.0]`. It ends with its input.
"""

import argparse
import json
import os
import select
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, int64, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from tests.support.dds_peer import Point
from tests.support.nav2_types import Duration


@dataclass
class Height(IdlStruct, typename="crazyflie_interfaces.srv.dds_.Takeoff_Request_"):
    guid: uint64 = 0
    seq: int64 = 0
    group_mask: uint8 = 0
    height: float32 = 0.0
    duration: Duration = field(default_factory=Duration)


@dataclass
class LandRequest(IdlStruct, typename="crazyflie_interfaces.srv.dds_.Land_Request_"):
    guid: uint64 = 0
    seq: int64 = 0
    group_mask: uint8 = 0
    height: float32 = 0.0
    duration: Duration = field(default_factory=Duration)


@dataclass
class GoTo(IdlStruct, typename="crazyflie_interfaces.srv.dds_.GoTo_Request_"):
    guid: uint64 = 0
    seq: int64 = 0
    group_mask: uint8 = 0
    relative: bool = False
    goal: Point = field(default_factory=Point)
    yaw: float32 = 0.0
    duration: Duration = field(default_factory=Duration)


@dataclass
class TakeoffResponse(IdlStruct, typename="crazyflie_interfaces.srv.dds_.Takeoff_Response_"):
    guid: uint64 = 0
    seq: int64 = 0
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class LandResponse(IdlStruct, typename="crazyflie_interfaces.srv.dds_.Land_Response_"):
    guid: uint64 = 0
    seq: int64 = 0
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class GoToResponse(IdlStruct, typename="crazyflie_interfaces.srv.dds_.GoTo_Response_"):
    guid: uint64 = 0
    seq: int64 = 0
    structure_needs_at_least_one_member: uint8 = 0


SERVICES: dict[str, tuple[type[Any], type[Any]]] = {
    "takeoff": (Height, TakeoffResponse),
    "go_to": (GoTo, GoToResponse),
    "land": (LandRequest, LandResponse),
}


def say(*what: object) -> None:
    sys.stdout.write(json.dumps(what if len(what) > 1 else what[0]) + "\n")
    sys.stdout.flush()


def run(domain: int, manners: dict[str, str]) -> None:
    """Serve until the input ends."""
    participant = DomainParticipant(domain)
    quality = Qos(
        Policy.Reliability.Reliable(1_000_000_000),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(10),
        Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),
    )
    ends: list[tuple[str, str, Any, Any, Any]] = []
    for name in manners:
        for service, (asked, told) in SERVICES.items():
            reader = DataReader(participant, Topic(participant, f"rq{name}/{service}Request", asked), qos=quality)
            writer = DataWriter(participant, Topic(participant, f"rr{name}/{service}Reply", told), qos=quality)
            ends.append((name, service, reader, writer, told))
    say("ready")
    while True:
        if select.select([sys.stdin], [], [], 0.005)[0] and not sys.stdin.readline():
            return
        for name, service, reader, writer, told in ends:
            for request in reader.take(100):
                if request.sample_info.valid_data:
                    goal = getattr(request, "goal", None)
                    at = [goal.x, goal.y, goal.z] if goal else round(request.height, 3)
                    say(name, service, at, request.duration.sec + request.duration.nanosec / 1e9)
                    if manners[name] != "mute":
                        writer.write(told(guid=request.guid, seq=request.seq))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("place", metavar="PLACE")
    parser.add_argument("drones", type=json.loads, metavar="DRONES", help="a JSON object")
    given = parser.parse_args()
    with suppress(KeyboardInterrupt, BrokenPipeError):
        run(int(given.place.partition(":")[2]), given.drones)
    os._exit(0)
