"""Progress of a run: one line on a terminal, nothing elsewhere."""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from robochoc.communication.run_result import Progress

REFRESH_S = 0.1
TICK_S = 0.5
_ERASE = "\r\x1b[K"
"""Go to the beginning of the line, and erase it (ECMA-48)."""


def waiting(show: Callable[[Progress], None]) -> Callable[[], None]:
    """Return a function that shows the elapsed time while the robots have nothing to report."""
    from robochoc.communication.run_result import Progress

    began = time.monotonic()
    return lambda: show(Progress(0, time.monotonic() - began, "the robots may report"))


@contextmanager
def progress_line(team: str) -> Iterator[Callable[[Progress], None] | None]:
    """Give a function that shows the progress of a run on the last line of a terminal; None if stderr is none.

    The line is refreshed by calls only: a thread in the background and the forks of a run do not go together.
    """
    if not _on_a_terminal():
        yield None
        return
    from robochoc.system.plain_text import on_one_line

    last = 0.0

    def show(progress: Progress) -> None:
        nonlocal last
        if time.monotonic() - last < REFRESH_S:
            return
        last = time.monotonic()
        stage = progress.stage or f"{progress.messages:,} messages"
        line = on_one_line(f"{team}: {stage}, {progress.elapsed_s:.1f} s")[: shutil.get_terminal_size().columns - 1]
        click.echo(f"{_ERASE}{click.style(line, dim=True)}", nl=False, err=True)

    try:
        yield show
    finally:
        click.echo(_ERASE, nl=False, err=True)


@contextmanager
def elapsed_time(what: str, stage: str) -> Iterator[None]:
    """Show the elapsed time of the block on a terminal, for work that reports no progress and forks no process."""
    from robochoc.communication.run_result import Progress

    with progress_line(what) as show:
        if show is None:
            yield
            return
        began, is_over = time.monotonic(), threading.Event()

        def tick() -> None:
            while not is_over.wait(TICK_S):
                show(Progress(0, time.monotonic() - began, stage))

        ticking = threading.Thread(target=tick, daemon=True)
        ticking.start()
        try:
            yield
        finally:
            is_over.set()
            ticking.join()


def print_above(line: str) -> None:
    """Print `line` on standard error, where a progress line may stand."""
    click.echo(f"{_ERASE}{line}" if _on_a_terminal() else line, err=True)


def _on_a_terminal() -> bool:
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


@contextmanager
def stages(team: str) -> Iterator[Callable[[str], None] | None]:
    """Do as `progress_line` for work that has stages, and no messages to count."""
    from robochoc.communication.run_result import Progress

    began = time.monotonic()
    with progress_line(team) as show:
        yield None if show is None else lambda stage: show(Progress(0, time.monotonic() - began, stage))
