"""Tools for developers say how they are used when they are asked, and do nothing else then."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.support.limits import HANG_S
from tests.support.program import ROOT

ONLY_STARTED_BY_OTHERS = {
    Path("benchmarks/peer_runs.py"),  # what it imports would count as memory of who is measured
    Path("tests/support/debian_ros.py"),
    Path("tests/support/faulty_protocols.py"),
    Path("tests/support/toulbar2_once.py"),
    Path("tests/support/without_posix.py"),  # it runs before anything else is imported
}
NEED_OTHER_LIBRARIES = {Path(f"benchmarks/{peer}_once.py") for peer in ("mujoco", "raven", "rotorpy")}
READING_ORDER = ROOT / "docs" / "explanation" / "reading-order.md"


@cache
def programs() -> list[Path]:
    """Return the files of the repository that can be started."""
    files = (path for folder in ("tests", "benchmarks") for path in sorted((ROOT / folder).rglob("*.py")))
    return [path.relative_to(ROOT) for path in files if '\nif __name__ == "__main__":\n' in path.read_text("utf-8")]


def tools() -> list[Path]:
    return [path for path in programs() if path not in ONLY_STARTED_BY_OTHERS | NEED_OTHER_LIBRARIES]


def help_of(tool: Path) -> str:
    """Return what the tool prints if it is asked how it is used."""
    module = ".".join(tool.with_suffix("").parts).removesuffix(".__main__")
    words = [str(tool)] if tool.parts[0] == "benchmarks" else ["-m", module]
    asked = [sys.executable, *words, "--help"]
    return subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True, timeout=HANG_S).stdout


def times_of_change() -> dict[Path, int]:
    """Return when each file that tools write was changed: golden journals, pages, and results of benchmarks."""
    folders = ("tests/golden", "docs", "robochoc/app/lessons", "benchmarks")
    files = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix != ".pyc")
    return {path: path.stat().st_mtime_ns for path in files if path.is_file()}


def test_every_program_reads_its_words_by_argparse() -> None:
    assert len(tools()) > 15
    assert {*programs()} > ONLY_STARTED_BY_OTHERS | NEED_OTHER_LIBRARIES
    others = [
        path for path in programs() if "argparse.ArgumentParser(" not in (ROOT / path).read_text(encoding="utf-8")
    ]
    assert {*others} == ONLY_STARTED_BY_OTHERS


def test_a_tool_that_rewrites_says_how_it_is_used_and_rewrites_nothing() -> None:
    before = READING_ORDER.stat().st_mtime_ns
    assert help_of(Path("tests/docs/test_reading_order.py")).startswith("usage: ")
    assert READING_ORDER.stat().st_mtime_ns == before


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_every_tool_says_how_it_is_used_and_changes_nothing() -> None:
    before = times_of_change()
    for tool in tools():
        assert help_of(tool).startswith("usage: "), tool
    assert times_of_change() == before
