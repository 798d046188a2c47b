"""Asynchronous Max-Sum.

Max-Sum without cycles. Each robot processes the messages that have arrived, chooses the cheapest value according to
them, and sends its neighbours the changes. When nothing changes any more, no more messages are sent, and the search
ends.

- **When to use**: costs, a graph with few cycles, and messages with unequal delays.
- **Guarantees**: incomplete. It ends, because a robot sends each neighbour at most `limit` messages. On a graph without
  cycles the result is optimal, if `limit` and `tolerance` do not cut the search short; elsewhere it is an estimate. The
  result consists of the values at the end, or at a limit of the run. A robot whose values all cost `inf` proves that
  there is no solution.
- **Parameters (`--set`)**: `damping` (the weight of the last message in a new one; default 0.5), `preference` (the
  maximum random charge of a value; default 0.01), `tolerance` (smaller changes are not sent; default 0.0001), `limit`
  (the number of messages to each neighbour; default 200).
- **References**: Farinelli, Rogers, Petcu, Jennings: "Decentralised coordination of low-power embedded devices using
  the max-sum algorithm", AAMAS 2008, Section 4, which says that nodes may send at any time; for damping: Cohen, Galiki,
  Zivan: "Governing convergence of Max-sum on DCOPs through damping and splitting", AIJ 279, 2020.

Functions, R, Q, Z and preferences are those of Max-Sum (`maxsum`).

Choices that the papers leave open, and differences:

- Messages between robots, R and Q, are damped; messages between nodes of the same robot are not.
- A damped message is not the robot's actual result. So it is marked as not `settled`, and its receiver answers in any
  case; then the robot sends closer results, until the difference is at most `tolerance`. So damping does not change the
  result on a graph without cycles.
- All robots start at once, with their private costs.
- If messages are lost and no more arrive, all robots send their last messages again, up to ten times.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), AsyncMaxSum, Concurrent(seed=0)).search()
>>> result.verdict.value, result.metrics.messages
('no-solution', {'Domain': 6})
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.inference import maxsum
from robochoc.protocols.inference.maxsum_factor import Functions, Row, cheapest, checked, from_zero, total, without_each
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.cycles import Domain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class AsyncMaxSumSettings(Settings, frozen=True):
    """`damping`: the weight of the last message. `preference`: its maximum for a value.

    `tolerance`: smaller changes are not sent. `limit`: the number of messages to each neighbour.
    """

    damping: float = 0.5
    preference: float = 0.01
    tolerance: float = 0.0001
    limit: int = 200

    def __post_init__(self) -> None:
        if not 0 <= self.damping < 1:
            raise ValueError(f"damping is {self.damping:g}; it must be from 0 to below 1")
        for name in ("preference", "tolerance"):
            given = getattr(self, name)
            if not 0 <= given < INFINITE:
                raise ValueError(f"{name} is {given:g}; it must be a number, 0 or more")
        if self.limit < 1:
            raise ValueError(f"limit is {self.limit}; it must be 1 or more")


class R(maxsum.R, frozen=True):
    """The costs of `maxsum.R`; `settled`: they are not damped. Otherwise the receiver answers, and more follows."""

    settled: bool

    act = maxsum.R.act

    def in_words(self, words: Wording) -> str:
        return f"{super().in_words(words)}{'' if self.settled else MORE}"


class Q(maxsum.Q, frozen=True):
    """The costs of `maxsum.Q`; `settled`: they are not damped. Otherwise the receiver answers, and more follows."""

    settled: bool

    act = maxsum.Q.act

    def in_words(self, words: Wording) -> str:
        return f"{super().in_words(words)}{'' if self.settled else MORE}"


MORE = " for the moment"


REPEATS = 10
"""The number of times that a robot sends all its last messages again after messages were lost."""


class AsyncMaxSum(Protocol):
    """One agent of asynchronous Max-Sum.

    `functions` are this robot's functions, with the last Q from above; None until all domains from above have arrived.
    `from_below` contains the last R from each robot below, `sent_rows` the last rows sent to each neighbour, and
    `sent_messages` the number of these messages. `owed` are the neighbours that wait for an answer.
    """

    messages = Domain | R | Q
    settings: ClassVar[AsyncMaxSumSettings] = AsyncMaxSumSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Farinelli, Rogers, Petcu, Jennings 2008",
        complete=False,
        costs=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="costs, few cycles in the graph, unequal delays; no proof",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        place = order.rank[problem.agent]
        self.above = tuple(name for name in problem.neighbours if order.rank[name] < place)
        self.below = tuple(name for name in problem.neighbours if order.rank[name] > place)
        self.functions: Functions | None = None
        self.preferred: Row = []
        self.from_below: dict[str, list[Row]] = {}
        self.sent_rows: dict[str, list[Row]] = {}
        self.sent_messages: dict[str, int] = {}
        self.owed: set[str] = set()
        self._domains: dict[str, Sequence[Value]] = {}
        self._repeated = 0

    def start(self) -> None:
        """Choose the cheapest value, and send the domain to the holders of this robot's functions."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.problem.neighbours:
            costs = self.problem.lexicographic_costs({})
            self.value = costs.index(min(costs))
        else:
            preference = self.settings.preference
            self.preferred = [cost + preference * self.chance() for cost in self.problem.costs({})]
            self.value = cheapest(self.preferred)
            for name in self.below:
                self.send(name, Domain(list(self.problem.values)))
            self.settle()

    def receive(self, sender: str, message: Message) -> None:
        """Store the content of the message."""
        if self.verdict is not None:
            return
        match cast("Domain | R | Q", message):
            case Domain(values):
                for value in values:
                    self.problem.refuse_value(sender, value)
                self._domains[sender] = values
            case R(rows, settled):
                many = len(self.from_below.get(sender, rows))
                self.from_below[sender] = checked(rows, many, len(self.preferred))
                self._record_request(sender, settled=settled)
            case Q(rows, settled):
                if self.functions is None:
                    raise ValueError(f"{sender} sent Q before it received R from {self.problem.agent}")
                self.functions.receive_q(sender, rows)
                self._record_request(sender, settled=settled)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Choose a value based on all received messages, and send the changes."""
        if self.verdict is not None or not self.preferred or len(self._domains) < len(self.above):
            return
        if self.functions is None:
            self.functions = Functions(self.problem.tables(self._domains), self._domains)
        functions = self.functions
        own, _ = functions.answers([[0.0] * len(self.preferred)] * len(functions.factors))
        rows = [*own, *(row for r in self.from_below.values() for row in r)]
        z = total(self.preferred, rows)
        if min(z) == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.value = cheapest(z)
        q = [from_zero(row) for row in without_each(self.preferred, rows, z)]
        for name, answers in functions.answers(q[: len(own)])[1].items():
            self._send_changes(name, answers, R)
        rest = iter(q[len(own) :])
        for name, r in self.from_below.items():
            self._send_changes(name, [next(rest) for _ in r], Q)

    def go_on(self) -> bool:
        """Send all last messages again, up to `REPEATS` times, because messages were lost and no more will arrive."""
        if self._repeated >= REPEATS or self.verdict is not None or not self.preferred:
            return False
        self._repeated += 1
        for name in self.below:
            if name not in self.from_below:
                self.send(name, Domain(list(self.problem.values)))
        for name, rows in self.sent_rows.items():
            self.send(name, (Q if name in self.below else R)(rows, settled=True))
        return True

    def _record_request(self, sender: str, *, settled: bool) -> None:
        """Record whether `sender` waits for an answer."""
        if settled:
            self.owed.discard(sender)
        else:
            self.owed.add(sender)

    def _send_changes(self, name: str, fresh: list[Row], kind: type[R | Q]) -> None:
        """Send `fresh`, damped, if it has changed or is owed as an answer; never empty rows, or above the limit."""
        tolerance = self.settings.tolerance
        before = self.sent_rows.get(name)
        owed = name in self.owed
        self.owed.discard(name)
        sent = self.sent_messages.get(name, 0)
        if not fresh or sent >= self.settings.limit:
            return
        if before is not None and not owed and _near(before, fresh, tolerance):
            return
        rows = fresh if before is None else self._damped(before, fresh)
        settled = _near(rows, fresh, tolerance)
        self.sent_rows[name] = fresh if settled else rows
        self.sent_messages[name] = sent + 1
        self.send(name, kind(self.sent_rows[name], settled))

    def _damped(self, before: list[Row], fresh: list[Row]) -> list[Row]:
        damping = self.settings.damping
        if not damping:
            return fresh
        return [
            [damping * old + (1 - damping) * new for old, new in zip(one, other, strict=True)]
            for one, other in zip(before, fresh, strict=True)
        ]


def _near(before: list[Row], after: list[Row], tolerance: float) -> bool:
    """Return whether no entry differs by more than `tolerance`."""
    return all(
        old == new or abs(old - new) <= tolerance
        for one, other in zip(before, after, strict=True)
        for old, new in zip(one, other, strict=True)
    )
