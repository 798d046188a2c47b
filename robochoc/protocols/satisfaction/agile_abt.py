"""Agile Asynchronous Backtracking (Agile-ABT).

ABT with an order that changes at dead ends; any robot may move. An Ok contains the sender's value and its explanation:
the robots on which its nogoods depend, and its number of remaining values. A robot without a value left may send the
nogood to any robot in the conflict. For each of these it computes an order that is compatible with all its
explanations, extended by the new nogood, with robots with few remaining values first. If the least termination vector
of these orders is smaller than that of the current order, the robot adopts that order and sends it to all robots.
Otherwise it keeps its order and sends the nogood to the lowest-priority robot in the conflict. A robot that receives an
order adopts it if it is stronger: its vector is smaller, or equal and its names come first.

- **When to use**: no costs, and no good static order is known. Messages are large.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial.
- **Parameters**: none.
- **Reference**: Bessiere, Bouyakhf, Mechqrane, Wahbi: "Agile asynchronous backtracking for distributed constraint
  satisfaction problems", ICTAI 2011.

It follows the paper's ideas (explanations, termination vectors, orders that only become stronger), with these methods:

    UpdateExplanations   `agile_order.updated`     choose an order   `_choose_order`
    ComputeOrder         `agile_order.ordered`     adopt an order    `_check_order`

Termination: each order that a robot makes or adopts is stronger than the one before, and there are finitely many
orders, because numbers of remaining values are between 0 and the domain's size, or unknown. So changes of order cease,
however inexact the numbers are. All robots then have the strongest order ever made, because each order was sent to all.
From then on the protocol is ABT.

Correctness: nogoods follow from the constraints in any order, so the empty nogood proves that there is no solution. At
quiescence all orders are equal, and each robot's value agrees with its view of higher robots. The view is complete:
each robot stores the last value that it sent to each robot (`sent_values`), and sends its value to lower robots that
have another one, or that dropped it when they sent a nogood.

Choices that the paper leaves open, and differences:

- Constraints may be n-ary. The robot in the scope that is lowest at present checks them.
- An order is sent only in separate messages, not with each Ok and Nogood. A nogood that arrives before its order is
  dropped as obsolete, and its sender receives the value again if it is lower.
- The age of a value is its position in its channel, not a counter.
- A robot whose domain size is unknown counts as having `UNKNOWN` values left, more than any other robot.
- Values are checked one by one until one is consistent, so the remaining values are those without a nogood so far.
- Messages are read in packets. As in `abt.py`, of several nogoods for a value the one with the highest possible lowest
  variable is kept, and a nogood contains only the relevant variables.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> Simulation(queens3d(4), AgileABT, Concurrent(seed=0)).run().verdict.value
'no-solution'
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.agile_abt_messages import AddLink, Ok, Order
from robochoc.protocols.satisfaction.agile_order import (
    UNKNOWN,
    Explanation,
    Explanations,
    Proposal,
    TerminationVector,
    compatible,
    proposed,
    updated,
)
from robochoc.protocols.satisfaction.backtracking import Backtracking
from robochoc.protocols.satisfaction.nogood import LeftSide, NogoodStore, contradicts, joined
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class AgileABT(Backtracking):
    """One agent of Agile-ABT.

    State: `present` (o_i) and `termination` (TV_i), `view` (AgentView), `store` (NogoodStore), `explanations` (E_i),
    and the received domain `sizes`. `higher` are robots that send their values to this one while they have higher
    priority. It sends its own value to `listeners` while they have lower priority; `sent_values` are the last values
    sent to them.
    """

    messages: ClassVar[Any] = Ok | Nogood | Order | AddLink
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Bessiere et al. 2011",
        shared_scopes=True,
        privacy="none",
        use_when="no costs, and no good static order is known; large messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.name = problem.agent
        self.present = order
        self.termination: TerminationVector = (UNKNOWN,) * len(order.names)
        self.explanations: dict[str, Explanation] = {}
        self.sizes = {self.name: len(problem.values)}
        self.higher = set(problem.neighbours)
        self.listeners = list(problem.neighbours)
        self.sent_values: dict[str, Value] = {}

    def start(self) -> None:
        """Choose a first value and send it."""
        self._check_agent_view()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Ok | Nogood | Order | AddLink", message):
            case Ok() as ok:
                self._process_info(sender, ok)
            case Nogood() as nogood:
                self._resolve_conflict(sender, nogood)
            case Order() as order:
                self._process_order(order)
            case AddLink():
                self._set_link(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        if self.verdict is None:
            self._check_agent_view()

    # Messages

    def _process_info(self, sender: str, ok: Ok) -> None:
        """Store a received value and its explanation."""
        self._update(sender, ok.value)
        self.sizes[sender] = ok.size
        self.explanations[sender] = Explanation(ok.lhs, ok.left)

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        """Accept a nogood about the current value that agrees with order and view; all other nogoods are obsolete."""
        last = self.sent_values.get(sender)
        if last is not None and not contradicts(nogood.value, last):
            del self.sent_values[sender]  # the sender has forgotten it; a newer value would be in transit
        current = self._current()
        if current is None or contradicts(nogood.value, current) or not self._coherent(nogood):
            return
        self._check_add_link(nogood)
        for index in self.problem.interchangeable(nogood.value):
            self.store.add(index, nogood.lhs)
        self.value = None

    def _process_order(self, order: Order) -> None:
        self._check_order(tuple([self.order.names[place] for place in order.places]), order.termination)

    def _set_link(self, sender: str) -> None:
        """Add the sender to the listeners, and send it the value if it has lower priority now."""
        if sender not in self.listeners:
            self.listeners.append(sender)
        self.sent_values.pop(sender, None)

    # The search

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another value or backtrack; then send it."""
        while self.verdict is None:
            above = self._above()
            if self.value is None or not self._consistent(self.value, above):
                self.value = self._choose_value(above)
            if self.value is not None:
                self._send_value(self.problem.values[self.value])
                return
            self._backtrack()

    def _send_value(self, value: Value) -> None:
        """Send the value to all lower listeners that were last sent another value, or none."""
        rank = self.present.rank
        below = [
            name for name in self.listeners if rank[name] > rank[self.name] and self.sent_values.get(name) != value
        ]
        if below:
            lhs, left = self._own_explanation()
            ok = Ok(value, dict(lhs), left, len(self.problem.values))
            for name in below:
                self.send(name, ok)
                self.sent_values[name] = value

    def _backtrack(self) -> None:
        """Resolve the stored nogoods, one for each value, and send the result to a robot in it."""
        conflict = self.store.resolve()
        if not conflict:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self._choose_order(conflict)
        self.send(culprit, Nogood(_without(culprit, conflict), conflict[culprit]))
        self._update(culprit, None)

    # The order

    def _choose_order(self, conflict: LeftSide) -> str:
        """Return the robot to send `conflict` to; adopt and send a smaller order if there is one.

        Without a smaller order, it is the lowest-priority robot in the conflict.
        """
        held = self._held_explanations()
        best = min(
            (self._proposed(culprit, conflict, held) for culprit in conflict),
            key=lambda proposal: (proposal.termination, proposal.names),
        )
        smaller = best.termination < self.termination
        culprit = best.culprit if smaller else self.present.lowest(conflict)
        self.explanations = updated(held, culprit, _without(culprit, conflict), self.sizes)
        if smaller:
            self._check_order(best.names, best.termination)
            order = Order(tuple([self.order.rank[name] for name in best.names]), best.termination)
            for name in self.order.names:
                if name != self.name:
                    self.send(name, order)
        return culprit

    def _proposed(self, culprit: str, conflict: LeftSide, held: Explanations) -> Proposal:
        """Return the order in which `culprit` receives the nogood; nogoods with its value will be dropped."""
        explanations = {**held, self.name: self._own_explanation(culprit)}
        return proposed(self.present.names, culprit, _without(culprit, conflict), explanations, self.sizes)

    def _check_order(self, names: tuple[str, ...], termination: TerminationVector) -> None:
        """Adopt an order if it is stronger; drop the nogoods that are not compatible with it."""
        if (termination, names) >= (self.termination, self.present.names):
            return
        before, self.store = self.store, NogoodStore(PriorityOrder(names), len(self.problem.values))
        self.present = PriorityOrder(names)
        self.termination = termination
        for index in range(len(self.problem.values)):
            lhs = before[index]
            if lhs is not None and compatible(self.present, self.name, lhs):
                self.store.add(index, lhs)

    def _own_explanation(self, forgotten: str = "") -> Explanation:
        """Return this robot's explanation without nogoods that contain the robot `forgotten`."""
        kept = [lhs for lhs in self.store if forgotten not in lhs]
        union: dict[str, Value] = {}
        for lhs in kept:
            for agent, value in lhs.items():
                union[agent] = joined(union.get(agent), value)
        return Explanation(union, len(self.problem.values) - len(kept))

    def _held_explanations(self) -> dict[str, Explanation]:
        """Return the explanations that agree with order and view; this robot has no value left."""
        return {
            name: one
            for name, one in self.explanations.items()
            if compatible(self.present, name, one.lhs)
            and self.name not in one.lhs
            and not any(agent in self.view and contradicts(value, self.view[agent]) for agent, value in one.lhs.items())
        }

    # The view

    def _above(self) -> dict[str, Value]:
        """Return the known values of higher-priority robots, on which constraint checks and nogoods may depend."""
        rank = self.present.rank
        return {name: value for name, value in self.view.items() if rank[name] < rank[self.name]}

    def _coherent(self, nogood: Nogood) -> bool:
        """Return whether all robots in the left side are higher and their values do not contradict it."""
        return compatible(self.present, self.name, nogood.lhs) and all(
            agent in self.view and not contradicts(value, self.view[agent])
            for agent, value in nogood.lhs.items()
            if agent in self.higher
        )

    def _check_add_link(self, nogood: Nogood) -> None:
        """Request links to robots in the nogood that send no values yet; assume the nogood's values for now."""
        for agent in self._assume(nogood.lhs):
            self.send(agent, AddLink())


def _without(culprit: str, conflict: LeftSide) -> dict[str, Value]:
    return {name: value for name, value in conflict.items() if name != culprit}
