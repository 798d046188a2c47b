"""Asymmetric Two-Way Bounding (ATWB).

AFB for asymmetric costs: each robot in a constraint pays its own part, which no other robot knows. The robot that holds
the current partial assignment (CPA) computes bounds in both directions at the same time. Robots after it answer with
estimates, as in AFB (forward bounding). Robots before it that share a partially known constraint with it answer with
the costs of their own sides for its new value (backward bounding). Once all of these have answered, the CPA continues
with its exact cost. As soon as the cost so far and the estimates reach the best solution (B), the holder takes its next
value.

- **When to use**: asymmetric costs; fewer messages and checks than SyncABB, but robots disclose more of their costs.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution.
- **Parameters**: none.
- **Reference**: Grinshpoun, Grubshtein, Zivan, Netzer, Meisels: "Asymmetric distributed constraint optimization
  problems", JAIR 47, 2013 (ATWB).

The methods, in addition to those of AFB (`afb.py`):

    backward bounding: ask robots before   `_pass_on`          their answers            `_send_side`
    both costs are known: pass on the CPA  `_assign_cpa`       add them                 `_add_side`

Information disclosed: robots after the holder learn the values in the CPA, its cost, and B. The holder learns bounds on
the costs of robots after it, and, for each robot before it, the cost that its side adds for each value that the holder
tries. In its part towards robots after it, a robot uses only the least entry for each of its values, and the requested
entries; no other entry affects any message.

Choices that the paper leaves open, and differences:

- A request contains the counters of both values, and the answer contains the counter of the holder's value. So a
  request for a value that its receiver has changed is dropped, and so is an answer about a value that the holder has
  changed: a stronger CPA is in transit, or the search has ended.
- A robot's cost in the CPA contains, from the beginning, the least costs of its own parts with robots after it. Its
  answers are the costs of its side in excess of these.
- Totally known constraints are paid by their lowest robot, as in AFB; they may be n-ary.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.random_csp import random_csp
>>> team = random_csp(5, 3, 0.6, 0, max_cost=9, asymmetric=True)
>>> result = Simulation(team, ATWB, Concurrent(seed=0)).run()
>>> result.verdict.value, result.assignments["Robot1"]
('solution', {'V1': 1})
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never, cast

from robochoc.model.problem import INFINITE
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.afb import AFB, CPA, FBCPA, FBEstimate, NewSolution, Terminate
from robochoc.protocols.optimization.afb_bounds import Cost, CostLookup, stamp_of
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LocalProblem


class SideRequest(Message, frozen=True):
    """A request for the cost that the receiver's side of constraints with the sender adds to the CPA.

    This is backward bounding. The sender has taken `value`, its `counter`-th value; the receiver's value in the CPA is
    its `yours`-th.
    """

    value: Value
    counter: int
    yours: int

    act = Act(Performative.QUERY_REF, "the sender asks for the cost that the receiver's side of constraints adds")

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} for now; what does your side of it add?"


class Side(Message, frozen=True):
    """The cost that the sender's side adds, beyond the counted cost, to the CPA with the `counter`-th value."""

    counter: int
    cost: Cost

    act = Act(Performative.INFORM, "the answer to `SideRequest`")

    def in_words(self, _: Wording) -> str:
        return f"my side of it adds {cost_text(self.cost)}"


class KnownSides(CostLookup):
    """The costs of this robot's values, including the received sides of robots before it, each requested once."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self._rank = order.rank
        self._known: dict[tuple[str, Value], dict[int, Cost]] = {}
        """For each value of another robot, that robot's sides by the indices of this robot's values."""

    def knows(self, robot: str, index: int | None) -> bool:
        """Return whether the side of `robot`, with its value in the last CPA, for the value at `index` is known."""
        return index in self._known.get((robot, self._view[robot]), {})

    def add_side(self, robot: str, index: int, cost: Cost) -> None:
        """Add the side of `robot`, with its value in the last CPA, to the cost of the value at `index`."""
        self._known.setdefault((robot, self._view[robot]), {})[index] = cost
        first = self._rank[robot] + 1
        for length in range(first, len(self._rows)):
            row = [*self._rows[length]]
            row[index] += cost
            self._rows[length] = row
            self._depths[length] = max(self._depths[length], first)
            self.estimates[length] = self._estimate(row)

    def _added(self, robot: str) -> Sequence[Cost] | None:
        """Return the additional cost of each value with the value of `robot`, including its side as far as known."""
        more = super()._added(robot)
        sides = self._known.get((robot, self._view[robot]))
        if not sides:
            return more
        own = more or [0] * len(self._problem.values)
        return [cost + sides.get(index, 0) for index, cost in enumerate(own)]


class ATWB(AFB):
    """One agent of ATWB.

    State besides that of AFB:

    - `least`: for each child, the least cost of each value for this robot's parts of constraints with the child.
    - `asked`: the robots before it that have not sent their sides for the value yet; None: the CPA has been passed on.
    """

    messages = CPA | FBCPA | FBEstimate | NewSolution | Terminate | SideRequest | Side
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Grinshpoun, Grubshtein, Zivan, Netzer & Meisels 2013",
        costs=True,
        upper_bound=True,
        partially_known=True,
        asymmetric=True,
        shared_scopes=True,
        privacy="parts of PKC but for entries that are asked for, and bounds",
        use_when="asymmetric costs, fewer messages than syncabb",
    )

    costs: KnownSides

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.least: dict[str, list[Cost]] = {}
        self.asked: set[str] | None = None

    def _cost_lookup(self) -> KnownSides:
        """Return the lookup of this robot's costs, which stores the received sides of robots before it."""
        return KnownSides(self.problem, self.order)

    def start(self) -> None:
        """Compute the least costs of this robot's sides; then begin as in AFB."""
        self.least = {child: self.problem.least_side(child) for child in self.problem.children}
        super().start()

    def receive(self, sender: str, message: Message) -> None:
        match cast("CPA | FBCPA | FBEstimate | NewSolution | Terminate | SideRequest | Side", message):
            case SideRequest() as request:
                self._send_side(sender, request)
            case Side() as side:
                self._add_side(sender, side)
            case CPA() | FBCPA() | FBEstimate() | NewSolution() | Terminate():
                super().receive(sender, message)
            case never:
                assert_never(never)

    # The holder

    def _assign(self, index: int) -> None:
        """Choose a value; its cost includes the least costs of this robot's sides, and known costs of other sides."""
        super()._assign(index)
        self.cost += sum(least[index] for least in self.least.values())

    def _pass_on(self, lower_bounds: list[Cost]) -> bool:
        """Ask robots on both sides for their costs; pass on the CPA if the sides of all robots before it are known.

        Return False if the CPA is complete, or too costly with the known other sides.
        """
        cpa = self._cpa
        if self.cost + self.estimates.totals(stamp_of(cpa))[-1] >= self.bound:
            self.value = None
            return False
        asked = [name for name in self.problem.pkc_parents if not self.costs.knows(name, self.value)]
        if not asked:
            return super()._pass_on(lower_bounds)
        value, counter = cpa[-1]
        self.asked = {*asked}
        for name in asked:
            self.send(name, SideRequest(value, counter, cpa[self.order.rank[name]][1]))
        self._send_fb_cpas(cpa, self.below)
        return True

    def _add_side(self, sender: str, side: Side) -> None:
        """Add the side of a robot before this one, unless the value has changed since."""
        if self.value is None or side.counter != self.counter:
            return
        if self.asked is None or sender not in self.asked:
            raise ValueError(f"{sender} sent a cost that {self.problem.agent} did not request")
        self.asked.remove(sender)
        self.costs.add_side(sender, self.value, side.cost)
        self.cost += side.cost

    def _assign_cpa(self, lower_bounds: list[Cost]) -> None:
        """Keep or choose a value, as in AFB; send the CPA on once all sides of the robots before this one are known."""
        super()._assign_cpa(lower_bounds)
        if self.value is not None and self.asked is not None and not self.asked:
            self.asked = None
            if not super()._pass_on(lower_bounds):
                self._assign_cpa(lower_bounds)

    # The robots before

    def _send_side(self, sender: str, request: SideRequest) -> None:
        """Send the cost of this robot's side beyond the cost in the CPA; drop requests about another value."""
        if sender not in self.problem.children:
            raise ValueError(f"{sender} is not below {self.problem.agent}")
        if self.over or self.value is None or request.yours != self.counter:
            return
        broken, cost = self.problem.own_side(self.value, sender, request.value)
        more = INFINITE if broken else cost - self.least[sender][self.value]
        self.send(sender, Side(request.counter, more))
