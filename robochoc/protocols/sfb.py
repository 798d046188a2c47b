"""Synchronous forward bounding, many partial assignments at a time.

Branch and bound with a current partial assignment (CPA) that goes from robot to robot in priority order is Hirayama,
Yokoo: "Distributed partial constraint satisfaction problem", CP 1997 (SyncBB). That robots which have no value yet
bound from below what they will have to pay, and so let the holder give up early, is Gershman, Meisels, Zivan:
"Asynchronous forward bounding for distributed COPs", JAIR 34, 2009, whose names the methods bear:

    assign_CPA   `_extend`       backtrack      `_explored`
    CPA_MSG      `CPAs`          NEW_SOLUTION   `Solution`

There, copies of the CPA go to those robots, and their estimates come back. Here the CPA itself carries for each of
them what each of its values would cost by now, as partial forward checking does in one machine (Freuder, Wallace:
"Partial constraint satisfaction", AIJ 58, 1992; Larrosa, Meseguer, Schiex: "Maintaining reversible DAC for Max-CSP",
AIJ 107, 1999). Whoever takes a value adds the prices of the constraints that it shares with them; all robots of a
scope know it. So the holder alone knows the bound, and prunes before it sends: no estimate is asked for.

That a message carries many CPAs, all of the same robots, is ours. The first ones go alone, straight down to a first
solution; then each robot extends twice as many at a time as the time before, up to `batch`, the lowest bounds first.
The search stays depth first, by bundles: proofs by branch and bound hardly mind, as most of what they visit has to be
visited in any order, and hundreds of nodes cost one message. One robot acts at a time; with the setting `window` at 2
or more, robots extend the next CPAs while those below are busy with the last ones, an idea of concurrent search
(Zivan, Meisels: "Concurrent search for distributed CSPs", AIJ 170, 2006). On two cores it gained nothing.

Complete, for minimisation. First two waves tell all robots each other's values: down the order, and back up, with
what the values are charged and the most that costs can come to. The last robot turns CPAs into solutions. Each that
is cheaper than all before is told from robot to robot up the order, and everybody holds its value; CPAs tell those
below what it costs. When the first robot has nothing left to extend, the last solution is optimal, or there is none.

Constraints may be n-ary: the last but one robot of a scope adds what the last one will pay. Prices are looked up in
tables that are made before the search (see `LocalProblem.tables`), so all constraint checks are done by then.

>>> from robochoc.communication.schedule import Concurrent
>>> from robochoc.communication.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.solver.part import Brief
>>> result = Simulation(queens3d(4), SFB, Concurrent(seed=0), brief=Brief(aside=1)).run()
>>> sum(bool(values) for values in result.assignments.values())  # of 16, and no more can fly
10
>>> result.findings["Robot1.1"].bound
6
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import assert_never, cast

from robochoc.message import Message, Value
from robochoc.outcome import Verdict
from robochoc.protocols.findings import NOTHING, Best, Findings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol, Settings
from robochoc.protocols.sfb_bounds import BOUND, ForwardBounds, Rows, dearest
from robochoc.protocols.traits import Traits
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.cost_table import EXACT, refuse_inexact

MESSAGE_BYTES = 1 << 22
"""About how large messages become: as much is extended at once as fits, if everything can be extended."""


class Above(Message, frozen=True):
    """The values of all robots above the receiver, in priority order."""

    domains: list[list[Value]]


class Below(Message, frozen=True):
    """The values of all robots below the receiver, in priority order, and what each of them is charged for each.

    `most` is the most that these charges, and the constraints whose lowest two robots are below, can come to.
    """

    domains: list[list[Value]]
    charges: list[list[float]]
    most: int


class CPAs(Message, frozen=True):
    """`count` partial assignments of all robots above the receiver (see `sfb_bounds`) that may cost below `least`.

    `least` is what the cheapest known solution costs, or the `ceiling`, which no cost reaches.
    """

    count: int
    rows: bytes
    least: int
    ceiling: int


class Explored(Message, frozen=True):
    """Nothing is left of the oldest `CPAs` that I have had from you and have not yet answered."""


class Solution(Message, frozen=True):
    """A solution that costs less than all before, as the place of each robot's value in its domain."""

    cost: int
    places: list[int]


class SFBSettings(Settings, frozen=True):
    """`batch`: how many CPAs are extended at once, at most. `window`: how many messages of them may be under way."""

    batch: int = 4096
    window: int = 1

    def __post_init__(self) -> None:
        if self.batch < 1 or self.window < 1:
            raise ValueError("batch and window are 1 or more")


class Batch:
    """What came in one message: `rows` are still to be extended; of the others, `sent` messages are under way."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.sent = 0

    def take(self, count: int, least: int) -> Rows:
        """Of the next `count` rows those that may still cost less than `least`."""
        rows, self.rows = self.rows[:count], self.rows[count:]
        return rows[rows[:, BOUND] < least]


class SFB(Protocol):
    """One agent. State: the `batches` that it is to explore, the oldest first, and the `best` solution.

    `least` is what that costs; `under_way` are, for each message of CPAs to the next robot that has not been
    answered, the batch that it is of, and its lowest bound. `width` CPAs are extended next. `bounds` is what this
    robot adds to CPAs: there once it knows everybody's values, and of use once it knows the `ceiling`.
    """

    bounds: ForwardBounds
    messages = Above | Below | CPAs | Explored | Solution
    traits = Traits(
        paper="Hirayama & Yokoo 1997; Gershman, Meisels, Zivan 2009",
        synchronous=True,
        costs=True,
        everywhere=True,
        tables=True,
    )
    settings: SFBSettings = SFBSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        rank = order.rank[problem.agent]
        self.previous = order.names[rank - 1] if rank else None
        self.next = order.names[rank + 1] if rank + 1 < len(order.names) else None
        self.domains: list[list[Value]] = []
        self.best: Solution | None = None
        self.least = self.ceiling = 0
        self.batches: deque[Batch] = deque()
        self.under_way: deque[tuple[Batch, int]] = deque()
        self.width = 1

    def start(self) -> None:
        """The first robot tells its values; who has none at all ends the search."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.previous is None:
            self._tell_below([])
            self.settle()

    def receive(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type. Raises `ValueError` for what no robot says here and now."""
        if self.verdict is not None:
            return
        if not self._expects(sender, message):
            raise ValueError(f"{sender} says {type(message).__name__}, which it cannot say now")
        match cast("Above | Below | CPAs | Explored | Solution", message):
            case Above(domains):
                self._tell_below(domains)
            case Below() as below:
                self._tell_above(below)
            case CPAs() as cpas:
                self._process_cpas(cpas)
            case Explored():
                batch, _ = self.under_way.popleft()
                batch.sent -= 1
            case Solution() as solution:
                self._process_solution(solution)
            case never:
                assert_never(never)

    def _expects(self, sender: str, message: Message) -> bool:
        """Whether `message` may come from `sender` at this point: from the robot before, or from the next one."""
        match message:
            case Above():
                return sender == self.previous and not self.domains
            case Below():
                return sender == self.next and bool(self.domains) and not self._priced
            case CPAs(_, _, least, ceiling):
                return sender == self.previous and self._priced and least >= 0 and 0 < ceiling <= EXACT
            case Explored():
                return sender == self.next and bool(self.under_way)
            case Solution(_, places):
                sizes = [len(domain) for domain in self.domains]
                fits = len(places) == len(sizes) and all(0 <= p < size for p, size in zip(places, sizes, strict=True))
                return sender == self.next and fits
            case _:
                return False

    @property
    def _priced(self) -> bool:
        """Whether everybody's values are known, and constraints with them priced."""
        return hasattr(self, "bounds")

    def settle(self) -> None:
        """Extend what is there, as long as messages may be sent; say what has been explored."""
        while self.batches and self.verdict is None:
            batch = next((batch for batch in self.batches if len(batch.rows)), None)
            if not len(self.batches[0].rows) and not self.batches[0].sent:
                self.batches.popleft()
                self._explored()
            elif batch is not None and len(self.under_way) < self.settings.window:
                self._extend(batch)
            else:
                return

    # Before the search

    def _tell_below(self, domains: Sequence[list[Value]]) -> None:
        self.domains = [*domains, list(self.problem.values)]
        if self.next is None:
            self._tell_above(Below([], [], 0))
        else:
            self.send(self.next, Above(self.domains))

    def _tell_above(self, below: Below) -> None:
        """Know everybody's values, and price the constraints; the first robot begins."""
        own = self.domains[-1]
        self.domains = [*self.domains, *below.domains]
        self.bounds = ForwardBounds(self.problem, self.order, self.domains)
        charges = [self.problem.costs({}), *below.charges]
        most = below.most + self.bounds.most + dearest(charges[0])
        refuse_inexact(most)
        if self.previous is not None:
            self.send(self.previous, Below([own, *below.domains], charges, most))
        else:
            self._count_up_to(most + 1)
            self.batches.append(Batch(self.bounds.nothing(charges)))

    def _count_up_to(self, ceiling: int) -> None:
        self.bounds.count_up_to(ceiling)
        self.least = self.ceiling = ceiling

    # The search

    def _process_cpas(self, cpas: CPAs) -> None:
        """Take in what is to be explored, and how cheap it has to be."""
        if not self.ceiling:
            self._count_up_to(cpas.ceiling)
        self.least = min(self.least, cpas.least)
        self.batches.append(Batch(self.bounds.read(cpas.rows, cpas.count)))

    def _extend(self, batch: Batch) -> None:
        """Add the own values to the next few CPAs, and send on what may become a cheaper solution."""
        if self.next is None:
            self._complete(batch.take(len(batch.rows), self.least))
            return
        fit = max(1, MESSAGE_BYTES // (self.bounds.width * len(self.problem.values)))
        rows = self.bounds.extended(batch.take(min(self.width, fit), self.least), self.least)
        self.width = min(2 * self.width, self.settings.batch)
        step = max(1, MESSAGE_BYTES // self.bounds.width)
        for start in range(0, len(rows), step):
            self._send_cpas(batch, rows[start : start + step])

    def _send_cpas(self, batch: Batch, rows: Rows) -> None:
        batch.sent += 1
        self.under_way.append((batch, int(rows[0, BOUND])))
        self.send(str(self.next), CPAs(len(rows), rows.tobytes(), self.least, self.ceiling))

    def _complete(self, rows: Rows) -> None:
        """The last robot's part: the cheapest of all that these become is a solution, if it is cheap enough."""
        if len(rows):
            cost, places = self.bounds.completed(rows)
            if cost < self.least:
                self._process_solution(Solution(cost, places))

    def _process_solution(self, solution: Solution) -> None:
        """Hold the own value of a solution that is cheaper than all before, and tell it to those above."""
        self.best = solution
        self.least = solution.cost
        self.value = solution.places[self.bounds.rank]
        if self.previous is not None:
            self.send(self.previous, solution)

    def _explored(self) -> None:
        """The oldest batch is done with: back. The first robot's only one: all is done."""
        if self.previous is not None:
            self.send(self.previous, Explored())
        elif self.best is None:
            self.conclude(Verdict.NO_SOLUTION)

    # What is known so far

    @property
    def heard(self) -> Best | None:
        """The best solution that has come by here."""
        if self.best is None:
            return None
        chosen = zip(self.order.names, self.domains, self.best.places, strict=True)
        return Best(self.best.cost, {name: values[place] for name, values, place in chosen})

    @property
    def findings(self) -> Findings:
        """The best solution that has come by here; the first robot's least bound of all that is not explored."""
        if not self.ceiling:
            return NOTHING
        bound = None
        if self.previous is None:
            left = [int(batch.rows[:, BOUND].min()) for batch in self.batches if len(batch.rows)]
            bound = min([self.least, *left, *(least for _, least in self.under_way)])
        return Findings(self.heard, bound)
