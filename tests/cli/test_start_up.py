"""What a small run imports: each module that it can do without is time for everybody."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.program import ROOT, unmeasured

HEAVY = {
    "hashlib", "pickle", "shutil", "fractions", "numpy", "meshcat", "tornado", "zenoh", "cryptography", "pycsp3",
    "jpype", "importlib.metadata", "tomllib",
    "robochoc.solver.ace", "robochoc.solver.central", "robochoc.verification.second_opinion",
    "robochoc.communication.simulator.channel", "robochoc.sniffer", "robochoc.flight",
    "robochoc.communication.network", "robochoc.view", "robochoc.ros", "robochoc.robots",
    "robochoc.vehicles", "robochoc.replay", "robochoc.formats.dialects", "robochoc.formats.team_writer",
}  # fmt: skip
"""What a run of ABT in a pipe has no use for."""
HERE = {**unmeasured(), "PYTHONPATH": str(ROOT)}


def imported(*words: str) -> set[str]:
    """Return those of `HEAVY` that `robochoc WORDS` imports."""
    code = (
        f"import sys; sys.argv = ['robochoc', *{words!r}]\n"
        "from robochoc.cli.main import main\n"
        "try: main()\n"
        "except SystemExit as ending: assert not ending.code, ending.code\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=unmeasured())
    return HEAVY & set(done.stderr.split())


@pytest.mark.parametrize("runtime", ["processes", "simulator"])
def test_a_run_imports_what_it_needs(runtime: str, four: Path) -> None:
    assert imported("solve", str(four), "--runtime", runtime) == set()


def test_validate_imports_what_it_needs(four: Path) -> None:
    assert imported("validate", str(four)) == set()


def test_help_imports_no_command() -> None:
    code = (
        "import sys; sys.argv = ['robochoc', '--help']\n"
        "from robochoc.cli.main import main\n"
        "try: main()\n"
        "except SystemExit: print(*(n for n in sys.modules if n.startswith('robochoc.')), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=unmeasured())
    assert set(done.stderr.split()) == {
        "robochoc.cli", "robochoc.cli.main", "robochoc.cli.group", "robochoc.system", "robochoc.system.streams",
        "robochoc.system.termination", "robochoc.system.posix",
    }  # fmt: skip


def test_nothing_slow_is_imported_before_signals_are_heard() -> None:
    """Until then Python answers Ctrl-C, with a traceback."""
    code = "import sys; before = {*sys.modules}; import robochoc.cli.main; print(*{*sys.modules} - before)"
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True, env=HERE)
    assert not {"typing", "contextlib", "re", "pathlib", "click"} & set(done.stdout.split())
