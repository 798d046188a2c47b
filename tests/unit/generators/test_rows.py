"""3D queens whose robots fly a row each: complex robots from the generator to the scene."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Metrics, Verdict
from robochoc.run import Options, Runtime, solve
from tests.support.flights import scene_of
from tests.support.limits import HANG_S
from tests.support.outcomes import outcome_of
from tests.support.program import robochoc_within


@pytest.mark.parametrize("model", ["planar", "full"])
def test_a_team_of_rows_says_what_a_team_of_cells_says(model: str) -> None:
    def said(robots: str) -> set[tuple[object, ...]]:
        constraints = queens3d(4, model, robots).constraints()
        return {(c.definition, frozenset(c.variables), c.scope[2:]) for c in constraints}

    rows = queens3d(4, model, "rows")
    assert said("rows") == said("cells")
    assert rows.order == ("Robot1", "Robot2", "Robot3", "Robot4")
    assert all(len(robot.private) == 6 and len(robot.variables) == 4 for robot in rows.robots)


@pytest.mark.usefixtures("in_a_folder")
def test_a_team_of_rows_is_written_and_read_back(tmp_path: Path) -> None:
    write_team(queens3d(5, robots="rows"), tmp_path / "queens3d-5-rows")
    assert read_team(tmp_path / "queens3d-5-rows") == queens3d(5, robots="rows")
    done = robochoc_within("generate", "queens3d", "--n", 5, "--robots", "rows")
    assert done.stdout.startswith("instances/queens3d-5-rows: 5 robots")
    assert read_team(tmp_path / "instances" / "queens3d-5-rows") == queens3d(5, robots="rows")


@pytest.mark.parametrize(
    ("n", "model", "verdict", "runtime"),
    [
        (4, "planar", Verdict.NO_SOLUTION, Runtime.SIMULATOR),
        (4, "full", Verdict.NO_SOLUTION, Runtime.PROCESSES),
        (7, "planar", Verdict.SOLUTION, Runtime.SIMULATOR),
        (7, "full", Verdict.NO_SOLUTION, Runtime.SIMULATOR),
        pytest.param(7, "planar", Verdict.SOLUTION, Runtime.PROCESSES, marks=pytest.mark.more),
        pytest.param(11, "planar", Verdict.SOLUTION, Runtime.SIMULATOR, marks=pytest.mark.slow),
        pytest.param(11, "planar", Verdict.SOLUTION, Runtime.PROCESSES, marks=pytest.mark.slow),
    ],
)
def test_rows_reach_the_verdict_that_cells_reach(n: int, model: str, verdict: Verdict, runtime: Runtime) -> None:
    outcome = solve(queens3d(n, model, "rows"), Options(protocol="abt", runtime=runtime, timeout=HANG_S))
    assert outcome.verdict is verdict
    assert outcome.verified is (verdict is Verdict.SOLUTION)
    assert (outcome.metrics.memory > 0) is (runtime is Runtime.PROCESSES)


def test_counts_of_rows_are_exact_and_repeat() -> None:
    """The simulator's, seed 0: 19 messages, of which 5 nogoods, where 16 single robots need 679."""
    first, again = (
        solve(queens3d(4, robots="rows"), Options(protocol="abt", runtime=Runtime.SIMULATOR)).metrics for _ in range(2)
    )
    assert first.messages == again.messages == {"Ok": 14, "Nogood": 5}
    assert (first.ncccs, first.checks, first.bytes) == (again.ncccs, again.checks, again.bytes) == (21, 43, 220)


def test_a_robot_takes_its_whole_row_from_the_scene(tmp_path: Path) -> None:
    write_team(queens3d(4, robots="rows"), tmp_path / "four")
    result = json.loads(robochoc_within("solve", tmp_path / "four", "--withdraw", "--json").stdout)
    assert result["verified"] is True
    assert len(result["assignment"]) == 4 * (4 - len(result["withdrawn"]))


def test_the_scene_counts_drones_and_not_the_robots_that_fly_several() -> None:
    placed = {f"V1.{column}": level for column, level in enumerate((2, 4, 1, 3), 1)}
    aside = ("Robot2", "Robot3", "Robot4")
    told = outcome_of(placed, team="four", withdrawn=aside, metrics=Metrics())
    scene = scene_of(told, queens3d(4, robots="rows"))
    assert scene.title == "four: 4 of 16 fly (not proven to be the best)"
    assert scene.facts[0] == ("verdict", "no solution for all 16")
    assert len(scene.drones) == 16
