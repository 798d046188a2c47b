"""`robochoc fly`: what it says of a saved result's flight, what it publishes and shows, and what it refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from robochoc.formats import write_team
from robochoc.formats.result import result_json
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import EpochOutcome, Verdict
from tests.support.cases import cases
from tests.support.outcomes import outcome_of
from tests.support.program import ROOT, robochoc_within
from tests.support.solve_ros import HANGAR, SIMULATED, messages, ran

RESCUE = ROOT / "docs" / "examples" / "rescue"
HOSTILE = "</script><img src=x onerror=alert(1)>\n\x1b[31m"


def flown(*words: object) -> dict[str, Any]:
    """What `fly --json` tells of a flight that went as planned."""
    result = ran("fly", *words, "--json")
    assert result.exit_code == 0, result.stderr
    told: dict[str, Any] = json.loads(result.stdout)
    return told


def saved(folder: Path, values: dict[str, int], *, epochs: tuple[EpochOutcome, ...] = (), name: str = "two") -> Path:
    verdict = Verdict.SOLUTION if values else Verdict.NO_SOLUTION
    outcome = outcome_of(values, verdict, team=name, epochs=epochs)
    path = folder / "result.json"
    path.write_bytes(result_json(outcome))
    return path


def solved(folder: Path, team: Path, *words: object) -> Path:
    """The result of a team, saved."""
    path = folder / "solved.json"
    path.write_text(ran("solve", team, *words, "--json").stdout)
    return path


def planar(n: int) -> dict[str, int]:
    """A solution of 3D queens: 3 i + 5 j, modulo n."""
    return {f"V{i}.{j}": (3 * i + 5 * j) % n + 1 for i in range(1, n + 1) for j in range(1, n + 1)}


@pytest.fixture
def two(tmp_path: Path) -> Path:
    return saved(tmp_path, {"V1.1": 1, "V1.2": 2})


# How it went


def test_progress_is_shown_on_a_terminal_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.cli.reports.progress.REFRESH_S", 0)  # every stage, however soon the next one comes
    solution = saved(tmp_path, {"Robot1": 1, "Robot2": 2})
    assert "flown" not in robochoc_within("fly", solution).stderr
    shown = robochoc_within("fly", solution, terminal=True).stderr
    assert re.search(r"two: leg 1, [0-9.]+ s of [0-9.]+ s flown, [0-9.]+ s", shown)


def test_a_table_for_people(two: Path) -> None:
    result = ran("fly", two)
    assert result.exit_code == 0
    title, head, leg, *rest = result.stdout.splitlines()
    assert title == "two: 2 drones: 2 at their goals"
    assert head.split() == ["leg", "opened", "by", "verdict", "fly", "land", "from", "s", "to", "s"]
    assert leg.split()[:6] == ["0", "the", "start", "solution", "2", "0"]
    assert [line.split(":")[0].split(" within")[0].strip() for line in rest[:2]] == ["all", "nearest"]
    assert "minimum: 0.50 m" in rest[1]
    assert "drones are named after variables" in result.stderr


@pytest.mark.parametrize("n", [7, pytest.param(11, marks=pytest.mark.more)])
def test_everybody_is_at_its_place_and_nobody_too_near(n: int, tmp_path: Path) -> None:
    values = planar(n)
    told = flown(saved(tmp_path, values, name=f"planar-{n}"), "--scale", 1)
    assert len(told["drones"]) == n * n
    for drone in told["drones"]:
        row, column = map(int, drone["name"][1:].split("."))
        assert drone["at"] == pytest.approx([row, column, values[drone["name"]]], abs=0.01)
        assert drone["error_m"] < 0.01
    assert told["nearest"]["distance_m"] >= told["distance_m"] == 0.5
    assert (told["as_planned"], told["scale"], told["happenings"]) == (True, 1, [])


def test_of_four_rows_those_that_withdrew_land(tmp_path: Path) -> None:
    team = tmp_path / "queens3d-4"
    write_team(queens3d(4), team)
    result = solved(tmp_path, team, "--withdraw", "--runtime", "simulator")
    away = json.loads(result.read_text())["withdrawn"]
    told = flown(result, "--team", team)
    assert len(told["drones"]) == 16
    assert {drone["name"] for drone in told["drones"] if drone["at"][2] == 0} == {*away}
    assert max(drone["error_m"] for drone in told["drones"]) < 0.01
    assert told["nearest"]["distance_m"] >= 0.5


def test_who_falls_is_told_and_is_status_4(two: Path) -> None:
    result = ran("fly", two, "--fail", "V1.2@2", "--fail", "V1.2@2.1", "--fail", "V1.1@1e9")
    assert result.exit_code == 4
    assert "two: 2 drones: 1 at their goals, 1 fallen" in result.stdout
    assert "V1.2: motor 0 has stopped" in result.stdout
    assert "V1.2 fell; all others within" in result.stdout
    assert "to a fallen drone: " in result.stdout
    told = json.loads(ran("fly", two, "--fail", "V1.2@2", "--json").stdout)
    assert [drone["error_m"] is None for drone in told["drones"]] == [False, True]
    assert [one["drone"] for one in told["happenings"]] == ["V1.2", "V1.2"]
    assert not told["as_planned"]


def test_who_does_not_arrive_is_status_4(two: Path) -> None:
    result = ran("fly", two, "--wind", 60)
    assert result.exit_code == 4
    assert "not at their goals: V1.1, V1.2" in result.stdout or "fell" in result.stdout


def test_who_comes_nearer_than_set_is_status_4(tmp_path: Path) -> None:
    result = ran("fly", saved(tmp_path, {"V1.1": 1, "V1.2": 1}), "--distance", 0.9, "--gusts", 8)
    assert result.exit_code == 4
    assert "too near: " in result.stdout


def test_the_scale_is_that_of_places(two: Path) -> None:
    told = flown(two, "--scale", "0.5")
    assert [drone["at"] for drone in told["drones"]] == [
        pytest.approx([0.5, 0.5, 0.5], abs=0.01),
        pytest.approx([0.5, 1, 1], abs=0.01),
    ]
    assert told["distance_m"] == pytest.approx(0.4)


def test_places_far_from_the_origin_are_flown_there(tmp_path: Path) -> None:
    told = flown(saved(tmp_path, {"V1.1": 10**7, "V1.2": 10**7 + 1}))
    heights = [drone["at"][2] for drone in told["drones"]]
    assert heights == pytest.approx([10**7, 10**7 + 1], abs=0.01)
    assert told["nearest"]["distance_m"] >= 0.5


def test_drones_of_one_name_are_all_told(tmp_path: Path) -> None:
    outcome = outcome_of({"A": 1}, withdrawn=("A",))
    (tmp_path / "result.json").write_bytes(result_json(outcome))
    assert [drone["name"] for drone in flown(tmp_path / "result.json")["drones"]] == ["A", "A"]


# Epochs


def test_the_epochs_of_a_scenario(tmp_path: Path) -> None:
    result = solved(tmp_path, RESCUE, *SIMULATED)
    epochs = json.loads(result.read_text())["epochs"]
    told = flown(result, "--team", RESCUE)
    assert [leg["opened_by"] for leg in told["legs"]] == [epoch["opened_by"] for epoch in epochs]
    assert [leg["verdict"] for leg in told["legs"]] == [epoch["verdict"] for epoch in epochs]
    begins = [leg["begins_s"] for leg in told["legs"]]
    assert begins == sorted(begins)
    assert max(drone["error_m"] for drone in told["drones"]) < 0.01


def test_epochs_that_the_situation_opened_and_a_recording_that_takes_the_same_drone_out(tmp_path: Path) -> None:
    first = solved(tmp_path, HANGAR, *SIMULATED, "--situation", "flight", "--fail", "Fin@4")
    legs = flown(first, "--team", HANGAR)["legs"]
    assert [leg["opened_by"] for leg in legs] == ["the start", "-Fin"]
    before = solved(tmp_path, HANGAR, *SIMULATED)
    recording = f"mcap:{tmp_path / 'run.mcap'}"
    fell = ran("fly", before, "--team", HANGAR, "--fail", "Fin@2", "--ros", recording)
    assert fell.exit_code == 4
    again = json.loads(ran("solve", HANGAR, *SIMULATED, "--situation", recording, "--json").stdout)
    assert [epoch["opened_by"] for epoch in again["epochs"]] == ["the start", "-Fin"]


def test_a_team_without_a_solution_stays_on_the_ground(tmp_path: Path) -> None:
    nowhere = (
        EpochOutcome(Verdict.SOLUTION, robots=("A",), assignment={"V1.1": 1}),
        EpochOutcome(Verdict.NO_SOLUTION, robots=("A",)),
    )
    told = flown(saved(tmp_path, {}, epochs=nowhere))
    assert [leg["verdict"] for leg in told["legs"]] == ["solution", "no-solution"]
    result = ran("fly", saved(tmp_path, {}))
    assert (result.exit_code, result.stdout) == (1, "")
    assert "the result cannot be flown: there are no drones to fly" in result.stderr


# What is published and shown


def test_waypoints_poses_and_reports_have_the_flights_time(tmp_path: Path) -> None:
    solution = solved(tmp_path, HANGAR, *SIMULATED, "--situation", "flight", "--fail", "Fin@4")
    place = tmp_path / "run.mcap"
    asked = ("--team", HANGAR, "--scale", 0.5, "--frame", "hall", "--fail", "Tail@1.5", "--ros", f"mcap:{place}")
    result = ran("fly", solution, *asked, "--json")
    assert result.exit_code == 4
    told = json.loads(result.stdout)
    heard = messages(place)
    second_s = told["legs"][1]["begins_s"]
    assert [at_s for topic, at_s, _ in heard if topic == "/nose/waypoint"] == pytest.approx([0, second_s])
    (_, _, landing) = [one for one in heard if one[0] == "/fin/waypoint"][-1]
    assert (landing.header.frame_id, landing.pose.position.z) == ("hall", 0)
    ((fell_s, why),) = [(at_s, decoded.data) for topic, at_s, decoded in heard if topic == "/tail/out_of_order"]
    assert fell_s == pytest.approx(1.5, abs=0.01)
    assert why == "motor 0 has stopped"
    poses = [(at_s, decoded.pose.position) for topic, at_s, decoded in heard if topic == "/nose/pose"]
    assert [at_s for at_s, _ in poses] == pytest.approx([number / 20 for number in range(len(poses))])
    assert poses[-1][0] == pytest.approx(told["flight_s"], abs=0.06)
    nose = next(drone for drone in told["drones"] if drone["name"] == "Nose")
    last = poses[-1][1]
    assert [last.x, last.y, last.z] == pytest.approx(nose["at"], abs=0.01)
    for _, at_s, decoded in heard:
        if hasattr(decoded, "header"):
            assert decoded.header.stamp.sec + decoded.header.stamp.nanosec / 1e9 == pytest.approx(at_s)


def test_the_page_and_names_that_are_hostile(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    result = ran("fly", saved(tmp_path, {HOSTILE: 1, "__proto__": 2}), "--html", page)
    assert result.exit_code == 0
    assert "\x1b" not in result.output
    assert len(result.stdout.splitlines()) == 6
    content = page.read_bytes()
    assert b"<img" not in content
    assert b'id="playback"' in content


# What is refused


def test_what_cannot_be_flown_is_one_clear_line(two: Path) -> None:
    with cases() as each:
        for words, status, why in [
            (
                ("--distance", 9),
                1,
                "the homes of V1.1 and V1.2 are 1.00 m apart, and the minimum is 9 m: use a smaller",
            ),
            (
                ("--distance", 1),
                1,
                "are 1.00 m apart, and the minimum is 1 m, which requires 1.1 m: use a smaller distance",
            ),
            (
                ("--scale", 1e-6),
                1,
                "the homes of V1.1 and V1.2 are 1e-06 m apart, and the minimum is 0.01 m: use a l",
            ),
            (("--scale", 1e9), 2, "--scale"),
            (("--scale", 1e5), 1, "m: use a smaller scale"),
            (
                ("--scale", 1e5),
                1,
                "V1.2 would have to fly 200,000 m, more than the maximum of 2,000 m: use a smaller scale",
            ),
            (("--distance", 1e-9), 2, "the distance is 1e-09; it must be finite, and at least 0.01 m"),
            (("--distance", "nan"), 2, "nan"),
            (("--downwash", 2, "--fail", "V1.1"), 2, "downwash cannot be combined with motor failures"),
            (("--downwash", 1000), 2, "downwash is 1000.0; it must be a number from 1 to 100"),
            (("--wind", 500), 2, "faster than the maximum of 200 m/s"),
            (("--gusts", 1e9), 2, "gusts are 1000000000.0 m/s; they must be"),
            (("--fail", "nobody"), 2, "there is no drone 'nobody' to fail: choose V1.1, V1.2"),
            (("--fail", "V1.1@-1"), 2, "is not of the form ROBOT or ROBOT@SECONDS"),
            (("--ros", "mcap:run.mcap"), 2, "give their folder with --team"),
            (("--team", HANGAR), 1, "the team in this folder is not"),
        ]:
            with each(words):
                result = ran("fly", two, *words)
                assert (result.exit_code, result.stdout) == (status, "")
                assert why in result.stderr.splitlines()[-1]


def test_vast_numbers_are_told_soon(tmp_path: Path) -> None:
    for far in [10**6, 10**18, 10**400]:
        result = ran("fly", saved(tmp_path, {"V1.1": 1, "V1.2": far}))
        assert result.exit_code == 1
        assert "the homes of V1.1 and V1.2 are" in result.stderr
        assert "use a larger scale" in result.stderr


def test_too_many_drones_are_told_soon(tmp_path: Path) -> None:
    result = ran("fly", saved(tmp_path, {f"V{number}": 1 for number in range(1001)}))
    assert result.exit_code == 1
    assert "1,001 drones, more than the maximum of 1,000" in result.stderr


def test_a_map_says_where_it_begins(tmp_path: Path) -> None:
    ground = tmp_path / "map.json"
    ground.write_text(json.dumps({"columns": 4, "rows": 4, "starts": {"A": [3, 4]}, "blocked": [{"x": 4, "y": 4}]}))
    result = saved(tmp_path, planar(2))
    page = tmp_path / "flight.html"
    told = flown(result, "--map", ground, "--html", page)
    assert told["as_planned"]
    assert b"blocked cell" in page.read_bytes()
    assert ran("animate", result, "--map", ground, "--html", page).exit_code == 0
    assert b"blocked cell" in page.read_bytes()
    ground.write_text('{"columns": 4, "rows": 4, "starts": {"A": [5, 4]}}')
    for command in ("fly", "animate"):
        refused = ran(command, result, "--map", ground, "--html", page)
        assert refused.exit_code == 1
        assert "A is at (5, 4), outside the map of 4 x 4 cells" in refused.stderr
    assert ran("fly", result, "--map", ground, "--html", ground).exit_code == 2
