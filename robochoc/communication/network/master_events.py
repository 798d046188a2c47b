"""The master's events: registrations, losses, grants, refusals, and events from robots."""

from __future__ import annotations

import time
from collections.abc import Sequence

import msgspec

from robochoc.communication.network.plausibility import Doubt
from robochoc.communication.network.quotas import EVENTS_A_SECOND, REPORTS_A_SECOND, Allowance
from robochoc.communication.network.refusals import Refusals
from robochoc.journal.events import AnyEvent, DroppedOut, Granted, Leads, Lost, Observer, Refused, Registered, actor


class MasterEvents:
    """Reports events to `observer`, if there is one. Refusals and grants may come from any thread."""

    def __init__(self, observer: Observer | None) -> None:
        self._observer = observer
        self._began = time.monotonic()
        self._allowances: dict[tuple[str, float], Allowance] = {}
        self.refuse = Refusals(self._refused).note
        """Reports a refusal, with who, what and why."""

    @property
    def observed(self) -> bool:
        """True if there is an observer."""
        return self._observer is not None

    def start_search(self) -> None:
        """Start a search. From now on, times are relative to this moment, like those in the robots' events."""
        self._began = time.monotonic()

    def registered(self, robot: str) -> None:
        """Report that `robot` has registered."""
        self._report(Registered(t=self._now, robot=robot))

    def dropped_out(self, robot: str, why: str) -> None:
        """Report that a registered `robot` has dropped out, and is awaited again."""
        self._report(DroppedOut(t=self._now, robot=robot, why=why))

    def lost(self, robot: str, why: str) -> None:
        """Report that `robot` is lost."""
        self._report(Lost(t=self._now, robot=robot, why=why))

    def leads(self, master: str, term: int, why: str) -> None:
        """Report that this master leads the team in a term."""
        self._report(Leads(t=self._now, master=master, term=term, why=why))

    def granted(self, who: str, what: str) -> None:
        """Report that the participant `who` was granted `what`."""
        self._report(Granted(t=self._now, who=who, what=what))

    def relay(self, event: Granted | Refused) -> None:
        """Report an event from the Authority, with a time in this run."""
        self._report(msgspec.structs.replace(event, t=self._now))

    def relay_from(self, name: str, events: Sequence[AnyEvent]) -> None:
        """Report events from a robot. Events about other robots are refused."""
        if not self._is_within_quota(name, len(events), EVENTS_A_SECOND):
            self.refuse(name, "report events", f"more than {EVENTS_A_SECOND:,} a second")
            return
        for event in events:
            if actor(event) == name:
                self._report(event)
            else:
                self.refuse(name, f"report {type(event).__name__}", "it is about another robot")

    def may_report_others(self, name: str) -> bool:
        """Return whether `name` may report another refusal or loss. If it has reported too many, report a refusal."""
        is_allowed = self._is_within_quota(name, 1, REPORTS_A_SECOND)
        if not is_allowed:
            self.refuse(name, "report others", f"more than {REPORTS_A_SECOND} times a second")
        return is_allowed

    def doubted(self, doubts: Sequence[Doubt]) -> str:
        """Report pairs of robots that contradict each other. Return a text on them that starts with a semicolon."""
        for doubt in doubts:
            for name in doubt.between:
                self.refuse(name, "its counts of messages", doubt.why)
        return "".join(f"; {doubt.why}" for doubt in doubts)

    def _is_within_quota(self, name: str, number: int, a_second: float) -> bool:
        now = time.monotonic()
        allowance = self._allowances.setdefault((name, a_second), Allowance(a_second, now))
        enough = allowance.has(number, now)
        allowance.use(number if enough else 0)
        return enough

    def _refused(self, who: str, what: str, why: str) -> None:
        self._report(Refused(t=self._now, who=who, what=what, why=why))

    @property
    def _now(self) -> float:
        return time.monotonic() - self._began

    def _report(self, event: AnyEvent) -> None:
        if self._observer:
            self._observer(event)
