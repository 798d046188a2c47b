"""The search state of a master that does not trust its robots: their messages are compared. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice

from robochoc.communication.control import EpochMessage, EpochReport, RobotSnapshot
from robochoc.communication.network.control_messages import CheckResult, DetailedReport
from robochoc.communication.network.plausibility import (
    NOTHING_DECLARED,
    Declarations,
    Doubt,
    FinishedSearch,
    doubts_about_checks,
    doubts_about_messages,
    doubts_about_values,
    fault_of_check,
    fault_of_counters,
    fault_of_report,
    fault_of_snapshot,
    objections,
    thoroughness,
    total_of,
    violations_of,
    widest_gap,
)
from robochoc.communication.quiescence import MessageCounts
from robochoc.communication.search_state import SearchState
from robochoc.model.outcome import CheckCounts, Violations
from robochoc.system.plain_text import listed

_MOST_NAMED = 3
"""The maximum number of doubts described in a text."""


class AuditedSearchState(SearchState):
    """The state of a search whose robots are not trusted: their messages are checked for plausibility.

    drops: True if robots must drop messages.
    duration_s: The duration of the search in seconds, after `note_end` was called.
    """

    def __init__(
        self,
        epoch: int = 0,
        order: Sequence[str] = (),
        max_messages: int | None = None,
        declared: Declarations = NOTHING_DECLARED,
    ) -> None:
        super().__init__(epoch, order, max_messages, declared.traits)
        self.drops = False
        self.duration_s = 0.0
        self._declared = declared
        self._late: tuple[str, ...] = ()
        self._received_before: int | None = None
        self._accounts: dict[str, DetailedReport] = {}
        self._checks: dict[str, CheckResult] = {}
        self._snapshot_checks: dict[str, CheckResult] = {}
        self._snapshot_checked = 0
        self._contradictions: list[Doubt] = []

    def handle(self, name: str, message: EpochMessage) -> str:
        """See `SearchState.handle`. Robots also report the costs of their constraints."""
        if isinstance(message, CheckResult) and message.epoch == self.epoch and name in self._present:
            return self._take_check(name, message)
        return super().handle(name, message)

    def _count(self, name: str, wave: int, counts: MessageCounts) -> str:
        """Record counters. A wave cannot report more messages received than the next wave reports sent."""
        if fault := fault_of_counters(counts, self.counters.latest(name)):
            return fault
        was_waving = self.counters.is_wave_open
        super()._count(name, wave, counts)
        total = self.counters.total
        if was_waving and not self.counters.is_wave_open and total is not None:
            if self._received_before is not None and self._received_before > total.sent:
                self.stuck = (
                    f"robots have reported {self._received_before:,} messages received, but only {total.sent:,} sent"
                )
            self._received_before = total.received
        return ""

    def _conclude(self, name: str, verdict: str) -> str:
        """Record a verdict that the robot `name` concluded alone. Only the first verdict counts."""
        if not self.ordered:
            return "it has concluded a verdict before the start of the search"
        if fault := super()._conclude(name, verdict):
            return fault
        if self.verdict == verdict or self.witness is None:  # after quiescence the answer is checked anyway
            return ""
        if self.witness == name:
            return f"it has concluded {verdict}, and {self.verdict} before"
        why = f"{self.witness} has concluded {self.verdict}, and {name} {verdict}"
        self._contradictions.append(Doubt((self.witness, name), why))
        return ""

    def _take_report(self, name: str, report: EpochReport) -> str:
        if not isinstance(report, DetailedReport):
            return "its message is not for the master"
        counts = self.counters.latest(name) or MessageCounts(0, 0)
        course = FinishedSearch(self.order, counts, self.duration_s, self.by_quiescence, self.drops)
        fault = fault_of_report(name, report, self._declared, course)
        if not fault:
            self._accounts[name] = report
            super()._take_report(name, report)
        return fault

    def _take_snapshot(self, name: str, snapshot: RobotSnapshot) -> str:
        return fault_of_snapshot(name, snapshot, self._declared, self.order) or super()._take_snapshot(name, snapshot)

    def _take_check(self, name: str, check: CheckResult) -> str:
        fault = fault_of_check(name, check, self._declared, self.order)
        checks = self._snapshot_checks if check.snapshot else self._checks
        if check.snapshot and (check.snapshot != self._snapshot_checked or name in checks):
            fault = fault or "it sent a check that was not requested"
        if not fault:
            checks[name] = check
        return fault

    def start_check(self, number: int) -> None:
        """Start waiting for the robots' checks of the snapshot `number`."""
        self._snapshot_checked, self._snapshot_checks = number, {}

    @property
    def snapshot_checks(self) -> Mapping[str, CheckResult] | None:
        """All robots' checks of the current snapshot; None until all robots have answered."""
        return None if self._present - self._snapshot_checks.keys() else self._snapshot_checks

    def lose(self, name: str, why: str) -> None:
        """See `SearchState.lose`."""
        super().lose(name, why)
        self._accounts.pop(name, None)
        self._checks.pop(name, None)
        self._snapshot_checks.pop(name, None)

    def note_end(self, duration_s: float, *, in_time: bool) -> None:
        """Record the end of the search after `duration_s` seconds. `in_time`: the time limit was not reached."""
        self.duration_s = duration_s
        if not in_time:
            self._late = self.silent

    @property
    def by_quiescence(self) -> bool:
        """True if the search ended by quiescence, not by the conclusion of a single robot."""
        return self.counters.quiescent and self.witness is None

    @property
    def unchecked(self) -> bool:
        """True if a robot has not yet checked its constraints against the decision."""
        return bool(self._present - self._checks.keys())

    @property
    def held(self) -> bool:
        """True if all robots have checked their constraints, and no constraint is violated."""
        return not self.unchecked and all(check.allowed for check in self._checks.values())

    @property
    def objections(self) -> tuple[str, ...]:
        """Descriptions of violated constraints, reported by the robots that hold them."""
        return tuple(islice(objections(self._checks), _MOST_NAMED))

    @property
    def violations(self) -> Violations | None:
        """The violated constraints that all robots have reported; None if they hold, or some robot has not checked."""
        return None if self.unchecked else violations_of(self._checks)

    @property
    def thoroughness(self) -> CheckCounts:
        """The number of constraints checked by several robots, and the number checked by only one robot."""
        return thoroughness(self._checks)

    # Contradictions between robots

    @property
    def doubts_about_counts(self) -> tuple[Doubt, ...]:
        """Pairs of robots whose message counts do not agree, after all robots have reported."""
        stirred = any(total_of(one) != self.counters.latest(name) for name, one in self._accounts.items())
        still = (self.by_quiescence and not stirred) or bool(self.stuck)
        return tuple(islice(doubts_about_messages(self._accounts, quiet=still), _MOST_NAMED))

    @property
    def doubts_about_verdict(self) -> tuple[Doubt, ...]:
        """Pairs of robots that contradict each other about the verdict, the values, or a constraint that both know.

        After quiescence the counters decide the verdict, but matter only for the proof that a cost is optimal.
        """
        proven = self._declared.traits.costs and self.by_quiescence
        values = {name: account.assignment for name, account in self._accounts.items()}
        found = [*self._contradictions, *(self.doubts_about_counts if proven else ())]
        found += [*doubts_about_values(values), *doubts_about_checks(self._checks)]
        return tuple(found[:_MOST_NAMED])

    @property
    def unfinished(self) -> str:
        """A text on the robots that had not finished at the time limit; empty if no such robot is known."""
        names = listed(self._late)
        waited = f"{names} {'has' if len(self._late) == 1 else 'have'} not answered the master"
        doubts = [doubt.why for doubt in self.doubts_about_counts]
        return "; ".join(filter(None, [waited if names else "", *(doubts or [widest_gap(self._accounts)])]))

    @property
    def cost(self) -> float:
        """The total cost of all checked constraints."""
        return sum(check.cost for check in self._checks.values())

    @property
    def assigned(self) -> Mapping[str, bool]:
        """For each robot that has reported, whether it has values."""
        return {name: account.assigned for name, account in self._accounts.items()}
