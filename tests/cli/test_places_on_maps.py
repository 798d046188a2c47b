"""`robochoc solve` says where on the map of a team its values are."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.formats.result import read_result
from tests.support.maps import write_map


def ran(*words: object) -> str:
    done = CliRunner().invoke(cli, [*map(str, words)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture
def team(tmp_path: Path) -> Path:
    folder = tmp_path / "team"
    at = ("--at", "1,1 1,2", "--anchor", "2,1.5", "--cell", "0.5", "--radius", "0", "--spacing", "1")
    ran("generate", "formation", "--map", write_map(tmp_path, ["......"] * 6), *at, "-o", folder)
    return folder


HOW = ("--runtime", "simulator", "--protocol", "dpop")


def test_the_report_has_metres_beside_values(team: Path) -> None:
    said = ran("solve", team, *HOW)
    assert "Robot1: V1 = 18 (2,1 m)" in said
    assert "Robot2: V2 = 32 (2,2 m)" in said


def test_json_has_places_beside_the_assignment(team: Path) -> None:
    said = ran("solve", team, *HOW, "--json")
    found = json.loads(said)
    assert found["assignment"] == {"V1": 18, "V2": 32}
    assert found["places"] == {"V1": [2.0, 1.0], "V2": [2.0, 2.0]}
    assert read_result(said.encode()).assignment == found["assignment"]


def test_every_optimum_that_is_listed_has_its_places(team: Path) -> None:
    said = ran("solve", team, "--runtime", "simulator", "--protocol", "list-dpop", "--set", "limit=9")
    assert "Robot1: V1 = 18 (2,1 m)" in said
    assert said.count(" m)") == said.count("V1 = ") + said.count("V2 = ")


@pytest.mark.parametrize("content", [None, "{", '{"columns": 7, "rows": 7}'])
def test_without_a_map_that_says_so_nothing_is_told(team: Path, content: str | None) -> None:
    (team / "map.json").unlink()
    if content is not None:
        (team / "map.json").write_text(content)
    assert " m)" not in ran("solve", team, *HOW)
    assert "places" not in json.loads(ran("solve", team, *HOW, "--json"))
