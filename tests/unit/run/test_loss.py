"""Robots that die while the team searches: the others go on (`--on-loss withdraw`), or it comes back (`--spare`)."""

from __future__ import annotations

import random
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.model.team_edits import without_robots
from robochoc.run import Options, Runtime, solve
from tests.support.faults import PROGRAM, Run, running
from tests.support.limits import HANG_S

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

TEAMS = {team.name: team for team in (queens3d(4), queens3d(5), queens3d(7))}
LONGEST_S = {"queens3d-4": 0.3, "queens3d-5": 0.8, "queens3d-7": 0.8}
"""About so long they search; a robot dies within that."""
FEW, MANY = (2, 7, 9), 100
"""Of the first ones each protocol once, with the small team."""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    home = tmp_path_factory.mktemp("teams")
    for name, team in TEAMS.items():
        write_team(team, home / name)
    return {name: home / name for name in TEAMS}


def solving(folder: Path, *options: str) -> list[str]:
    return [PROGRAM, "solve", str(folder), "--timeout", str(HANG_S), "--json", *options]


def kill_some(run: Run, chance: random.Random, within_s: float) -> int:
    """SIGKILL one or two robots at random moments, if they are still there; returns how many."""
    run.wait_for_robots(1)
    killed = 0
    for _ in range(chance.choice((1, 1, 2))):
        time.sleep(chance.uniform(0, within_s))
        robots = run.robots()
        if robots:
            with suppress(ProcessLookupError):
                run.strike(signal.SIGKILL, chance.choice(robots))
                killed += 1
    return killed


def kill_one(run: Run, chance: random.Random, first: Callable[[], None] = lambda: None) -> None:
    """SIGKILL a robot once all have a process; meanwhile the master stands still, so that the run does not end."""
    run.wait_for_robots(len(TEAMS["queens3d-7"].robots))
    with run.standing_still():
        first()
        robots = run.robots()
        if robots:
            run.strike(signal.SIGKILL, chance.choice(robots))


def told(run: Run) -> dict[str, object]:
    answer: dict[str, object] = msgspec.json.decode(run.output())
    return answer


def truth(team: Team) -> Verdict:
    return solve(team, Options(runtime=Runtime.SIMULATOR)).verdict


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=pytest.mark.more if seed in FEW else pytest.mark.slow) for seed in range(MANY)]
)
def test_the_others_go_on_and_are_right(seed: int, folders: dict[str, Path], tmp_path: Path) -> None:
    chance = random.Random(f"loss {seed}")
    name = chance.choice(list(TEAMS))
    protocol = ("dynabt", "abt", "afc-ng")[seed % 3]
    with running(solving(folders[name], "--on-loss", "withdraw", "--protocol", protocol), tmp_path / "run") as run:
        killed = kill_some(run, chance, LONGEST_S[name])
        run.end()
        assert run.status() == 0, run.errors()
        answer = told(run)
        assert run.left_behind() == []
    withdrawn = answer["withdrawn"]
    assert isinstance(withdrawn, list)
    assert len(withdrawn) <= killed
    rest = without_robots(TEAMS[name], withdrawn)
    assert answer["verdict"] == truth(rest)
    assignment = answer["assignment"]
    assert isinstance(assignment, dict)
    assert set(assignment) == (set(rest.variables) if answer["verdict"] == "solution" else set())


@pytest.mark.parametrize(
    "protocol", [pytest.param("dynabt", marks=pytest.mark.more), pytest.param("abt", marks=pytest.mark.slow)]
)
def test_a_spare_comes_back_and_the_whole_team_has_a_verdict(
    protocol: str, folders: dict[str, Path], tmp_path: Path
) -> None:
    chance = random.Random(f"spare {protocol}")
    for attempt in range(10):
        with running(solving(folders["queens3d-7"], "--spare", "--protocol", protocol), tmp_path / f"{attempt}") as run:
            kill_one(run, chance)
            run.end()
            assert run.status() == 0, run.errors()
            answer = told(run)
        assert answer["withdrawn"] == []
        assert answer["verdict"] == "solution"
        epochs = answer["epochs"]
        assert isinstance(epochs, list)
        if epochs:
            assert len(epochs) == 2
            (lost,) = epochs[0]["lost"]
            assert epochs[1]["robots"][-1] != lost or len(epochs[1]["robots"]) == 49
            return
    raise AssertionError("every run was over before the robot died")


@pytest.mark.more
def test_a_spare_whose_file_is_gone_stays_out(folders: dict[str, Path], tmp_path: Path) -> None:
    import shutil  # noqa: PLC0415

    for attempt in range(10):
        folder = tmp_path / f"team{attempt}"
        shutil.copytree(folders["queens3d-7"], folder)
        with running(solving(folder, "--spare"), tmp_path / f"{attempt}") as run:
            kill_one(run, random.Random(attempt), lambda folder=folder: shutil.rmtree(folder))  # type: ignore[misc]
            run.end()
            assert run.status() == 0, run.errors()
            answer = told(run)
        if answer["epochs"]:
            withdrawn = answer["withdrawn"]
            assert isinstance(withdrawn, list)
            assert len(withdrawn) == 1
            assert "could not come back" in str(answer["reason"])
            return
    raise AssertionError("every run was over before the robot died")
