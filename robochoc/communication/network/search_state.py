"""What the master hears of a search: who is ready, the counters, the verdict, and what came of it. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

from robochoc.communication.control import Conclusion, Counters, OfEpoch, Ready
from robochoc.communication.network.control_messages import Account, Checked
from robochoc.communication.network.plausibility import (
    NOTHING_DECLARED,
    Course,
    Declared,
    Doubt,
    doubts_about_checks,
    doubts_about_messages,
    doubts_about_values,
    fault_of_account,
    fault_of_check,
    fault_of_counters,
    objections,
    thoroughness,
    total_of,
    widest_gap,
)
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.run_result import RunResult
from robochoc.journal.events import AnyEvent, actor
from robochoc.model.outcome import CheckCounts, Verdict

_ASKED_ENOUGH = 2
_TOLD = 3
"""So many doubts are told in words."""


class SearchState:
    """The search `epoch` of the robots in `order`. `enough` is the limit on messages, if there is one.

    `declared` is what the master knows of the robots, against which their words are held. `lost` says why, by name,
    robots were lost in it; `ordered` is whether it has begun, and `stuck` says why it can never end, if that is so.
    """

    def __init__(
        self,
        epoch: int = 0,
        order: Sequence[str] = (),
        enough: int | None = None,
        declared: Declared = NOTHING_DECLARED,
    ) -> None:
        self.epoch = epoch
        self.order = tuple(order)
        self.ordered = False
        self.lasted_s = 0.0
        self._awaited: tuple[str, ...] = ()
        self.stuck = ""
        self._declared = declared
        self._had_before: int | None = None
        self.counters = FourCounters(order)
        self.lost: dict[str, str] = {}
        self.verdict: Verdict | None = None
        self.searching = False
        self._unready = set(order)
        self._silent = set(order)
        self._enough = enough
        self._witness: str | None = None
        self._accounts: dict[str, Account] = {}
        self._checks: dict[str, Checked] = {}
        self._contradictions: list[Doubt] = []
        self._unchecked = set(order)
        self._still: Counts | None = None
        self._since = 0.0
        self._asked = 0

    def hear(self, name: str, word: OfEpoch) -> str:
        """Take in what a robot tells of this search; return why it cannot be, or is none for the master (else empty).

        Late words of another search, and those of robots that were lost, say nothing.
        """
        if word.epoch != self.epoch or name not in self._silent | self._accounts.keys():
            return ""
        fault = ""
        match word:
            case Ready():
                self._unready.discard(name)
            case Counters(_, wave, sent, received):
                fault = self._count(name, wave, Counts(sent, received))
            case Conclusion(_, verdict):
                fault = self._conclude(name, verdict)
            case Account():
                fault = self._report(name, word)
            case Checked():
                fault = self._check(name, word)
            case _:
                fault = "it is none for the master"
        return fault

    def _count(self, name: str, wave: int, counts: Counts) -> str:
        """Take in counters. Who answers a wave has had no more than all say they have sent in the next one."""
        if fault := fault_of_counters(counts, self.counters.latest(name)):
            return fault
        was_waving = self.counters.waving
        self.counters.answer(name, wave, counts)
        total = self.counters.total
        if was_waving and not self.counters.waving and total is not None:
            if self._had_before is not None and self._had_before > total.sent:
                self.stuck = f"robots have counted {self._had_before:,} messages taken in, and {total.sent:,} sent"
            self._had_before = total.received
        return ""

    def _conclude(self, name: str, verdict: str) -> str:
        """Take in that the robot `name` alone can tell the verdict: the first word stands, whatever others say."""
        before = "" if self.ordered else "it has concluded something before the search began"
        if fault := before or self._declared.traits.fault_of_conclusion(verdict):
            return fault
        if self.verdict is None:
            self.verdict, self._witness = Verdict(verdict), name
        if self.verdict == verdict:
            return ""
        if self._witness is None:  # all were quiet, and the answer is checked: another may have stirred it since
            return ""
        if self._witness == name:
            return f"it has concluded {verdict}, and {self.verdict} before"
        why = f"{self._witness} has concluded {self.verdict}, and {name} {verdict}"
        self._contradictions.append(Doubt((self._witness, name), why))
        return ""

    def _report(self, name: str, account: Account) -> str:
        """Take in what the search has come to for a robot."""
        heard = self.counters.latest(name) or Counts(0, 0)
        course = Course(self.order, heard, self.lasted_s, self.quiet)
        fault = fault_of_account(name, account, self._declared, course)
        if not fault:
            self._accounts[name] = account
            self._silent.discard(name)
        return fault

    def _check(self, name: str, check: Checked) -> str:
        """Take in what a robot has found of the decision."""
        fault = fault_of_check(name, check, self._declared, self.order)
        if not fault:
            self._checks[name] = check
            self._unchecked.discard(name)
        return fault

    def lose(self, name: str, why: str) -> None:
        """The robot is lost; what it has claimed is void."""
        self.lost.setdefault(name, why)
        self._accounts.pop(name, None)
        self._checks.pop(name, None)
        for waited_for in (self._unready, self._silent, self._unchecked):
            waited_for.discard(name)

    def note_end(self, lasted_s: float, *, in_time: bool) -> None:
        """The search is over after `lasted_s` seconds, `in_time` or because the time was over."""
        self.lasted_s = lasted_s
        if not in_time:  # to be ready, or to answer
            self._awaited = tuple(sorted(self._unready)) or self.counters.silent

    @property
    def ready(self) -> bool:
        """Whether all robots can begin."""
        return not self._unready

    @property
    def broken_off(self) -> bool:
        """Whether the search has to end without a verdict: robots were lost, or messages enough, or it is stuck."""
        return bool(self.lost or self.stuck) or (self._enough is not None and self.counters.sent >= self._enough)

    @property
    def wave_due(self) -> bool:
        """Whether a wave could show that all is quiet, that there were messages enough, or that some are missing."""
        return self.counters.due or ((self._enough is not None or bool(self._asked)) and not self.counters.waving)

    def missing(self, now: float, patience_s: float) -> int:
        """How many messages were sent and are lost for good; 0 as long as that cannot be told.

        It can when nothing has been sent or taken in for `patience_s`, and all robots, asked twice after that, say the
        same again: then nothing is under way either. `now` is on the monotonic clock.
        """
        total = self.counters.total
        if total is None or total != self._still or total.sent == total.received:
            self._still, self._since, self._asked = total, now, 0
        elif now - self._since > patience_s and not self.counters.waving:
            if self._asked == _ASKED_ENOUGH:
                return total.sent - total.received
            self._asked += 1
        return 0

    @property
    def quiet(self) -> bool:
        """Whether the search ended as all were quiet, and not by one robot's word."""
        return self.counters.quiescent and self._witness is None

    @property
    def silent(self) -> tuple[str, ...]:
        """Who has not reported yet."""
        return tuple(sorted(self._silent))

    @property
    def unchecked(self) -> bool:
        """Whether somebody has not held its constraints against the decision yet."""
        return bool(self._unchecked)

    @property
    def held(self) -> bool:
        """Whether all have, and none of them is broken."""
        return not self._unchecked and all(check.allowed for check in self._checks.values())

    @property
    def objections(self) -> tuple[str, ...]:
        """Which constraints are broken, by who says so."""
        return tuple(islice(objections(self._checks), _TOLD))

    @property
    def thoroughness(self) -> CheckCounts:
        """How many constraints were checked by whom."""
        return thoroughness(self._checks)

    # Whose words contradict each other

    @property
    def doubts_about_counts(self) -> tuple[Doubt, ...]:
        """Of which two robots the counts do not agree. Once all have reported."""
        stirred = any(total_of(one) != self.counters.latest(name) for name, one in self._accounts.items())
        still = (self.quiet and not stirred) or bool(self.stuck)
        return tuple(islice(doubts_about_messages(self._accounts, quiet=still), _TOLD))

    @property
    def doubts_about_verdict(self) -> tuple[Doubt, ...]:
        """Which two robots say what cannot both be so of the verdict, the values, or a constraint that both know.

        Where all were quiet, that is the verdict of the counters; and only costs are proven by it.
        """
        proven = self._declared.traits.costs and self.quiet
        found = [*self._contradictions, *(self.doubts_about_counts if proven else ())]
        found += [*doubts_about_values(self._accounts), *doubts_about_checks(self._checks)]
        return tuple(found[:_TOLD])

    @property
    def restless(self) -> str:
        """Who has kept the search awake until the time was over, in words; empty if that cannot be told."""
        names = ", ".join(self._awaited[:_TOLD]) + ", ..." * (len(self._awaited) > _TOLD)
        waited = f"{names} {'has' if len(self._awaited) == 1 else 'have'} not answered the master"
        doubts = [doubt.why for doubt in self.doubts_about_counts]
        return "; ".join(filter(None, [waited if names else "", *(doubts or [widest_gap(self._accounts)])]))

    @property
    def cost(self) -> float:
        """What all constraints charge together, as far as they were checked."""
        return sum(check.cost for check in self._checks.values())

    @property
    def assigned(self) -> Mapping[str, bool]:
        """Of those who have reported, whether they have values."""
        return {name: account.assigned for name, account in self._accounts.items()}

    def result(self, wall_s: float) -> RunResult:
        """What the search has come to."""
        settled = self.verdict is not None and not self.lost
        result = RunResult.of(
            self.verdict if self.verdict is not None and settled else Verdict.UNKNOWN,
            self._witness if settled else None,
            {name: account.assignment for name, account in self._accounts.items()},
            [account.metrics for account in self._accounts.values()],
            wall_s,
        )
        findings = {name: account.findings for name, account in self._accounts.items()}
        return replace(result, lost=dict(self.lost), findings=findings)


def is_of(event: AnyEvent, name: str) -> bool:
    """Whether `event` is one that the robot `name` may tell of in a search: of what itself has done."""
    return actor(event) == name
