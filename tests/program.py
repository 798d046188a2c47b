"""The program as tests run it: as a user does, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = str(Path(sys.executable).parent / "robochoc")
ROOT = Path(__file__).parents[1]


def robochoc(*words: object, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the program; no run prints a traceback."""
    done = subprocess.run(
        [PROGRAM, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=100, check=False
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done
