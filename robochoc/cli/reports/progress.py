"""Progress of a run: one line on a terminal, silence elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robochoc.communication.run_result import Progress

REFRESH_S = 0.1


def waiting(show: Callable[[Progress], None]) -> Callable[[], None]:
    """What tells of time that goes by while the robots have nothing to report: for whoever waits to call."""
    from robochoc.communication.run_result import Progress

    began = time.monotonic()
    return lambda: show(Progress(0, time.monotonic() - began, "the robots may report"))


@contextmanager
def progress_line(team: str) -> Iterator[Callable[[Progress], None] | None]:
    """A function that shows how far the run has come, while it lasts; None where stderr is no terminal.

    Refreshed by calls only: a thread in the background and the forks of a run do not go together.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from robochoc.system.plain_text import on_one_line

    last = 0.0
    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:

        def show(progress: Progress) -> None:
            nonlocal last
            if time.monotonic() - last < REFRESH_S:
                return
            last = time.monotonic()
            stage = progress.stage or f"{progress.messages:,} messages"
            line = f"{team}: {stage}, {progress.elapsed_s:.1f} s"
            live.update(Text(on_one_line(line), style="dim"), refresh=True)

        yield show


@contextmanager
def stages(team: str) -> Iterator[Callable[[str], None] | None]:
    """Like `progress_line`, of work whose stages have words and nothing to count."""
    from robochoc.communication.run_result import Progress

    began = time.monotonic()
    with progress_line(team) as show:
        yield None if show is None else lambda stage: show(Progress(0, time.monotonic() - began, stage))
