"""Whole runs over rmw_zenoh: another end, not ours, receives every waypoint, and its reports change the problem."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from robochoc.ros.recordings.mcap_file import McapSource
from tests.support.limits import HANG_S, wait_until
from tests.support.program import PROGRAM, ROOT
from tests.support.zenoh_ros2 import FarEnd, Router

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
NAMES = ("fin", "nose", "port", "roof", "starboard", "tail")
POSE = "geometry_msgs/msg/PoseStamped"


@pytest.fixture
def router() -> Iterator[Router]:
    with Router() as router:
        yield router


@pytest.fixture
def end(router: Router) -> Iterator[FarEnd]:
    pytest.importorskip("zenoh_ros2_sdk")
    with FarEnd(router, {"ROS_DOMAIN_ID": "7"}) as end:
        yield end


def recorded(file: Path, topics: list[str]) -> list[tuple[str, object]]:
    """The waypoints of an MCAP file: topics and fields."""
    found: list[tuple[str, object]] = []
    with McapSource(str(file)) as source:
        source.listen(dict.fromkeys(topics, POSE))
        while (received := source.next(0)) is not None:
            found.append((received.topic, received.fields))
    return found


def as_ours(fields: dict[str, dict[str, object]]) -> dict[str, object]:
    """The fields of a pose with its time in nanoseconds, as sinks have it."""
    header = fields["header"]
    stamp = header["stamp"]
    assert isinstance(stamp, dict)
    return {**fields, "header": {**header, "stamp": stamp["sec"] * 10**9 + stamp["nanosec"]}}


@pytest.mark.more
def test_the_far_end_receives_every_waypoint(
    router: Router, end: FarEnd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it has received is what a recording of the same run holds, message for message."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    topics = [f"/drone{row}_{column}/waypoint{row}_{column}" for row in range(1, 5) for column in range(1, 5)]
    end.ask("subscribe", topics=topics, kind=POSE, latched=False)
    file = tmp_path / "run.mcap"
    team = [str(ROOT / "instances" / "queens3d-4"), "--withdraw", "fewest", "--runtime", "simulator"]
    done = subprocess.run(
        [PROGRAM, "solve", *team, "--ros", f"rmw_zenoh://{router.place}", "--ros", f"mcap:{file}", "--frame", "hall"],
        capture_output=True,
        text=True,
        timeout=HANG_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    heard = [(topic, as_ours(fields)) for topic, fields in end.wait_for(16)]
    assert sorted(heard, key=lambda one: one[0]) == sorted(recorded(file, topics), key=lambda one: one[0])
    assert sorted(topic for topic, _ in heard) == topics


@pytest.mark.slow
def test_a_battery_of_the_far_end_changes_the_problem_and_a_late_comer_hears_the_last_waypoints(
    router: Router, end: FarEnd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    place = f"rmw_zenoh:{router.place}"
    words = [HANGAR, "--protocol", "dynabt", "--json", "--ros", place, "--situation", place, "--report-timeout", "20"]
    topics = [f"/{name}/waypoint" for name in NAMES]
    end.ask("subscribe", topics=topics, kind=POSE, latched=False)
    with subprocess.Popen(
        [PROGRAM, "solve", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as program:
        end.wait_for(6)
        end.ask("publish_battery", topic="/nose/battery", level=0.05)
        second = end.wait_for(12)[6:]
        with FarEnd(router, {"ROS_DOMAIN_ID": "7"}) as late:
            late.ask("subscribe", topics=topics, kind=POSE, latched=True)
            assert sorted(late.wait_for(6)) == sorted(second)
        result, said = program.communicate(timeout=HANG_S)
    assert program.returncode == 0, said
    first, after = json.loads(result)["epochs"]
    assert {*first["assignment"]} - {*after["assignment"]} == {"nose"}
    landing = dict(second)["/nose/waypoint"]["pose"]["position"]
    assert landing["z"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("end_by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_however_a_run_ends_nothing_of_it_stays(router: Router, end_by: signal.Signals) -> None:
    pytest.importorskip("zenoh_ros2_sdk")
    place = f"rmw_zenoh:{router.place}"
    words = [HANGAR, "--protocol", "dynabt", "--ros", place, "--situation", place, "--report-timeout", "3600"]
    with FarEnd(router) as other:
        other.ask("subscribe", topics=["/tail/waypoint"], kind=POSE, latched=False)
        with subprocess.Popen(
            [PROGRAM, "solve", *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as program:
            other.wait_for(1)
            program.send_signal(end_by)
            _, said = program.communicate(timeout=HANG_S)
        assert "Traceback" not in said
        wait_until(lambda: [topic for topic, _ in other.ask("topics")] == ["/tail/waypoint"], "our topics are there")
