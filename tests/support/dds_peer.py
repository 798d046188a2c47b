"""The other end of DDS: a program of cyclonedds alone, with types written by hand, that shares no code with ours.

Run as `dds_peer.py subscribe DOMAIN SETTINGS` or `dds_peer.py report DOMAIN SETTINGS`; the settings are JSON. It says
"ready" when its topics exist. A subscriber says a line of JSON for each message until its input ends; with
`tells_matched` it says "matched" when it has found a publisher of each topic. A reporter publishes one message for each
line of its input, once somebody has subscribed.
"""

import argparse
import json
import select
import sys
import time
from dataclasses import asdict, dataclass, field
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = "map"


@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PoseStamped_"):
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class PointStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PointStamped_"):
    header: Header = field(default_factory=Header)
    point: Point = field(default_factory=Point)


@dataclass
class String(IdlStruct, typename="std_msgs.msg.dds_.String_"):
    data: str = ""


@dataclass
class BatteryState(IdlStruct, typename="sensor_msgs.msg.dds_.BatteryState_"):
    header: Header = field(default_factory=Header)
    voltage: float32 = 0.0
    temperature: float32 = 0.0
    current: float32 = 0.0
    charge: float32 = 0.0
    capacity: float32 = 0.0
    design_capacity: float32 = 0.0
    percentage: float32 = 0.0
    power_supply_status: uint8 = 0
    power_supply_health: uint8 = 0
    power_supply_technology: uint8 = 0
    present: bool = True
    cell_voltage: sequence[float32] = field(default_factory=list)  # type: ignore[type-arg, assignment]  # none to mypy
    cell_temperature: sequence[float32] = field(default_factory=list)  # type: ignore[type-arg, assignment]  # none to mypy
    location: str = ""
    serial_number: str = ""


KINDS = {kind.__name__: kind for kind in (PoseStamped, PointStamped, String, BatteryState)}


def quality(settings: dict[str, Any]) -> Qos:
    reliable = Policy.Reliability.Reliable(1_000_000_000) if settings.get("reliable") else Policy.Reliability.BestEffort
    latched = Policy.Durability.TransientLocal if settings.get("latched") else Policy.Durability.Volatile
    return Qos(reliable, latched, Policy.History.KeepLast(settings.get("depth", 100)))


def partition(settings: dict[str, Any]) -> Qos:
    return Qos(Policy.Partition(settings["partitions"])) if "partitions" in settings else Qos()


def say(what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def ended(wait_s: float) -> bool:
    """Whether standard input has ended, or ends within that time."""
    return bool(select.select([sys.stdin], [], [], wait_s)[0]) and not sys.stdin.readline()


def subscribe(participant: DomainParticipant, settings: dict[str, Any]) -> None:
    subscriber = Subscriber(participant, qos=partition(settings))
    readers: dict[str, Any] = {
        topic: DataReader(subscriber, Topic(participant, f"rt{topic}", KINDS[kind]), qos=quality(settings))
        for topic, kind in settings["topics"].items()
    }
    say("ready")
    over, is_told = False, not settings.get("tells_matched")
    while not over:
        over = ended(0.02)
        if not is_told and all(reader.get_subscription_matched_status().current_count for reader in readers.values()):
            is_told = True
            say("matched")
        for topic, reader in readers.items():
            for message in reader.take(100):
                if message.sample_info.valid_data:
                    say([topic, asdict(message)])


def stamped(fields: dict[str, Any]) -> IdlStruct:
    """Fields with those of a point, a text or a battery filled in."""
    if "point" in fields:
        return PointStamped(header=Header(frame_id=fields.get("frame", "map")), point=Point(*fields["point"]))
    return String(**fields) if "data" in fields else BatteryState(**fields)


def report(participant: DomainParticipant, settings: dict[str, Any]) -> None:
    publisher = Publisher(participant, qos=partition(settings))
    writers: dict[str, Any] = {
        topic: DataWriter(publisher, Topic(participant, f"rt{topic}", KINDS[kind]), qos=quality(settings))
        for topic, kind in settings["topics"].items()
    }
    say("ready")
    while any(not writer.get_publication_matched_status().current_count for writer in writers.values()):
        time.sleep(0.02)
    say("matched")
    for line in sys.stdin:
        topic, fields = json.loads(line)
        writers[topic].write(stamped(fields))
        say("written")


if __name__ == "__main__":
    roles = {"subscribe": subscribe, "report": report}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("role", choices=roles)
    parser.add_argument("domain", type=int, metavar="DOMAIN")
    parser.add_argument("settings", type=json.loads, metavar="SETTINGS", help="a JSON object")
    asked = parser.parse_args()
    roles[asked.role](DomainParticipant(asked.domain), asked.settings)
