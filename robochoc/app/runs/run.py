"""A run of a team, with its files in a folder.

sketch.json    the sketch of the team
TEAM/          the team's files
run.json       the record: options, state and errors
run.journal    the journal, written during the run
result.json    the result
errors.txt     the standard error of the command
change.json    later events, and the team after them, if there were any
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Protocol

import msgspec

from robochoc.app.jobs.job import Call
from robochoc.app.listeners import Listeners
from robochoc.app.parts_owner import PartsOwner
from robochoc.app.runs.live import Live
from robochoc.app.runs.options import RESULT, RunOptions, command_line
from robochoc.app.runs.result import RunResult, decoded
from robochoc.app.sketch.sketch import MAX_LABEL, Sketch
from robochoc.formats.names import is_name

RECORD = "run.json"
SKETCH = "sketch.json"
CHANGE = "change.json"
ERRORS = "errors.txt"
MAX_RESULT = 64 << 20
"""The maximum size of a result in bytes. Larger results are rejected."""
_MAX_MESSAGE = 2_000


class RunState(StrEnum):
    """The state of a run."""

    RUNNING = "running"
    ENDED = "ended"
    """The run has an answer, or a limit was reached."""
    STOPPED = "stopped"
    """The user stopped the run. The best answer found so far may exist."""
    FAILED = "failed"
    """The run failed. `Run.message` contains the error."""


class Checked(StrEnum):
    """The result of checking the answer in an opened file."""

    KEPT = "kept"
    """All hard constraints are satisfied, and the cost is correct."""
    BROKEN = "broken"
    """A hard constraint is violated, or a value is invalid."""
    COST = "cost"
    """All hard constraints are satisfied, but the cost is wrong."""


class Record(msgspec.Struct):
    """The record of a run (run.json). Times are Unix times. `message` contains the error of a failed run.

    `labels`: the user's values that are spelled differently in files, by the spelling in files. `opened`: whether the
    run comes from an opened file; `checked`: the result of checking its answer (None: could not be checked). For an
    imported team, `flies`: whether its decisions are robots' positions; `maximised`: whether its costs are utilities.
    `point`: the index of the chosen point of a Pareto front.
    """

    options: RunOptions
    arguments: list[str] = []
    purpose: str = "decide"
    state: RunState = RunState.RUNNING
    started: float = 0.0
    ended: float | None = None
    message: str = ""
    labels: dict[str, str] = {}
    opened: bool = False
    checked: Checked | None = None
    flies: bool | None = None
    maximised: bool = False
    point: int = 0


class Watcher(Protocol):
    """The watcher of a run's process."""

    @property
    def pid(self) -> int | None:
        """The id of the process and its group, or None if there is no process (yet)."""

    def stop(self) -> None:
        """Request a stop."""

    def end(self) -> None:
        """End the process now."""


class Run(PartsOwner):
    """A run. `Runs` starts runs, and pages listen to them."""

    def __init__(self, folder: Path, record: Record, sketch: Sketch | None = None) -> None:
        super().__init__()
        self.id = folder.name
        self.folder = folder
        self.record = record
        self.live = Live()
        """The live state during the run."""
        self.result: RunResult | None = None
        """The answer, as soon as there is one. For a stopped run, the best answer so far."""
        self._sketch = sketch
        self._listeners = Listeners()
        self._call: Call = lambda does: does()
        self.watched_by: Watcher | None = None

    @property
    def state(self) -> RunState:
        """The state of the run: running, ended, stopped or failed."""
        return self.record.state

    @property
    def message(self) -> str:
        """The error of a failed run, or an error in addition to an ended run's answer, on one line; else empty."""
        return self.record.message

    @property
    def command(self) -> str:
        """The equivalent command line in the run's folder; empty if there is none.

        An opened file may contain any command. So for a run from such a file, the command line is rebuilt from the
        options, provided that the application could have set them.
        """
        record = self.record
        if not record.opened:
            return command_line(record.arguments)
        try:
            ranked = self.sketch.is_ranked
        except (OSError, ValueError):  # the run's files are damaged
            return ""
        return command_line(record.options.arguments(self.team.name, ranked=ranked)) if record.options.are_known else ""

    @property
    def seconds(self) -> float:
        """The elapsed time of the run in seconds."""
        return max(0.0, (self.record.ended or time.time()) - self.record.started)

    @property
    def sketch(self) -> Sketch:
        """The team's sketch. Raises `ValueError` if its file is damaged, `OSError` if the file cannot be read."""
        if self._sketch is None:
            try:
                self._sketch = msgspec.json.decode((self.folder / SKETCH).read_bytes(), type=Sketch)
            except (msgspec.DecodeError, RecursionError) as damaged:
                raise ValueError(f"{self.folder / SKETCH}: {damaged}") from None
        return self._sketch

    @property
    def team(self) -> Path:
        """The folder with the team's files. Its name is the team's name, if that is a valid folder name."""
        name = self.sketch.name
        return self.folder / (name if is_name(name) and len(name) <= MAX_LABEL else "team")

    def stop(self) -> None:
        """Request a stop with the best answer so far, and return immediately."""
        if self.watched_by:
            self.watched_by.stop()

    @property
    def pid(self) -> int | None:
        """The id of the run's process and its group, while there is a process."""
        return self.watched_by.pid if self.watched_by else None

    def artefact(self, name: str) -> Path | None:
        """Return a file in the run's folder, such as `run.journal`, if it exists."""
        file = self.folder / Path(name).name
        return file if file.is_file() else None

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` after each change, in the run's event loop. Returns a function that removes the callback."""
        return self._listeners.add(callback)

    def call_listeners_by(self, call: Call) -> None:
        """Call listeners through `call`, for example to move the calls from a thread to an event loop."""
        self._call = call

    def notify(self) -> None:
        """Call all listeners."""
        self._call(self._listeners)

    def finish(self, state: RunState, message: str = "") -> None:
        """Set the final state. Later calls have no effect."""
        if self.state != RunState.RUNNING:
            return
        self.record.message = " ".join(message.split())[:_MAX_MESSAGE]
        self.record.ended = time.time()
        self.record.state = state
        self.save()

    def choose_point(self, place: int) -> None:
        """Choose the point at this index of the Pareto front, whose values are then those of the result."""
        result = self.read_result()
        if result is None or not 0 <= place < len(result.front):
            return
        self.record.point = place
        self.result = result.at_point(place)
        self.save()
        self.notify()

    def save(self) -> None:
        """Save the record atomically."""
        fresh = self.folder / f"{RECORD}.{os.getpid()}.new"
        with suppress(OSError):  # if the disk is full or the team was removed, the run continues
            fresh.write_bytes(msgspec.json.encode(self.record))
            fresh.replace(self.folder / RECORD)

    def read_result(self) -> RunResult | None:
        """Read the result, if there is one."""
        file = self.folder / RESULT
        if self.result is None:
            with suppress(OSError):
                if 0 < file.stat().st_size <= MAX_RESULT:
                    result = decoded(file.read_bytes(), self.record.labels)
                    self.result = result and result.at_point(self.record.point)
        return self.result


def run_of(folder: Path) -> Run:
    """Return an earlier run. A damaged run counts as failed, and so does a run whose process has disappeared."""
    try:
        record = msgspec.json.decode((folder / RECORD).read_bytes(), type=Record)
    except (OSError, msgspec.DecodeError, RecursionError):
        return Run(folder, Record(RunOptions(), state=RunState.FAILED, message="broken"))
    run = Run(folder, record)
    run.read_result()
    if record.state == RunState.RUNNING:
        run.finish(RunState.ENDED if run.result else RunState.FAILED, "" if run.result else "lost")
    return run
