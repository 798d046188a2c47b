"""The server's data: a journal's file, its trace so far, and the answers to requests about it."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from robochoc.model.problem import Robot
from robochoc.sniffer.cache import Cache
from robochoc.sniffer.growing_file import GrowingFile, open_to_read
from robochoc.sniffer.live_trace import LiveTrace
from robochoc.sniffer.page_data import DETAILS, BadRequestError, PageData
from robochoc.sniffer.trace import Trace

if TYPE_CHECKING:
    from robochoc.sniffer.robot_states import RobotStates
    from robochoc.sniffer.scene import TraceScene

_KEPT_BYTES = 1 << 26


class NotBegunError(BadRequestError):
    """There is no trace: the journal has no header yet, or was replaced by another journal."""


class SnifferSession:
    """A journal that may still be written. `source`: the path or a descriptor of its file.

    `chosen`: names or patterns of the robots that are shown at first; `robots`: robots whose files are known from
    another source. All methods except `states` must be called in the same thread.

    Raises:
        OSError: if the file cannot be read.
    """

    def __init__(
        self, source: Path | int, *, live: bool = False, chosen: Sequence[str] = (), robots: Mapping[str, Robot] = {}
    ) -> None:
        self._path = source if isinstance(source, Path) else None
        self._live = live
        self._written = False
        self._chosen = chosen
        self._robots = robots
        self._descriptor = source if isinstance(source, int) else open_to_read(source)
        self._file = GrowingFile(self._descriptor)
        self._live_trace = LiveTrace(self._file, self._age_s)
        self._robot_states: RobotStates | None = None
        self._details = Cache(_KEPT_BYTES)
        self._page_data: PageData | None = None
        self._scene: TraceScene | None = None
        self._scene_made_with = (-1, False, 0)

    @property
    def begun(self) -> bool:
        """True if there is something to show."""
        return self._live_trace.presentable

    def advance(self) -> bool:
        """Read a little; return False at the end. Raises `JournalError`, `TraceTooLargeError`, `OSError`."""
        return self._live_trace.advance() or self._replaced()

    def read_header(self) -> None:
        """Read until the header, if there is one. Raises the exceptions of `advance`."""
        while self._live_trace.trace is None and self._live_trace.advance():
            pass

    def _replaced(self) -> bool:
        """Return whether another file has replaced the journal, and if so, open that file."""
        if self._path is None:
            return False
        try:
            if os.path.samestat(self._path.stat(), os.fstat(self._descriptor)):
                return False
            descriptor = open_to_read(self._path)
            file = GrowingFile(descriptor)
        except OSError:  # the file was removed: what has been read is still shown
            return False
        self._robot_states = None
        os.close(self._descriptor)
        self._descriptor, self._file = descriptor, file
        self._live_trace.restart(file)
        return True

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)

    def finish(self) -> None:
        """Record that the file is complete."""
        self._written = True

    def stop(self) -> None:
        """Stop long computations soon."""
        if self._robot_states:
            self._robot_states.stopped = True

    def _age_s(self) -> float:
        """Return the seconds since the file was last written, or 0 if it is known to have a writer."""
        if self._written:
            return math.inf
        return 0.0 if self._live else time.time() - os.fstat(self._descriptor).st_mtime

    # The page's data

    @property
    def _answers(self) -> PageData:
        trace = self._trace
        if self._page_data is None or self._page_data.trace is not trace:
            self._page_data = PageData(trace, live=self._live, chosen=self._chosen)
        return self._page_data

    @property
    def _trace(self) -> Trace:
        trace = self._live_trace.trace
        if trace is None:
            raise NotBegunError("the journal has no header yet")
        return trace

    def about(self) -> bytes:
        """Return the description of the run and its progress, as JSON."""
        return self._answers.about()

    def news(self) -> dict[str, Any]:
        """Return the progress: the updates for the page, and the fraction of the file read so far, from 0 to 1."""
        return {**self._answers.news(), "loaded": round(self._live_trace.loaded, 3)}

    def rows(self, what: str, first: int, end: int) -> bytes:
        """Return messages (`columns`), `steps` or `decisions`. Raises `BadRequestError`."""
        match what:
            case "columns":
                return self._answers.columns(first, end)
            case "steps":
                return self._answers.steps(first, end)
            case _:
                return self._answers.decisions(first, end)

    def details(self, chunk: int) -> bytes:
        """Return the contents of the messages in a chunk as JSON. Raises `BadRequestError`."""
        trace = self._trace
        key = (trace.generation, chunk)
        answer = self._details.get(key)
        if answer is None:
            answer = self._answers.details(chunk)
            if len(trace.messages.t) >= (chunk + 1) * DETAILS:
                self._details.put(key, answer)
        return answer

    def search(self, text: str, first: int, end: int) -> bytes:
        """Return the first messages with `text`, as `PageData.search` does. Raises `BadRequestError`."""
        return self._answers.search(text, first, end)

    def robot(self, number: int) -> str:
        """Return the name of a robot. Raises `BadRequestError`."""
        robots = self._trace.robots
        if number >= len(robots):
            raise BadRequestError(f"robot {number} does not exist; there are {len(robots)}")
        return robots[number]

    def states(self, robot: str, chunk: int) -> bytes:
        """Return the robot's states after the steps in a chunk as JSON; this is slow. Raises `BadRequestError`."""
        from robochoc.sniffer.robot_states import RobotStates  # noqa: PLC0415 - slow, and the page is shown first

        self._robot_states = self._robot_states or RobotStates()
        return self._robot_states.chunk(self._file, robot, chunk, final=self._live_trace.settled)

    # The scene

    def scene(self, first: int = 0) -> bytes:
        """Return the drones and their moves for the decisions from `first` as JSON; `null` if there are no drones."""
        from robochoc.sniffer.scene import TraceScene, robots_given  # noqa: PLC0415 - as above

        trace = self._trace
        files = trace.runs[-1].files if trace.runs else {}
        made_with = (trace.generation, trace.over, len(files))
        if self._scene is None or (made_with != self._scene_made_with and not first) or not self._scene:
            self._scene = TraceScene(trace, {**robots_given(trace), **self._robots})
            self._scene_made_with = made_with
        nothing = not self._scene and trace.over
        return msgspec.json.encode(None if nothing else self._scene.answer(first))

    # The file

    @property
    def size(self) -> int:
        """The current length of the file."""
        return self._file.size

    @property
    def file_name(self) -> str:
        """The file name for a copy of the journal."""
        trace = self._live_trace.trace
        name = self._path.name if self._path else f"{trace.header.team if trace else 'run'}.journal"
        return "".join(sign if sign.isascii() and (sign.isalnum() or sign in "._-") else "_" for sign in name)[:100]

    def bytes_at(self, place: int, most: int) -> bytes:
        """Return up to `most` bytes of the file, starting at position `place`."""
        return os.pread(self._descriptor, most, place)
