"""A run's process, from its start to its end, in a job that watches it."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from functools import partial

from robochoc.app.jobs.job import Job
from robochoc.app.jobs.process import Command, Finished
from robochoc.app.runs.live import LiveReader
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.prepared import Prepared
from robochoc.app.runs.run import ERRORS, Run, State
from robochoc.formats import InvalidInputError
from robochoc.modelling.errors import ModelError
from robochoc.run.options import Options
from robochoc.run.recording import objective_to_record
from robochoc.system.stopping import STOP

PATIENCE_S = 4.0
"""A run that was asked to stop tells its best so far in this time; then it is told to end, then it is ended."""
_STOPPING = ((0.0, STOP), (PATIENCE_S, signal.SIGTERM), (2 * PATIENCE_S, signal.SIGKILL))
_LIMIT = 3
"""The exit status when a limit was reached."""
READ_ON_S = 1.0
"""What a run has said that has ended is read for so long. The rest is left out: `Live.is_cut`."""


def watched(run: Run, prepare: Callable[[Run], Prepared]) -> Job[None]:
    """Return the job that carries out a run. `prepare` writes the files of the run's team."""
    return Job(
        f"run {run.folder}",
        partial(_carry_out, run, prepare),
        over=partial(_broken_off, run),
        folder=run.folder,
        stopping=_STOPPING,
    )


def _carry_out(run: Run, prepare: Callable[[Run], Prepared], job: Job[None]) -> None:
    try:
        reader = _reader(run, prepare)
    except (ModelError, InvalidInputError, ValueError, TypeError, KeyError) as mistake:
        _over(run, State.FAILED, str(mistake))
        return
    if job.stopped_at is not None:
        _over(run, State.STOPPED)
        return
    try:
        finished = job.run(_command(run), partial(_look, run, reader))
        _read_on(run, reader, job)
    finally:
        reader.close()
    _note(run, finished, stopped=job.stopped_at is not None)


def _reader(run: Run, prepare: Callable[[Run], Prepared]) -> LiveReader:
    """Write the team's files; return what reads the journal."""
    ready = prepare(run)
    # where robots may step aside, what is minimised has a price for that, which is no cost of the user's
    objective = None if run.record.options.withdraw else objective_to_record(ready.team, Options())
    run.record.labels = ready.labels
    weighed = objective() if objective else None
    return LiveReader(run.folder / JOURNAL, run.live, ready.label, weighed, ready.called)


def _command(run: Run) -> Command:
    out, errors = run.folder / RESULT, run.folder / ERRORS
    return Command((*run.record.arguments,), run.folder, out=out, errors=errors, can_be_asked=True)


def _look(run: Run, reader: LiveReader) -> None:
    reader.advance()
    run.read_result()  # the process may not have ended then
    run.tell()


def _read_on(run: Run, reader: LiveReader, job: Job[None]) -> None:
    """Read what has not been read yet: all of it, or as much as there is time for."""
    until = time.monotonic() + READ_ON_S
    while reader.advance():
        job.check()
        if time.monotonic() > until:
            run.live.is_cut = True
            return


def _note(run: Run, finished: Finished, *, stopped: bool) -> None:
    """Note how the process has ended."""
    run.read_result()
    if stopped and (run.result is None or run.result.verdict == "unknown"):
        _over(run, State.STOPPED)
    elif run.result is not None:  # though its journal, say, may not have been written
        _over(run, State.ENDED, "" if finished.status in {0, _LIMIT} else finished.why)
    else:
        _over(run, State.FAILED, finished.why)


def _broken_off(run: Run, why: str) -> None:
    run.read_result()
    _over(run, State.FAILED if why else State.STOPPED, why)


def _over(run: Run, state: State, message: str = "") -> None:
    run.become(state, message)
    run.tell()
