"""Services and actions: the messages they consist of, their names and their hashes, as ROS 2 itself has them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from rosbags.typesys import Stores, get_typestore

from robochoc.ros import interfaces, message_types
from robochoc.ros.interfaces import full_name
from robochoc.ros.live.ros2_names import dds_type_name
from robochoc.ros.message_types import Types, types_of
from robochoc.ros.type_hashes import service_hash, type_hash

NAVIGATE = "nav2_msgs/NavigateToPose"
GO_TO_HASH = "RIHS01_5ef2b5ac82f34a16abf356c3092a7d27006a9ab0dd0b88921c2f457ca293d9dc"
SEND_GOAL_HASH = "RIHS01_f20274642c68c8129a7cfd872cba5837339bfab9f00d9a9d5ddb96d0925dafa7"
GET_RESULT_HASH = "RIHS01_2873aeee2f19018ab084c7cd5625912fa3eb0d92a85ba2646757819d4e774888"
FEEDBACK_HASH = "RIHS01_04a77bbfd082fb70b61325db4d33ed3962be850af4a43897567388754343c865"


@pytest.fixture
def fibonacci(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An action whose hashes are published: rosidl of Jazzy made them for this package."""
    caches = (interfaces._parts, message_types.types_of, type_hash, service_hash)  # noqa: SLF001 - emptied below
    kind = "myroboticarm_msgs/Fibonacci"
    text = "int32 order\n---\nint32[] sequence\n---\nint32[] partial_sequence\n"
    monkeypatch.setattr(interfaces, "_actions", lambda _: {kind: text})
    for one in caches:
        one.cache_clear()
    yield kind
    for one in caches:
        one.cache_clear()


def test_hashes_of_messages_are_those_of_rosbags() -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {name: name.replace("/msg/", "/") for name in store.fielddefs}
    assert {name: type_hash(kind) for name, kind in kinds.items()} == {name: store.hash_rihs01(name) for name in kinds}


def test_hashes_of_services_and_actions_are_those_of_rosidl(fibonacci: str) -> None:
    assert service_hash("crazyflie_interfaces/GoTo") == GO_TO_HASH
    assert service_hash(f"{fibonacci}_SendGoal") == SEND_GOAL_HASH
    assert service_hash(f"{fibonacci}_GetResult") == GET_RESULT_HASH
    assert type_hash(f"{fibonacci}_FeedbackMessage") == FEEDBACK_HASH


def test_names_have_the_namespace_of_their_definition() -> None:
    assert full_name("std_srvs/Trigger") == "std_srvs/srv/Trigger"
    assert full_name("std_msgs/String") == "std_msgs/msg/String"
    assert full_name(f"{NAVIGATE}_SendGoal") == "nav2_msgs/action/NavigateToPose_SendGoal"
    assert (
        dds_type_name(f"{NAVIGATE}_GetResult_Request") == "nav2_msgs::action::dds_::NavigateToPose_GetResult_Request_"
    )
    assert dds_type_name("action_msgs/CancelGoal") == "action_msgs::srv::dds_::CancelGoal_"


@pytest.mark.parametrize(
    ("distribution", "result", "last"),
    [
        ("humble", ["result"], "distance_remaining"),
        ("", ["error_code"], "distance_remaining"),
        ("kilted", ["error_code", "error_msg"], "distance_remaining"),
        ("rolling", ["error_code", "error_msg"], "heading_tracking_error"),
    ],
)
def test_the_definition_is_that_of_the_distribution(
    monkeypatch: pytest.MonkeyPatch, distribution: str, result: list[str], last: str
) -> None:
    monkeypatch.setenv("ROS_DISTRO", distribution)
    types = Types(2)
    assert [name for name, _ in types.layout(f"{NAVIGATE}_Result")] == result
    assert [name for name, _ in types.layout(f"{NAVIGATE}_Feedback")][-1] == last


def test_a_goal_is_encoded_and_decoded() -> None:
    goal = {"pose": {"header": {"stamp": 5, "frame_id": "map"}, "pose": {"position": {"x": 1.0}}}}
    request = {"goal_id": {"uuid": [*range(16)]}, "goal": goal}
    kind = f"{NAVIGATE}_SendGoal_Request"
    decoded = types_of(2).decode(kind, types_of(2).encode(kind, request))
    assert decoded["goal_id"] == request["goal_id"]
    assert decoded["goal"]["pose"]["pose"]["position"] == {"x": 1.0, "y": 0.0, "z": 0.0}
