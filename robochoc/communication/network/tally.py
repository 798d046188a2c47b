"""What the master hears of a search: who is ready, the counters, the verdict, and what came of it. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from robochoc.communication.control import Conclusion, Counters, OfEpoch, Ready
from robochoc.communication.network.words import Account, Checked
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.run_result import RunResult
from robochoc.formats.constraints import is_name
from robochoc.observers.events import AnyEvent, actor
from robochoc.outcome import Metrics, Verdict
from robochoc.problem import INFINITE

_ASKED_ENOUGH = 2
_LARGEST_COUNT = 2**53


def _is_sound(metrics: Metrics) -> bool:
    """Whether a robot can have counted that: names of messages are printed, and numbers added up."""
    counts = (metrics.bytes, metrics.ncccs, metrics.checks, metrics.memory, metrics.largest, *metrics.messages.values())
    return all(map(is_name, metrics.messages)) and all(0 <= count <= _LARGEST_COUNT for count in counts)


class Tally:
    """The search `epoch` of the robots in `order`. `enough` is the limit on messages, if there is one.

    `lost` says why, by name, robots were lost in it.
    """

    def __init__(self, epoch: int = 0, order: Sequence[str] = (), enough: int | None = None) -> None:
        self.epoch = epoch
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
        self._unchecked = set(order)
        self._still: Counts | None = None
        self._since = 0.0
        self._asked = 0

    def hear(self, name: str, word: OfEpoch) -> bool:
        """Take in what a robot tells of this search; whether the word is one for the master.

        Late words of another search, and those of robots that were lost, say nothing.
        """
        if word.epoch != self.epoch or name not in self._silent | self._accounts.keys():
            return True
        match word:
            case Ready():
                self._unready.discard(name)
            case Counters(_, wave, sent, received):
                self.counters.answer(name, wave, Counts(sent, received))
            case Conclusion(_, verdict) if verdict in set(Verdict):
                self.verdict, self._witness = Verdict(verdict), name
            case Account(metrics=metrics) if _is_sound(metrics):
                self._accounts[name] = word
                self._silent.discard(name)
            case Checked(cost=cost) if 0 <= cost < INFINITE:
                self._checks[name] = word
                self._unchecked.discard(name)
            case _:
                return False
        return True

    def lose(self, name: str, why: str) -> None:
        """The robot is lost; what it has claimed is void."""
        self.lost.setdefault(name, why)
        self._accounts.pop(name, None)
        for waited_for in (self._unready, self._silent, self._unchecked):
            waited_for.discard(name)

    @property
    def ready(self) -> bool:
        """Whether all robots can begin."""
        return not self._unready

    @property
    def broken_off(self) -> bool:
        """Whether the search has to end without a verdict: robots were lost, or there were messages enough."""
        return bool(self.lost) or (self._enough is not None and self.counters.sent >= self._enough)

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
