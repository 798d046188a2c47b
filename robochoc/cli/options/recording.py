"""`--journal`: the journal that a command is asked to write."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import OutputFile
from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from robochoc.communication.run_result import Progress
    from robochoc.journal.journal import BlockSink, Header, JournalRecorder
    from robochoc.verification.objective import Objective


journal_option = click.option(
    "--journal",
    type=OutputFile(),
    metavar="FILE",
    help="Write all messages and decisions to a compact file, during the run ('robochoc journal', 'replay', 'sniff').",
)

bounds_option = click.option(
    "--bounds",
    is_flag=True,
    help="With --journal: also when a least cost is proven.",
)


@contextmanager
def recording(
    path: Path | None,
    header: Callable[[], Header],
    objective: Callable[[], Objective] | None = None,
    sinks: Sequence[BlockSink] = (),
) -> Iterator[JournalRecorder | None]:
    """A recorder that writes to `path`, and to other `sinks`, while the run goes on; None if there is neither.

    When the file cannot be written, the run goes on. That is told at the end, and then it is what the command fails
    for; a run that has failed itself keeps its own status. Other sinks tell of their failures themselves.
    """
    if path is None and not sinks:
        yield None
        return
    from robochoc.journal.journal import JournalFile, JournalRecorder

    file = JournalFile(path) if path else None
    recorder = JournalRecorder(header(), objective, [file.write, *sinks] if file else sinks)
    try:
        yield recorder
    except BaseException:
        if not recorder.is_empty:  # a run that was refused leaves the journal of another one alone
            recorder.close()
        for failure in _failures(recorder):
            failure.show()
        if file:
            with suppress(OSError):  # the error that ended the run matters more
                file.close()
        raise
    else:
        recorder.close()
        for failure in _failures(recorder):
            raise failure
    finally:
        if file:
            file.close()


def shown_and_flushed(
    recorder: JournalRecorder | None, show: Callable[[Progress], None] | None
) -> Callable[[Progress], None] | None:
    """Return the function that receives a run's progress. It flushes the recorder if due, and calls `show`."""
    if recorder is None:
        return show

    def told(progress: Progress) -> None:
        recorder.flush_if_due()
        if show:
            show(progress)

    return told


def _failures(recorder: JournalRecorder) -> list[Failure]:
    from robochoc.formats import on_one_line

    return [
        Failure(
            INVALID,
            on_one_line(f"{error.filename}: the journal could not be written to its end: {error.strerror}")
            + " (what is there can be read; free some space, or name another file)",
        )
        for error in recorder.failures
        if error.filename
    ]
