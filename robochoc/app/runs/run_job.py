"""The job that starts a run's process and watches it until its end."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from functools import partial

from robochoc.app.jobs.job import Job
from robochoc.app.jobs.process import Command, Finished
from robochoc.app.runs.live import LiveReader
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.prepared_team import PreparedTeam
from robochoc.app.runs.run import ERRORS, Run, State
from robochoc.formats import InvalidInputError
from robochoc.modelling.errors import ModelError
from robochoc.run.options import Options
from robochoc.run.recording import objective_to_record
from robochoc.system.stopping import STOP

PATIENCE_S = 4.0
"""The time for a stopped run to report its best answer; then SIGTERM is sent, and later SIGKILL."""
_STOPPING = ((0.0, STOP), (PATIENCE_S, signal.SIGTERM), (2 * PATIENCE_S, signal.SIGKILL))
_LIMIT = 3
"""The exit status when a limit was reached."""
READ_ON_S = 1.0
"""The time for reading the rest of the journal of an ended run. Later entries are skipped: `Live.is_cut`."""


def run_job(run: Run, prepare: Callable[[Run], PreparedTeam]) -> Job[None]:
    """Return the job of a run. `prepare` writes the files of the run's team."""
    return Job(
        f"run {run.folder}",
        partial(_work, run, prepare),
        over=partial(_interrupted, run),
        folder=run.folder,
        stopping=_STOPPING,
    )


def _work(run: Run, prepare: Callable[[Run], PreparedTeam], job: Job[None]) -> None:
    try:
        reader = _reader(run, prepare)
    except (ModelError, InvalidInputError, ValueError, TypeError, KeyError) as mistake:
        _finish(run, State.FAILED, str(mistake))
        return
    if job.stopped_at is not None:
        _finish(run, State.STOPPED)
        return
    try:
        finished = job.run(_command(run), partial(_update, run, reader))
        _read_rest(run, reader, job)
    finally:
        reader.close()
    _set_result(run, finished, stopped=job.stopped_at is not None)


def _reader(run: Run, prepare: Callable[[Run], PreparedTeam]) -> LiveReader:
    """Write the team's files; return the reader of the journal."""
    ready = prepare(run)
    # with withdrawals, the objective includes the price of a withdrawal, which is not a cost of the user
    objective = None if run.record.options.withdraw else objective_to_record(ready.team, Options())
    run.record.labels = ready.labels
    weighed = objective() if objective else None
    return LiveReader(run.folder / JOURNAL, run.live, ready.label, weighed, ready.called)


def _command(run: Run) -> Command:
    out, errors = run.folder / RESULT, run.folder / ERRORS
    return Command((*run.record.arguments,), run.folder, out=out, errors=errors, can_be_asked=True)


def _update(run: Run, reader: LiveReader) -> None:
    reader.advance()
    run.read_result()  # the result may be there before the process ends
    run.notify()


def _read_rest(run: Run, reader: LiveReader, job: Job[None]) -> None:
    """Read the rest of the journal within a time limit."""
    until = time.monotonic() + READ_ON_S
    while reader.advance():
        job.check()
        if time.monotonic() > until:
            run.live.is_cut = True
            return


def _set_result(run: Run, finished: Finished, *, stopped: bool) -> None:
    """Set the state of the run after the end of its process."""
    run.read_result()
    if stopped and (run.result is None or run.result.verdict == "unknown"):
        _finish(run, State.STOPPED)
    elif run.result is not None:  # but, for example, its journal may not have been written
        _finish(run, State.ENDED, "" if finished.status in {0, _LIMIT} else finished.why)
    else:
        _finish(run, State.FAILED, finished.why)


def _interrupted(run: Run, why: str) -> None:
    run.read_result()
    _finish(run, State.FAILED if why else State.STOPPED, why)


def _finish(run: Run, state: State, message: str = "") -> None:
    run.finish(state, message)
    run.notify()
