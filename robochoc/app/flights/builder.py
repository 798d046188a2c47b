"""Builds the flight and the conversation of a run with robochoc's commands, each in a separate process.

map.json             the map of the ground, where the flight begins
flight.html          the scene of the simulated flight
flight.json          the result of the flight, or the reason why there was none
conversation.html    all messages, as shown by the sniffer
flight.mcap          a recording, on request

The files are stored in the run's folder. The work is ended when no page requests the files any more.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec

from robochoc.app.flights.flight_map import MAP, ground_of, happened_in
from robochoc.app.flights.flight_result import FLOWN, flight_result_of, refused
from robochoc.app.imported.facts import events_in_words
from robochoc.app.jobs.job import Call, Job, event_loop_caller
from robochoc.app.jobs.process import Command
from robochoc.app.listeners import Listeners
from robochoc.app.log import error_text
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.run import MAX_RESULT, Run
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import DecisionKind
from robochoc.formats import InvalidInputError, read_team
from robochoc.modelling.errors import ModelError
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically

FLIGHT = "flight.html"
CONVERSATION = "conversation.html"
RECORDING = "flight.mcap"
CAPTIONED = "told.json"
"""The file with the run's result and its events in words."""
MOST_MESSAGES = 100_000
"""The maximum number of messages shown, since a page with more would open slowly."""
_NOT_AS_PLANNED = 4
"""The exit status of `robochoc fly` if a drone did not arrive: the flight can still be shown."""
_MAX_MESSAGE = 600
_REFUSAL = "the result cannot be flown: "
"""The text that `robochoc fly` prints before the reason for a refusal."""


class BuildStage(StrEnum):
    """The stage of the work."""

    WAITING = "waiting"
    FLIGHT = "flight"
    CONVERSATION = "conversation"
    DONE = "done"


class BuildError(RobochocError):
    """A command failed. The message is its error text."""


def flies(run: Run) -> bool:
    """Return whether there is a flight: whether some decisions are robots' positions.

    A sketch without decisions is the picture of an imported team, which flies according to its files.
    """
    if run.record.flies is not None:
        return run.record.flies
    decisions = run.sketch.decisions
    return not decisions or any(decision.kind in {DecisionKind.LEVEL, DecisionKind.PLACE} for decision in decisions)


def can_record() -> bool:
    """Return whether the extra for recordings is installed."""
    return find_spec("mcap") is not None


class FlightBuilder:
    """Builds the files for one run. `builder_of` returns the object for a run."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.stage = BuildStage.WAITING
        self.troubles: dict[BuildStage, str] = {}
        """The errors of failed stages."""
        self._began = time.monotonic()
        self._requests = Listeners()
        self._job: Job[None] | None = None
        self._before: Job[None] | None = None
        self._call: Call = event_loop_caller()
        self._recording = asyncio.Lock()

    @property
    def has_answer(self) -> bool:
        """True if the team has an answer that can be flown, at the end or before an event."""
        return self.run.result is not None and self.run.result.has_decided

    @property
    def has_flight(self) -> bool:
        """True if there is a flight to show once it is built."""
        return self.has_answer and flies(self.run) and BuildStage.FLIGHT not in self.troubles

    @property
    def has_conversation(self) -> bool:
        """True if there are messages to show."""
        return self.run.artefact(JOURNAL) is not None and BuildStage.CONVERSATION not in self.troubles

    @property
    def flight(self) -> Path | None:
        """The page with the scene, if it exists."""
        return self.run.artefact(FLIGHT)

    @property
    def conversation(self) -> Path | None:
        """The page with the messages, if it exists."""
        return self.run.artefact(CONVERSATION)

    @property
    def seconds(self) -> float:
        """The elapsed time of the work in seconds."""
        return time.monotonic() - self._began

    @property
    def is_cut(self) -> bool:
        """True if only the first messages are shown."""
        return self.run.result is not None and self.run.result.messages > MOST_MESSAGES

    def request(self, on_stage: Callable[[], None]) -> Callable[[], None]:
        """Start the work if necessary, and call `on_stage` at each stage. Returns a function that ends the request."""
        leave = self._requests.add(on_stage)
        if self.stage == BuildStage.WAITING:
            self._start()

        def release() -> None:
            leave()
            if not self._requests:
                self.cancel()

        return release

    def retry(self) -> None:
        """Repeat the failed stages, or a flight that was refused. Raises `OSError`."""
        if self.stage != BuildStage.DONE:
            return
        flown = flight_result_of(self.run)
        if flown and flown.refused:
            for name in (FLIGHT, FLOWN):
                (self.run.folder / name).unlink(missing_ok=True)
        if self.troubles or self._needs_flight:
            self._start()

    def discard(self) -> None:
        """Delete the flight and its recording, because another point of the run's Pareto front was chosen."""
        self.cancel()
        for name in (FLIGHT, FLOWN, RECORDING):
            (self.run.folder / name).unlink(missing_ok=True)
        self._set_stage(BuildStage.WAITING)

    def cancel(self) -> None:
        """End the work. Existing files are kept."""
        if self._job is not None:
            self._job.end()
            self._before, self._job = self._job, None
            self._set_stage(BuildStage.WAITING)

    async def recording(self) -> Path:
        """Return a recording of the flight, which is made if it does not exist. Raises `BuildError`."""
        async with self._recording:
            file = self.run.artefact(RECORDING)
            if file is None:
                job = Job(f"recording {self.run.folder}", self._record, folder=self.run.folder).start()
                await asyncio.wait([asyncio.wrap_future(job.future)])
                try:
                    file = job.future.result()
                except BuildError:
                    raise
                except Exception as fault:  # noqa: BLE001 - the job was ended, or the error is in the error log
                    raise BuildError(error_text(fault)) from None
            return file

    def _start(self) -> None:
        self.troubles.clear()
        self._began = time.monotonic()
        self._call = event_loop_caller()
        self.stage = BuildStage.FLIGHT if self._needs_flight else BuildStage.CONVERSATION
        before, self._before = self._before, None
        self._job = job = Job(f"flight {self.run.folder}", partial(self._build, before), folder=self.run.folder)
        job.on_incomplete = partial(self._interrupted, job)
        job.start()

    @property
    def _needs_flight(self) -> bool:
        return self.flight is None and self.has_answer and flies(self.run)

    def _build(self, before: Job[None] | None, job: Job[None]) -> None:
        if before:  # two jobs must not write the same files
            before.join()
        if self._needs_flight:
            self._part(job, BuildStage.FLIGHT, self._build_flight)
        if self.conversation is None and self.run.artefact(JOURNAL):
            self._part(job, BuildStage.CONVERSATION, self._build_conversation)
        self._advance(job, BuildStage.DONE)

    def _part(self, job: Job[None], stage: BuildStage, make: Callable[[Job[None]], None]) -> None:
        self._advance(job, stage)
        try:
            make(job)
        except BuildError as why:
            self.troubles[stage] = str(why)

    def _interrupted(self, job: Job[None], why: str) -> None:
        if self._job is job and why:
            self.troubles[self.stage] = why
        self._advance(job, BuildStage.DONE if why else BuildStage.WAITING)

    def _build_flight(self, job: Job[None]) -> None:
        self._write_team()
        given = [self._result(), "--team", self.run.team.name, *self._map()]
        try:
            result = self._run(job, "fly", *given, "--json", "--html", FLIGHT)
        except BuildError as why:  # for example, two drones are too close: the goals are shown nevertheless
            self._run(job, "animate", *given, "--html", FLIGHT)
            result = refused(str(why).rpartition(_REFUSAL)[2])
        write_atomically(self.run.folder / FLOWN, result)

    def _build_conversation(self, job: Job[None]) -> None:
        cut = ["--to", str(MOST_MESSAGES - 1)] if self.is_cut else []
        self._run(job, "journal", "export", JOURNAL, "--format", "html", "-o", CONVERSATION, *cut)

    def _map(self) -> list[str]:
        """Write the map of the ground, if there is one, and return the options for using it."""
        ground = ground_of(self.run)
        if ground is None:
            return []
        write_atomically(self.run.folder / MAP, msgspec.json.encode(ground))
        return ["--map", MAP]

    def _result(self) -> str:
        """Return the file with the run's result, with its events in words, or of the chosen point of a front."""
        result = captioned(self.run) or of_chosen_point(self.run)
        if result is None:
            return RESULT
        write_atomically(self.run.folder / CAPTIONED, result)
        return CAPTIONED

    def _record(self, job: Job[Path]) -> Path:
        self._write_team()
        fresh = f"{RECORDING}.new"
        given = [self._result(), "--team", self.run.team.name, *self._map()]
        self._run(job, "fly", *given, "--json", "--ros", f"mcap:{fresh}")
        return (self.run.folder / fresh).replace(self.run.folder / RECORDING)

    def _write_team(self) -> None:
        """Write the team's files if they do not exist, since an opened state does not contain them."""
        run = self.run
        if run.team.is_dir():
            return
        try:
            model_of(run.sketch).save(run.team)
        except (ModelError, InvalidInputError, ValueError, TypeError) as mistake:
            raise BuildError(str(mistake)) from None

    def _run(self, job: Job[None] | Job[Path], *arguments: str) -> bytes:
        """Run a robochoc command in the run's folder, and return its output."""
        finished = job.run(Command(arguments, self.run.folder))
        if finished.status not in {0, _NOT_AS_PLANNED}:
            raise BuildError(finished.why[-_MAX_MESSAGE:])
        return finished.out

    def _advance(self, job: Job[None], stage: BuildStage) -> None:
        """Set the stage that a job has reached, unless the job was cancelled."""
        if self._job is job:
            if stage in {BuildStage.DONE, BuildStage.WAITING}:
                self._job = None
            self._set_stage(stage)

    def _set_stage(self, stage: BuildStage) -> None:
        self.stage = stage
        self._call(self._requests)


def builder_of(run: Run) -> FlightBuilder:
    """Return the builder for a run, which is the same object for all pages."""
    return run.part(FlightBuilder)


def captioned(run: Run) -> bytes | None:
    """Return the result of a run with its events in words, or None if there are no events, or they are unknown."""
    with suppress(OSError, ValueError, TypeError, LookupError, msgspec.MsgspecError, RecursionError, InvalidInputError):
        happened = _events(run)
        file = run.folder / RESULT
        if not happened or file.stat().st_size > MAX_RESULT:
            return None
        result: dict[str, Any] = msgspec.json.decode(file.read_bytes().partition(b"\n")[0], type=dict[str, Any])
        first, *others = result["epochs"]
        if len(others) != len(happened):
            return None
        captions = zip(others, happened, strict=True)
        result["epochs"] = [first, *({**epoch, "opened_by": caption} for epoch, caption in captions)]
        return msgspec.json.encode(result) + b"\n"
    return None


def of_chosen_point(run: Run) -> bytes | None:
    """Return the result of a run with the values of the chosen point of its front, or None if it is the first one."""
    if run.result is None or not run.result.point:
        return None
    result: dict[str, Any] = msgspec.json.decode((run.folder / RESULT).read_bytes().partition(b"\n")[0])
    point = result["front"][run.result.point]
    result |= {**point, "cost": next(iter(point["objectives"].values()))}
    return msgspec.json.encode(result) + b"\n"


def _events(run: Run) -> list[str]:
    """Return the event before each epoch except the first, without a full stop."""
    if run.sketch.decisions:
        sentences = happened_in(run)
        return [" ".join(sentences).removesuffix(".")] if sentences else []
    return [sentence.removesuffix(".") for sentence in events_in_words(read_team(run.team))]
