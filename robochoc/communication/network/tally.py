"""What the master hears of a search: who is ready, the counters, the verdict, and what came of it. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from robochoc.communication.control import Conclusion, Counters, OfEpoch, Ready
from robochoc.communication.network.words import Account, Checked
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.run_result import RunResult
from robochoc.outcome import Verdict


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
            case Account():
                self._accounts[name] = word
                self._silent.discard(name)
            case Checked():
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
        """Whether a wave could show that all is quiet, or that there were messages enough."""
        return self.counters.due or (self._enough is not None and not self.counters.waving)

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
