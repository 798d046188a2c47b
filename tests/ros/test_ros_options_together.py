"""`--tf`, `--diagnostics`, `--use-sim-time` and `--ros-type` together, in any sinks at once: each gets the same."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from robochoc.cli.group import cli
from robochoc.robots.connections import open_source
from robochoc.robots.source import ReceivedMessage
from robochoc.ros.recordings.mcap_file import McapSink
from robochoc.ros.source_feedback import CLOCK, CLOCK_KIND
from tests.support import rclpy_stand_in
from tests.support.dds import LOOPBACK_ALONE, free_domain
from tests.support.program import ROOT
from tests.support.rosbridge_server import Server, begin_the_loop_of_roslibpy
from tests.support.zenoh_ros2 import Router

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
SECOND = 1_000_000_000
NOW = 7 * SECOND
TYPES = (
    "",
    "geometry_msgs/PoseStamped",
    "nav_msgs/Path",
    "std_msgs/String",
    "geometry_msgs/Point",
    "tf2_msgs/TFMessage",
)
FLAGS = ("--tf", "--diagnostics", "--use-sim-time")
TOPICS = {"--tf": "/tf_static", "--diagnostics": "/diagnostics"}
LIVE = ("dds", "rmw_zenoh", "rosbridge", "rclpy")


@pytest.fixture
def bridge() -> Iterator[Server]:
    begin_the_loop_of_roslibpy()
    with Server() as server:
        yield server
        assert not server.wrong


@pytest.fixture
def places(monkeypatch: pytest.MonkeyPatch, bridge: Server) -> Iterator[dict[str, str]]:
    """The places of live sinks, all on this machine alone."""
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
    for name in ("ROS_DOMAIN_ID", "ROS_DISTRO", "ZENOH_SESSION_CONFIG_URI"):
        monkeypatch.delenv(name, raising=False)
    rclpy_stand_in.install(monkeypatch)
    monkeypatch.setattr("robochoc.ros.live.rclpy_node.WAIT_S", 0.0)
    with Router() as router:
        yield {
            "dds": f"dds:{free_domain()}?wait=0",
            "rmw_zenoh": f"rmw_zenoh://{router.place}",
            "rosbridge": f"rosbridge:{bridge.place}",
            "rclpy": "rclpy",
        }
    assert rclpy_stand_in.is_empty()


def heard(place: str, topics: Mapping[str, str]) -> list[ReceivedMessage]:
    """What a recording has on these topics."""
    with open_source(place) as source:
        source.listen(topics)
        return [*iter(lambda: source.next(0), None)]


def check(folder: Path, places: Mapping[str, str], flags: set[str], kind: str, sinks: set[str]) -> None:
    """Publish in all these places, and compare the two recordings."""
    clock = folder / "clock.mcap"
    with McapSink(str(clock)) as sink:
        sink.publish(CLOCK, CLOCK_KIND, {"clock": NOW}, 1)
    files = [f"mcap:{folder}/out.mcap", f"rosbag:{folder}/out.bag"]
    words = ["solve", HANGAR, "--protocol", "dynabt", "--runtime", "simulator", *sorted(flags)]
    words += ["--situation", f"mcap:{clock}"] if "--use-sim-time" in flags else []
    words += ["--ros-type", kind] if kind else []
    words += itertools.chain.from_iterable(("--ros", place) for place in [*files, *(places[sink] for sink in sinks)])
    done = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert done.exit_code == 0, (words, done.stderr)
    topics = {
        "/port/waypoint": kind or "geometry_msgs/PoseStamped",
        "/tf_static": "tf2_msgs/TFMessage",
        "/diagnostics": "diagnostic_msgs/DiagnosticArray",
    }
    first, second = (heard(place, topics) for place in files)
    assert [(one.topic, one.kind, one.fields) for one in first] == [(one.topic, one.kind, one.fields) for one in second]
    assert {one.topic for one in first} == {"/port/waypoint"} | flags_topics(flags)
    if "--use-sim-time" in flags:
        assert {stamp for one in first for stamp in stamps(one.fields)} <= {NOW}


def flags_topics(flags: set[str]) -> set[str]:
    """The topics that flags bring."""
    return {topic for flag, topic in TOPICS.items() if flag in flags}


def stamps(fields: Any) -> Iterator[int]:  # noqa: ANN401 - fields are nested
    """All times in a message."""
    if isinstance(fields, Mapping):
        for name, value in fields.items():
            yield from [value] if name == "stamp" else stamps(value)
    elif isinstance(fields, list):
        for value in fields:
            yield from stamps(value)


def test_all_options_in_all_sinks(tmp_path: Path, places: dict[str, str]) -> None:
    check(tmp_path, places, {*FLAGS}, "nav_msgs/Path", {*LIVE})


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_any_options_in_any_sinks(places: dict[str, str], bridge: Server) -> None:
    @settings(max_examples=40, deadline=None)
    @given(st.sets(st.sampled_from(FLAGS)), st.sampled_from(TYPES), st.sets(st.sampled_from(LIVE)))
    def one(flags: set[str], kind: str, sinks: set[str]) -> None:
        with tempfile.TemporaryDirectory() as folder:
            check(Path(folder), places, flags, kind, sinks)
        wanted = {"/port/waypoint"} | flags_topics(flags) if "rosbridge" in sinks else set()
        assert {topic for topic, _ in bridge.published if topic in {"/port/waypoint", *TOPICS.values()}} == wanted
        bridge.published.clear()
        bridge.advertised.clear()  # each run is a client of its own

    one()
