"""A far end that speaks rmw_zenoh and is not ours: zenoh-ros2-sdk, in a process of its own. It imports nothing of ours.

Each line of its standard input is a command in JSON; each line of its output a pair: the topic and the fields of a
message that it received, or an empty text and an answer.
Definitions are written here as ROS 2 has them, and hashes are computed by the SDK, not by rosbags.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_service_names_and_types, get_topic_info, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosDurability, QosProfile
from zenoh_ros2_sdk.utils import get_type_hash

TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
POINT = "float64 x\nfloat64 y\nfloat64 z\n"
PARTS = {
    "builtin_interfaces/msg/Time": TIME,
    "std_msgs/msg/Header": HEADER,
    "geometry_msgs/msg/Point": POINT,
    "geometry_msgs/msg/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/msg/Pose": "Point position\nQuaternion orientation\n",
}
KINDS = {
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\nPose pose\n",
    "geometry_msgs/msg/PointStamped": "std_msgs/Header header\nPoint point\n",
    "std_msgs/msg/String": "string data\n",
    "sensor_msgs/msg/BatteryState": "std_msgs/Header header\n"
    + "".join(f"float32 {name}\n" for name in ("voltage", "temperature", "current", "charge", "capacity"))
    + "float32 design_capacity\nfloat32 percentage\n"
    + "".join(f"uint8 power_supply_{name}\n" for name in ("status", "health", "technology"))
    + "bool present\nfloat32[] cell_voltage\nfloat32[] cell_temperature\nstring location\nstring serial_number\n",
}
SERVICES = {
    "std_srvs/srv/Trigger": ("uint8 structure_needs_at_least_one_member\n", "bool success\nstring message\n"),
    "robochoc_msgs/srv/Decide": (
        "string team\nstring changes\nfloat64 timeout\n",
        (
            "bool success\nstring message\nstring verdict\nstring cost\nstring[] variables\nint64[] values\n"
            "string[] withdrawn\nstring result\n"
        ),
    ),
}


def hash_of(kind: str) -> str:
    return str(get_type_hash(kind, msg_definition=KINDS[kind], dependencies=PARTS))


def definition_of(kind: str) -> str:
    parts = [f"{'=' * 80}\nMSG: {name.replace('/msg/', '/')}\n{text}" for name, text in PARTS.items()]
    return "\n".join([KINDS[kind], *parts])


class Subscriber(ROS2Subscriber):  # type: ignore[misc]  # the SDK is untyped
    """One that asks for earlier messages of topics such as `/a/b`, too. The SDK (0.1.8) looks for a token of `%a/b`."""

    def _discover_publishers(self) -> list[str]:
        token = f"@ros2_lv/{self.domain_id}/*/*/*/MP/*/*/*/{self.topic.replace('/', '%')}/**"
        replies = self.session_mgr.liveliness.get(token)
        return [str(reply.ok.key_expr).split("/")[2] for reply in replies if reply.ok is not None]


class End:
    """What the process holds; commands are its methods."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.lock = threading.Lock()
        self.kept: list[object] = []
        self.publishers: dict[str, ROS2Publisher] = {}

    def say(self, what: object) -> None:
        with self.lock:
            sys.stdout.write(json.dumps(what) + "\n")
            sys.stdout.flush()

    def common(self, kind: str, *, latched: bool) -> dict[str, Any]:
        durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
        return {
            "msg_type": kind,
            "msg_definition": definition_of(kind),
            "type_hash": hash_of(kind),
            "router_port": self.port,
            "qos": QosProfile(durability=durability, history_depth=1),
        }

    def subscribe(self, topics: list[str], kind: str, latched: bool) -> None:  # noqa: FBT001 - a command
        for topic in topics:
            options = self.common(kind, latched=latched)
            self.kept.append(Subscriber(topic, callback=self.heard(topic), **options))
        get_topic_names_and_types(router_port=self.port)  # when the router answers, it knows of the subscriptions
        self.say(["", "subscribed"])

    def heard(self, topic: str) -> Callable[[Any], None]:
        return lambda message: self.say([topic, plain(message)])

    def publish_battery(self, topic: str, level: float) -> None:
        kind = "sensor_msgs/msg/BatteryState"
        if topic not in self.publishers:
            self.publishers[topic] = ROS2Publisher(topic, **self.common(kind, latched=False))
        publisher = self.publishers[topic]
        types = publisher.session_mgr.store.types
        stamp = types["builtin_interfaces/msg/Time"](5, 7)
        none = np.zeros(0, np.float32)
        publisher.publish(
            header=types["std_msgs/msg/Header"](stamp, "map"),
            **dict.fromkeys(("voltage", "temperature", "current", "charge", "capacity", "design_capacity"), 1.0),
            percentage=level,
            **{f"power_supply_{name}": 0 for name in ("status", "health", "technology")},
            present=True,
            cell_voltage=none,
            cell_temperature=none,
            location="",
            serial_number="A1",
        )
        self.say(["", "published"])

    def call(self, service: str, kind: str, fields: dict[str, Any], timeout: float) -> None:
        """Ask a service, in a thread of its own; the answer is null if none came."""

        def ask() -> None:
            request, response = SERVICES[kind]
            client = ROS2ServiceClient(
                service,
                kind,
                request_definition=request,
                response_definition=response,
                router_port=self.port,
                timeout=timeout,
            )
            answer = client.call(**fields)
            self.say(["", [service, plain(answer) if answer is not None else None]])
            client.close()

        threading.Thread(target=ask, daemon=True).start()

    def services(self) -> None:
        self.say(["", get_service_names_and_types(router_port=self.port)])

    def hashes(self) -> None:
        self.say(["", {kind: hash_of(kind) for kind in KINDS}])

    def topics(self) -> None:
        self.say(["", get_topic_names_and_types(router_port=self.port)])

    def info(self, topic: str) -> None:
        found = get_topic_info(topic, router_port=self.port, verbose=True)
        publishers = found.publishers if found else []
        self.say(["", [[one.node_name, one.type_hash, one.qos] for one in publishers]])


def plain(message: Any) -> Any:  # noqa: ANN401 - the SDK's messages
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is None:
        return message.tolist() if isinstance(message, np.ndarray) else message
    return {name: plain(getattr(message, name)) for name in fields if not name.startswith("__")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("port", type=int, metavar="PORT", help="port of the zenoh router")
    end = End(parser.parse_args().port)
    end.say(["", "ready"])
    for line in sys.stdin:
        name, given = json.loads(line)
        getattr(end, name)(**given)
    os._exit(0)


if __name__ == "__main__":
    main()
