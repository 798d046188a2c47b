"""What the server serves: one journal's file, the trace of what is in it by now, and the answers about it."""

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
from robochoc.sniffer.feed import DETAILS, BadRequestError, Feed
from robochoc.sniffer.following import Following
from robochoc.sniffer.trace import Trace
from robochoc.sniffer.window import Window, opened

if TYPE_CHECKING:
    from robochoc.sniffer.insight import Insight
    from robochoc.sniffer.moves import Stage

_KEPT_BYTES = 1 << 26


class NotBegunError(BadRequestError):
    """There is nothing yet, or, as another journal has taken its place, nothing any more."""


class Session:
    """One journal: `source` is its path, or a descriptor of the file, which others may still write.

    `chosen` are names or patterns of the robots to begin with, `robots` those whose files are known beside the
    journal. Raises `OSError` when it cannot be read. But for `states`, all is to be asked in one thread.
    """

    def __init__(
        self, source: Path | int, *, live: bool = False, chosen: Sequence[str] = (), robots: Mapping[str, Robot] = {}
    ) -> None:
        self._path = source if isinstance(source, Path) else None
        self._live = live
        self._written = False
        self._chosen = chosen
        self._robots = robots
        self._descriptor = source if isinstance(source, int) else opened(source)
        self._window = Window(self._descriptor)
        self._following = Following(self._window, self._age_s)
        self._insight: Insight | None = None
        self._details = Cache(_KEPT_BYTES)
        self._feed: Feed | None = None
        self._stage: Stage | None = None
        self._staged_with = (-1, False, 0)

    @property
    def begun(self) -> bool:
        """Whether there is something to be shown."""
        return self._following.presentable

    def advance(self) -> bool:
        """Read on a bit; False when there was nothing. Raises `JournalError`, `TraceTooLargeError`, `OSError`."""
        return self._following.advance() or self._replaced()

    def begin(self) -> None:
        """Read until the header is known, if it is there. Raises as `advance` does."""
        while self._following.trace is None and self._following.advance():
            pass

    def _replaced(self) -> bool:
        """Whether another file has taken the place of the journal; it is the journal then."""
        if self._path is None:
            return False
        try:
            if os.path.samestat(self._path.stat(), os.fstat(self._descriptor)):
                return False
            descriptor = opened(self._path)
            window = Window(descriptor)
        except OSError:  # it has been taken away: what was read is still there
            return False
        self._insight = None
        os.close(self._descriptor)
        self._descriptor, self._window = descriptor, window
        self._following.restart(window)
        return True

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)

    def finish(self) -> None:
        """Nothing more will be written to the file."""
        self._written = True

    def stop(self) -> None:
        """Whatever takes long is to end soon."""
        if self._insight:
            self._insight.stopped = True

    def _age_s(self) -> float:
        """Since when nobody has written to the file; 0 where somebody is known to."""
        if self._written:
            return math.inf
        return 0.0 if self._live else time.time() - os.fstat(self._descriptor).st_mtime

    # The feed

    @property
    def _answers(self) -> Feed:
        trace = self._trace
        if self._feed is None or self._feed.trace is not trace:
            self._feed = Feed(trace, live=self._live, chosen=self._chosen)
        return self._feed

    @property
    def _trace(self) -> Trace:
        trace = self._following.trace
        if trace is None:
            raise NotBegunError("the journal has not begun")
        return trace

    def about(self) -> bytes:
        """What was run, and how far it is; JSON."""
        return self._answers.about()

    def news(self) -> dict[str, Any]:
        """How far it is: the feed's news, and how much of the file has been read, 0 to 1."""
        return {**self._answers.news(), "loaded": round(self._following.loaded, 3)}

    def rows(self, what: str, first: int, end: int) -> bytes:
        """Messages (`columns`), `steps` or `decisions`. Raises `BadRequestError`."""
        match what:
            case "columns":
                return self._answers.columns(first, end)
            case "steps":
                return self._answers.steps(first, end)
            case _:
                return self._answers.decisions(first, end)

    def details(self, chunk: int) -> bytes:
        """What the messages of a chunk hold; JSON. Raises `BadRequestError`."""
        trace = self._trace
        key = (trace.generation, chunk)
        answer = self._details.get(key)
        if answer is None:
            answer = self._answers.details(chunk)
            if len(trace.messages.t) >= (chunk + 1) * DETAILS:
                self._details.put(key, answer)
        return answer

    def robot(self, number: int) -> str:
        """The name of a robot. Raises `BadRequestError`."""
        robots = self._trace.robots
        if number >= len(robots):
            raise BadRequestError(f"there is no robot {number}, only {len(robots)}")
        return robots[number]

    def states(self, robot: str, chunk: int) -> bytes:
        """What a robot knew after its steps of a chunk; JSON. Takes its time. Raises `BadRequestError`."""
        from robochoc.sniffer.insight import Insight  # noqa: PLC0415 - the page comes first

        self._insight = self._insight or Insight()
        return self._insight.chunk(self._window, robot, chunk, final=self._following.settled)

    # The scene

    def scene(self, first: int = 0) -> bytes:
        """The drones, and their moves by the decisions from the `first` on; JSON.

        `null`: there is nothing to see, nor will there be.
        """
        from robochoc.sniffer.moves import Stage, robots_given  # noqa: PLC0415 - as above

        trace = self._trace
        files = trace.runs[-1].files if trace.runs else {}
        staged_with = (trace.generation, trace.over, len(files))
        if self._stage is None or (staged_with != self._staged_with and not first) or not self._stage:
            self._stage = Stage(trace, {**robots_given(trace), **self._robots})
            self._staged_with = staged_with
        nothing = not self._stage and trace.over
        return msgspec.json.encode(None if nothing else self._stage.answer(first))

    # The file

    @property
    def size(self) -> int:
        """How long the file is by now."""
        return self._window.size

    @property
    def file_name(self) -> str:
        """What a copy of it may be called."""
        trace = self._following.trace
        name = self._path.name if self._path else f"{trace.header.team if trace else 'run'}.journal"
        return "".join(sign if sign.isascii() and (sign.isalnum() or sign in "._-") else "_" for sign in name)[:100]

    def bytes_at(self, place: int, most: int) -> bytes:
        """A piece of the file."""
        return os.pread(self._descriptor, most, place)
