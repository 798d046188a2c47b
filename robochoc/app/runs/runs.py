"""The runs of a team: starts, watches and stops them, and finds them again after a restart of the server."""

from __future__ import annotations

import shutil
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import msgspec

from robochoc.app.jobs.job import Job, end_jobs_in, event_loop_caller, jobs_alive
from robochoc.app.jobs.process import Command, Finished
from robochoc.app.listeners import Listeners
from robochoc.app.projects import Project
from robochoc.app.runs.live import LiveReader
from robochoc.app.runs.options import JOURNAL, RESULT, RunOptions
from robochoc.app.runs.prepared_team import PreparedTeam, TeamFiles, prepare_files, prepare_sketch
from robochoc.app.runs.run import ERRORS, RECORD, SKETCH, Record, Run, RunState, run_of
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import Sketch
from robochoc.formats import InvalidInputError
from robochoc.modelling.errors import ModelError
from robochoc.modelling.model import Model
from robochoc.run.options import Options
from robochoc.run.recording import objective_to_record
from robochoc.system.stopping import STOP

MAX_RUNS = 30
"""The maximum number of runs stored for a team. Older ones are removed."""
_USUAL = RunOptions()


class RunsOwner(Protocol):
    """The owner of runs, such as a `Project`."""

    @property
    def sketch(self) -> Sketch:
        """The current state of the team."""

    @property
    def folder(self) -> Path:
        """The folder that contains the subfolder `runs`."""


class Runs:
    """The runs of one team. `runs_of` returns the object for an open team."""

    def __init__(self, project: RunsOwner) -> None:
        self._project = project
        self._folder = project.folder / "runs"
        self._listeners = Listeners()
        self._runs = [run_of(one.parent) for one in sorted(self._folder.glob(f"[0-9]*/{RECORD}"))]
        self._sweep()

    @property
    def latest(self) -> Run | None:
        """The run that was started last."""
        return self._runs[-1] if self._runs else None

    def latest_for(self, purpose: str) -> Run | None:
        """Return the run that was started last for a purpose, such as `decide`."""
        return next((run for run in self.all() if run.record.purpose == purpose), None)

    def all(self) -> list[Run]:
        """Return all runs, the last one first."""
        return self._runs[::-1]

    def find(self, name: str) -> Run | None:
        """Return the run with this id."""
        return next((run for run in self._runs if run.id == name), None)

    def start(
        self,
        options: RunOptions = _USUAL,
        *,
        sketch: Sketch | None = None,
        model: Callable[[Sketch], Model] = model_of,
        files: TeamFiles | None = None,
        purpose: str = "decide",
    ) -> Run:
        """Start a run and return it. All work is done in a thread and a process.

        Args:
            options: The options.
            sketch: The team. None: the team's current state.
            model: Converts the sketch to a model.
            files: The files of an imported team. They are used instead of the sketch, which is only the team's picture.
            purpose: The purpose, for `latest_for`. There is one run at a time for each purpose: if an earlier run is
                still in progress, it is ended.

        Raises:
            EditError: if the team was removed.
            OSError: for example, if a file cannot be written. In this case nothing has changed.
        """
        chosen = self._project.sketch if sketch is None else sketch
        record = Record(options, purpose=purpose, started=time.time())
        if files:
            record.flies, record.maximised = files.flies, files.maximised
        run = self._new_run(record, chosen)
        run.call_listeners_by(event_loop_caller())
        run.save()
        self._end_before(purpose)
        self._runs.append(run)
        self._forget_old()
        prepare = partial(prepare_files, files=files) if files else partial(prepare_sketch, model=model)
        run.watched_by = run_job(run, prepare).start()
        self._listeners()
        return run

    def on_start(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` when a run is started. Returns a function that removes the callback."""
        return self._listeners.add(callback)

    def _new_run(self, record: Record, sketch: Sketch) -> Run:
        """Return a run in a new folder."""
        folder = self._new_folder()
        try:
            run = Run(folder, record, sketch)
            run.record.arguments = record.options.arguments(run.team.name, ranked=sketch.is_ranked)
            (folder / SKETCH).write_bytes(msgspec.json.encode(sketch))
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        return run

    def _new_folder(self) -> Path:
        try:
            self._folder.mkdir(mode=0o700, exist_ok=True)
        except FileNotFoundError:
            raise EditError("app.removed") from None
        taken = [int(one.name) for one in self._folder.iterdir() if one.name.isdecimal()]
        number = max(taken, default=0) + 1
        while True:
            try:
                (self._folder / f"{number:05}").mkdir(mode=0o700)
            except FileExistsError:
                number += 1
            else:
                return self._folder / f"{number:05}"

    def _end_before(self, purpose: str) -> None:
        for run in self._runs:
            if run.record.purpose == purpose and run.watched_by:
                run.watched_by.end()

    def _forget_old(self) -> None:
        ended = [run for run in self._runs if run.state != RunState.RUNNING]
        for run in ended[: max(0, len(self._runs) - MAX_RUNS)]:
            self._runs.remove(run)
            with suppress(OSError):  # without a record, this is not a run, even if the process dies now
                (run.folder / RECORD).unlink()
            self._remove(run.folder, end_jobs_in(run.folder))

    def _sweep(self) -> None:
        """Remove folders that are not runs, because starting the run failed, or because its removal was interrupted.

        No other process writes there: the folder with all teams is locked (`Store.locked`), no run of this team has
        started yet, and work on the files of earlier runs is done in jobs.
        """
        if not self._folder.is_dir():
            return
        used = {job.folder for job in jobs_alive()}
        for folder in self._folder.iterdir():
            if folder.name.isdecimal() and folder not in used and not (folder / RECORD).exists():
                self._remove(folder)

    def _remove(self, folder: Path, ended: Sequence[Job[Any]] = ()) -> None:
        """Remove a folder in a thread, after its jobs `ended` have finished, since these may still write files."""

        def remove(job: Job[None]) -> None:
            job.wait_for(ended)
            shutil.rmtree(folder, ignore_errors=True)

        Job(f"removal of {folder}", remove, folder=folder).start()


def runs_of(project: Project) -> Runs:
    """Return the runs of a team, which are the same object for all pages."""
    return project.part(Runs)


PATIENCE_S = 4.0
"""The time in seconds for a stopped run to report its best answer, before SIGTERM and later SIGKILL are sent."""
_STOPPING = ((0.0, STOP), (PATIENCE_S, signal.SIGTERM), (2 * PATIENCE_S, signal.SIGKILL))
_LIMIT = 3
"""The exit status of a run that reached a limit."""
READ_ON_S = 1.0
"""The time in seconds for reading the rest of an ended run's journal. Later entries are skipped: `Live.is_cut`."""


def run_job(run: Run, prepare: Callable[[Run], PreparedTeam]) -> Job[None]:
    """Return the job for a run. `prepare` writes the files of the run's team."""
    return Job(
        f"run {run.folder}",
        partial(_work, run, prepare),
        on_incomplete=partial(_interrupted, run),
        folder=run.folder,
        stopping=_STOPPING,
    )


def _work(run: Run, prepare: Callable[[Run], PreparedTeam], job: Job[None]) -> None:
    try:
        reader = _reader(run, prepare)
    except (ModelError, InvalidInputError, ValueError, TypeError, KeyError) as mistake:
        _finish(run, RunState.FAILED, str(mistake))
        return
    if job.stopped_at is not None:
        _finish(run, RunState.STOPPED)
        return
    try:
        finished = job.run(_command(run), partial(_update, run, reader))
        _read_rest(run, reader, job)
    finally:
        reader.close()
    _set_result(run, finished, stopped=job.stopped_at is not None)


def _reader(run: Run, prepare: Callable[[Run], PreparedTeam]) -> LiveReader:
    """Write the team's files, and return the reader for the journal."""
    ready = prepare(run)
    # with withdrawals, the objective includes the price of a withdrawal, which is not one of the user's costs
    team = None if run.record.options.withdraw else ready.team
    objective = objective_to_record(team, Options()) if team else None
    run.record.labels = ready.labels
    weighed = objective() if objective else None
    return LiveReader(run.folder / JOURNAL, run.live, ready.label, weighed, ready.called, team)


def _command(run: Run) -> Command:
    out, errors = run.folder / RESULT, run.folder / ERRORS
    return Command((*run.record.arguments,), run.folder, out=out, errors=errors, can_be_asked=True)


def _update(run: Run, reader: LiveReader) -> None:
    reader.advance()
    run.read_result()  # the result may exist before the process ends
    run.notify()


def _read_rest(run: Run, reader: LiveReader, job: Job[None]) -> None:
    """Read the rest of the journal, within a time limit."""
    until = time.monotonic() + READ_ON_S
    while reader.advance():
        job.check()
        if time.monotonic() > until:
            run.live.is_cut = True
            return


def _set_result(run: Run, finished: Finished, *, stopped: bool) -> None:
    """Set the state of the run after its process has ended."""
    run.read_result()
    if stopped and (run.result is None or run.result.verdict == "unknown"):
        _finish(run, RunState.STOPPED)
    elif run.result is not None:  # there is a result, but, for example, the journal could not be written
        _finish(run, RunState.ENDED, "" if finished.status in {0, _LIMIT} else finished.why)
    else:
        _finish(run, RunState.FAILED, finished.why)


def _interrupted(run: Run, why: str) -> None:
    run.read_result()
    _finish(run, RunState.FAILED if why else RunState.STOPPED, why)


def _finish(run: Run, state: RunState, message: str = "") -> None:
    run.finish(state, message)
    run.notify()
