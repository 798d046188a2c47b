"""The option `--journal`, with which a command writes a journal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import OutputFile
from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from robochoc.communication.search_result import Progress
    from robochoc.journal.journal import BlockSink, Header, JournalRecorder
    from robochoc.verification.objective import Objective


journal_option = click.option(
    "--journal",
    type=OutputFile(),
    metavar="FILE",
    help="Record the run ('robochoc journal', 'replay', 'sniff').",
)

bounds_option = click.option(
    "--bounds",
    is_flag=True,
    help="With --journal: also record proven lower bounds of the cost.",
)


@contextmanager
def recording(
    path: Path | None,
    header: Callable[[], Header],
    objective: Callable[[], Objective] | None = None,
    sinks: Sequence[BlockSink] = (),
) -> Iterator[JournalRecorder | None]:
    """Provide a recorder that writes to `path` and to other `sinks` during the run, or None if neither is given.

    If the file cannot be written, the run continues. At the end, the error is reported as the failure of the command,
    unless the run itself failed. Other sinks report their own errors.
    """
    if path is None and not sinks:
        yield None
        return
    from robochoc.journal.recorder import recorded

    with recorded(path, header(), objective, sinks, on_error=_show_failures) as recorder:
        yield recorder
    for failure in _failures(recorder):
        raise failure


def flushing_progress(
    recorder: JournalRecorder | None, show: Callable[[Progress], None] | None
) -> Callable[[Progress], None] | None:
    """Return a function that receives a run's progress, flushes the recorder when due, and calls `show`."""
    if recorder is None:
        return show

    def flush_and_show(progress: Progress) -> None:
        recorder.flush_if_due()
        if show:
            show(progress)

    return flush_and_show


def _show_failures(recorder: JournalRecorder) -> None:
    for failure in _failures(recorder):
        failure.show()


def _failures(recorder: JournalRecorder) -> list[Failure]:
    from robochoc.formats import on_one_line

    return [
        Failure(
            INVALID,
            on_one_line(f"{error.filename}: the journal could not be written completely: {error.strerror}")
            + " (its beginning can be read; free some space, or name another file)",
        )
        for error in recorder.failures
        if error.filename
    ]
