"""ROS 2: the domain, names of types, and their hashes."""

from __future__ import annotations

import pytest

from robochoc.robots.sink import SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.ros2_names import dds_type_name, domain_id
from robochoc.ros.message_types import UnknownTypeError
from robochoc.ros.type_hashes import type_hash
from tests.support.cases import looped


@looped(("given", "domain"), [(None, 0), ("", 0), ("0", 0), (" 7 ", 7), ("232", 232)])
def test_the_domain(monkeypatch: pytest.MonkeyPatch, given: str | None, domain: int) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    if given is not None:
        monkeypatch.setenv("ROS_DOMAIN_ID", given)
    assert domain_id(SinkError) == domain


@looped("given", ["-1", "233", "one", "1.0", "٣", "9" * 5000, "0\x1b[31m"])
def test_a_domain_that_is_none(monkeypatch: pytest.MonkeyPatch, given: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", given)
    with pytest.raises(SourceError, match=r"^ROS_DOMAIN_ID is '[^\x1b]*': set it to a whole number from 0 to 232$"):
        domain_id(SourceError)


@pytest.mark.parametrize("kind", ["geometry_msgs/PoseStamped", "geometry_msgs/msg/PoseStamped"])
def test_the_name_of_a_type(kind: str) -> None:
    assert dds_type_name(kind) == "geometry_msgs::msg::dds_::PoseStamped_"


def test_hashes_are_those_of_ros_2() -> None:
    # std_msgs/String's is that of ROS 2's own tools; the other begins as keys seen in a Jazzy system do.
    string = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert type_hash("std_msgs/String") == type_hash("std_msgs/msg/String") == string
    assert type_hash("geometry_msgs/PoseStamped").startswith("RIHS01_10f3786d7d40fd2b")


def test_an_unknown_type_has_no_hash() -> None:
    with pytest.raises(UnknownTypeError, match="has no type 'no_msgs/Such'"):
        type_hash("no_msgs/Such")
