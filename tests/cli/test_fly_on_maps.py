"""Teams on maps on the command line: their folder says where walls are, and how long a unit is."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from robochoc.formats.result import read_result
from tests.support.maps import write_map
from tests.support.octomaps import FREE, write_octomap
from tests.support.solve_ros import messages, ran

HALL = ["#########", "#...#...#", "#...#...#", "#.......#", "#...#...#", "#...#...#", "#########"]
"""Two rooms with a door, 0.5 m a pixel."""


@pytest.fixture
def team(tmp_path: Path) -> Path:
    folder = tmp_path / "team"
    at = ("--at", "1,1 1,2.5", "--anchor", "3.5,1.75", "--shape", "line", "--cell", "0.5", "--spacing", "1.5")
    made = ran("generate", "formation", "--map", write_map(tmp_path, HALL), *at, "-o", folder)
    assert made.exit_code == 0, made.output
    assert "cells of 0.5 m, and walls that drones fly around" in made.output
    return folder


@pytest.fixture
def result(team: Path, tmp_path: Path) -> Path:
    path = tmp_path / "result.json"
    path.write_text(ran("solve", team, "--runtime", "simulator", "--protocol", "dpop", "--json").output)
    return path


def told(done: Result) -> dict[str, Any]:
    assert done.exit_code == 0, done.output
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_fly_and_animate_find_the_walls_beside_the_robots(team: Path, result: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    flown = told(ran("fly", result, "--team", team, "--html", page, "--json"))
    assert flown["scale"] == 0.5
    assert flown["as_planned"]
    assert flown["nearest_wall"]["set_m"] == 0.2
    assert 0.2 <= flown["nearest_wall"]["distance_m"] < 0.5
    assert "</i>wall</li>" in page.read_text()
    report = ran("fly", result, "--team", team).output
    assert "nearest to a wall: 0.2" in report
    assert "; minimum: 0.20 m" in report
    assert ran("animate", result, "--team", team, "--html", page).exit_code == 0
    assert "0.2 m)" in page.read_text()
    # A map that is handed over counts in its place.
    bare = tmp_path / "bare.json"
    whole = json.loads((team / "map.json").read_text())
    bare.write_text(json.dumps({key: part for key, part in whole.items() if key != "walls"}))
    assert told(ran("fly", result, "--team", team, "--map", bare, "--json"))["nearest_wall"] is None


def test_on_an_octomap_they_fly_around_its_voxels(tmp_path: Path) -> None:
    rooms = {(x, y, z): FREE for x, y, z in product(range(5), range(3), range(3)) if x != 2 or (y, z) == (1, 1)}
    folder, path = tmp_path / "team", tmp_path / "result.json"
    house = write_octomap(tmp_path / "rooms.bt", rooms)
    at = ("--at", "0.5,0.5,0.5", "--anchor", "2,0.5,1", "--cell", "0.5", "--cells", "200")
    made = ran("generate", "formation", "--map", house, *at, "-o", folder)
    assert "cells of 0.5 m, and walls that drones fly around" in made.output
    path.write_text(ran("solve", folder, "--runtime", "simulator", "--protocol", "dpop", "--json").output)
    flown = told(ran("fly", path, "--team", folder, "--json"))
    assert flown["as_planned"]
    assert flown["nearest_wall"]["set_m"] == 0.2
    assert flown["drones"][0]["at"] == pytest.approx([2, 0.5, 1], abs=0.02)
    done = ran("solve", folder, "--runtime", "simulator", "--situation", "flight")
    assert "nearest to a wall: " in done.output
    whole = json.loads((folder / "map.json").read_text())
    whole["volume"]["walls"]["free"] = "AAAA"
    (folder / "map.json").write_text(json.dumps(whole))
    assert "voxels, but free has flags for 24" in ran("fly", path, "--team", folder).stderr


def test_a_drone_that_is_blown_against_a_wall_is_told(team: Path, result: Path) -> None:
    blown = ran("fly", result, "--team", team, "--wind", "12", "--gusts", "4")
    assert blown.exit_code == 4
    assert "too near to a wall: " in blown.output


def test_solve_flies_and_publishes_in_the_scale_of_the_map(team: Path, tmp_path: Path) -> None:
    page, bag = tmp_path / "page.html", tmp_path / "bag.mcap"
    simulator = ("--runtime", "simulator")
    done = ran("solve", team, *simulator, "--situation", "flight", "--ros", f"mcap:{bag}", "--html", page)
    assert done.exit_code == 0, done.output
    assert "nearest to a wall: " in done.output
    assert "</i>wall</li>" in page.read_text()
    sent = [message.pose.position for topic, _, message in messages(bag) if topic.endswith("/waypoint")]
    places = [(position.x, position.y, position.z) for position in sent]
    assert sorted(places) == [(3.5, 1.0, 0.5), (3.5, 2.5, 0.5)]
    plain = ran("solve", team, *simulator, "--html", page)
    assert plain.exit_code == 0
    assert "</i>wall</li>" in page.read_text()
    for more in (("--situation", "flight"), ("--ros", f"mcap:{bag}")):
        refused = ran("solve", team, *simulator, *more, "--scale", "2")
        assert refused.exit_code == 2
        assert "--scale: the scale is 2 m, but the map with walls has the scale 0.5 m: omit the scale" in refused.stderr


def test_a_scenario_of_a_team_keeps_its_map(team: Path, tmp_path: Path) -> None:
    changing = tmp_path / "changing"
    made = ran("generate", "scenario", team, "--events", "1", "--kinds", "remove-constraint", "-o", changing)
    assert made.exit_code == 0, made.output
    assert (changing / "map.json").read_bytes() == (team / "map.json").read_bytes()
    path = tmp_path / "changes.json"
    path.write_text(ran("solve", changing, "--runtime", "simulator", "--json").output)
    assert told(ran("fly", path, "--team", changing, "--json"))["nearest_wall"]


def test_what_is_wrong_with_a_map_is_said_with_its_file(team: Path, result: Path) -> None:
    ground = team / "map.json"
    whole = json.loads(ground.read_text())
    for walls, why in (
        ({**whole["walls"], "free": "AAAA"}, "its walls have 63 pixels, but free has flags for 24"),
        ({**whole["walls"], "resolution": "x"}, "walls.resolution: expected a number, found a text"),
    ):
        ground.write_text(json.dumps({**whole, "walls": walls}))
        for words in (
            ("fly", result, "--team", team),
            ("solve", team, "--runtime", "simulator", "--situation", "flight"),
        ):
            refused = ran(*words)
            assert refused.exit_code == 1
            assert f"{ground}: " in refused.stderr
            assert why in refused.stderr
    ground.write_text(json.dumps({**whole, "walls": {**whole["walls"], "radius": 0.3}}))
    refused = ran("fly", result, "--team", team)
    assert refused.exit_code == 1
    assert "has no route around the walls from (1.00, " in refused.stderr


# `robochoc solve` says where on the map of a team its values are


def output_of(*words: object) -> str:
    done = ran(*words)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture
def open_ground(tmp_path: Path) -> Path:
    folder = tmp_path / "team"
    at = ("--at", "1,1 1,2", "--anchor", "2,1.5", "--cell", "0.5", "--radius", "0", "--spacing", "1")
    output_of("generate", "formation", "--map", write_map(tmp_path, ["......"] * 6), *at, "-o", folder)
    return folder


HOW = ("--runtime", "simulator", "--protocol", "dpop")


def test_the_report_has_metres_beside_values(open_ground: Path) -> None:
    said = output_of("solve", open_ground, *HOW)
    assert "Robot1: V1 = 18 (2,1 m)" in said
    assert "Robot2: V2 = 32 (2,2 m)" in said


def test_json_has_places_beside_the_assignment(open_ground: Path) -> None:
    said = output_of("solve", open_ground, *HOW, "--json")
    found = json.loads(said)
    assert found["assignment"] == {"V1": 18, "V2": 32}
    assert found["places"] == {"V1": [2.0, 1.0], "V2": [2.0, 2.0]}
    assert read_result(said.encode()).assignment == found["assignment"]


def test_every_optimum_that_is_listed_has_its_places(open_ground: Path) -> None:
    said = output_of("solve", open_ground, "--runtime", "simulator", "--protocol", "list-dpop", "--set", "limit=9")
    assert "Robot1: V1 = 18 (2,1 m)" in said
    assert said.count(" m)") == said.count("V1 = ") + said.count("V2 = ")


def test_without_a_map_that_says_so_nothing_is_told(open_ground: Path) -> None:
    for content in ("{", '{"columns": 7, "rows": 7}', None):
        (open_ground / "map.json").unlink() if content is None else (open_ground / "map.json").write_text(content)
        assert " m)" not in output_of("solve", open_ground, *HOW)
        assert "places" not in json.loads(output_of("solve", open_ground, *HOW, "--json"))
