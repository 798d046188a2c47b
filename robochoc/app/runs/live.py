"""What can be seen of a run while it goes on, from its journal: who speaks, what is decided, what it costs."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from robochoc.app.runs.tape import Said, in_words
from robochoc.app.sketch.sketch import Value
from robochoc.journal.entries import JournalError
from robochoc.journal.events import Began, Bounded, Decided, Heard, Sent
from robochoc.journal.reader import Follower
from robochoc.model.cost_units import Cost
from robochoc.run.known_costs import KnownCosts
from robochoc.sniffer.spoken import Called, Spoken
from robochoc.verification.objective import Objective

RECENT_S = 1.0
"""Messages are shown for so long."""
SETTLED_S = 1.0
"""A value that stays for so long looks settled."""
AT_ONCE = 5_000
"""So many entries are read in one go."""
READ_S = 0.1
"""Entries are read for so long at a time, then others get their turn."""
LAST = 8
"""So many of the last messages are kept in words."""
MOST_COSTS = 300
"""Points of the falling cost that are kept."""


@dataclass
class Live:
    """The facts.

    Attributes:
        messages: How many were sent so far.
        values: Each robot's present values, by `ROBOT.DECISION`.
        since: When each robot has changed them last, on the monotonic clock.
        costs: The costs of the answers of the present run so far: seconds since the start, and the cost. They fall.
        bound: Nothing costs less. None: not known.
        recent: The messages of the last second: how many went from whom to whom.
        is_cut: Whether the last messages were not read, since the run had ended and there were too many.
        said: The last messages in words, the last one first.
    """

    messages: int = 0
    values: dict[str, dict[str, Value]] = field(default_factory=dict)
    since: dict[str, float] = field(default_factory=dict)
    bound: Cost | None = None
    costs: list[tuple[float, Cost]] = field(default_factory=list)
    recent: Counter[tuple[str, str]] = field(default_factory=Counter)
    is_cut: bool = False
    said: tuple[Said, ...] = ()

    def settled(self, robot: str) -> bool:
        """Return whether a robot has kept its values for a while."""
        return robot in self.since and time.monotonic() - self.since[robot] >= SETTLED_S


class LiveReader:
    """Follows the journal at `file`, which need not be there yet, and keeps `live` up to date. Memory is bounded.

    `label` says what the code of a variable's value stands for; `objective`, what assignments cost (None: nothing is
    minimised, or the problem changes); `called`, what values are called in messages.
    """

    def __init__(
        self,
        file: Path,
        live: Live,
        label: Callable[[str, int], Value],
        objective: Objective | None = None,
        called: Called | None = None,
    ) -> None:
        self._file = file
        self._live = live
        self._label = label
        self._known = KnownCosts(objective) if objective else None
        self._robots = frozenset(objective.interfaces) if objective else None
        self._minimised = objective is not None and objective.told(0) < objective.told(1)
        self._spoken = Spoken(called)
        self._open: BinaryIO | None = None
        self._follower: Follower | None = None
        self._began = time.monotonic()
        self._bunches: deque[tuple[float, Counter[tuple[str, str]]]] = deque()

    def advance(self) -> bool:
        """Read what is new, for a short while; return whether there was something."""
        if self._follower is None and self._file.is_file():
            self._open = self._file.open("rb")
            self._follower = Follower(self._open)
        if self._follower is None:
            return False
        began, anything = time.monotonic(), False
        while time.monotonic() - began < READ_S and self._read(self._follower):
            anything = True
        self._forget_old(time.monotonic())
        return anything

    def _read(self, follower: Follower) -> bool:
        """Read a few entries; return whether there were some."""
        try:
            entries = follower.read(AT_ONCE)
        except JournalError:  # not even its beginning is there: the run has its own words on that
            return False
        now = time.monotonic()
        bunch: Counter[tuple[str, str]] = Counter()
        last: deque[Sent] = deque(maxlen=LAST)
        for entry in entries:
            match entry:
                case Sent():
                    bunch[entry.sender, entry.receiver] += 1
                    last.append(entry)
                case Decided():
                    self._decided(entry, now)
                case Heard() | Bounded():
                    self._weigh(entry, now)
                case Began():
                    self._live.values.clear()
                    self._live.costs.clear()
                    self._weigh(entry, now)
                    self._spoken.follow(entry)
                case _:
                    self._spoken.follow(entry)
        if bunch:
            self._live.messages += bunch.total()
            self._bunches.append((now, bunch))
            said = [in_words(sent, self._spoken) for sent in reversed(last)]
            self._live.said = (*said, *self._live.said)[:LAST]
        return bool(entries)

    def close(self) -> None:
        """Close the file."""
        self._follower = None
        if self._open:
            self._open.close()
            self._open = None

    def _decided(self, event: Decided, now: float) -> None:
        if self._robots is not None and event.robot not in self._robots:
            return
        values = {name: self._label(name, value) for name, value in event.assignment.items()}
        if self._live.values.get(event.robot) != values:
            self._live.values[event.robot] = values
            self._live.since[event.robot] = now
            self._weigh(event, now)

    def _weigh(self, event: Decided | Heard | Bounded | Began, now: float) -> None:
        """Take note of what is known of the cost."""
        if self._known is None:
            return
        before = self._known.best
        self._known.take(event)
        if self._minimised:
            self._live.bound = self._known.bound
        if self._known.best is None or self._known.best == before:
            return
        costs = self._live.costs
        costs.append((now - self._began, self._known.best))
        if len(costs) > MOST_COSTS:  # every other point is enough, but the last one
            del costs[1:-1:2]

    def _forget_old(self, now: float) -> None:
        """Keep the messages of the last second, and count them."""
        while self._bunches and now - self._bunches[0][0] > RECENT_S:
            self._bunches.popleft()
        recent: Counter[tuple[str, str]] = Counter()
        for _, said in self._bunches:
            recent.update(said)
        self._live.recent = recent
