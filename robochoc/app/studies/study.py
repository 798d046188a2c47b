"""A study that is carried out: `robochoc experiment run` and `report`, each a process, in a folder of the team."""

from __future__ import annotations

import asyncio
import os
import signal
import sqlite3
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from statistics import median
from weakref import WeakKeyDictionary

import msgspec

from robochoc.app.listeners import Listeners
from robochoc.app.projects import Project
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.studies.families import family_of
from robochoc.app.studies.question import Question, folder_of, number_of_runs, study_of
from robochoc.experiments.task import Status
from robochoc.formats import InvalidInputError
from robochoc.modelling.places import ModelError

STUDY = "study.toml"
ROWS = "study.sqlite"
REPORT = "report.html"
_STATE = "state.json"
_ERRORS = "errors.txt"
_SAID = "said.txt"
_LOOK_S = 0.4
_PATIENCE_S = 4.0
_MAX_MESSAGE = 2_000
_FINISHED = frozenset({Status.DONE, Status.ENDED})


class Stage(StrEnum):
    """How far a study is."""

    PREPARING = "preparing"
    RUNNING = "running"
    REPORTING = "reporting"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


ENDED = frozenset({Stage.DONE, Stage.STOPPED, Stage.FAILED})


class Line(msgspec.Struct, frozen=True):
    """What a protocol needed: medians of all of its runs, and how many of them came to an end in time."""

    protocol: str
    runs: int
    finished: int
    messages: float
    ncccs: float
    bytes: float
    cost: float | None = None


class Facts(msgspec.Struct):
    """What is known of a study. `lines`: what each protocol needed."""

    question: Question
    text: str
    total: int
    done: int = 0
    stage: Stage = Stage.PREPARING
    message: str = ""
    lines: list[Line] = []


class Study:
    """The study of a team: there is one at a time, and the last one is kept."""

    def __init__(self, project: Project) -> None:
        self._folder = project.folder / "study"
        self._listeners = Listeners()
        self._process: asyncio.subprocess.Process | None = None
        self._task: asyncio.Task[None] | None = None
        self._stopping = False
        self.facts = self._last()

    @property
    def running(self) -> bool:
        """Whether it is carried out at present."""
        return self.facts is not None and self.facts.stage not in ENDED

    @property
    def report(self) -> Path | None:
        """The report, if there is one."""
        file = self._folder / REPORT
        return file if self.facts and self.facts.stage is Stage.DONE and file.is_file() else None

    def start(self, sketch: Sketch, question: Question) -> None:
        """Begin. Rows of runs that are the same as before are kept: only what is new is run."""
        if self.running:
            return
        family = family_of(sketch) if question.family else None
        text = study_of(sketch, question, family)
        self.facts = Facts(question, text, number_of_runs(question, family))
        self._stopping = False
        self._task = asyncio.get_running_loop().create_task(self._carry_out(sketch, self.facts))
        self._tell()

    def stop(self) -> None:
        """Ask it to stop. What is there is kept."""
        self._stopping = True
        self._signal(signal.SIGINT)

    async def end(self) -> None:
        """End it at once: the server ends."""
        self._stopping = True
        if self._task is not None and not self._task.done():
            self._kill()
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` when there is news; return what ends that."""
        return self._listeners.add(callback)

    async def _carry_out(self, sketch: Sketch, facts: Facts) -> None:
        try:
            await asyncio.to_thread(self._prepare, sketch, facts)
            self._become(Stage.RUNNING)
            status = await self._command("run", STUDY, "-o", ROWS)
            facts.done = await asyncio.to_thread(self._rows)
            if self._stopping:
                self._become(Stage.STOPPED)
            elif status:
                self._become(Stage.FAILED, self._errors())
            else:
                await self._tell_what_came_of_it(facts)
        except (ModelError, InvalidInputError, OSError, ValueError, sqlite3.Error) as error:
            self._become(Stage.FAILED, str(error))

    async def _tell_what_came_of_it(self, facts: Facts) -> None:
        self._become(Stage.REPORTING)
        facts.lines = await asyncio.to_thread(lines_of, self._folder / ROWS, facts.question.protocols)
        (self._folder / REPORT).unlink(missing_ok=True)
        failed = await self._command("report", ROWS, "-o", REPORT)
        self._become(Stage.STOPPED if self._stopping else Stage.DONE, self._errors() if failed else "")

    def _prepare(self, sketch: Sketch, facts: Facts) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not facts.question.family:
            model_of(sketch).save(self._folder / folder_of(sketch), replace=True)
        (self._folder / STUDY).write_text(facts.text, encoding="utf-8")

    async def _command(self, *arguments: str) -> int:
        """Carry out `robochoc experiment`; return its exit status."""
        if self._stopping:
            return -signal.SIGINT
        with (self._folder / _SAID).open("wb") as said, (self._folder / _ERRORS).open("wb") as errors:
            self._process = process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-P", "-m", "robochoc.app.runs.child", str(os.getpid()), "experiment", *arguments),
                cwd=self._folder,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=said,
                stderr=errors,
                process_group=0,
            )
        try:
            return await self._watched(process)
        finally:
            self._kill()
            self._process = None

    async def _watched(self, process: asyncio.subprocess.Process) -> int:
        """Look how far it is until it ends; if it does not when it is asked to, end it."""
        stopping_s = 0.0
        while True:
            with suppress(TimeoutError):
                return await asyncio.wait_for(process.wait(), _LOOK_S)
            done = await asyncio.to_thread(self._rows)
            if self.facts and done != self.facts.done:
                self.facts.done = done
                self._tell()
            if self._stopping:
                stopping_s += _LOOK_S
                if stopping_s > _PATIENCE_S:
                    self._kill()

    def _rows(self) -> int:
        """Return how many of the study's runs are there."""
        file = self._folder / ROWS
        if not file.is_file():
            return 0
        try:
            with _opened(file) as rows:
                (found,) = rows.execute("SELECT count(*) FROM results").fetchone()
                return int(found)
        except sqlite3.Error:  # it is being made
            return self.facts.done if self.facts else 0

    def _errors(self) -> str:
        with suppress(OSError):
            said = (self._folder / _ERRORS).read_bytes()[-_MAX_MESSAGE:].decode(errors="replace")
            return " ".join(said.split())
        return ""

    def _signal(self, number: int) -> None:
        if self._process is not None and self._process.returncode is None:
            with suppress(ProcessLookupError):
                self._process.send_signal(number)

    def _kill(self) -> None:
        """End whatever is left of the process and those that it has started."""
        if self._process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _become(self, stage: Stage, message: str = "") -> None:
        if self.facts is None:
            return
        self.facts.stage, self.facts.message = stage, message
        if stage in ENDED:
            with suppress(OSError):
                (self._folder / _STATE).write_bytes(msgspec.json.encode(self.facts))
        self._tell()

    def _last(self) -> Facts | None:
        try:
            return msgspec.json.decode((self._folder / _STATE).read_bytes(), type=Facts)
        except (OSError, msgspec.DecodeError):
            return None

    def _tell(self) -> None:
        self._listeners()


def lines_of(file: Path, protocols: Sequence[str]) -> list[Line]:
    """Return what each protocol needed, in the order in which they were asked for."""
    asked = "SELECT status, messages, ncccs, bytes, cost FROM results WHERE protocol = ?"
    found = []
    with _opened(file) as rows:
        for protocol in protocols:
            of_it = rows.execute(asked, [protocol]).fetchall()
            counted = [row for row in of_it if None not in row[1:4]]
            if counted:
                messages, ncccs, sent = (median(column) for column in [*zip(*counted, strict=True)][1:4])
                costs = [float(row[4]) for row in counted if row[4] is not None]
                finished = sum(row[0] in _FINISHED for row in of_it)
                cost = median(costs) if costs else None
                found.append(Line(protocol, len(of_it), finished, messages, ncccs, sent, cost))
    return found


@contextmanager
def _opened(file: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True, timeout=0.2)) as rows:
        yield rows


_STUDIES: WeakKeyDictionary[Project, Study] = WeakKeyDictionary()


def study_on(project: Project) -> Study:
    """Return the study of a team, the same object for all pages that show it."""
    if project not in _STUDIES:
        _STUDIES[project] = Study(project)
    return _STUDIES[project]


async def end_studies() -> None:
    """End all that runs: the server does."""
    for study in [*_STUDIES.values()]:
        await study.end()
