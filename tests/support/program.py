"""The program as tests run it: as a user does, in a process of its own, or in theirs where there are many to run."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from robochoc.cli.group import run
from tests.support.limits import HANG_S

PROGRAM = str(Path(sys.executable).parent / "robochoc")
ROOT = Path(__file__).parents[2]


def unmeasured() -> dict[str, str]:
    """Return the environment for a process whose imports or files a test counts: without those of `make coverage`."""
    return {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_PROCESS_")}


def robochoc(*words: object, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the program; no run prints a traceback."""
    done = subprocess.run(
        [PROGRAM, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=HANG_S, check=False
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


class _Stream(io.TextIOWrapper):
    """What is written to it, and whether it passes for a terminal."""

    def __init__(self, *, terminal: bool) -> None:
        super().__init__(io.BytesIO(), encoding="utf-8", write_through=True)
        self._terminal = terminal

    def isatty(self) -> bool:
        return self._terminal

    @property
    def written(self) -> str:
        assert isinstance(self.buffer, io.BytesIO)
        return self.buffer.getvalue().decode()


def robochoc_within(
    *words: object, folder: Path | None = None, terminal: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run the program in this process, which takes a twentieth of the time; what it does not catch, the test gets.

    Its robots, solvers, routers and viewers have processes of their own all the same. What differs: signals are the
    test's, warnings are errors, and modules are there already. `terminal`: standard error is one.
    """
    command = [PROGRAM, *map(str, words)]
    output, errors = _Stream(terminal=False), _Stream(terminal=terminal)
    with ExitStack() as place:
        place.enter_context(patch.object(sys, "argv", command))
        place.enter_context(redirect_stdout(output))
        place.enter_context(redirect_stderr(errors))
        if folder is not None:
            place.enter_context(chdir(folder))
        try:
            status = run()
        except SystemExit as leaving:
            status = leaving.code if isinstance(leaving.code, int) else 1
    return subprocess.CompletedProcess(command, status, output.written, errors.written)


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
        running.wait(timeout=HANG_S)
    os.close(ours)
    return shown
