"""`robochoc solve --ros` and `--situation`: what is published, what comes back, and what is refused."""

from __future__ import annotations

import itertools
import json
import sys
import time
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner, Result

from robochoc.cli.group import cli
from robochoc.flight.mission import Goal
from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Verdict
from robochoc.ros.recordings.mcap_file import McapSink
from robochoc.ros.single_robot import drones_of_robot, leg_of_robot
from robochoc.ros.sinks import open_source
from tests.support.deployments import Deployment, ended
from tests.support.program import ROOT

HANGAR = ROOT / "docs" / "examples" / "hangar"
RESCUE = ROOT / "docs" / "examples" / "rescue"
PATROL = ROOT / "docs" / "examples" / "patrol"
SCOUTS = ROOT / "docs" / "examples" / "scouts"
FOUR = ROOT / "instances" / "queens3d-4"
MET = ("--situation", "flight", "--obstacle", "3,1,3", "--fail", "Fin@7")
SIMULATED = ("--runtime", "simulator", "--protocol", "dynabt")
OPENINGS = ["the start", "port without 3", "-Fin"]


def ran(*words: object) -> Result:
    done = CliRunner().invoke(cli, [*map(str, words)], catch_exceptions=False)
    assert "Traceback" not in done.output
    return done


def solved(*words: object) -> Result:
    return ran("solve", *words, *SIMULATED)


def epochs(result: Result) -> list[tuple[str, str, dict[str, int]]]:
    told = json.loads(result.stdout)["epochs"]
    return [(epoch["opened_by"], epoch["verdict"], epoch["assignment"]) for epoch in told]


def published(path: Path, topic: str, kind: str = "geometry_msgs/PoseStamped") -> list[tuple[float, tuple[float, ...]]]:
    """When, and where to, in the recording at `path`."""
    with open_source(f"mcap:{path}") as source:
        source.listen({topic: kind})
        found: list[tuple[float, tuple[float, ...]]] = []
        while (heard := source.next(0)) is not None:
            at = heard.fields["pose"]["position"]
            assert heard.fields["header"]["stamp"] == heard.at_ns
            found.append((heard.at_ns / 1e9, (at["x"], at["y"], at["z"])))
    return found


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
    assert "-Fin" in result.stdout
    assert "5 fly" not in result.stdout


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


@pytest.fixture
def a_second_a_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a second pass whenever the simulator, or the run, looks at the clock: so no machine is too slow."""
    clock = itertools.count(time.monotonic())
    for module in ("communication.simulator.simulator", "run.context", "run.improvement"):
        monkeypatch.setattr(f"robochoc.{module}.time", SimpleNamespace(monotonic=lambda: next(clock)))


ANYTIME = ("--runtime", "simulator", "--protocol", "dsa", "--set", "cycles=100000", "--seed", 1)


@pytest.mark.usefixtures("a_second_a_look")
def test_better_decisions_are_published_while_the_team_searches_on(tmp_path: Path) -> None:
    """Each drone gets a waypoint when it is to go elsewhere, and only then; all products show the run."""
    place, journal, page = (tmp_path / name for name in ("run.mcap", "run.journal", "run.html"))
    products = ("--ros", f"mcap:{place}", "--journal", journal, "--html", page)
    told = ran("solve", PATROL, *ANYTIME, "--deadline", 4, "--improve", 300, "--json", *products)
    last = json.loads(told.stdout)
    costs = [one["cost"] for one in last["improvements"]]
    assert told.exit_code == 0
    assert costs == sorted(set(costs), reverse=True)
    assert len(costs) > 1
    assert (last["cost"], last["verdict"], last["verified"], last["deadline"]) == (costs[-1], "solution", True, 4)
    sent = [published(place, f"/{name}/waypoint") for name in ("lead", "north", "south", "west")]
    assert all(one[1] != other[1] for each in sent for one, other in pairwise(each))
    assert sum(map(len, sent)) < 4 * len(costs)
    replayed = ran("replay", journal)
    assert replayed.exit_code == 0, replayed.output
    assert page.read_text().count("a better decision") == len(costs) - 1


@pytest.mark.usefixtures("a_second_a_look")
def test_without_a_sink_better_answers_are_told(tmp_path: Path) -> None:
    told = ran("solve", PATROL, *ANYTIME, "--deadline", 4, "--improve", 300)
    lines = [line for line in told.stderr.splitlines() if "a solution of cost" in line]
    assert len(lines) > 1
    assert lines[0].startswith("patrol: a solution of cost ")
    assert "by the deadline of 4 s, improved after" in told.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("a_second_a_look")
def test_each_event_of_a_flight_has_a_deadline_and_improvements(tmp_path: Path) -> None:
    """Decisions while the team searches on are published; the last one of each epoch is flown."""
    place = tmp_path / "run.mcap"
    words = ("--deadline", 2, "--improve", 200, "--ros", f"mcap:{place}", *MET)
    told = ran("solve", HANGAR, *ANYTIME, *words, "--json")
    last = json.loads(told.stdout)
    assert [epoch["opened_by"] for epoch in last["epochs"]] == OPENINGS
    assert [epoch["verdict"] for epoch in last["epochs"]] == ["solution"] * 3
    assert told.exit_code == 0


def test_with_downwash_drones_keep_more_distance_above_each_other() -> None:
    words = ("--situation", "flight", "--distance", "0.4")
    assert "above each other" not in solved(HANGAR, *words).stdout
    assert "; set: 0.40 m, 0.80 m above each other" in solved(HANGAR, *words, "--downwash", "2").stdout


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--situation", "flight", "--withdraw"), "--withdraw is for problems that do not change"),
        (("--situation", "flight", "--runtime", "network"), "--runtime network is for problems that do not change"),
        (("--situation", "flight", "--protocol", "central"), "--protocol central is for problems that do not change"),
        (("--ros", "mcap:a.mcap", "--count", "--protocol", "central"), "--count gives only a number"),
        (("--obstacle", "1,1,1"), "--obstacle is for the simulated flight"),
        (("--fail", "Fin"), "--fail is for the simulated flight"),
        (("--wind", "1,1,1", "--situation", "mcap:a"), "--wind is for the simulated flight"),
        (("--distance", "1"), "--distance is for the simulated flight"),
        (("--improve", "1"), "--improve goes on after --deadline SECONDS"),
        (("--improve", "1", "--deadline", "1", "--protocol", "central"), "--deadline is for robots"),
        (("--downwash", "2"), "--downwash is for the simulated flight"),
        (("--situation", "flight", "--downwash", "2", "--fail", "Fin"), "with downwash neither motors can fail"),
        (("--patience", "1", "--runtime", "simulator"), "--patience is for robots with processes"),
        (("--patience", "1", "--protocol", "central"), "--patience is for robots with processes"),
        (("--patience", "0"), "--patience"),
        (("--battery", "0.1", "--situation", "flight"), "--battery is for robots that report"),
        (("--frame", "hall"), "--frame is for what is published"),
        (("--scale", "2"), "--scale is for what is published"),
        (("--ros", "mcap:a", "--situation", "mcap:a"), "--situation mcap:a and --ros mcap:a are one place"),
        (("--ros", "mcap:a", "--ros", "mcap:a"), "mcap:a is given twice"),
        (("--ros", "mcap:a.mcap", "--ros", "./a.mcap"), "--ros mcap:a.mcap and --ros ./a.mcap are one place"),
        (("--ros", "a.mcap", "--ros", "rosbag:a.mcap"), "--ros a.mcap and --ros rosbag:a.mcap are one place"),
        (("--ros", "mcap:a", "--journal", "a"), "--journal a and --ros mcap:a are one place"),
        (("--ros", "mcap:a", "--html", "a"), "--html a and --ros mcap:a are one place"),
        (("--situation", "flight", "--wind", "1e9"), "is faster than 200 m/s"),
        (("--situation", "flight", "--gusts", "1e9"), "gusts have to be a number from 0 to 200 m/s"),
        (("--scale", "1e300", "--ros", "mcap:a"), "--scale"),
        (("--situation", "flight", "--fail", "Wing"), "no drone 'Wing' that could fail"),
        (("--situation", "flight", "--fail", "Fin@soon"), "is not ROBOT or ROBOT@SECONDS"),
        (("--situation", "flight", "--obstacle", "1,2"), "is not three numbers"),
        (("--situation", "flight", "--obstacle", "1,2,nan"), "is not three numbers"),
        (("--scale", "nan", "--ros", "mcap:a"), "--scale"),
        (("--scale", "inf", "--ros", "mcap:a"), "--scale"),
        (("--battery", "nan", "--situation", "mcap:a"), "--battery"),
        (("--patience", "nan"), "--patience"),
        (("--report-timeout", "nan", "--situation", "mcap:a"), "--report-timeout"),
        (("--report-timeout", "1"), "--report-timeout is for robots that report"),
        ((str(SCOUTS), "--ros", "mcap:a"), "--ros and --situation are for one team; 2 were found"),
    ],
)
def test_what_does_not_go_together(
    words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    result = ran("solve", HANGAR, *words)
    assert result.exit_code == 2, result.output
    assert said in " ".join(result.stderr.split())
    assert not list(tmp_path.iterdir())


def test_a_live_place_is_published_to_and_listened_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rospy", None)
    result = ran("solve", HANGAR, "--ros", "rospy", "--situation", "rospy")
    assert result.exit_code == 1
    assert "rospy cannot be imported" in result.stderr


def test_a_report_timeout_with_a_recording(run: tuple[Path, Result]) -> None:
    folder, _ = run
    result = solved(HANGAR, "--situation", f"mcap:{folder / 'run.mcap'}", "--report-timeout", "3")
    assert result.exit_code == 2
    assert "run.mcap is a recording" in result.stderr


def test_a_recording_that_is_read_is_not_written(run: tuple[Path, Result], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, _ = run
    monkeypatch.chdir(folder)
    before = (folder / "run.mcap").read_bytes()
    result = solved(HANGAR, "--situation", "mcap:run.mcap", "--ros", f"mcap:{folder / 'run.mcap'}")
    assert result.exit_code == 2
    assert "--situation mcap:run.mcap and --ros mcap:" in result.stderr
    assert (folder / "run.mcap").read_bytes() == before


def test_a_flight_that_would_never_end_is_not_begun(tmp_path: Path) -> None:
    result = solved(HANGAR, "--situation", "flight", "--scale", "1e6", "--ros", f"mcap:{tmp_path / 'run.mcap'}")
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
    assert "ask for a smaller scale" in result.stderr
    assert not list(tmp_path.iterdir())


# One robot, on its own machine


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


def test_how_a_flight_went_is_told() -> None:
    result = solved(HANGAR, *MET)
    assert result.exit_code == 0
    for told in ("Port: sees an obstacle at (3, 1, 3)", "Fin: motor 0 has stopped", "Fin fell; all others within"):
        assert told in result.stdout
    assert "nearest: " in result.stdout


def test_a_flight_that_goes_wrong_is_a_failure() -> None:
    result = solved(HANGAR, "--situation", "flight", "--wind", "80")
    assert result.exit_code == 4
    assert "not at their places: " in result.stdout


def test_a_failure_that_comes_too_late_is_told() -> None:
    result = solved(HANGAR, "--situation", "flight", "--fail", "Fin@99")
    assert result.exit_code == 0
    assert "--fail Fin@99: the flight was over after" in result.stderr


def test_reports_that_nobody_can_use_are_told(tmp_path: Path) -> None:
    place = tmp_path / "odd.mcap"
    with McapSink(str(place)) as sink:
        sink.publish("/nose/battery", "std_msgs/String", {"data": "full"}, 1)
        sink.publish("/nobody/out_of_order", "std_msgs/String", {"data": "lost"}, 2)
        sink.publish("/elsewhere/scan", "std_msgs/String", {"data": "none of ours"}, 3)
    result = solved(HANGAR, "--situation", f"mcap:{place}")
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [
        "/nose/battery holds std_msgs/String, not sensor_msgs/BatteryState, and was passed over",
        "/nobody/out_of_order is of no drone of this team, and was passed over",
    ]


@pytest.mark.parametrize("frame", ["", "two words", "a\nb"])
def test_a_frame_has_a_name(frame: str, tmp_path: Path) -> None:
    result = ran("solve", HANGAR, "--ros", f"mcap:{tmp_path / 'run.mcap'}", "--frame", frame)
    assert result.exit_code == 2
    assert "is no name of a frame, such as map" in result.stderr
