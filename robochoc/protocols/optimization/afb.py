"""Asynchronous Forward Bounding (AFB), with backjumping (AFB-BJ).

Complete search for minimum cost with a current partial assignment (CPA), which goes from robot to robot in priority
order. Copies of the CPA go to all lower robots, which answer with an estimate: a lower bound on the cost of adding
their own values. The sender does not wait. Once the CPA and the estimates cost as much as the best solution (B), the
sender takes its next value, wherever the CPA is at that moment. So there may be several CPAs. Each value carries its
robot's counter of assignments; together, these counters are the time-stamp of the CPA. The first counter that differs
decides which CPA is stronger; the others are obsolete.

- **When to use**: costs, a dense graph, little memory.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution.
- **Parameters**: none.
- **Reference**: Gershman, Meisels, Zivan: "Asynchronous forward bounding for distributed COPs", JAIR 34, 2009.

The methods have the names of its procedures, or of the messages that they handle:

    assign_CPA    `_assign_cpa`       CPA_MSG        `_receive_cpa`
    backtrack     `_backtrack`        FB_CPA         `_receive_fb_cpa`, `_send_fb_estimates`
    backtrackTo   `_backtrack_to`     FB_ESTIMATE    `Estimates.save`
                                      NEW_SOLUTION   `_receive_new_solution`

Backjumping: if no value is cheap enough, a prefix of the CPA may already be the cause. So a robot sends an estimate for
each prefix, and a CPA carries a lower bound for each of its prefixes (`least`): the costs of its own robots, and the
estimates of all robots after the prefix that the CPA has passed. Together with the estimates of lower robots, this is a
lower bound for the whole team. The CPA goes back to the last robot of the shortest prefix whose bound is not below B,
because no solution with that prefix is better. (The paper's bound has no estimates from the robots in between. Wahbi,
Ezzahir,
Bessiere: "Asynchronous forward bounding revisited", CP 2013, also send one bound for each prefix.)

An estimate is the minimum, over the robot's values, of the cost with the prefix plus h, a lower bound on constraints
with lower robots only. So each constraint is in at most one term: in its highest robot's h until that robot has a
value; later, once all other robots in the scope have values, in the estimate of the lowest robot, which finally pays
it. h is computed from the declared domains, without messages; for robots that may withdraw it is 0.

Choices that the paper leaves open, and differences:

- Messages are read in packets; a robot decides when the inbox has been drained.
- Constraints may be n-ary. Values are tried by increasing cost.
- Estimates are kept as long as their prefix is valid. Robots are asked only when their estimates may have changed, and
  answer only with new estimates. The next robot's answer is about the CPA itself.
- A robot also checks its bound when B has changed, and when the CPA arrives.
- Every CPA carries B, so that no robot concludes that there is no solution while the message about a solution is in
  transit.
- A robot that finds that no prefix allows a better solution ends the search (`Terminate`), and sends B with it: the
  message about the best solution may arrive later, and the first robot reports B as a lower bound of all solutions.
- A robot with an empty domain reports it at the start.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), AFB, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import (
    NOTHING,
    EveryValuePays,
    HasValue,
    Proof,
    Reception,
    SomeValuePays,
    Total,
    partial_assignment,
)
from robochoc.protocols.findings import Findings, Incumbent
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.afb_bounds import (
    Assignment,
    Cost,
    CostLookup,
    CPAEstimates,
    Estimates,
    common_length,
    stamp_of,
)
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text, costs_text, incumbent_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted


class CPA(Message, frozen=True):
    """The current partial assignment of all robots from the first one to the sender (`CPA_MSG`).

    If its last value is the receiver's own, it was sent back: no extension of it costs less than `bound` (B). On the
    way down, `least` contains a lower bound for each of its prefixes, the empty prefix first.
    """

    assignments: list[Assignment]
    bound: Cost
    least: list[Cost]

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        values = words.partial([value for value, _ in self.assignments])
        if self.least:
            known = incumbent_text(self.bound)
            turn = f"it is {words.receiver}'s turn"
            return f"so far {values}, which costs at least {cost_text(self.least[-1])}; {known}; {turn}"
        if math.isinf(self.bound):
            return f"no solution has {values}: take another value"
        return f"no solution with {values} costs less than {cost_text(self.bound)}: take another value"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The cost of the CPA; if it was sent back, a lower bound on the last robot's cost.
        values = [value for value, _ in self.assignments]
        found = partial_assignment(reception.order, values)
        view = dict(zip(reception.order, values, strict=False))
        if self.least:
            return [*found, Total(view, self.least[-1])]
        sent = reception.last(CPA, reception.receiver, reception.sender)
        if sent and sent.least and sent.assignments == self.assignments and reception.is_lowest(reception.sender):
            found.append(EveryValuePays(reception.sender, view, self.bound - sent.least[-1]))
        return found


class FBCPA(Message, frozen=True):
    """A copy of the CPA down to the sender, which requests the receiver's estimate (`FB_CPA`)."""

    assignments: list[Assignment]

    act = Act(Performative.QUERY_REF, "the sender asks for the costs that the receiver adds to the CPA")

    def in_words(self, words: Wording) -> str:
        values = words.partial([value for value, _ in self.assignments])
        return f"so far {values}; what does a value of yours add to it at least?"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return partial_assignment(reception.order, [value for value, _ in self.assignments])


class FBEstimate(Message, frozen=True):
    """Lower bounds on the cost of adding a value of the sender to each prefix of the CPA (`FB_ESTIMATE`).

    The empty prefix is first; the last estimate also holds for all longer prefixes. `stamp` is the CPA's time-stamp.
    """

    stamp: Sequence[int]
    estimates: Sequence[Cost]

    act = Act(Performative.INFORM, "the answer to `FBCPA`")

    def in_words(self, _: Wording) -> str:
        length = counted(len(self.stamp), "value")
        last = f"a value of mine adds at least {cost_text(self.estimates[-1])} to a CPA of {length}"
        shorter = self.estimates[:-1]
        if not shorter:
            return last
        return f"{last}; to its beginnings, the empty one first, at least {costs_text(shorter)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The last robot's estimates contain no costs of robots below.
        asked = [
            reception.last(CPA, reception.receiver, reception.sender),
            reception.last(FBCPA, reception.receiver, reception.sender),
        ]
        for_these = [one.assignments for one in asked if one and stamp_of(one.assignments) == [*self.stamp]]
        if not for_these:
            return NOTHING
        found: list[Proof] = []
        values = [value for value, _ in for_these[0]]
        for length, estimate in enumerate(self.estimates):
            view = dict(zip(reception.order, values[:length], strict=False))
            found.append(SomeValuePays(reception.sender, view, estimate))
            if reception.is_lowest(reception.sender):
                found.append(EveryValuePays(reception.sender, view, estimate))
        return found


class NewSolution(Message, frozen=True):
    """The best solution so far: the values of all robots in priority order, and their cost B (`NEW_SOLUTION`)."""

    values: list[Value]
    cost: Cost

    act = Act(Performative.INFORM, "the receiver learns the best solution so far")

    def in_words(self, words: Wording) -> str:
        return f"the best solution so far costs {cost_text(self.cost)}: {words.partial(self.values)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # Robots take these values unless a better solution follows.
        view = dict(zip(reception.order, self.values, strict=False))
        return [Total(view, self.cost), *(HasValue(robot, value) for robot, value in view.items())]


class Terminate(Message, frozen=True):
    """The end of the search: no solution costs less than `bound`, the cost of the best one found (`TERMINATE`)."""

    bound: Cost

    act = acts.TERMINATE

    def in_words(self, _: Wording) -> str:
        return f"the search is over: no solution costs less than {cost_text(self.bound)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The last robot learns that its last solution is final.
        best = reception.last(NewSolution, reception.receiver, reception.sender)
        if best is None:
            return NOTHING
        return [HasValue(robot, value) for robot, value in zip(reception.order, best.values, strict=False)]


@mypyc_attr(allow_interpreted_subclasses=True)
class AFB(Protocol):
    """One agent of AFB. State: the strongest known CPA (`assignments`), this robot's `counter`, and `bound` (B).

    These are set while this robot holds a CPA or has passed it on:

    - `lower_bounds`: a lower bound for each prefix of the CPA, including this robot's estimate.
    - `paid`: the cost of the CPA. `cost`: the cost including this robot's value.
    - `left`: the values not yet tried, the most costly first.

    `solution` is the best solution that this robot knows.
    """

    messages: ClassVar[Any] = CPA | FBCPA | FBEstimate | NewSolution | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Gershman, Meisels & Zivan 2009",
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        privacy="constraints that a robot has no part in",
        use_when="costs, dense graph, little memory",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.below = order.names[self.rank + 1 :]
        self.assignments: list[Assignment] = []
        self.counter = 0
        self.bound: Cost = problem.upper_bound
        self.solution: NewSolution | None = None
        self.over = False
        self.costs = self._cost_lookup()
        self.estimates = Estimates()
        self.lower_bounds: list[Cost] | None = None
        self.paid: Cost = 0
        self.cost: Cost = 0
        self.left: list[int] = []
        self._came: list[Cost] | None = None
        self._asked: dict[str, list[Assignment]] = {}
        self._sent_estimates: dict[str, CPAEstimates] = {}

    def _cost_lookup(self) -> CostLookup:
        """Return the lookup of this robot's costs; overridden in subclasses that know more costs."""
        return CostLookup(self.problem, self.order)

    def start(self) -> None:
        """Create the CPA, as the first robot; other robots wait."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.costs.look_ahead()
        if self.rank == 0:
            self._came = [0]
            self.settle()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None or (self.over and not isinstance(message, NewSolution)):
            return
        match cast("CPA | FBCPA | FBEstimate | NewSolution | Terminate", message):
            case CPA() as cpa:
                self._receive_cpa(sender, cpa)
            case FBCPA(assignments):
                self._receive_fb_cpa(sender, assignments)
            case FBEstimate(stamp, estimates):
                self.estimates.save(sender, CPAEstimates(stamp, estimates))
            case NewSolution() as solution:
                self._receive_new_solution(solution)
            case Terminate(bound):
                self.bound = min(self.bound, bound)  # the best solution may arrive later
                self._stop()
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Process the CPA, then answer the requests for estimates."""
        if self.over or self.verdict is not None:
            return
        came, self._came = self._came, None
        if came is not None:
            self._start_cpa(came)
        if self.lower_bounds is not None:
            self._assign_cpa(self.lower_bounds)
        self._send_fb_estimates()

    @property
    def incumbent(self) -> Incumbent | None:
        """The best solution that this robot knows."""
        if self.solution is None:
            return None
        return Incumbent(self.solution.cost, dict(zip(self.order.names, self.solution.values, strict=True)))

    @property
    def findings(self) -> Findings:
        """The best solution that this robot knows; for the first robot also a lower bound on all solutions."""
        return Findings(best=self.incumbent, bound=self._bound_of_all())

    # Messages

    def _receive_cpa(self, sender: str, cpa: CPA) -> None:
        """Continue a CPA that is not obsolete; a CPA that returns with the current value rules that value out."""
        self.bound = min(self.bound, cpa.bound)
        if len(cpa.assignments) > self.rank:
            if cpa.assignments[-1][1] == self.counter:
                self.value = None
        elif self._update(cpa.assignments):
            self._came = cpa.least
            self._asked[sender] = cpa.assignments

    def _receive_fb_cpa(self, sender: str, assignments: list[Assignment]) -> None:
        """Record a request for an estimate, unless its CPA is obsolete."""
        if self._update(assignments):
            self._asked[sender] = assignments

    def _receive_new_solution(self, solution: NewSolution) -> None:
        """Record a solution. Only the last robot finds solutions, each better than the one before."""
        self.solution = solution
        self.bound = min(self.bound, solution.cost)
        if self.over:
            self._adopt_best()

    def _update(self, assignments: list[Assignment]) -> bool:
        """Return whether a CPA is not obsolete. Keep the strongest CPA; drop the work on a weaker one."""
        common = common_length(stamp_of(assignments), stamp_of(self.assignments))
        if common == len(assignments):
            return True
        if common < len(self.assignments) and assignments[common][1] < self.assignments[common][1]:
            return False
        self.assignments = assignments
        self.lower_bounds = self._came = self.value = None
        return True

    # The holder of the CPA

    def _start_cpa(self, lower_bounds: list[Cost]) -> None:
        """Compute the costs of all values for the CPA, unless its bound already rules it out."""
        self.lower_bounds, self.paid, self.left = lower_bounds, lower_bounds[-1], []
        if self._backtrack_to(lower_bounds, self.estimates.totals(stamp_of(self.assignments))) is None:
            self.costs.look_up(self.assignments)
            self.lower_bounds = [cost + more for cost, more in zip(lower_bounds, self.costs.estimates, strict=True)]
            self.left = self.costs.by_decreasing_cost()

    def _assign_cpa(self, lower_bounds: list[Cost]) -> None:
        """Keep the value while its bound is below B; otherwise choose the cheapest remaining value, or backtrack."""
        while True:
            totals = self.estimates.totals(stamp_of(self._cpa))
            shortest = self._backtrack_to(lower_bounds, totals)
            if shortest is not None:
                self._backtrack(shortest)
                return
            if self.value is not None:
                if self.cost + totals[-1] < self.bound:
                    return
                self.value = None
            if not self.left or self.paid + self.costs.lower_bound(self.left[-1]) + totals[self.rank] >= self.bound:
                self._backtrack(self.rank)
                return
            self._assign(self.left.pop())
            if self._pass_on(lower_bounds):
                return

    def _pass_on(self, lower_bounds: list[Cost]) -> bool:
        """Send the CPA with this robot's value to the next robot. Return False if the CPA is complete, a solution."""
        if not self.below:
            self._send_new_solution()
            return False
        self._send_cpa(lower_bounds)
        return True

    def _assign(self, index: int) -> None:
        self.value = index
        self.counter += 1
        self.cost = self.paid + self.costs.last[index]

    def _send_cpa(self, lower_bounds: list[Cost]) -> None:
        """Send the CPA to the next robot, and copies to all robots whose estimates may change."""
        cpa = self._cpa
        self.send(self.below[0], CPA(cpa, self.bound, [*lower_bounds, self.cost]))
        self.estimates.ask(self.below[0], stamp_of(cpa))
        self._send_fb_cpas(cpa, self.below[1:])

    def _send_fb_cpas(self, cpa: list[Assignment], robots: Sequence[str]) -> None:
        """Ask the `robots` whose estimates may change."""
        stamp = stamp_of(cpa)
        for robot in robots:
            if self.estimates.outdated(robot, stamp):
                self.send(robot, FBCPA(cpa))
                self.estimates.ask(robot, stamp)

    def _send_new_solution(self) -> None:
        """Send a complete CPA that is cheaper than B to all robots."""
        self.bound = self.cost
        self.solution = NewSolution([value for value, _ in self._cpa], self.cost)
        for robot in self.order.names[: self.rank]:
            self.send(robot, self.solution)
        self.value = None

    def _backtrack_to(self, lower_bounds: list[Cost], totals: list[Cost]) -> int | None:
        """Return the length of the shortest prefix of the CPA with a bound of at least B; None if there is none."""
        pairs = enumerate(zip(lower_bounds, totals, strict=False))
        return next((length for length, (cost, more) in pairs if cost + more >= self.bound), None)

    def _backtrack(self, length: int) -> None:
        """Send the CPA back to the last robot in its prefix of this `length`, which has no better solution."""
        self.lower_bounds = self.value = None
        self._asked = {robot: asked for robot, asked in self._asked.items() if len(asked) < length}
        if length:
            self.send(self.order.names[length - 1], CPA(self.assignments[:length], self.bound, []))
        elif self.bound == self.problem.upper_bound:
            self.conclude(Verdict.NO_SOLUTION)
        else:
            self._stop()
            for robot in self.order.names:
                if robot != self.problem.agent:
                    self.send(robot, Terminate(self.bound))

    # The other robots, and the end

    def _send_fb_estimates(self) -> None:
        """Send estimates to all robots that requested them and whose CPA is not obsolete."""
        asked, self._asked = self._asked, {}
        for robot, assignments in asked.items():
            length = len(assignments)
            if self.assignments[:length] == assignments:
                self.costs.look_up(assignments)
                estimates = CPAEstimates(stamp_of(assignments), self.costs.shared(length))
                if robot not in self._sent_estimates or not estimates.follows(self._sent_estimates[robot]):
                    self._sent_estimates[robot] = estimates
                    self.send(robot, FBEstimate(estimates.stamp, estimates.estimates))

    def _stop(self) -> None:
        self.over = True
        self._adopt_best()

    def _adopt_best(self) -> None:
        """Adopt this robot's value in the best solution. The solution may arrive after `Terminate`."""
        self.value = None if self.solution is None else self.problem.values.index(self.solution.values[self.rank])

    def _bound_of_all(self) -> Cost | None:
        """Return a lower bound on every solution, at most B; None if this robot does not know one."""
        if self.rank or (self.lower_bounds is None and not self.over):
            return None
        if self.over:
            return self.bound
        totals = self.estimates.totals(stamp_of(self._cpa))
        ways = [self.bound]
        if self.value is not None:
            ways.append(self.cost + totals[-1])
        if self.left:
            ways.append(self.costs.lower_bound(self.left[-1]) + totals[0])
        return min(ways)

    @property
    def _cpa(self) -> list[Assignment]:
        """The CPA, with this robot's value if it has one."""
        if self.value is None:
            return self.assignments
        return [*self.assignments, (self.problem.values[self.value], self.counter)]
