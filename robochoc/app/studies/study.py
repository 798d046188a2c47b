"""Executes a study: runs `robochoc experiment run` and `report` as processes, in a folder of the team."""

from __future__ import annotations

import signal
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from enum import StrEnum
from functools import partial
from pathlib import Path
from statistics import median

import msgspec

from robochoc.app.jobs.job import Call, Job, event_loop_caller
from robochoc.app.jobs.process import Command, Finished
from robochoc.app.listeners import Listeners
from robochoc.app.projects import Project
from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.studies.families import family_of
from robochoc.app.studies.question import StudyQuestion, folder_of, number_of_runs, study_of
from robochoc.experiments.task import Status
from robochoc.formats import InvalidInputError, read_team, write_team
from robochoc.modelling.errors import ModelError

STUDY = "study.toml"
ROWS = "study.sqlite"
REPORT = "report.html"
_STATE = "state.json"
_ERRORS = "errors.txt"
_STOPPING = ((0.0, signal.SIGINT), (4.0, signal.SIGKILL))
_MAX_MESSAGE = 2_000
_FINISHED = frozenset({Status.DONE, Status.ENDED})


class StudyStage(StrEnum):
    """The stage of a study."""

    PREPARING = "preparing"
    RUNNING = "running"
    REPORTING = "reporting"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


ENDED = frozenset({StudyStage.DONE, StudyStage.STOPPED, StudyStage.FAILED})


class Line(msgspec.Struct, frozen=True):
    """The results of one protocol: the medians over its runs, and the number of runs that ended in time."""

    protocol: str
    runs: int
    finished: int
    messages: float
    ncccs: float
    bytes: float
    cost: float | None = None


class StudyState(msgspec.Struct):
    """The state of a study, with the results of each protocol in `lines`."""

    question: StudyQuestion
    text: str
    total: int
    done: int = 0
    stage: StudyStage = StudyStage.PREPARING
    message: str = ""
    lines: list[Line] = []


class TeamStudy:
    """The study of a team. There is one study at a time, and the last one is saved."""

    def __init__(self, project: Project) -> None:
        self._folder = project.folder / "study"
        self._listeners = Listeners()
        self._job: Job[None] | None = None
        self._call: Call = event_loop_caller()
        self.facts = self._last()

    @property
    def running(self) -> bool:
        """True if the study is running."""
        return self.facts is not None and self.facts.stage not in ENDED

    @property
    def report(self) -> Path | None:
        """The report, if there is one."""
        file = self._folder / REPORT
        return file if self.facts and self.facts.stage == StudyStage.DONE and file.is_file() else None

    def start(self, sketch: Sketch, question: StudyQuestion, files: TeamFiles | None = None) -> None:
        """Start a study of the team given by a sketch or by files. Results of equal earlier runs are reused."""
        if self.running:
            return
        family = family_of(sketch) if question.family else None
        text = study_of(sketch, question, family)
        facts = self.facts = StudyState(question, text, number_of_runs(question, family))
        self._call = event_loop_caller()
        self._job = Job(
            f"study {self._folder}",
            partial(self._work, sketch, files, facts),
            on_incomplete=partial(self._interrupted, facts),
            folder=self._folder,
            stopping=_STOPPING,
        ).start()
        self._notify()

    def stop(self) -> None:
        """Request a stop. The results so far are kept."""
        if self._job:
            self._job.stop()

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` after each change. Returns a function that removes the callback."""
        return self._listeners.add(callback)

    def _work(self, sketch: Sketch, files: TeamFiles | None, facts: StudyState, job: Job[None]) -> None:
        try:
            self._prepare(sketch, files, facts)
            if not self._is_stopped(job, facts):
                self._run(facts, job)
        except (ModelError, InvalidInputError, ValueError, sqlite3.Error) as error:
            self._set_stage(facts, StudyStage.FAILED, str(error))

    def _run(self, facts: StudyState, job: Job[None]) -> None:
        self._set_stage(facts, StudyStage.RUNNING)
        finished = self._command(job, "run", STUDY, "-o", ROWS)
        facts.done = self._rows()
        if self._is_stopped(job, facts):
            return
        if finished.status:
            self._set_stage(facts, StudyStage.FAILED, _error_of(finished))
            return
        self._set_stage(facts, StudyStage.REPORTING)
        facts.lines = lines_of(self._folder / ROWS, facts.question.protocols)
        (self._folder / REPORT).unlink(missing_ok=True)
        reported = self._command(job, "report", ROWS, "-o", REPORT)
        if not self._is_stopped(job, facts):
            self._set_stage(facts, StudyStage.DONE, _error_of(reported) if reported.status else "")

    def _is_stopped(self, job: Job[None], facts: StudyState) -> bool:
        """Return whether the study was stopped, and if so, set its stage."""
        stopped = job.stopped_at is not None
        if stopped:
            self._set_stage(facts, StudyStage.STOPPED)
        return stopped

    def _interrupted(self, facts: StudyState, why: str) -> None:
        self._set_stage(facts, StudyStage.FAILED if why else StudyStage.STOPPED, why)

    def _prepare(self, sketch: Sketch, files: TeamFiles | None, facts: StudyState) -> None:
        self._folder.mkdir(mode=0o700, exist_ok=True)  # not its parents: if they do not exist, the team was removed
        if files:
            write_team(read_team(files.folder), self._folder / folder_of(sketch), replace=True)
        elif not facts.question.family:
            model_of(sketch).save(self._folder / folder_of(sketch), replace=True)
        (self._folder / STUDY).write_text(facts.text, encoding="utf-8")

    def _command(self, job: Job[None], *arguments: str) -> Finished:
        """Run `robochoc experiment`."""
        errors = self._folder / _ERRORS
        return job.run(Command(("experiment", *arguments), self._folder, errors=errors), self._update)

    def _update(self) -> None:
        """Update the number of completed runs."""
        done = self._rows()
        if self.facts and done != self.facts.done:
            self.facts.done = done
            self._notify()

    def _rows(self) -> int:
        """Return the number of completed runs."""
        file = self._folder / ROWS
        if not file.is_file():
            return 0
        try:
            with _opened(file) as rows:
                (found,) = rows.execute("SELECT count(*) FROM results").fetchone()
                return int(found)
        except sqlite3.Error:  # the file is being created
            return self.facts.done if self.facts else 0

    def _set_stage(self, facts: StudyState, stage: StudyStage, message: str = "") -> None:
        if facts.stage in ENDED:
            return
        facts.message, facts.stage = message, stage
        if stage in ENDED:
            with suppress(OSError):
                (self._folder / _STATE).write_bytes(msgspec.json.encode(facts))
        self._notify()

    def _last(self) -> StudyState | None:
        try:
            return msgspec.json.decode((self._folder / _STATE).read_bytes(), type=StudyState)
        except (OSError, msgspec.DecodeError, RecursionError):
            return None

    def _notify(self) -> None:
        self._call(self._listeners)


def _error_of(finished: Finished) -> str:
    return " ".join(finished.why.split())[-_MAX_MESSAGE:]


def lines_of(file: Path, protocols: Sequence[str]) -> list[Line]:
    """Return the results of each protocol, in the order of the question."""
    query = "SELECT status, messages, ncccs, bytes, cost FROM results WHERE protocol = ?"
    found = []
    with _opened(file) as rows:
        for protocol in protocols:
            own = rows.execute(query, [protocol]).fetchall()
            counted = [row for row in own if None not in row[1:4]]
            if counted:
                messages, ncccs, sent = (median(column) for column in [*zip(*counted, strict=True)][1:4])
                costs = [float(row[4]) for row in counted if row[4] is not None]
                finished = sum(row[0] in _FINISHED for row in own)
                cost = median(costs) if costs else None
                found.append(Line(protocol, len(own), finished, messages, ncccs, sent, cost))
    return found


@contextmanager
def _opened(file: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True, timeout=0.2)) as rows:
        yield rows


def study_on(project: Project) -> TeamStudy:
    """Return the study of a team, which is the same object for all pages."""
    return project.part(TeamStudy)
