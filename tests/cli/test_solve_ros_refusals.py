"""`robochoc solve --ros` and `--situation`: what is refused, and that it leaves files as they were."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.ros.recordings.mcap_file import McapSink
from tests.support.solve_ros import HANGAR, ran, solved


def test_a_run_that_fails_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    place = tmp_path / "run.mcap"
    place.write_text("of another run")
    result = solved(HANGAR, "--ros", f"mcap:{place}", "--situation", f"mcap:{tmp_path / 'none.mcap'}")
    assert result.exit_code == 1
    assert "none.mcap: No such file" in result.stderr
    refused = solved(HANGAR, "--ros", f"mcap:{place}", "--situation", "flight", "--distance", "5")
    assert refused.exit_code == 1
    assert "5 m are to be kept" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
    assert place.read_text() == "of another run"


def test_what_cannot_be_published_at_last_is_told_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(McapSink, "finish", full)
    result = solved(HANGAR, "--ros", f"mcap:{tmp_path / 'run.mcap'}", "--json")
    assert result.exit_code == 1
    assert json.loads(result.stdout)["verdict"] == "solution"
    assert "run.mcap: No space left on device" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_sink_that_nobody_has(tmp_path: Path) -> None:
    result = solved(HANGAR, "--ros", f"cassette:{tmp_path}/a")
    assert result.exit_code == 2
    assert "no sink 'cassette' is installed" in result.stderr
    assert "no source 'cassette' is installed" in solved(HANGAR, "--situation", "cassette:a").stderr


def test_a_team_without_topics_has_nothing_to_publish(tmp_path: Path) -> None:
    team = queens3d(2)
    write_team(
        type(team)("plain", tuple(type(one)(one.name, one.variables) for one in team.robots)), tmp_path / "plain"
    )
    result = solved(tmp_path / "plain", "--ros", f"mcap:{tmp_path / 'run.mcap'}")
    assert result.exit_code == 1
    assert "has a topic to publish its waypoints on" in result.stderr
    assert not (tmp_path / "run.mcap").exists()


def test_a_live_place_is_published_to_and_listened_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rospy", None)
    result = ran("solve", HANGAR, "--ros", "rospy", "--situation", "rospy")
    assert result.exit_code == 1
    assert "rospy cannot be imported" in result.stderr


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording with one report."""
    place = tmp_path / "run.mcap"
    with McapSink(str(place)) as sink:
        sink.publish("/fin/out_of_order", "std_msgs/String", {"data": "a motor"}, 1)
    return place


def test_a_report_timeout_with_a_recording(recording: Path) -> None:
    result = solved(HANGAR, "--situation", f"mcap:{recording}", "--report-timeout", "3")
    assert result.exit_code == 2
    assert "run.mcap is a recording" in result.stderr


def test_a_recording_that_is_read_is_not_written(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(recording.parent)
    before = recording.read_bytes()
    result = solved(HANGAR, "--situation", "mcap:run.mcap", "--ros", f"mcap:{recording}")
    assert result.exit_code == 2
    assert "--situation mcap:run.mcap and --ros mcap:" in result.stderr
    assert recording.read_bytes() == before


def test_a_flight_that_would_never_end_is_not_begun(tmp_path: Path) -> None:
    result = solved(HANGAR, "--situation", "flight", "--scale", "1e6", "--ros", f"mcap:{tmp_path / 'run.mcap'}")
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
    assert "ask for a smaller scale" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_result_that_is_flown_is_not_written_over(tmp_path: Path) -> None:
    result = tmp_path / "result.json"
    result.write_text(solved(HANGAR, "--json").stdout)
    before = result.read_text()
    flown = ran("fly", result, "--team", HANGAR, "--ros", f"mcap:{result}")
    assert (flown.exit_code, result.read_text()) == (2, before)
    assert "are one place" in " ".join(flown.stderr.split())
    windy = ran("fly", result, "--wind", "1e9")
    assert windy.exit_code == 2
    assert "is faster than 200 m/s" in windy.stderr
