"""Snapshots of a search whose constraints are known only to the robots: all robots check a snapshot before it counts.

A round has these steps. The robots report their values. If their findings contain a better assignment (the cheapest
one known to a robot, or a cycle that all robots have completed), each robot is asked for its values in that assignment.
Then all robots check the reported values. The search continues meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import CheckRequest, CheckResult, Recall, ToRobot
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.search_result import SearchResult
from robochoc.protocols.findings import Incumbent
from robochoc.protocols.message import Value


class _Part(NamedTuple):
    """The requested values of a robot: its current ones, those in a `cycle`, or those behind a `value`."""

    cycle: int | None = None
    value: Value | None = None


class CheckedSnapshots:
    """The snapshots in the search of `state`, by the robots in `members`. `send` sends a message to a robot.

    Attributes:
        number: The number of the latest checked snapshot.
        checks: The robots' checks of that snapshot, by name.
    """

    def __init__(
        self, state: AuditedSearchState, members: NetworkMembers, send: Callable[[str, ToRobot], None]
    ) -> None:
        self.number = 0
        self.checks: Mapping[str, CheckResult] = {}
        self._state = state
        self._members = members
        self._send = send
        self._asked = 0
        self._first: SearchResult | None = None
        """The robots' first values, while better values are requested."""
        self._unchecked: SearchResult | None = None
        self._checked: SearchResult | None = None
        self._tried: set[tuple[float, frozenset[tuple[str, Value]]]] = set()

    def ask(self, number: int) -> None:
        """Request the snapshot `number` from all robots."""
        self._ask(number, dict.fromkeys(self._state.order, _Part()))

    def advance(self) -> SearchResult | None:
        """Do the next step of the round. Return the snapshot when all robots have checked it; until then None."""
        snapshot = self._state.completed_snapshot() if self._unchecked is None else None
        if snapshot is not None:
            self._continue_round(snapshot)
        checks = self._state.snapshot_checks if self._unchecked is not None else None
        if checks is None:
            return None
        self._checked, self._unchecked = self._unchecked, None
        self.number, self.checks = self._asked, checks
        return self._checked

    def _continue_round(self, snapshot: SearchResult) -> None:
        """Request better values than `snapshot`, or have `snapshot` checked."""
        if self._first is not None:
            first, self._first = self._first, None
            self._have_checked(replace(snapshot, findings=first.findings))
            return
        bests = [found.best for found in snapshot.findings.values() if found.best is not None]
        parts = self._parts_of_best(bests) or self._parts_of_cycle(snapshot)
        number = self._state.start_snapshot() if parts else None
        if number is not None:
            self._first = snapshot
            self._ask(number, parts)
        elif bests and self._checked is not None:  # nothing new; the robots' current trial values are not an answer
            self._have_checked(replace(snapshot, assignments=self._checked.assignments))
        else:
            self._have_checked(snapshot)

    def _parts_of_best(self, bests: list[Incumbent]) -> dict[str, _Part]:
        """Return each robot's value in the cheapest assignment not tried before; empty if there is no such assignment.

        An assignment that violates a constraint is not tried again; the next one is tried instead.
        """
        order = self._state.order
        for best in sorted((one for one in bests if one.values.keys() == set(order)), key=lambda one: one.cost):
            tried = (best.cost, frozenset(best.values.items()))
            if tried not in self._tried:
                self._tried.add(tried)
                return {name: _Part(value=best.values[name]) for name in order}
        return {}

    def _parts_of_cycle(self, snapshot: SearchResult) -> dict[str, _Part]:
        """Return the requests for the last cycle that all robots have completed; empty if there is no such cycle."""
        order = self._state.order
        cycles = [found.trail.cycle for found in snapshot.findings.values() if found.trail is not None]
        known = len(cycles) == len(order) and min(cycles, default=-1) >= 0
        return dict.fromkeys(order, _Part(cycle=min(cycles))) if known else {}

    def _have_checked(self, snapshot: SearchResult) -> None:
        """Let all robots check the values in `snapshot`, unless they have been checked before."""
        self._unchecked = snapshot
        if self._checked is not None and snapshot.assignments == self._checked.assignments:
            self._asked = self.number
            return
        self._state.start_check(self._asked)
        for name in self._state.order:
            values = self._members.neighbourhood(name, snapshot.assignments)
            self._send(name, CheckRequest(self._state.epoch, values, self._asked))

    def _ask(self, number: int, parts: Mapping[str, _Part]) -> None:
        self._asked = number
        for name, part in parts.items():
            self._send(name, Recall(self._state.epoch, number, part.cycle, part.value))
