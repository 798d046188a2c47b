"""Problems made in Python are solved without the modules, functions and signals that only POSIX systems have."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import robochoc

ROOT = Path(__file__).resolve().parents[3]
TEAM = str(ROOT / "instances" / "queens3d-4")
SOLVED = {
    "abt": "solution",
    "dpop": 2,
    "auto": 2,
    "arrays": "solution",
    "array problem": 0,
    "central, small": 2,
    "cache": "solution",
    "conflict": 1,
    "solutions": 6,
    "time": "unknown",
    "save": 2,
    "journal": True,
}
PROCESSES = {"central, ACE": 29, "central, OR-Tools": 29}
"""Their processes are without POSIX, too."""
INSTEAD = "requires a POSIX system such as Linux or macOS"
REFUSED = {
    "processes": f"refused: runtime='processes' {INSTEAD}: use runtime='simulator'",
    "network": f"refused: runtime='network' {INSTEAD}: use runtime='simulator'",
    "container": f"refused: a run on several machines {INSTEAD}: solve the problem with runtime='simulator'",
}


def without_posix(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python as on Windows, and return the finished process."""
    (folder / "sitecustomize.py").write_text("from tests.support.without_posix import take_away\ntake_away()\n")
    path = f"{folder}{os.pathsep}{ROOT}"
    environment = os.environ | {"PYTHONPATH": path, "XDG_CACHE_HOME": str(folder), "XDG_DATA_HOME": str(folder)}
    program = [sys.executable, "-W", "ignore", *command]
    return subprocess.run(program, env=environment, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "expected",
    [
        pytest.param(SOLVED, id="solved"),
        pytest.param(REFUSED, id="refused"),
        pytest.param(PROCESSES, id="solvers", marks=pytest.mark.more),
    ],
)
def test_results(tmp_path: Path, expected: dict[str, object]) -> None:
    """Every problem is solved, or refused in a sentence that names an alternative."""
    done = without_posix(tmp_path, "-m", "tests.support.without_posix", *expected)
    assert done.stderr == ""
    assert dict(map(json.loads, done.stdout.splitlines())) == expected


@pytest.mark.parametrize(
    ("command", "status", "text"),
    [
        (["solve", TEAM, "--runtime", "simulator", "--withdraw", "minimum"], 0, "10 of 16"),
        (["solve", TEAM], 2, f"--runtime processes {INSTEAD}: use --runtime simulator"),
        (["solve", TEAM, "--runtime", "simulator", "--sniff"], 2, f"--sniff {INSTEAD}"),
        (["app", "--no-open"], 2, f"robochoc app {INSTEAD}"),
    ],
)
def test_command_line(tmp_path: Path, command: list[str], status: int, text: str) -> None:
    """The command line solves in the simulator, and refuses everything else in a sentence."""
    done = without_posix(tmp_path, "-c", "from robochoc.cli.main import main; main()", *command)
    assert done.returncode == status, done.stderr
    assert text in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_a_journal_becomes_a_page(tmp_path: Path) -> None:
    model = robochoc.Model("pair")
    model.add(robochoc.all_different([model.robot(name).variable("x", range(2)) for name in "ab"]))
    model.solve("abt", journal=tmp_path / "run.journal")
    export = ["journal", "export", "run.journal", "--format", "html", "-o", "page.html"]
    done = without_posix(tmp_path, "-c", "from robochoc.cli.main import main; main()", *export)
    assert done.returncode == 0, done.stderr
    assert "abt on " in (tmp_path / "page.html").read_text()
