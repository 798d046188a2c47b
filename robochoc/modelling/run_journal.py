"""The journal of a run started from Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robochoc.journal.recorder import JournalRecorder
    from robochoc.run.orchestrator import PreparedRun


@contextmanager
def recorded(path: Path | str | None, run: PreparedRun) -> Iterator[JournalRecorder | None]:
    """Provide a recorder that writes the journal of `run` to `path` during the run, or None if no path is given.

    Raises:
        OSError: if the file cannot be written.
    """
    if path is None:
        yield None
        return
    from robochoc.journal.recorder import JournalFile, JournalRecorder  # noqa: PLC0415 - start-up
    from robochoc.run.recording import journal_header, objective_to_record  # noqa: PLC0415 - start-up

    file = JournalFile(Path(path))
    options = run.choice.options
    objective = objective_to_record(run.team, options)
    recorder = JournalRecorder(journal_header(run.team, options), objective, [file.write])
    try:
        yield recorder
    except BaseException:
        if not recorder.is_empty:  # a rejected run must not overwrite an older journal
            recorder.close()
        with suppress(OSError):  # the error that ended the run is more important
            file.close()
        raise
    recorder.close()
    file.close()
    for failure in recorder.failures:
        raise failure
