"""Searches for a conflict between the rules of a team, in a separate process with a time limit."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import msgspec

from robochoc.app.jobs.job import EndedError, Job, LateError
from robochoc.app.jobs.process import Command
from robochoc.app.log import error_text
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say

PATIENCE_S = 30.0
"""The time limit for a search, in seconds."""
_GRACE_S = 5.0
"""The additional time for starting the process and for its output, in seconds."""
_PROCESS = "robochoc.app.conflicts.process"


class Finder(StrEnum):
    """The tool that found a conflict."""

    CPMPY = "cpmpy"
    OWN = "own"


class Conflict(msgspec.Struct, frozen=True):
    """The result of a search for rules that cannot be satisfied together.

    Attributes:
        rules: The ids of a minimal set of rules that cannot be satisfied together. Empty: a decision has no values.
            None: all rules can be satisfied together, or no conflict was found in time.
        finder: The tool that found the conflict.
        late: True if the time limit was reached.
        why: The error if the search failed, otherwise empty.
        words: The conflicting constraints of an imported team, in words.
    """

    rules: tuple[str, ...] | None
    finder: Finder = Finder.OWN
    late: bool = False
    why: str = ""
    words: tuple[str, ...] = ()


def found_by(conflict: Conflict) -> str:
    """Return a sentence about the tool that was used, with advice if CPMpy is not installed."""
    if conflict.finder == Finder.CPMPY:
        return say("decide.by-cpmpy")
    advice = "" if find_spec("cpmpy") else say("decide.without-cpmpy")
    return advice if conflict.late else " ".join(filter(None, (say("decide.by-own"), advice)))


class TeamOfFiles(NamedTuple):
    """An imported team: the folder with its files, and the number of past events in its scenario."""

    folder: Path
    events: int = 0


class ConflictSearch:
    """A search, which starts immediately. `found` waits for the result; `end` ends the search.

    Args:
        asked: The team.
        seconds: The time limit.
        folder: The team's folder. The search ends when the folder is removed.
    """

    def __init__(self, asked: Sketch | TeamOfFiles, seconds: float = PATIENCE_S, *, folder: Path | None = None) -> None:
        self._asked, self._seconds = asked, seconds
        self._job = Job("conflict search", self._search, folder=folder).start()

    @property
    def pid(self) -> int | None:
        """The id of the search's process, while it runs."""
        return self._job.pid

    def result(self) -> Conflict | None:
        """Wait for the result, or return None if the search was ended."""
        return _conflict(self._job.future.result)

    async def found(self) -> Conflict | None:
        """Wait for the result, or return None if the search was ended."""
        await asyncio.wait([asyncio.wrap_future(self._job.future)])
        return self.result()

    def end(self) -> None:
        """End the search."""
        self._job.end()

    def _search(self, job: Job[Conflict]) -> Conflict:
        asked = self._asked
        if isinstance(asked, TeamOfFiles):
            arguments = (str(self._seconds), str(asked.folder), str(asked.events))
            command = Command(arguments, module=_PROCESS)
        else:
            command = Command((str(self._seconds),), module=_PROCESS, given=msgspec.json.encode(asked))
        try:
            finished = job.run(command, within_s=self._seconds + _GRACE_S)
        except LateError:
            return Conflict(None, late=True)
        if finished.status or not finished.out:
            return Conflict(None, why=(finished.why.splitlines() or [""])[-1])
        return msgspec.json.decode(finished.out, type=Conflict)


def _conflict(result: Callable[[], Conflict]) -> Conflict | None:
    try:
        return result()
    except EndedError:
        return None
    except Exception as fault:  # noqa: BLE001 - already in the error log
        return Conflict(None, why=error_text(fault))
