"""Distributed Forward Checking (DisFC).

ABT (`satisfaction/abt.py`) in which no value is ever sent. A robot names its assignment by a counter, which grows with
each new assignment. Instead of its value it sends each lower neighbour the receiver's domain, filtered by this value:
`Ok(counter, allowed)`. The receiver takes a value that all filters allow; a value that a filter removes is ruled out by
the sender's counter. Nogoods are over counters: a robot accepts a nogood about its current counter and the counters in
its view. A filter is a bitmap over the receiver's declared domain (`solver/filters.py`), so messages contain only
indices in that domain.

- **When to use**: values or constraints are private (PKC). Constraints must be between two robots.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial.
- **Parameters**: none.
- **References**: Brito and Meseguer: "Distributed forward checking", CP 2003; with partially known constraints: Brito,
  Meisels, Meseguer, Zivan: "Distributed constraint satisfaction with partially known constraints", Constraints 14
  (2009).

The methods have the names of ABT's procedures, except these for filters:

    check the filters   `_consistent`     refuse filters from below (PKC)   `_refuse_below`

A totally known constraint (TKC) is in the filter that its higher robot sends down. In a partially known constraint
(PKC) each robot has a part, and both send filters, in a single phase: down for the higher robot's part, up for the
lower robot's. A higher robot whose value is not in a filter from below sends a nogood against that assignment.

Choices that the paper leaves open:

- Packets of messages, and the choice among several nogoods, are as in ABT.
- A counter names an assignment and not a value, so others cannot see that a value is repeated. An assignment that is
  kept keeps its counter.
- A robot that requested a link, but shares no constraint with the sender, gets a filter that allows everything.
- A robot with several variables is filtered over all combinations of values of its interface variables.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), DisFC, Concurrent(0)).run()
>>> result.verdict.value, result.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.disfc_messages import AddLink, Nogood, Ok
from robochoc.protocols.satisfaction.nogood import NogoodStore
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.filters import allows
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class DisFC(Protocol):
    """One agent of DisFC.

    - `counter`: names this robot's assignment.
    - `view`: the counters of higher-priority robots. `filters`: the filters that these robots sent.
    - `below`: counters and filters of lower-priority robots with parts of PKCs, not yet checked.

    The nogood store has values on its left sides; a counter is stored there as a value with one component.
    """

    messages: ClassVar[Any] = Ok | Nogood | AddLink
    numbered_values: ClassVar[bool] = True
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Brito and Meseguer 2003; PKC: Brito et al. 2009",
        n_ary=False,
        partially_known=True,
        shared_scopes=True,
        privacy="values; of PKCs every robot's part, but for the rows of values taken",
        use_when="values are private, or constraints are (PKC)",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.places = problem.filter_places
        self.counter = 0
        self.view: dict[str, int] = {}
        self.filters: dict[str, bytes] = {}
        self.below: dict[str, tuple[int, bytes]] = {}
        self.store = NogoodStore(order, len(problem.values))
        self.higher = set(problem.parents)
        self.lower = list(problem.children)

    def start(self) -> None:
        """Make a first assignment and send the filters."""
        self._check_agent_view()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Ok | Nogood | AddLink", message):
            case Ok() as ok:
                self._process_info(sender, ok)
            case Nogood() as nogood:
                self._resolve_conflict(sender, nogood)
            case AddLink():
                self._set_link(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Check the view, then check the value against the filters of lower-priority robots."""
        if self.verdict is None:
            self._check_agent_view()
            self._refuse_below()

    # Messages

    def _process_info(self, sender: str, ok: Ok) -> None:
        if sender in self.problem.children:
            self.below[sender] = ok.counter, ok.allowed
        else:
            self._update(sender, ok.counter)
            self.filters[sender] = ok.allowed

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        """Accept a nogood about the current assignment that agrees with the view; all other nogoods are obsolete."""
        if self.value is None or nogood.counter != self.counter:
            return
        if self._coherent(nogood):
            self._check_add_link(nogood)
            self.store.add(self.value, {agent: (counter,) for agent, counter in nogood.lhs.items()})
            self.value = None
        else:
            # The sender's view was outdated, and the sender has forgotten this robot's assignment: send it again.
            self._send_filter(sender, self.value)

    def _set_link(self, sender: str) -> None:
        if sender not in self.lower:
            self.lower.append(sender)
        if self.value is not None:
            self._send_filter(sender, self.value)

    # The search

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another value, or backtrack until there is one."""
        while self.verdict is None:
            if self.value is not None and self._consistent(self.value):
                return
            self.value = self._choose_value()
            if self.value is None:
                self._backtrack()
                continue
            self.counter += 1
            for neighbour in (*self.lower, *self.problem.pkc_parents):
                self._send_filter(neighbour, self.value)
            return

    def _send_filter(self, receiver: str, index: int) -> None:
        self.send(receiver, Ok(self.counter, self.problem.filter(index, receiver)))

    def _choose_value(self) -> int | None:
        """Return the first value that no nogood and no filter rules out, or the start value; None if there is none."""
        start = self.problem.start
        if start is not None and self._consistent(start):
            return start
        index = self.store.first_open()
        while index is not None and not self._consistent(index):
            index = self.store.first_open(index + 1)
        return index

    def _backtrack(self) -> None:
        """Resolve the stored nogoods, one for each value, and send the result to the lowest-priority robot in it."""
        lhs = {agent: self.view[agent] for agent in self.store.resolve()}
        if not lhs:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self.order.lowest(lhs)
        counter = lhs.pop(culprit)
        self.send(culprit, Nogood(lhs, counter))
        self._update(culprit, None)

    def _refuse_below(self) -> None:
        """Send nogoods to lower-priority robots whose filters do not contain this robot's value (PKC)."""
        if self.value is None:
            return
        for child, (counter, allowed) in list(self.below.items()):
            if not allows(allowed, self.places[self.value]):
                self.send(child, Nogood({self.problem.agent: self.counter}, counter))
                del self.below[child]

    def _consistent(self, index: int) -> bool:
        """Return whether the filters allow the value at `index`; store a nogood if one does not."""
        if self.store[index] is not None:
            return False
        for agent in sorted(self.filters, key=self.order.rank.__getitem__):
            if not allows(self.filters[agent], self.places[index]):
                self.store.add(index, {agent: (self.view[agent],)})
                return False
        return True

    # The view

    def _update(self, agent: str, counter: int | None) -> None:
        """Store a new assignment of `agent` (None: unknown); drop its old filter and the nogoods with it."""
        if counter is None:
            del self.view[agent]
            self.store.forget(agent)
        else:
            self.view[agent] = counter
            self.store.forget(agent, (counter,))
        self.filters.pop(agent, None)

    def _coherent(self, nogood: Nogood) -> bool:
        return all(self.view.get(agent) == counter for agent, counter in nogood.lhs.items() if agent in self.higher)

    def _check_add_link(self, nogood: Nogood) -> None:
        """Request links to robots in the nogood that send no assignments yet; assume the nogood's counters for now."""
        for agent, counter in nogood.lhs.items():
            if agent not in self.higher:
                self.higher.add(agent)
                self.send(agent, AddLink())
                self._update(agent, counter)
