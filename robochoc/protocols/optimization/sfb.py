"""Synchronous Forward Bounding (SFB), with many partial assignments at a time.

Complete branch and bound for minimum cost. A current partial assignment (CPA) goes from robot to robot in priority
order, as in SyncBB. Robots without a value are bounded from below, as in AFB. Here the CPA itself carries, for each of
these robots, the cost of each of its values so far, as in partial forward checking. A robot that takes a value adds the
costs of the constraints that it shares with them; all robots of a scope know it. So the holder alone knows the bound,
and prunes before it sends: no estimates are requested.

- **When to use**: costs; it is the default for such problems. It needs few messages.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Memory is bounded
  (`memory`).
- **Parameters (`--set`)**: `batch` (default 4096), `window` (default 1), `memory` (default 64 MiB); see `SFBSettings`.
- **References**: Hirayama, Yokoo: "Distributed partial constraint satisfaction problem", CP 1997 (SyncBB); Gershman,
  Meisels, Zivan: "Asynchronous forward bounding for distributed COPs", JAIR 34, 2009 (AFB); partial forward checking:
  Freuder, Wallace: "Partial constraint satisfaction", AIJ 58, 1992; Larrosa, Meseguer, Schiex: "Maintaining reversible
  DAC for Max-CSP", AIJ 107, 1999.

The methods and messages correspond to AFB's procedures:

    assign_CPA   `_extend`       backtrack      `_explored`
    CPA_MSG      `CPAs`          NEW_SOLUTION   `Solution`

Batches are an addition of this project: one message carries many CPAs, all of the same robots. The first ones go alone,
straight down to a first solution. Then each robot extends twice as many at a time as the time before, up to `batch` and
`memory`, the lowest bounds first. The search stays depth first, by batches. One robot acts at a time. With `window` at
2 or more, robots extend the next CPAs while lower robots work on the last ones, an idea of concurrent search (Zivan,
Meisels: "Concurrent search for distributed CSPs", AIJ 170, 2006). On two cores it gained nothing.

The course of a search: first, two waves tell all robots each other's domains. One goes down the order; one comes back
up, with the charges of the values and an upper bound on all costs. The last robot turns CPAs into solutions. A solution
that is cheaper than all before goes up the order, and every robot stores its value in it; CPAs carry its cost down.
When the first robot has nothing left to extend, the last solution is optimal, or there is none.

The proof, and how it compares: docs/explanation/sfb.md.

Without costs a value is consistent or not: CPAs carry bits instead of costs (`sfb_bits`). The rest is the same.

Constraints may be n-ary: the last but one robot of a scope adds the costs that the last one will pay. Costs are read
from tables that are made before the search (see `LocalProblem.tables`), so all constraint checks are done by then.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.solver.agent_problem import RunParameters
>>> result = Simulation(queens3d(4), SFB, Concurrent(seed=0), parameters=RunParameters(withdrawal_cost=1)).run()
>>> sum(bool(values) for values in result.assignments.values())  # of 16, and no more can fly
10
>>> result.findings["Robot1.1"].bound
6
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, assert_never, cast

from robochoc.model.message import Message
from robochoc.model.outcome import Verdict
from robochoc.protocols.findings import NOTHING, Findings, Incumbent
from robochoc.protocols.optimization.interchangeable import expanded, fits
from robochoc.protocols.optimization.messages.sfb import Above, Below, Charges, CPAs, Domain, Explored, Solution
from robochoc.protocols.optimization.settings.sfb import MIB, SFBSettings
from robochoc.protocols.optimization.sfb_bits import ForwardBits
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.exact_costs import EXACT, check_exact

if TYPE_CHECKING:
    from robochoc.protocols.optimization.sfb_bounds import ForwardBounds

    Bounds = ForwardBounds | ForwardBits

LARGEST = 4 * MIB
"""No message of several CPAs has more bytes of them, however much memory there is: runtimes have limits, too."""


class Batch:
    """The content of one message: `rows` are still to be extended; `ready` is extended, and waits to be sent.

    `sent` is the number of its messages that are not yet explored.
    """

    def __init__(self, rows: Any, bounds: Bounds) -> None:  # noqa: ANN401 - rows of either form
        self.rows = rows
        self.ready = rows[:0]
        self.sent = 0
        self._bounds = bounds

    @property
    def left(self) -> bool:
        """Whether something is still to be sent."""
        return bool(len(self.rows) or len(self.ready))

    @property
    def bound(self) -> int | None:
        """The minimum lower bound of the rows still to be sent; None if there are none."""
        return min((self._bounds.least(rows) for rows in (self.rows, self.ready) if len(rows)), default=None)

    def take(self, count: int, upper_bound: int) -> Any:  # noqa: ANN401 - as above
        """Remove the next `count` rows and return those with a lower bound below `upper_bound`."""
        rows, self.rows = self.rows[:count], self.rows[count:]
        return self._bounds.below(rows, upper_bound)

    def part(self, count: int, upper_bound: int) -> Any:  # noqa: ANN401 - as above
        """Return the next `count` ready rows with a lower bound below `upper_bound`; the others keep waiting."""
        rows = self._bounds.below(self.ready, upper_bound)
        self.ready = rows[count:]
        return rows[:count]


class SFB(Protocol):
    """One agent. State: the `batches` that it is to explore, the oldest first, and the `best` solution.

    - `upper_bound`: the cost of the best solution.
    - `under_way`: for each unanswered message to the next robot, its batch and its minimum lower bound.
    - `width`: the number of CPAs to extend next. `first_sent`: the first CPA was sent, alone.
    - `bounds`: the costs that this robot adds to CPAs; set once it knows all values, complete with the `ceiling`.
    """

    bounds: Bounds
    messages = Above | Below | CPAs | Explored | Solution
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Hirayama & Yokoo 1997; Gershman, Meisels, Zivan 2009",
        synchronous=True,
        costs=True,
        shared_scopes=True,
        tables=True,
        use_when="what auto mostly takes, with or without costs: few messages",
    )
    settings: ClassVar[SFBSettings] = SFBSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.previous = order.names[self.rank - 1] if self.rank else None
        self.next = order.names[self.rank + 1] if self.rank + 1 < len(order.names) else None
        self.domains: list[Domain] = []
        self.best: Solution | None = None
        self.upper_bound = self.ceiling = 0
        self.batches: deque[Batch] = deque()
        self.under_way: deque[tuple[Batch, int]] = deque()
        self.width = 1
        self.first_sent = False

    def start(self) -> None:
        """Send the own values, as the first robot; a robot with an empty domain ends the search."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.previous is None:
            self._tell_below([])
            self.settle()
        if self.problem.values and not self.problem.has_costs:
            self.problem.look_ahead()

    def receive(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type. Raises `ValueError` for a message that is not possible at this point."""
        if self.verdict is not None:
            return
        heard = cast("Above | Below | CPAs | Explored | Solution", message)
        if not self._expects(sender, heard):
            raise ValueError(f"{sender} says {type(message).__name__}, which it cannot say now")
        match heard:
            case Above(domains, runs):
                self._tell_below(expanded(domains, runs))
            case Below() as below:
                self._tell_above(below.robots, below.most)
            case CPAs() as cpas:
                self._process_cpas(cpas)
            case Explored():
                batch, _ = self.under_way.popleft()
                batch.sent -= 1
            case Solution() as solution:
                self._process_solution(solution)
            case never:
                assert_never(never)

    def _expects(self, sender: str, message: Above | Below | CPAs | Explored | Solution) -> bool:
        """Return whether `sender`, the robot before or the next one, may send `message` at this point."""
        match message:
            case Above(domains, runs):
                fitting = fits(len(domains), runs, self.rank)
                return sender == self.previous and not self.domains and fitting
            case Below(domains, charges, runs):
                alike = len(domains) == len(charges) and all(map(_same_length, domains, charges))
                fitting = alike and fits(len(domains), runs, len(self.order.names) - self.rank - 1)
                return sender == self.next and bool(self.domains) and not self._priced and fitting
            case CPAs(_, _, least, ceiling):
                return sender == self.previous and self._priced and least >= 0 and 0 < ceiling <= EXACT
            case Explored():
                return sender == self.next and bool(self.under_way)
            case Solution(_, places):
                sizes = [len(domain) for domain in self.domains]
                fitting = len(places) == len(sizes) and all(
                    0 <= p < size for p, size in zip(places, sizes, strict=True)
                )
                return sender == self.next and fitting
            case never:
                assert_never(never)

    @property
    def _priced(self) -> bool:
        """Whether all robots' values are known, and the constraints with them evaluated."""
        return hasattr(self, "bounds")

    def settle(self) -> None:
        """Extend CPAs while messages may be sent; report explored batches."""
        while self.batches and self.verdict is None:
            batch = next((batch for batch in self.batches if batch.left), None)
            if not self.batches[0].left and not self.batches[0].sent:
                self.batches.popleft()
                self._explored()
            elif batch is not None and len(self.under_way) < self.settings.window:
                self._extend(batch)
            else:
                return

    # Before the search

    def _tell_below(self, domains: Sequence[Domain]) -> None:
        self.domains = [*domains, self.problem.values]
        if self.next is None:
            self._tell_above([], 0)
        else:
            self.send(self.next, Above.of(self.domains))

    def _tell_above(self, below: Sequence[tuple[Domain, Charges]], most: int) -> None:
        """Store all robots' values and evaluate the constraints; the first robot begins the search."""
        own = self.problem.values, tuple(map(_whole, self.problem.costs({})))
        self.domains += [domain for domain, _ in below]
        self.bounds = self._made_bounds()
        most += self.bounds.most + max_finite(own[1])
        check_exact(most)
        if self.previous is not None:
            self.send(self.previous, Below.of([own, *below], most))
        else:
            self._count_up_to(most + 1)
            self.batches.append(Batch(self.bounds.nothing([own[1], *(charges for _, charges in below)]), self.bounds))

    def _made_bounds(self) -> Bounds:
        if self.problem.has_costs:
            from robochoc.protocols.optimization.sfb_bounds import ForwardBounds  # noqa: PLC0415 - start-up: numpy

            return ForwardBounds(self.problem, self.order, self.domains)
        return ForwardBits(self.problem, self.order, self.domains)

    def _count_up_to(self, ceiling: int) -> None:
        self.bounds.count_up_to(ceiling)
        self.upper_bound = self.ceiling = ceiling

    # The search

    def _process_cpas(self, cpas: CPAs) -> None:
        """Store the received CPAs and their upper bound."""
        if not self.ceiling:
            self._count_up_to(cpas.ceiling)
        self.upper_bound = min(self.upper_bound, cpas.least)
        self.batches.append(Batch(self.bounds.read(cpas.rows, cpas.count), self.bounds))

    def _extend(self, batch: Batch) -> None:
        """Extend the next CPAs if none are ready, and send those that may lead to a cheaper solution."""
        if self.next is None:
            self._complete(batch.take(len(batch.rows), self.upper_bound))
            return
        fit = max(1, self.share // self.bounds.width)
        if not len(batch.ready):
            many = max(1, fit // len(self.problem.values))
            batch.ready = self.bounds.extended(batch.take(min(self.width, many), self.upper_bound), self.upper_bound)
            self.width = min(2 * self.width, self.settings.batch)
        rows = batch.part(fit if self.first_sent else 1, self.upper_bound)
        if len(rows):
            self.first_sent = True
            batch.sent += 1
            self.under_way.append((batch, self.bounds.least(rows)))
            self.send(self.next, CPAs(len(rows), self.bounds.packed(rows), self.upper_bound, self.ceiling))

    @property
    def share(self) -> int:
        """The bytes that one message of CPAs may take."""
        return min(LARGEST, self.settings.memory // (len(self.order.names) * self.settings.window))

    def _complete(self, rows: Any) -> None:  # noqa: ANN401 - of either form
        """Complete the CPAs, as the last robot; the cheapest one is a solution if it costs less than the best."""
        if len(rows):
            cost, places = self.bounds.completed(rows)
            if cost < self.upper_bound:
                self._process_solution(Solution(cost, places))

    def _process_solution(self, solution: Solution) -> None:
        """Store the own value of a cheaper solution, and send it on to the robots above."""
        self.best = solution
        self.upper_bound = solution.cost
        self.value = solution.places[self.bounds.rank]
        if self.previous is not None:
            self.send(self.previous, solution)

    def _explored(self) -> None:
        """Report the oldest batch as explored; for the first robot, the search is over."""
        if self.previous is not None:
            self.send(self.previous, Explored())
        elif self.best is None:
            self.conclude(Verdict.NO_SOLUTION)

    # What is known so far

    @property
    def incumbent(self) -> Incumbent | None:
        """The best solution that this robot knows."""
        if self.best is None:
            return None
        chosen = zip(self.order.names, self.domains, self.best.places, strict=True)
        return Incumbent(self.best.cost, {name: values[place] for name, values, place in chosen})

    @property
    def findings(self) -> Findings:
        """The best known solution; for the first robot also the minimum lower bound of all that is unexplored."""
        if not self.ceiling:
            return NOTHING
        bound = None
        if self.previous is None:
            left = [batch.bound for batch in self.batches if batch.bound is not None]
            bound = min([self.upper_bound, *left, *(least for _, least in self.under_way)])
        return Findings(self.incumbent, bound)


def _whole(cost: float) -> float:
    """Return `cost` as an integer if it is finite: integers take fewer bytes in a message."""
    return cost if cost == math.inf else int(cost)


def max_finite(charges: Sequence[float]) -> int:
    """Return the largest finite charge."""
    return int(max((charge for charge in charges if charge < math.inf), default=0))


def _same_length(domain: Domain, charges: Charges) -> bool:
    return len(domain) == len(charges)
