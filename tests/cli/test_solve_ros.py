"""`robochoc solve --ros` and `--situation`: what is published, what comes back, and what is told."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest
from click.testing import Result

import robochoc
from robochoc.flight.mission import Goal
from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Verdict
from robochoc.robots.closed_loop import drones_of_robot, leg_of_robot
from robochoc.ros.recordings.mcap_file import McapSink
from tests.support.deployments import Deployment, ended
from tests.support.program import ROOT
from tests.support.solve_ros import HANGAR, MET, OPENINGS, PATROL, SCOUTS, epochs, published, ran, solved

RESCUE = ROOT / "docs" / "examples" / "rescue"
FOUR = ROOT / "instances" / "queens3d-4"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A closed loop in the simulation, and its folder: the recording, the journal."""
    folder = tmp_path_factory.mktemp("run")
    words = ("--ros", f"mcap:{folder / 'run.mcap'}", "--journal", folder / "run.journal", "--json")
    return folder, solved(HANGAR, *MET, *words)


def test_the_loop_closes_and_nothing_else_is_said(run: tuple[Path, Result]) -> None:
    folder, result = run
    assert (result.exit_code, result.stderr) == (0, "")
    assert [opened for opened, _, _ in epochs(result)] == OPENINGS
    assert sorted(path.name for path in folder.iterdir()) == ["run.journal", "run.mcap"]


def test_a_recording_of_the_loop_fed_back_gives_the_same_epochs(run: tuple[Path, Result]) -> None:
    folder, result = run
    again = solved(HANGAR, "--situation", f"mcap:{folder / 'run.mcap'}", "--json")
    assert again.exit_code == 0
    assert epochs(again) == epochs(result)


def test_so_does_one_of_drones_that_fall_out_one_after_the_other(tmp_path: Path) -> None:
    names = ("Fin", "Nose", "Roof", "Port", "Starboard", "Tail")
    failures = [word for number, name in enumerate(names) for word in ("--fail", f"{name}@{2 + number * 0.7}")]
    place = f"mcap:{tmp_path / 'run.mcap'}"
    result = solved(HANGAR, "--situation", "flight", *failures, "--ros", place, "--json")
    again = solved(HANGAR, "--situation", place, "--json")
    assert epochs(again) == epochs(result)
    assert len(epochs(again)) > 3


def test_the_journal_of_such_a_run_can_be_replayed(run: tuple[Path, Result]) -> None:
    folder, _ = run
    again = ran("replay", folder / "run.journal", "--json")
    assert again.exit_code == 0, again.output
    told = json.loads(again.stdout)
    assert (told["identical"], told["runs"]) == (True, len(OPENINGS))


def test_each_decision_is_published_when_it_is_made(run: tuple[Path, Result]) -> None:
    folder, _ = run
    times, places = zip(*published(folder / "run.mcap", "/port/waypoint"), strict=True)
    assert places == ((3, 1, 3), (3, 1, 2), (3, 1, 2))
    assert times[0] == 0 < times[1] < 7 < times[2]
    fin = published(folder / "run.mcap", "/fin/waypoint")
    assert [place[2] for _, place in fin] == [1, 1, 0]
    assert len(published(folder / "run.mcap", "/port/pose")) > 200


def test_a_flight_for_people(tmp_path: Path) -> None:
    result = solved(HANGAR, *MET, "--ros", f"mcap:{tmp_path / 'run.mcap'}", "--ros", f"rosbag:{tmp_path / 'run.bag'}")
    assert result.exit_code == 0
    for line in result.stderr.splitlines():
        assert ": 17 waypoints, 1 landing, 2 reports, " in line
    assert len(result.stderr.splitlines()) == 2
    assert "5 fly" not in result.stdout
    told = ("-Fin", "Port: sees an obstacle at (3, 1, 3)", "Fin: motor 0 has stopped", "Fin fell; all others within")
    assert all(words in result.stdout for words in (*told, "nearest: "))


def test_the_decision_of_a_team_that_does_not_change(tmp_path: Path) -> None:
    place = tmp_path / "run.mcap"
    result = ran("solve", FOUR, "--withdraw", "--ros", f"mcap:{place}", "--runtime", "simulator", "--json")
    told = json.loads(result.stdout)
    assert (result.exit_code, told["verdict"], "epochs" in told and bool(told["epochs"])) == (0, "optimal", False)
    for row, column in ((row, column) for row in range(1, 5) for column in range(1, 5)):
        (sent,) = published(place, f"/drone{row}_{column}/waypoint{row}_{column}")
        level = told["assignment"].get(f"V{row}.{column}")
        if level is None:
            assert sent[1][2] == 0  # it lands at the edge
        else:
            assert sent[1] == (row, column, level)


def test_all_decisions_of_a_scenario(tmp_path: Path) -> None:
    place = tmp_path / "run.mcap"
    result = solved(RESCUE, "--ros", f"mcap:{place}", "--scale", "0.5", "--json")
    assert (result.exit_code, result.stderr) == (0, "")
    team = read_team(RESCUE)
    for robot in team.robots:
        topic = robot.topics[0].name
        sent = published(place, topic)
        flown = [assignment for _, _, assignment in epochs(result) if robot.variables[0].name in assignment]
        assert len(sent) >= len(flown) >= 1, topic
        assert all(x % 0.5 == y % 0.5 == z % 0.5 == 0 for _, (x, y, z) in sent)


@pytest.mark.slow
def test_all_decisions_of_the_central_judge(tmp_path: Path) -> None:
    result = ran("solve", RESCUE, "--ros", f"mcap:{tmp_path / 'run.mcap'}", "--protocol", "central")
    assert result.exit_code == 0
    assert "waypoints" in result.stderr


def test_with_downwash_drones_keep_more_distance_above_each_other() -> None:
    words = ("--situation", "flight", "--distance", "0.4")
    assert "above each other" not in solved(HANGAR, *words).stdout
    assert "; minimum: 0.40 m, 0.80 m above each other" in solved(HANGAR, *words, "--downwash", "2").stdout


@pytest.mark.slow
def test_a_robot_publishes_its_own_decision(site: Deployment, tmp_path: Path) -> None:
    tokens = site.enrol("--team", SCOUTS)
    master = site.master("--json")
    first = next(iter(tokens))
    place = tmp_path / f"{first}.mcap"
    robots = {
        name: site.robot(SCOUTS / f"{name}.xml", "--token", token, *(["--ros", f"mcap:{place}"] * (name == first)))
        for name, token in tokens.items()
    }
    assert master.status() == 0, master.errors
    ended(robots)
    assert f"{first}.mcap: 1 waypoint, 0 landings" in robots[first].errors


def test_what_one_robot_knows_of_its_goal() -> None:
    robot = read_team(FOUR)["Robot3.2"]
    assert leg_of_robot(robot, "optimal, 6 withdraw", {"V3.2": 4}).goals == {0: Goal((3.0, 2.0, 4.0))}
    assert leg_of_robot(robot, "optimal, 6 withdraw", {}).goals == {0: Goal((3.0, 2.0, 0.0), lands=True)}
    assert leg_of_robot(robot, "solution", {"V3.2": 1}, 0.5).goals == {0: Goal((1.5, 1.0, 0.5))}
    for why, values in (("no-solution", {"V3.2": 1}), ("unknown", {"V3.2": 1}), ("solution", {})):
        assert leg_of_robot(robot, why, values).goals == {}
        assert leg_of_robot(robot, why, values).verdict is Verdict.UNKNOWN
    assert [drone.name for drone in drones_of_robot(robot)] == ["Robot3.2"]


def test_a_flight_that_goes_wrong_is_a_failure() -> None:
    result = solved(HANGAR, "--situation", "flight", "--wind", "80")
    assert result.exit_code == 4
    assert "not at their goals: " in result.stdout


def test_a_failure_that_comes_too_late_is_told() -> None:
    result = solved(HANGAR, "--situation", "flight", "--fail", "Fin@99")
    assert result.exit_code == 0
    assert "--fail Fin@99: the flight ended earlier, after" in result.stderr


def test_reports_that_nobody_can_use_are_told(tmp_path: Path) -> None:
    place = tmp_path / "odd.mcap"
    with McapSink(str(place)) as sink:
        sink.publish("/nose/battery", "std_msgs/String", {"data": "full"}, 1)
        sink.publish("/nobody/out_of_order", "std_msgs/String", {"data": "lost"}, 2)
        sink.publish("/elsewhere/scan", "std_msgs/String", {"data": "none of ours"}, 3)
    result = solved(HANGAR, "--situation", f"mcap:{place}")
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [
        "/nose/battery has the type std_msgs/String, not sensor_msgs/BatteryState, and was ignored",
        (
            "/nobody/out_of_order does not belong to a drone of this team, and was ignored"
            " (expected: /fin/out_of_order, /nose/out_of_order, /port/out_of_order, ...)"
        ),
    ]


# `robochoc solve --ros` and `--situation`: what is refused, and that it leaves files as they were


def test_a_run_that_fails_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    place = tmp_path / "run.mcap"
    place.write_text("of another run")
    result = solved(HANGAR, "--ros", f"mcap:{place}", "--situation", f"mcap:{tmp_path / 'none.mcap'}")
    assert result.exit_code == 1
    assert "none.mcap: No such file" in result.stderr
    refused = solved(HANGAR, "--ros", f"mcap:{place}", "--situation", "flight", "--distance", "5")
    assert refused.exit_code == 1
    assert "the minimum is 5 m" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
    assert place.read_text() == "of another run"


def warehouse(folder: Path) -> Path:
    """A team of two robots on the ground, whose places are more than 40 m apart; `b` leaves after the first epoch."""
    model = robochoc.Model("warehouse")
    picks = {"near": 2, "far": 60}
    for name in "ab":
        robot = model.robot(name)
        pick = robot.variable("pick", [*picks])
        robot.topic(f"/{name}/goal", x=sum((pick == each) * x for each, x in picks.items()), y=5, z=0)
    model.add(model["a.pick"] == "far", model["b.pick"] != model["a.pick"])
    model.after_solution().remove_robot("b")
    model.save(folder)
    return folder


def test_who_leaves_high_above_the_ground_lands_on_it(tmp_path: Path) -> None:
    model = robochoc.Model("high")
    for name, x in (("a", 0), ("b", 3)):
        robot = model.robot(name)
        robot.topic(f"/{name}/goal", x=x, y=robot.variable("y", [0, 1]), z=50)
    model.after_solution().remove_robot("b")
    model.save(tmp_path / "high")
    recording = tmp_path / "run.mcap"
    ran("solve", tmp_path / "high", "--protocol", "abt", "--runtime", "simulator", "--ros", f"mcap:{recording}")
    assert [at[2] for _, at in published(recording, "/b/goal")] == [50, 0]


def test_places_are_in_metres_and_robots_on_the_ground_do_not_land(tmp_path: Path) -> None:
    team = warehouse(tmp_path / "warehouse")
    words = ("--protocol", "abt", "--runtime", "simulator", "--ros", f"mcap:{tmp_path / 'run.mcap'}")
    result = ran("solve", team, *words)
    assert (result.exit_code, result.stderr) == (0, f"{tmp_path / 'run.mcap'}: 3 waypoints, 0 landings\n")
    places = [[at for _, at in published(tmp_path / "run.mcap", f"/{name}/goal")] for name in "ab"]
    assert places == [[(60, 5, 0), (60, 5, 0)], [(2, 5, 0)]]
    robot = read_team(team)["a"]
    far = robot.symbol_table.index("far")
    assert leg_of_robot(robot, "solution", {"a.pick": far}).goals == {0: Goal((60, 5, 0))}


def test_echo_prints_each_message_with_its_topic_and_type(tmp_path: Path) -> None:
    words = ("--protocol", "abt", "--runtime", "simulator", "--json", "--ros", "echo", "--frame", "hall")
    result = ran("solve", warehouse(tmp_path / "warehouse"), *words)
    topics, kinds, fields = zip(*(line.split(" ", 2) for line in result.stderr.splitlines()), strict=True)
    assert topics == ("/a/goal", "/b/goal", "/a/goal")
    assert {*kinds} == {"geometry_msgs/PoseStamped"}
    read = [json.loads(text) for text in fields]
    assert [one["pose"]["position"]["x"] for one in read] == [60, 2, 60]
    assert {one["header"]["frame_id"] for one in read} == {"hall"}
    assert json.loads(result.stdout)["verdict"] == "solution"
    refused = ran("solve", tmp_path / "warehouse", "--ros", "echo:file")
    assert (refused.exit_code, "echo prints messages, and has no place" in refused.stderr) == (1, True)


def test_echo_prints_decisions_without_reports_and_poses() -> None:
    words = ("--runtime", "simulator", "--situation", "flight", "--fail", "Nose@3", "--ros", "echo")
    result = ran("solve", HANGAR, "--protocol", "abt", *words)
    lines = [line for line in result.stderr.splitlines() if line.startswith("/")]
    assert lines
    assert not [line for line in lines if re.search(r"/(pose|battery|out_of_order) ", line)]
    assert re.search(r"^echo: \d+ waypoints, \d landings?$", result.stderr, re.MULTILINE)


def test_the_status_of_a_team_with_costs_has_the_cost() -> None:
    result = ran(
        "solve", PATROL, "--protocol", "dpop", "--runtime", "simulator", "--json", "--ros", "echo", "--diagnostics"
    )
    (status,) = (line for line in result.stderr.splitlines() if line.startswith("/diagnostics "))
    values = json.loads(status.split(" ", 2)[2])["status"][0]["values"]
    assert {"key": "cost", "value": str(json.loads(result.stdout)["cost"])} in values


def test_places_near_each_other_are_published_as_they_are(tmp_path: Path) -> None:
    model = robochoc.Model("near")
    for name, x in {"a": 10, "b": 11, "c": 10, "d": 60}.items():
        robot = model.robot(name)
        robot.topic(f"/{name}/goal", x=robot.variable("x", [x]), y=0, z=0)
    model.save(tmp_path / "near")
    words = ("--protocol", "abt", "--runtime", "simulator", "--ros", f"mcap:{tmp_path / 'run.mcap'}")
    assert ran("solve", tmp_path / "near", *words).exit_code == 0
    places = [published(tmp_path / "run.mcap", f"/{name}/goal")[0][1] for name in "abcd"]
    assert places == [pytest.approx((x, 0, 0)) for x in (10, 11, 10, 60)]


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
    assert "use a smaller scale" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_result_that_is_flown_is_not_written_over(tmp_path: Path) -> None:
    result = tmp_path / "result.json"
    result.write_text(solved(HANGAR, "--json").stdout)
    before = result.read_text()
    flown = ran("fly", result, "--team", HANGAR, "--ros", f"mcap:{result}")
    assert (flown.exit_code, result.read_text()) == (2, before)
    assert "are the same place" in " ".join(flown.stderr.split())
    windy = ran("fly", result, "--wind", "1e9")
    assert windy.exit_code == 2
    assert "is faster than the maximum of 200 m/s" in windy.stderr
