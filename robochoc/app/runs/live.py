"""The live state of a run, read from its journal: messages, decisions and costs."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import field
from operator import attrgetter
from pathlib import Path
from typing import BinaryIO

from robochoc.app.runs.tape import MessageWords, in_words
from robochoc.app.sketch.sketch import Value
from robochoc.journal.entries import JournalError
from robochoc.journal.events import Began, Bounded, Decided, Heard, Received, Sent, Settled
from robochoc.journal.reader import Follower
from robochoc.model.cost_units import Cost
from robochoc.model.problem import Team
from robochoc.run.known_costs import KnownCosts
from robochoc.sniffer.sentences import JournalSentences, ValueLabel
from robochoc.system.lazy_dataclass import dataclass
from robochoc.verification.objective import Objective

RECENT_S = 1.0
"""The time for which a message is shown, in seconds."""
SETTLED_S = 1.0
"""The time after which an unchanged value counts as settled, in seconds."""
AT_ONCE = 5_000
"""The number of entries read at once."""
READ_S = 0.1
"""The time for reading entries before other work is done, in seconds."""
LAST = 8
"""The number of last messages available in words."""
MOST_COSTS = 300
"""The maximum number of points on the cost curve."""
_SEPARATE = frozenset({Sent, Received, Settled})
"""The most frequent entries, which are counted together or ignored."""
_LINK: Callable[[Sent], tuple[str, str]] = attrgetter("sender", "receiver")


@dataclass
class Live:
    """The live state of a run.

    Attributes:
        messages: The number of sent messages.
        values: The current values of each robot, by `ROBOT.DECISION`.
        since: The time at which each robot last changed its values, on the monotonic clock.
        costs: The decreasing costs of the answers so far: pairs of seconds since the start and cost.
        bound: The lower bound on the cost. None: unknown.
        recent: The number of messages in the last second, by sender and receiver.
        is_cut: True if the last messages were skipped because too many remained after the end of the run.
        last_messages: The last messages in words, the last one first.
    """

    messages: int = 0
    values: dict[str, dict[str, Value]] = field(default_factory=dict)
    since: dict[str, float] = field(default_factory=dict)
    bound: Cost | None = None
    costs: list[tuple[float, Cost]] = field(default_factory=list)
    recent: Counter[tuple[str, str]] = field(default_factory=Counter)
    is_cut: bool = False
    last_messages: tuple[MessageWords, ...] = ()

    def settled(self, robot: str) -> bool:
        """Return whether a robot has not changed its values for a while."""
        return robot in self.since and time.monotonic() - self.since[robot] >= SETTLED_S


class LiveReader:
    """Follows the journal in `file`, which need not exist yet, and updates `live`. Memory use is bounded.

    Args:
        file: The journal.
        live: The state to update.
        label: Converts a variable's code to the user's value.
        objective: The cost function of assignments. None: nothing is minimised, or the problem changes.
        called: Returns the names for values in messages.
        team: The team of the journal, if it is known.
    """

    def __init__(
        self,
        file: Path,
        live: Live,
        label: Callable[[str, int], Value],
        objective: Objective | None = None,
        called: ValueLabel | None = None,
        team: Team | None = None,
    ) -> None:
        self._file = file
        self._live = live
        self._label = label
        self._known = KnownCosts(objective) if objective else None
        self._robots = frozenset(objective.interfaces) if objective else None
        self._minimised = objective is not None and objective.in_user_units(0) < objective.in_user_units(1)
        self._spoken = JournalSentences(called, team)
        self._open: BinaryIO | None = None
        self._follower: Follower | None = None
        self._began = time.monotonic()
        self._bunches: deque[tuple[float, Counter[tuple[str, str]]]] = deque()

    def advance(self) -> bool:
        """Read new entries for a short time, and return whether there were any."""
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
        """Read a few entries, and return whether there were any."""
        try:
            entries = follower.read(AT_ONCE)
        except JournalError:  # the header is incomplete: the run reports the error
            return False
        now = time.monotonic()
        sent = [entry for entry in entries if type(entry) is Sent]
        for entry in entries:
            if type(entry) in _SEPARATE:
                continue
            match entry:
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
        if sent:
            self._live.messages += len(sent)
            self._bunches.append((now, Counter(map(_LINK, sent))))
            last_messages = [in_words(one, self._spoken) for one in reversed(sent[-LAST:])]
            self._live.last_messages = (*last_messages, *self._live.last_messages)[:LAST]
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
        """Update the costs and the bound."""
        if self._known is None:
            return
        before = self._known.best
        self._known.add(event)
        if self._minimised:
            self._live.bound = self._known.bound
        if self._known.best is None or self._known.best == before:
            return
        costs = self._live.costs
        costs.append((now - self._began, self._known.best))
        if len(costs) > MOST_COSTS:  # drop every other point but the last
            del costs[1:-1:2]

    def _forget_old(self, now: float) -> None:
        """Drop messages older than a second, and count the remaining ones."""
        while self._bunches and now - self._bunches[0][0] > RECENT_S:
            self._bunches.popleft()
        recent: Counter[tuple[str, str]] = Counter()
        for _, last_messages in self._bunches:
            recent.update(last_messages)
        self._live.recent = recent
