"""Ctrl-C and SIGTERM at any moment of any local command: no traceback, nothing left, the status of the signal."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from tests.support.faults import PROGRAM, running
from tests.support.program import ROOT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

EXAMPLES = ROOT / "docs" / "examples"
COMMANDS = {
    "validate": "validate {team} {examples}",
    "generate": "generate queens3d --n 6 -o {out}/made",
    "compile": "compile {examples}/arm --no-cache",
    "solve": "solve {team} --withdraw maximal --html {out}/page.html --journal {out}/run.journal",
    "simulator": "solve {team} --withdraw --runtime simulator",
    "standby": "solve {examples}/scouts --runtime network --standby 1 --protocol dsa --set cycles=1000000",
    "central": "solve {team} --protocol central --withdraw --timeout 20",
    "export": "export {team} -o {out}/problem.xml",
    "animate": "animate {saved} --team {team} -o {out}/page.html",
    "fly": "fly {saved} --team {team} --ros mcap:{out}/run.mcap",
    "replay": "replay {saved}",
    "journal": "journal export {saved} --format html -o {out}/page.html",
}
LONGEST_S = 2.0
MANY = 10


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The journal of a run of the team beside it."""
    folder = tmp_path_factory.mktemp("saved")
    write_team(queens3d(4), folder / "team")
    solving = [PROGRAM, "solve", str(folder / "team"), "--withdraw", "maximal", "--runtime", "simulator"]
    subprocess.run([*solving, "--journal", str(folder / "journal")], check=True, capture_output=True)
    return folder / "journal"


def struck(name: str, signum: signal.Signals, pause_s: float, saved: Path, home: Path) -> None:
    """Run the command, let a signal hit it `pause_s` after it has begun to listen, and look at what is left."""
    out = home / "out"
    out.mkdir(parents=True)
    places = {"team": saved.parent / "team", "examples": EXAMPLES, "saved": saved, "out": out}
    command = [PROGRAM, *(word.format(**places) for word in COMMANDS[name].split())]
    with running(command, home) as run:
        run.wait_until_listening()
        time.sleep(pause_s)
        if not run.is_over:
            run.strike(signum)
        run.end()
        assert run.status() in {0, 128 + signum}, run.errors()
        for fault in ("Traceback", "Exception", "Fatal"):
            assert fault not in run.errors()
        assert run.left_behind() == []


@pytest.mark.parametrize(
    "name",
    [
        "validate",
        "solve",
        *(pytest.param(one, marks=pytest.mark.more) for one in [*COMMANDS] if one not in {"validate", "solve"}),
    ],
)
def test_a_signal_at_the_start(name: str, saved: Path, tmp_path: Path) -> None:
    signum = random.Random(name).choice([signal.SIGINT, signal.SIGTERM])
    struck(name, signum, 0, saved, tmp_path / "run")


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_signals_at_many_moments(name: str, saved: Path, tmp_path: Path) -> None:
    chance = random.Random(f"many {name}")
    for number in range(MANY):
        signum = chance.choice([signal.SIGINT, signal.SIGTERM])
        struck(name, signum, chance.uniform(0, LONGEST_S * chance.random()), saved, tmp_path / str(number))
