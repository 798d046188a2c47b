"""The program as tests run it: as a user does, in a process of its own, or in theirs where there are many to run."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from robochoc.cli.group import run

PROGRAM = str(Path(sys.executable).parent / "robochoc")
ROOT = Path(__file__).parents[2]


def robochoc(*words: object, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the program; no run prints a traceback."""
    done = subprocess.run(
        [PROGRAM, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=100, check=False
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def robochoc_within(*words: object) -> subprocess.CompletedProcess[str]:
    """Run the program in this process, which takes a twentieth of the time; what it does not catch, the test gets."""
    command = [PROGRAM, *map(str, words)]
    output, errors = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with patch.object(sys, "argv", command), redirect_stdout(output), redirect_stderr(errors):
        try:
            status = run()
        except SystemExit as leaving:
            status = leaving.code if isinstance(leaving.code, int) else 1
    printed, complaints = (stream.buffer.getvalue().decode() for stream in (output, errors))
    return subprocess.CompletedProcess(command, status, printed, complaints)


def on_a_terminal(*words: object) -> bytes:
    """What the program shows on standard error where that is a terminal."""
    ours, theirs = pty.openpty()
    with subprocess.Popen([PROGRAM, *map(str, words)], stderr=theirs, stdout=subprocess.DEVNULL) as running:
        os.close(theirs)
        shown = b""
        while True:
            try:
                chunk = os.read(ours, 4096)
            except OSError:  # the program has hung up
                break
            shown += chunk
        running.wait(timeout=30)
    os.close(ours)
    return shown
