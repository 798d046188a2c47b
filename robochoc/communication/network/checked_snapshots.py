"""Snapshots of a search whose files only the robots have: all robots check each one before it counts.

A round: the robots tell what they have. If they know of something better (the cheapest assignment of all that one of
them has heard of; a cycle that all have completed), each is asked what that means for it. Then all robots check what
they have told. The search goes on meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import CheckRequest, CheckResult, Recall, ToRobot
from robochoc.communication.network.members import Members
from robochoc.communication.run_result import RunResult
from robochoc.model.message import Value
from robochoc.protocols.findings import Incumbent


class _Part(NamedTuple):
    """The values that a robot is asked for: those of now, of a `cycle`, or those with a `value`."""

    cycle: int | None = None
    value: Value | None = None


class CheckedSnapshots:
    """The snapshots of the search that `state` is of, by the robots of `members`. `send` sends to a robot.

    Attributes:
        number: The number of the snapshot that was checked last.
        checks: What the robots have found of it, by their names.
    """

    def __init__(self, state: AuditedSearchState, members: Members, send: Callable[[str, ToRobot], None]) -> None:
        self.number = 0
        self.checks: Mapping[str, CheckResult] = {}
        self._state = state
        self._members = members
        self._send = send
        self._asked = 0
        self._first: RunResult | None = None
        """The values that robots have told, while they are asked for better ones."""
        self._unchecked: RunResult | None = None
        self._checked: RunResult | None = None
        self._tried: set[tuple[float, frozenset[tuple[str, Value]]]] = set()

    def ask(self, number: int) -> None:
        """Ask all robots what they have, as snapshot `number`."""
        self._ask(number, dict.fromkeys(self._state.order, _Part()))

    def advance(self) -> RunResult | None:
        """Do what is next in the round. Return its snapshot once all robots have checked it; None before."""
        told = self._state.completed_snapshot() if self._unchecked is None else None
        if told is not None:
            self._go_on(told)
        checks = self._state.snapshot_checks if self._unchecked is not None else None
        if checks is None:
            return None
        self._checked, self._unchecked = self._unchecked, None
        self.number, self.checks = self._asked, checks
        return self._checked

    def _go_on(self, told: RunResult) -> None:
        """Ask for something better than what robots have `told`, or have it checked."""
        if self._first is not None:
            first, self._first = self._first, None
            self._have_checked(replace(told, findings=first.findings))
            return
        bests = [found.best for found in told.findings.values() if found.best is not None]
        parts = self._parts_of_best(bests) or self._parts_of_cycle(told)
        number = self._state.start_snapshot() if parts else None
        if number is not None:
            self._first = told
            self._ask(number, parts)
        elif bests and self._checked is not None:  # nothing new; what robots try meanwhile is no answer
            self._have_checked(replace(told, assignments=self._checked.assignments))
        else:
            self._have_checked(told)

    def _parts_of_best(self, bests: list[Incumbent]) -> dict[str, _Part]:
        """Return what each robot has in the cheapest assignment that was not checked before; empty: there is none.

        One that does not hold keeps nobody from the next one.
        """
        order = self._state.order
        for best in sorted((one for one in bests if one.values.keys() == set(order)), key=lambda one: one.cost):
            tried = (best.cost, frozenset(best.values.items()))
            if tried not in self._tried:
                self._tried.add(tried)
                return {name: _Part(value=best.values[name]) for name in order}
        return {}

    def _parts_of_cycle(self, told: RunResult) -> dict[str, _Part]:
        """Ask for the last cycle that all robots have completed; empty: there is none."""
        order = self._state.order
        cycles = [found.trail.cycle for found in told.findings.values() if found.trail is not None]
        known = len(cycles) == len(order) and min(cycles, default=-1) >= 0
        return dict.fromkeys(order, _Part(cycle=min(cycles))) if known else {}

    def _have_checked(self, told: RunResult) -> None:
        """Have all robots check what they have `told`, unless that was checked before."""
        self._unchecked = told
        if self._checked is not None and told.assignments == self._checked.assignments:
            self._asked = self.number
            return
        self._state.begin_check(self._asked)
        for name in self._state.order:
            values = self._members.neighbourhood(name, told.assignments)
            self._send(name, CheckRequest(self._state.epoch, values, self._asked))

    def _ask(self, number: int, parts: Mapping[str, _Part]) -> None:
        self._asked = number
        for name, part in parts.items():
            self._send(name, Recall(self._state.epoch, number, part.cycle, part.value))
