"""A counterexample as a journal: the run in which the messages arrive in the order that leads to the fault."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from robochoc.communication.host import Host
from robochoc.communication.search_result import SearchResult
from robochoc.communication.search_watch import SearchWatch
from robochoc.communication.simulator.losses import Losses
from robochoc.communication.simulator.schedule import Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.exploration.changes import CRASH, Course
from robochoc.exploration.check import Case
from robochoc.exploration.local_steps import LONGEST_STEP_S
from robochoc.exploration.team_state import Delivery
from robochoc.journal.events import Lost, Observer
from robochoc.journal.recorder import recorded
from robochoc.protocols.message import Envelope
from robochoc.run.options import Options
from robochoc.run.recording import journal_header
from robochoc.run.scenario import NOT_SEARCHED
from robochoc.run.this_machine import StartEvents
from robochoc.system.termination import Terminated


class Scripted(Schedule):
    """Delivers the messages of one epoch in the order of `path`, and none after that."""

    def __init__(self) -> None:
        self._left: deque[Delivery] = deque()
        self._channels: dict[tuple[str, str], deque[Envelope]] = defaultdict(deque)

    def begin(self, path: Sequence[Delivery]) -> None:
        """Deliver the messages on `path` from now on."""
        self._left = deque(delivery for delivery in path if delivery.receiver and not delivery.lost)

    @property
    def is_over(self) -> bool:
        """True if no further message will be delivered."""
        return not self._left

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - time is counted in packets
        """See `Schedule.put`."""
        self._channels[envelope.receiver, envelope.sender].append(envelope)

    def get(self) -> Sequence[Envelope]:
        """See `Schedule.get`."""
        if not self._left:
            return ()
        self.now += 1
        delivery = self._left.popleft()
        return [self._channels[delivery.receiver, sender].popleft() for sender in delivery.senders]

    def clear(self) -> None:
        """See `Schedule.clear`."""
        self._channels.clear()


class ScriptedLosses(Losses):
    """Loses the messages that are lost on `path`."""

    def __init__(self, path: Sequence[Delivery]) -> None:
        super().__init__(0, 0)
        self._sent: dict[tuple[str, str], int] = defaultdict(int)
        self._lost: set[tuple[str, str, int]] = set()
        passed: dict[tuple[str, str], int] = defaultdict(int)
        for delivery in path:
            for sender in delivery.senders:
                if delivery.lost:
                    self._lost.add((sender, delivery.receiver, passed[sender, delivery.receiver]))
                passed[sender, delivery.receiver] += 1

    def loses(self, envelope: Envelope) -> bool:
        """See `Losses.loses`."""
        link = envelope.sender, envelope.receiver
        self._sent[link] += 1
        if (*link, self._sent[link] - 1) not in self._lost:
            return super().loses(envelope)
        self.lost += 1
        self._missing[link] = self._missing.get(link, 0) + 1
        return True


class ScriptedSimulation(Simulation):
    """Simulates the run on `path`: each search ends at the next change of the problem."""

    def __init__(self, case: Case, path: Sequence[Delivery], observer: Observer) -> None:
        compiled, phase = case
        losses = ScriptedLosses(path) if any(delivery.lost for delivery in path) else None
        self._script, self._report = Scripted(), observer
        self._left = iter(epochs_on(path))
        self._is_first = True
        super().__init__(
            compiled, phase.protocol, self._script, observer=observer, parameters=phase.parameters, losses=losses
        )

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:  # noqa: ARG002
        """Search until the next change on the path; not at all if the robots do not start before it."""
        steps, end = next(self._left)
        self._script.begin(steps)
        self.watch = None if end is None or end.lossless else UntilChange(self._script)
        starts = self._is_first or any(step.starts for step in steps)
        result = super().search(LONGEST_STEP_S) if starts else NOT_SEARCHED
        self._is_first = False
        lost = () if end is None or end.change is None else end.change.lost
        for robot in lost:
            self._report(Lost(t=self._script.time(0), robot=robot, why=CRASH))
        return replace(result, lost=dict.fromkeys(lost, CRASH))

    def _note_verdict(self, host: Host) -> None:  # noqa: ARG002 - as its base
        """Note verdicts after the last delivery only, because other robots continue until then."""
        for one in self._hosts.values() if self._script.is_over else ():
            super()._note_verdict(one)


class UntilChange(SearchWatch):
    """Ends a search before it is known to be quiescent, after the last delivery."""

    def __init__(self, script: Scripted) -> None:
        self._script = script

    @property
    def satisfied(self) -> bool:
        """See `SearchWatch`."""
        return self._script.is_over

    def wait_s(self, now: float) -> float:  # noqa: ARG002 - as its base
        """See `SearchWatch`."""
        return math.inf

    def wants_snapshot(self, now: float) -> bool:  # noqa: ARG002 - as its base
        """See `SearchWatch`."""
        return False

    def receive(self, snapshot: SearchResult) -> None:
        """See `SearchWatch`."""


def epochs_on(path: Sequence[Delivery]) -> Iterator[tuple[Sequence[Delivery], Delivery | None]]:
    """Yield the steps of each epoch on `path`, with the change that ends it; None at the end of the path."""
    start = 0
    for place, step in enumerate(path):
        if step.change is not None:
            yield path[start:place], step
            start = place + 1
    yield path[start:], None


def write_counterexample(file: Path, case: Case, path: Sequence[Delivery], options: Options) -> None:
    """Write the run in which the messages of `case` arrive as on `path` as a journal. Raises `OSError`."""
    compiled, phase = case
    changes = [step.change for step in path if step.change is not None]
    run = Course(compiled.team, phase).run(changes)
    with recorded(file, journal_header(compiled.team, options)) as recorder:
        events = StartEvents(recorder)
        simulation = ScriptedSimulation(case, path, recorder)
        with suppress(Exception):  # it may be the fault
            try:
                epochs = run.epochs(simulation, partial(events.report, phase.protocol, session=simulation))
                deque(itertools.islice(epochs, len(changes) + 1), 0)
            except SystemExit as end:  # as above
                if isinstance(end, Terminated):
                    raise
    for failure in recorder.failures:
        raise failure
