"""A counterexample as a journal: the run in which the messages arrive in the order that leads to the fault."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from robochoc.communication.session import Epoch
from robochoc.communication.simulator.losses import Losses
from robochoc.communication.simulator.schedule import Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.exploration.check import Case
from robochoc.exploration.local_steps import LONGEST_STEP_S
from robochoc.exploration.state_graph import Delivery
from robochoc.journal.recorder import recorded
from robochoc.protocols.message import Envelope
from robochoc.run.options import Options
from robochoc.run.recording import journal_header
from robochoc.run.scenario import EpochStart
from robochoc.run.this_machine import StartEvents


class Scripted(Schedule):
    """Delivers the messages in the order of `path`, and none after that."""

    def __init__(self, path: Sequence[Delivery]) -> None:
        self._left = deque(delivery for delivery in path if delivery.receiver and not delivery.lost)
        self._channels: dict[tuple[str, str], deque[Envelope]] = defaultdict(deque)

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - time is counted in packets
        """See `Schedule.put`."""
        self._channels[envelope.receiver, envelope.sender].append(envelope)

    def get(self) -> Sequence[Envelope]:
        """See `Schedule.get`."""
        if not self._left:
            return ()
        self.now += 1
        receiver, senders, _ = self._left.popleft()
        return [self._channels[receiver, sender].popleft() for sender in senders]

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


def write_counterexample(file: Path, case: Case, path: Sequence[Delivery], options: Options) -> None:
    """Write the run in which the messages of `case` arrive as on `path` as a journal. Raises `OSError`."""
    compiled, phase = case
    with recorded(file, journal_header(compiled.team, options)) as recorder:
        StartEvents(recorder).report(phase.protocol, EpochStart(Epoch(compiled, parameters=phase.parameters)))
        losses = ScriptedLosses(path) if any(delivery.lost for delivery in path) else None
        simulation = Simulation(
            compiled, phase.protocol, Scripted(path), observer=recorder, parameters=phase.parameters, losses=losses
        )
        with suppress(Exception):  # it may be the fault
            simulation.search(LONGEST_STEP_S)
    for failure in recorder.failures:
        raise failure
