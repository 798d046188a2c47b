"""Makes what is to be looked at of a run, by robochoc's own commands, each in a process of its own.

map.json             the map of the ground, on which the flight begins
flight.html          the scene of the flight, which is simulated
flight.json          how it went, or why it could not be flown
conversation.html    all messages, as the sniffer shows them
flight.mcap          a recording, if somebody asks for it

They stay in the run's folder. Whoever wants them says so, and the work ends when nobody wants them any more.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import msgspec

from robochoc.app.flights.captions import captioned
from robochoc.app.flights.flight_map import MAP, ground_of
from robochoc.app.flights.flight_result import FLOWN, flight_result_of, refused
from robochoc.app.jobs.job import Call, Job, event_loop_caller
from robochoc.app.jobs.process import Command
from robochoc.app.listeners import Listeners
from robochoc.app.log import error_text
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.run import Run
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Kind
from robochoc.formats import InvalidInputError
from robochoc.modelling.errors import ModelError
from robochoc.system.files import write_atomically

FLIGHT = "flight.html"
CONVERSATION = "conversation.html"
RECORDING = "flight.mcap"
CAPTIONED = "told.json"
"""The result, with what has happened in words."""
MOST_MESSAGES = 100_000
"""Messages of a conversation that are shown: a page with more would open slowly."""
_NOT_AS_PLANNED = 4
"""The exit status of `robochoc fly` for a flight in which somebody has not arrived: it can be looked at."""
_MAX_MESSAGE = 600
_REFUSAL = "the result cannot be flown: "
"""What `robochoc fly` says before the reason."""


class Stage(StrEnum):
    """The stage that making a file has reached."""

    WAITING = "waiting"
    FLIGHT = "flight"
    CONVERSATION = "conversation"
    DONE = "done"


class CannotMakeError(Exception):
    """A command has failed; the text is what it said."""


def flies(run: Run) -> bool:
    """Return whether there is anything to fly: decisions that say where a robot is to be.

    A sketch without decisions is the picture of a team that was not drawn here: it flies as its files have it.
    """
    if run.record.flies is not None:
        return run.record.flies
    decisions = run.sketch.decisions
    return not decisions or any(decision.kind in {Kind.LEVEL, Kind.PLACE} for decision in decisions)


def can_record() -> bool:
    """Return whether the extra that writes recordings is installed."""
    return find_spec("mcap") is not None


class FlightBuilder:
    """Makes the files of one run that are looked at or handed on. `builder_of` returns the one object of each."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.stage = Stage.WAITING
        self.troubles: dict[Stage, str] = {}
        """What could not be made, and why."""
        self._began = time.monotonic()
        self._wanted = Listeners()
        self._job: Job[None] | None = None
        self._before: Job[None] | None = None
        self._call: Call = event_loop_caller()
        self._recording = asyncio.Lock()

    @property
    def has_answer(self) -> bool:
        """Whether the team has decided something that can be flown: in the end, or before something happened."""
        return self.run.result is not None and self.run.result.has_decided

    @property
    def has_flight(self) -> bool:
        """Whether there is a flight to be shown, once it is made."""
        return self.has_answer and flies(self.run) and Stage.FLIGHT not in self.troubles

    @property
    def has_conversation(self) -> bool:
        """Whether there are messages to be shown."""
        return self.run.artefact(JOURNAL) is not None and Stage.CONVERSATION not in self.troubles

    @property
    def flight(self) -> Path | None:
        """The scene, if it is there."""
        return self.run.artefact(FLIGHT)

    @property
    def conversation(self) -> Path | None:
        """The messages, if they are there."""
        return self.run.artefact(CONVERSATION)

    @property
    def seconds(self) -> float:
        """How long it has been at work."""
        return time.monotonic() - self._began

    @property
    def is_cut(self) -> bool:
        """Whether only the first messages are shown."""
        return self.run.result is not None and self.run.result.messages > MOST_MESSAGES

    def wanted(self, told: Callable[[], None]) -> Callable[[], None]:
        """Begin, if that has not been done; call `told` at every stage. Return what says that it is not wanted."""
        leave = self._wanted.add(told)
        if self.stage == Stage.WAITING:
            self._begin()

        def release() -> None:
            leave()
            if not self._wanted:
                self.cancel()

        return release

    def again(self) -> None:
        """Try again to make what could not be made, and a flight that was refused. Raises `OSError`."""
        if self.stage != Stage.DONE:
            return
        flown = flight_result_of(self.run)
        if flown and flown.refused:
            for name in (FLIGHT, FLOWN):
                (self.run.folder / name).unlink(missing_ok=True)
        if self.troubles or self._wants_flight:
            self._begin()

    def cancel(self) -> None:
        """End the work. What is there already stays."""
        if self._job is not None:
            self._job.end()
            self._before, self._job = self._job, None
            self._become(Stage.WAITING)

    async def recording(self) -> Path:
        """Return a recording of the flight, which is made now if it is not there. Raises `CannotMakeError`."""
        async with self._recording:
            file = self.run.artefact(RECORDING)
            if file is None:
                job = Job(f"recording {self.run.folder}", self._record, folder=self.run.folder).start()
                await asyncio.wait([asyncio.wrap_future(job.future)])
                try:
                    file = job.future.result()
                except CannotMakeError:
                    raise
                except Exception as fault:  # noqa: BLE001 - it was ended, or the file of errors has it
                    raise CannotMakeError(error_text(fault)) from None
            return file

    def _begin(self) -> None:
        self.troubles.clear()
        self._began = time.monotonic()
        self._call = event_loop_caller()
        self.stage = Stage.FLIGHT if self._wants_flight else Stage.CONVERSATION
        before, self._before = self._before, None
        self._job = job = Job(f"flight {self.run.folder}", partial(self._make, before), folder=self.run.folder)
        job.over = partial(self._broken_off, job)
        job.start()

    @property
    def _wants_flight(self) -> bool:
        return self.flight is None and self.has_answer and flies(self.run)

    def _make(self, before: Job[None] | None, job: Job[None]) -> None:
        if before:  # two shall not write the same files
            before.join()
        if self._wants_flight:
            self._part(job, Stage.FLIGHT, self._make_flight)
        if self.conversation is None and self.run.artefact(JOURNAL):
            self._part(job, Stage.CONVERSATION, self._make_conversation)
        self._advance(job, Stage.DONE)

    def _part(self, job: Job[None], stage: Stage, make: Callable[[Job[None]], None]) -> None:
        self._advance(job, stage)
        try:
            make(job)
        except CannotMakeError as why:
            self.troubles[stage] = str(why)

    def _broken_off(self, job: Job[None], why: str) -> None:
        if self._job is job and why:
            self.troubles[self.stage] = why
        self._advance(job, Stage.DONE if why else Stage.WAITING)

    def _make_flight(self, job: Job[None]) -> None:
        self._team_is_there()
        given = [self._result(), "--team", self.run.team.name, *self._map()]
        try:
            told = self._ran(job, "fly", *given, "--json", "--html", FLIGHT)
        except CannotMakeError as why:  # too near to each other, say: where they end can be seen all the same
            self._ran(job, "animate", *given, "--html", FLIGHT)
            told = refused(str(why).rpartition(_REFUSAL)[2])
        write_atomically(self.run.folder / FLOWN, told)

    def _make_conversation(self, job: Job[None]) -> None:
        cut = ["--to", str(MOST_MESSAGES - 1)] if self.is_cut else []
        self._ran(job, "journal", "export", JOURNAL, "--format", "html", "-o", CONVERSATION, *cut)

    def _map(self) -> list[str]:
        """Write the map of the ground; return the options that name it. Without a map there are none."""
        ground = ground_of(self.run)
        if ground is None:
            return []
        write_atomically(self.run.folder / MAP, msgspec.json.encode(ground))
        return ["--map", MAP]

    def _result(self) -> str:
        """Return the file of the run's result: with what has happened in words, if something has."""
        told = captioned(self.run)
        if told is None:
            return RESULT
        write_atomically(self.run.folder / CAPTIONED, told)
        return CAPTIONED

    def _record(self, job: Job[Path]) -> Path:
        self._team_is_there()
        fresh = f"{RECORDING}.new"
        given = [RESULT, "--team", self.run.team.name, *self._map()]
        self._ran(job, "fly", *given, "--json", "--ros", f"mcap:{fresh}")
        return (self.run.folder / fresh).replace(self.run.folder / RECORDING)

    def _team_is_there(self) -> None:
        """Write the team's files, if they are not there: a state from elsewhere comes without."""
        run = self.run
        if run.team.is_dir():
            return
        try:
            model_of(run.sketch).save(run.team)
        except (ModelError, InvalidInputError, ValueError, TypeError) as mistake:
            raise CannotMakeError(str(mistake)) from None

    def _ran(self, job: Job[None] | Job[Path], *arguments: str) -> bytes:
        """Run a command of robochoc in the run's folder; return what it wrote."""
        finished = job.run(Command(arguments, self.run.folder))
        if finished.status not in {0, _NOT_AS_PLANNED}:
            raise CannotMakeError(finished.why[-_MAX_MESSAGE:])
        return finished.out

    def _advance(self, job: Job[None], stage: Stage) -> None:
        """Note the stage that a job has reached, unless nobody wants that job any more."""
        if self._job is job:
            if stage in {Stage.DONE, Stage.WAITING}:
                self._job = None
            self._become(stage)

    def _become(self, stage: Stage) -> None:
        self.stage = stage
        self._call(self._wanted)


def builder_of(run: Run) -> FlightBuilder:
    """Return what is made of a run, the same object for all pages that show it."""
    return run.part(FlightBuilder)
