"""Which rules of a sketch are in each other's way: the search is a process of its own, and ends in time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import msgspec

from robochoc.app.jobs.job import EndedError, Job, LateError
from robochoc.app.jobs.process import Command
from robochoc.app.log import error_text
from robochoc.app.sketch.sketch import Sketch

PATIENCE_S = 30.0
"""The search is given so long."""
_GRACE_S = 5.0
"""Its process needs so long to begin, and to tell."""
_PROCESS = "robochoc.app.conflicts.process"


class Finder(StrEnum):
    """The tool that has found a conflict."""

    CPMPY = "cpmpy"
    OWN = "own"


class Conflict(msgspec.Struct, frozen=True):
    """The result of a search for rules that cannot hold together.

    Attributes:
        rules: The ids of rules that cannot hold together; any proper subset of them can. Empty: the decisions
            themselves have no values. None: all rules can hold together, or nothing was found in time.
        finder: The tool that has found it.
        late: Whether the time was over before.
        why: Why the search has failed; empty if it has not.
        words: What the constraints of files say that cannot hold together.
    """

    rules: tuple[str, ...] | None
    finder: Finder = Finder.OWN
    late: bool = False
    why: str = ""
    words: tuple[str, ...] = ()


class FilesAsked(NamedTuple):
    """A team of files: their folder, and how many events of its scenario have happened."""

    folder: Path
    events: int = 0


class ConflictSearch:
    """A search, which begins at once. `found` has what it finds; `end` ends it.

    Args:
        asked: The team.
        seconds: The search is given so long.
        folder: The team's folder: the search ends when that is removed.
    """

    def __init__(self, asked: Sketch | FilesAsked, seconds: float = PATIENCE_S, *, folder: Path | None = None) -> None:
        self._asked, self._seconds = asked, seconds
        self._job = Job("conflict search", self._search, folder=folder).start()

    @property
    def pid(self) -> int | None:
        """Its process, while there is one."""
        return self._job.pid

    def result(self) -> Conflict | None:
        """Wait for what it finds. None: it was ended."""
        return _told(self._job.future.result)

    async def found(self) -> Conflict | None:
        """Wait for what it finds. None: it was ended."""
        await asyncio.wait([asyncio.wrap_future(self._job.future)])
        return self.result()

    def end(self) -> None:
        """End it."""
        self._job.end()

    def _search(self, job: Job[Conflict]) -> Conflict:
        asked = self._asked
        if isinstance(asked, FilesAsked):
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


def _told(result: Callable[[], Conflict]) -> Conflict | None:
    try:
        return result()
    except EndedError:
        return None
    except Exception as fault:  # noqa: BLE001 - the file of errors has it already
        return Conflict(None, why=error_text(fault))
