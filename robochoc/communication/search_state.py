"""The state of a search as seen by its master, independent of the transport. Pure.

The state contains the ready robots, the counters, the lost robots, the verdict of the search, and the robots' reports.
The process and network runtimes use the same state; the network runtime also audits the robots' messages
(`network/audited_state.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from robochoc.communication.control import Conclusion, Counters, EpochMessage, EpochReport, Ready, RobotSnapshot, WentOn
from robochoc.communication.quiescence import FourCounters, MessageCounts
from robochoc.communication.search_result import SearchResult
from robochoc.communication.search_watch import SnapshotRound
from robochoc.model.outcome import Verdict
from robochoc.protocols.traits import Traits
from robochoc.system.plain_text import listed

NO_TRAITS = Traits()
_ASKED_ENOUGH = 2
_OVERDUE_S = 10.0
"""The time after which the progress report names robots that have not answered, in seconds."""


class SearchState:
    """The state of the search `epoch` by the robots in `order`.

    Attributes:
        counters: The robots' message counters, and the open wave.
        lost: The reasons for losses in this search, by robot.
        verdict: The verdict of the search; None until the search has ended.
        witness: The robot that concluded the verdict; None if the search ended by quiescence or a limit.
        max_messages: The limit on messages, if there is one.
        ordered: True if the robots were ordered to start.
        searching: True if the robots are searching now.
        stuck: The reason why the search can never end; empty if it can end.
        lossy: True if messages are lost and the protocol tolerates this: waiting robots continue without the lost
            messages, until no robot can continue.
    """

    def __init__(
        self, epoch: int = 0, order: Sequence[str] = (), max_messages: int | None = None, traits: Traits = NO_TRAITS
    ) -> None:
        self.epoch = epoch
        self.order = tuple(order)
        self.counters = FourCounters(order)
        self.lost: dict[str, str] = {}
        self.verdict: Verdict | None = None
        self.witness: str | None = None
        self.max_messages = max_messages
        self.ordered = self.searching = False
        self._traits = traits
        self._present = set(order)
        self._unready = set(order)
        self._reports: dict[str, EpochReport] = {}
        self.lossy = False
        self._undecided: set[str] = set()
        self._went = False
        self._snapshots = SnapshotRound()
        self.stuck = ""
        self._still: tuple[MessageCounts, int] | None = None
        self._still_since = 0.0
        self._asked = 0
        self._silent_since: dict[tuple[str, int], float] = {}

    def handle(self, name: str, message: EpochMessage) -> str:
        """Handle a control message from the robot `name`. Return why the message is invalid, or an empty text.

        Late messages from another search, and messages from lost robots, are ignored.
        """
        fault = ""
        if message.epoch != self.epoch or name not in self._present:
            return fault
        match message:
            case Ready():
                self._unready.discard(name)
            case Counters(_, wave, sent, received):
                fault = self._count(name, wave, MessageCounts(sent, received))
            case Conclusion(_, verdict):
                fault = self._conclude(name, verdict)
            case WentOn(_, went):
                fault = self._note_went_on(name, went=went)
            case RobotSnapshot():
                fault = self._take_snapshot(name, message)
            case EpochReport():
                fault = self._take_report(name, message)
            case _:
                fault = "its message is not for the master"
        return fault

    def _count(self, name: str, wave: int, counts: MessageCounts) -> str:
        self.counters.answer(name, wave, counts)
        if not self.ordered:
            self.counters.quiescent = False  # the search has not started
        return ""

    def start(self) -> None:
        """Record that the robots were ordered to start. Answers to an earlier wave do not count."""
        self.ordered = self.searching = True
        self.counters.close_wave()
        self._still, self._asked = None, 0

    def _conclude(self, name: str, verdict: str) -> str:
        """Record a verdict that the robot `name` concluded alone. Only the first verdict counts."""
        fault = self._traits.conclusion_error(verdict)
        if not fault and self.verdict is None:
            self.verdict, self.witness = Verdict(verdict), name
        return fault

    def _note_went_on(self, name: str, *, went: bool) -> str:
        """Record whether a robot has continued. If all have answered and none has continued, the search ends."""
        if name not in self._undecided:
            return "it answered whether it continues, without having been asked"
        self._undecided.discard(name)
        self._went = self._went or went
        if not self._undecided and not self._went:
            self.counters.quiescent = True
            self.verdict = self.verdict or Verdict.SOLUTION
        return ""

    def _take_snapshot(self, name: str, snapshot: RobotSnapshot) -> str:
        return self._snapshots.add(name, snapshot)

    def start_snapshot(self) -> int | None:
        """Return the number of a snapshot to request from all robots, or None while another snapshot is pending."""
        return self._snapshots.open()

    def completed_snapshot(self) -> SearchResult | None:
        """Return the requested snapshot, once, when all robots have answered; otherwise None."""
        return self._snapshots.close(self._present)

    def start_continuation(self) -> bool:
        """Return whether to order all robots to continue: no message is in transit, and some may be lost."""
        if not self.lossy or not self.counters.quiescent or self.ended:
            return False
        self.counters.quiescent = False
        self._undecided, self._went = set(self._present), False
        return True

    def _take_report(self, name: str, report: EpochReport) -> str:
        self._reports[name] = report
        return ""

    def lose(self, name: str, why: str) -> None:
        """Mark the robot `name` as lost, and discard its report."""
        self.lost.setdefault(name, why)
        self._present.discard(name)
        self._unready.discard(name)
        self._undecided.discard(name)
        self._reports.pop(name, None)

    @property
    def ready(self) -> bool:
        """True if all robots are ready."""
        return not self._unready

    @property
    def unready(self) -> tuple[str, ...]:
        """The robots that are not ready, sorted."""
        return tuple(sorted(self._unready))

    @property
    def broken_off(self) -> bool:
        """True if the search must end without a verdict: robots are lost, a limit is reached, or it is stuck."""
        over = self.max_messages is not None and self.counters.sent >= self.max_messages
        return bool(self.lost or self.stuck) or over

    @property
    def ended(self) -> bool:
        """True if the search is over, with or without a verdict."""
        return self.verdict is not None or self.broken_off

    @property
    def wave_due(self) -> bool:
        """True if a wave could prove quiescence, or show that the message limit is reached or the search is stuck."""
        counters = self.counters
        if counters.is_wave_open:
            return False
        over = self.max_messages is not None and counters.is_changed
        return bool(self._asked) or (self.ordered and (counters.due or over))

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots that are not ready or, if all are ready, have not reported their counters, sorted."""
        return self.unready or self.counters.silent

    def is_stalled(self, now: float, patience_s: float) -> bool:
        """Return whether the search can never continue: robots wait for data that are lost.

        A computing robot does not answer waves. So this is certain if robots are not ready or messages are missing,
        nothing has changed for `patience_s` seconds, and all robots then answer two waves with the same counts. While a
        robot has not answered whether it continues, no waves are started.

        Args:
            now: The time for which the master has waited so far, in seconds.
            patience_s: The longest transit of a message, in seconds.
        """
        counters = self.counters
        waits = bool(self._unready) or counters.total is None or counters.missing != 0
        mark = (counters.counted, len(self._unready))
        if mark != self._still or self._undecided:
            self._still, self._still_since, self._asked = mark, now, 0
        elif not waits:
            self._asked = 0
        elif now - self._still_since > patience_s and not counters.is_wave_open:
            if self._asked == _ASKED_ENOUGH:
                return True
            self._asked += 1
        return False

    def describe_stall(self) -> str:
        """Return why the search can never continue. It must be stalled."""
        if self._unready:
            return f"{listed(self.unready)} cannot start: data from other robots were lost for good"
        return f"{self.counters.missing:,} messages between robots were lost for good"

    def overdue(self, now: float) -> tuple[str, float]:
        """Return the robots that have not answered for long, and for how many seconds; ("", 0.0) if there are none.

        A computing robot answers no wave. Call this from time to time, with the same `now` as `is_stalled`.
        """
        wave, before = self.counters.wave, self._silent_since
        self._silent_since = {(name, wave): before.get((name, wave), now) for name in self.silent}
        late = {name: now - since for (name, _), since in self._silent_since.items() if now - since > _OVERDUE_S}
        return listed(late), max(late.values(), default=0.0)

    def next_wave(self, *, wanted: bool = False) -> int | None:
        """Return the number of a wave to start now, or None.

        If the last wave has proven quiescence, the verdict is a solution, unless a robot has concluded another verdict.

        Args:
            wanted: Start a wave unless one is open, because the message count is needed.
        """
        if self._undecided:
            return None
        if self.counters.quiescent:
            self.verdict = self.verdict or Verdict.SOLUTION
            return None
        return self.counters.start_wave() if self.wave_due or (wanted and not self.counters.is_wave_open) else None

    def has_reported(self, name: str) -> bool:
        """Return whether the robot has sent its final report."""
        return name in self._reports

    @property
    def pending_reports(self) -> tuple[str, ...]:
        """The robots that have not sent their final report, sorted."""
        return tuple(sorted(self._present - self._reports.keys()))

    def result(self, wall_s: float) -> SearchResult:
        """Return the result of the search, which lasted `wall_s` seconds.

        A verdict counts only if no robot is lost and all have reported: their values and lost messages belong to it.
        """
        settled = self.verdict is not None and not self.lost and not self.pending_reports
        result = SearchResult.of(
            self.verdict if self.verdict is not None and settled else Verdict.UNKNOWN,
            self.witness if settled else None,
            {name: report.assignment for name, report in self._reports.items()},
            [report.metrics for report in self._reports.values()],
            wall_s,
        )
        findings = {name: report.findings for name, report in self._reports.items()}
        return replace(result, lost=dict(self.lost), findings=findings)
