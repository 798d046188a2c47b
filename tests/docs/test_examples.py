"""The programs of the examples end without a traceback if the reader of their output has ended, such as `head`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.limits import HANG_S
from tests.support.program import ROOT

PROGRAMS = [one for one in (ROOT / "docs" / "examples").rglob("*.py") if "__main__" in one.read_text(encoding="utf-8")]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_closed_pipe_ends_the_program(program: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, program], stdout=writing, stderr=subprocess.PIPE, text=True, check=False, timeout=HANG_S
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")
