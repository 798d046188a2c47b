"""The search state of a master across machines, which audits its robots, in the exploration of `explored_team.py`.

The master's loop and the robots' loop are the same in both runtimes. Here the master has the state that audits, and the
robots report what it compares, as `Searcher` does.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import DetailedReport, Exchanged
from robochoc.communication.network.plausibility import Declarations, Doubt
from robochoc.communication.processes.robot_process import QueueRobot
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.communication.session import is_past
from robochoc.model.problem import Team
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import ensure_compiled
from tests.support.explored_master import Run


class Audit(NamedTuple):
    """The result of a search, and what the master holds against the robots."""

    result: SearchResult
    stuck: str
    doubts: tuple[Doubt, ...]


class AuditedRobot(QueueRobot):
    """Counts its messages by robot, and reports these counts at the end."""

    def __init__(self, *args: Any, **options: Any) -> None:  # noqa: ANN401 - as its base
        self._sent_to: Counter[str] = Counter()
        self._received_from: Counter[str] = Counter()
        super().__init__(*args, **options)

    def receive(self, packet: Sequence[Envelope]) -> None:
        if self._searching:
            self._received_from.update(envelope.sender for envelope in packet)
        super().receive(packet)

    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        self._sent_to.update(envelope.receiver for envelope in envelopes)
        super()._transmit(envelopes)

    def _report_end(self) -> None:
        host = self._host
        assert host is not None
        others = self._sent_to.keys() | self._received_from.keys()
        exchanged = {name: Exchanged(self._sent_to[name], self._received_from[name]) for name in sorted(others)}
        values, findings = self._known_to_master(host)
        report = DetailedReport(self.epoch, values, host.metrics(), findings, bool(values), exchanged)
        self._send_to_master(cast("Any", report))


class AuditedRun(Run):
    """The session of a master that audits. A search that is stuck is a result, as in `Master`."""

    longest_turn_s = math.inf

    def _new_state(self, epoch: int, order: Sequence[str]) -> AuditedSearchState:
        team = self.compiled.team
        shown = {robot.name: {one.name: one.domain for one in robot.variables} for robot in team.robots}
        return AuditedSearchState(epoch, order, None, Declarations(self._protocol.traits, shown))

    def _finish(self, began: float, *, late: bool) -> SearchResult:
        state = cast("AuditedSearchState", self.state)
        state.note_end(time.monotonic() - began, in_time=not is_past(self._deadline))
        return super()._finish(began, late=late)


def audited_search(team: Team, protocol: type[Protocol]) -> Callable[[], Audit]:
    """Return the program of a master with one audited search."""
    compiled = ensure_compiled(team)

    def program() -> Audit:
        with AuditedRun(compiled, protocol) as session:
            try:
                result = session.search()
            except RobotsLostError:
                if not session.state.stuck:
                    raise
                result = session.state.result(0.0)
            state = cast("AuditedSearchState", session.state)
            return Audit(result, state.stuck, (*state.doubts_about_counts, *state.doubts_about_verdict))

    return program
