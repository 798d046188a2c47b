"""A run: a team decides in a folder of its own, and what came of it stays there.

sketch.json    the sketch that it was made from
TEAM/          the team's files
run.json       how it was started, and how it ended
run.journal    what was said, while it is said
result.json    the answer
errors.txt     what the command had to say besides
change.json    what has happened meanwhile, and the team after it, if something has
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
from robochoc.app.parts import HasParts
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
"""A larger result is none of ours."""
_MAX_MESSAGE = 2_000


class State(StrEnum):
    """How far a run is."""

    RUNNING = "running"
    ENDED = "ended"
    """It has an answer, or a limit was reached."""
    STOPPED = "stopped"
    """Somebody stopped it. There may be an answer: the best so far."""
    FAILED = "failed"
    """It could not be; `Run.message` says why."""


class Checked(StrEnum):
    """What a check has found of an answer that came in a file."""

    KEPT = "kept"
    """Each constraint that must hold does, and the cost is right."""
    BROKEN = "broken"
    """Some constraint that must hold does not, or a value is none."""
    COST = "cost"
    """All hold, but the cost is another."""


class Record(msgspec.Struct):
    """What is kept of a run besides its files. Times are Unix times; `message`: why it failed.

    `labels`: the values that files cannot say as the user does, by what files say. `opened`: whether it came in a file,
    from elsewhere; `checked`: what came of checking its answer then (None: it could not be). `flies`: whether decisions
    say where robots are to be, of a team that was not drawn here; `maximised`: whether its costs are a worth.
    """

    options: RunOptions
    arguments: list[str] = []
    purpose: str = "decide"
    state: State = State.RUNNING
    started: float = 0.0
    ended: float | None = None
    message: str = ""
    labels: dict[str, str] = {}
    opened: bool = False
    checked: Checked | None = None
    flies: bool | None = None
    maximised: bool = False


class Watching(Protocol):
    """Who watches a run's process."""

    @property
    def pid(self) -> int | None:
        """The process, which is the first of its group; None: there is none (yet)."""

    def stop(self) -> None:
        """Ask it to stop."""

    def end(self) -> None:
        """End it now."""


class Run(HasParts):
    """A run. `Runs` starts them; pages listen to them."""

    def __init__(self, folder: Path, record: Record, sketch: Sketch | None = None) -> None:
        super().__init__()
        self.id = folder.name
        self.folder = folder
        self.record = record
        self.live = Live()
        """What can be seen while it runs."""
        self.result: RunResult | None = None
        """The answer, as soon as there is one; of a run that was stopped, the best so far."""
        self._sketch = sketch
        self._listeners = Listeners()
        self._call: Call = lambda does: does()
        self.watched_by: Watching | None = None

    @property
    def state(self) -> State:
        """The state of the run: running, ended, stopped or failed."""
        return self.record.state

    @property
    def message(self) -> str:
        """Why it failed, in one line; of one that has ended, what went wrong beside the answer; else empty."""
        return self.record.message

    @property
    def command(self) -> str:
        """The command line that does the same, in the run's folder. Empty: there is none.

        A stranger's file may hold any command. Of a run that came in one, it is made from its options, if they are any
        that can be set here.
        """
        record = self.record
        if not record.opened:
            return command_line(record.arguments)
        try:
            ranked = self.sketch.is_ranked
        except (OSError, ValueError):  # its files are damaged
            return ""
        return command_line(record.options.arguments(self.team.name, ranked=ranked)) if record.options.are_known else ""

    @property
    def seconds(self) -> float:
        """How long it has taken so far."""
        return max(0.0, (self.record.ended or time.time()) - self.record.started)

    @property
    def sketch(self) -> Sketch:
        """The sketch that it was made from. Raises `ValueError` if its file is damaged, `OSError` if it is gone."""
        if self._sketch is None:
            try:
                self._sketch = msgspec.json.decode((self.folder / SKETCH).read_bytes(), type=Sketch)
            except (msgspec.DecodeError, RecursionError) as damaged:
                raise ValueError(f"{self.folder / SKETCH}: {damaged}") from None
        return self._sketch

    @property
    def team(self) -> Path:
        """The folder of the team's files. Its name is the team's, if that is a name."""
        name = self.sketch.name
        return self.folder / (name if is_name(name) and len(name) <= MAX_LABEL else "team")

    def stop(self) -> None:
        """Stop it, with the best so far. It returns at once; nothing happens where it has ended."""
        if self.watched_by:
            self.watched_by.stop()

    @property
    def pid(self) -> int | None:
        """Its process, the first of its group, while there is one."""
        return self.watched_by.pid if self.watched_by else None

    def artefact(self, name: str) -> Path | None:
        """Return a file of the run, such as `run.journal`, if it is there."""
        file = self.folder / Path(name).name
        return file if file.is_file() else None

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` whenever there is news, in the event loop in which it was started; return what ends that."""
        return self._listeners.add(callback)

    def told_by(self, call: Call) -> None:
        """Have listeners called by `call`: from a thread into an event loop, say."""
        self._call = call

    def tell(self) -> None:
        """Call all listeners."""
        self._call(self._listeners)

    def become(self, state: State, message: str = "") -> None:
        """Note that it is over, and how. What was noted first stays."""
        if self.state != State.RUNNING:
            return
        self.record.message = " ".join(message.split())[:_MAX_MESSAGE]
        self.record.ended = time.time()
        self.record.state = state
        self.save()

    def save(self) -> None:
        """Keep its record on disk: all of it, or nothing."""
        fresh = self.folder / f"{RECORD}.{os.getpid()}.new"
        with suppress(OSError):  # the disk is full, or the team was removed: the run goes on
            fresh.write_bytes(msgspec.json.encode(self.record))
            fresh.replace(self.folder / RECORD)

    def read_result(self) -> RunResult | None:
        """Read its answer, if there is one by now."""
        file = self.folder / RESULT
        if self.result is None:
            with suppress(OSError):
                if 0 < file.stat().st_size <= MAX_RESULT:
                    self.result = decoded(file.read_bytes(), self.record.labels)
        return self.result


def run_of(folder: Path) -> Run:
    """Return a run of earlier: one that was running then, and is no more, has failed; so has one that is damaged."""
    try:
        record = msgspec.json.decode((folder / RECORD).read_bytes(), type=Record)
    except (OSError, msgspec.DecodeError, RecursionError):
        return Run(folder, Record(RunOptions(), state=State.FAILED, message="broken"))
    run = Run(folder, record)
    run.read_result()
    if record.state == State.RUNNING:
        run.become(State.ENDED if run.result else State.FAILED, "" if run.result else "lost")
    return run
