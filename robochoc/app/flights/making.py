"""Makes what is to be looked at of a run, by robochoc's own commands, each in a process of its own.

map.json             the map of the ground, on which the flight begins
flight.html          the scene of the flight, which is simulated
flight.json          how it went
conversation.html    all messages, as the sniffer shows them
flight.mcap          a recording, if somebody asks for it

They stay in the run's folder. Whoever wants them says so, and the work ends when nobody wants them any more.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from weakref import WeakValueDictionary

import msgspec

from robochoc.app.flights.ground import MAP, ground_of
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.run import Run
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Kind
from robochoc.formats import InvalidInputError
from robochoc.modelling.places import ModelError
from robochoc.system.files import write_atomically

FLIGHT = "flight.html"
FLOWN = "flight.json"
CONVERSATION = "conversation.html"
RECORDING = "flight.mcap"
MOST_MESSAGES = 100_000
"""Messages of a conversation that are shown: a page with more would open slowly."""
_NOT_AS_PLANNED = 4
"""The exit status of `robochoc fly` for a flight in which somebody has not arrived: it can be looked at."""
_MAX_MESSAGE = 600


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


class Making:
    """Makes the files of one run that are looked at or handed on. `making_of` returns the one object of each."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.stage = Stage.WAITING
        self.troubles: dict[Stage, str] = {}
        """What could not be made, and why."""
        self._began = time.monotonic()
        self._wanted: list[Callable[[], None]] = []
        self._task: asyncio.Task[None] | None = None
        self._recording = asyncio.Lock()

    @property
    def has_answer(self) -> bool:
        """Whether the team has decided something that can be flown."""
        return self.run.result is not None and bool(self.run.result.assignment)

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
        self._wanted.append(told)
        if self._task is None and self.stage is not Stage.DONE:
            self.troubles.clear()
            self._began = time.monotonic()
            self._task = asyncio.get_running_loop().create_task(self._make())

        def release() -> None:
            if told in self._wanted:
                self._wanted.remove(told)
            if not self._wanted:
                self.cancel()

        return release

    def cancel(self) -> None:
        """End the work. What is there already stays."""
        if self._task is not None:
            self._task.cancel()
            self._task = None
            self._become(Stage.WAITING)

    async def recording(self) -> Path:
        """Return a recording of the flight, which is made now if it is not there. Raises `CannotMakeError`."""
        async with self._recording:
            file = self.run.artefact(RECORDING)
            if file is None:
                await self._team_is_there()
                fresh = f"{RECORDING}.new"
                given = [RESULT, "--team", self.run.team.name, *await asyncio.to_thread(self._map)]
                await self._ran("fly", *given, "--json", "--ros", f"mcap:{fresh}")
                file = (self.run.folder / fresh).replace(self.run.folder / RECORDING)
            return file

    async def _make(self) -> None:
        try:
            if self.flight is None and self.has_answer and flies(self.run):
                await self._part(Stage.FLIGHT, self._make_flight)
            if self.conversation is None and self.run.artefact(JOURNAL):
                await self._part(Stage.CONVERSATION, self._make_conversation)
        except (OSError, ValueError) as damaged:
            self.troubles[self.stage] = str(damaged)
        self._task = None
        self._become(Stage.DONE)

    async def _part(self, stage: Stage, make: Callable[[], object]) -> None:
        self._become(stage)
        work = make()
        assert asyncio.iscoroutine(work)  # noqa: S101 - both are
        try:
            await work
        except CannotMakeError as why:
            self.troubles[stage] = str(why)

    async def _make_flight(self) -> None:
        await self._team_is_there()
        given = [RESULT, "--team", self.run.team.name, *await asyncio.to_thread(self._map)]
        try:
            told = await self._ran("fly", *given, "--json", "--html", FLIGHT)
        except CannotMakeError:  # too near to each other to be flown, say: where they end can be seen all the same
            await self._ran("animate", *given, "--html", FLIGHT)
        else:
            await asyncio.to_thread(write_atomically, self.run.folder / FLOWN, told)

    async def _make_conversation(self) -> None:
        cut = ["--to", str(MOST_MESSAGES - 1)] if self.is_cut else []
        await self._ran("journal", "export", JOURNAL, "--format", "html", "-o", CONVERSATION, *cut)

    def _map(self) -> list[str]:
        """Write the map of the ground; return the options that name it. Without a map there are none."""
        ground = ground_of(self.run)
        if ground is None:
            return []
        write_atomically(self.run.folder / MAP, msgspec.json.encode(ground))
        return ["--map", MAP]

    async def _team_is_there(self) -> None:
        """Write the team's files, if they are not there: a state from elsewhere comes without."""
        run = self.run
        if run.team.is_dir():
            return
        try:
            await asyncio.to_thread(lambda: model_of(run.sketch).save(run.team))
        except (ModelError, InvalidInputError, OSError, ValueError, TypeError) as mistake:
            raise CannotMakeError(str(mistake)) from None

    async def _ran(self, *arguments: str) -> bytes:
        """Run a command of robochoc in the run's folder; return what it wrote. It ends with this process."""
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-P", "-m", "robochoc.app.runs.child", str(os.getpid()), *arguments,
            cwd=self.run.folder,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            process_group=0,
        )  # fmt: skip
        try:
            out, errors = await process.communicate()
        finally:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
        if process.returncode not in {0, _NOT_AS_PLANNED}:
            said = errors.decode(errors="replace").strip()[-_MAX_MESSAGE:]
            raise CannotMakeError(said or f"exit status {process.returncode}")
        return out

    def _become(self, stage: Stage) -> None:
        self.stage = stage
        for told in [*self._wanted]:
            told()


_MAKING: WeakValueDictionary[Path, Making] = WeakValueDictionary()


def making_of(run: Run) -> Making:
    """Return what is made of a run, the same object for all pages that show it."""
    making = _MAKING.get(run.folder)
    if making is None or making.run is not run:
        making = _MAKING[run.folder] = Making(run)
    return making
