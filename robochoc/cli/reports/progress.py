"""Shows the progress of a run: one line on a terminal, nothing elsewhere."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from robochoc.communication.search_result import Progress

REFRESH_S = 0.1
TICK_S = 0.5
_ERASE = "\r\x1b[K"
"""Moves to the start of the line and erases it (ECMA-48)."""


def waiting_for_reports(show: Callable[[Progress], None]) -> Callable[[], None]:
    """Return a function that shows the elapsed time until robots report."""
    from robochoc.communication.search_result import Progress

    began = time.monotonic()
    return lambda: show(Progress(0, time.monotonic() - began, "waiting for reports of robots"))


@contextmanager
def progress_line(team: str) -> Iterator[Callable[[Progress], None] | None]:
    """Provide a function that shows the progress of a run on the last line of a terminal, or None without a terminal.

    The line is only refreshed by calls, not by a thread: a run forks processes, which must not happen beside threads.
    """
    if not _is_terminal():
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
        import shutil

        line = on_one_line(f"{team}: {stage}, {progress.elapsed_s:.1f} s")[: shutil.get_terminal_size().columns - 1]
        click.echo(f"{_ERASE}{click.style(line, dim=True)}", nl=False, err=True)

    try:
        yield show
    finally:
        click.echo(_ERASE, nl=False, err=True)


@contextmanager
def elapsed_time(what: str, stage: str) -> Iterator[None]:
    """Show the elapsed time of the block on a terminal, for work that reports no progress and forks no processes."""
    from robochoc.communication.search_result import Progress

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
    """Print `line` on standard error, above the progress line if there is one."""
    click.echo(f"{_ERASE}{line}" if _is_terminal() else line, err=True)


def _is_terminal() -> bool:
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


@contextmanager
def stages(team: str) -> Iterator[Callable[[str], None] | None]:
    """Provide a function like `progress_line`, for work with named stages instead of messages."""
    from robochoc.communication.search_result import Progress

    began = time.monotonic()
    with progress_line(team) as show:
        yield None if show is None else lambda stage: show(Progress(0, time.monotonic() - began, stage))
