"""Dynamic Asynchronous Backtracking (DynABT).

ABT (see `abt.py`) that continues when the problem changes. Its nogoods have an *explanation*, `because`: the
constraints and domains from which they were derived. A direct conflict is explained by its constraint. A resolvent is
explained by the union of the explanations of the resolved nogoods, and by the resolving robot's domain.

- **When to use**: the problem changes during the run, for example when a robot is "lost if hit by a meteor" (paper,
  Section 3.1).
- **Guarantees**: complete; each epoch terminates with a solution or with a proof that there is none.
- **Parameters**: none.
- **References**: Omomowo, Arana, Ahriz: "DynABT: dynamic asynchronous backtracking for dynamic DisCSPs", AIMSA 2008;
  on nogood justifications for dynamic problems: Schiex and Verfaillie, "Nogood recording for static and dynamic
  constraint satisfaction problems", IJAIT 3 (1994).

On a change of the problem, the paper's procedures do this (`change`, `_adjust_nogoods`):

    removeConstraint   drop nogoods explained by a removed constraint; also a proof of no solution
    addConstraint      link to the new lower-priority robot, and send it the value
    adjustNogood       drop nogoods of removed values; a domain that grew invalidates its resolvents

Choices that the paper leaves open, and differences:

- The runtime propagates the changes to all robots before any robot continues. In the paper the robots send them to
  each other.
- Messages in transit are lost if a search was interrupted or had concluded. In this case links are requested again and
  values are sent again before the search continues. If the search had reached quiescence, nothing was lost, and only
  new values are sent.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(4), Options(protocol="dynabt", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value, outcome.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.outcome import Verdict
from robochoc.protocols.dynamic import DynamicProtocol
from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.nogood import NO_EXPLANATION, Explanation, NogoodStore
from robochoc.protocols.satisfaction.nogood_messages import Nogood as PlainNogood
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.explanation import Invalidated, domain_key
from robochoc.solver.local_problem import LocalProblem


class Nogood(PlainNogood, frozen=True):
    """A nogood: the receiver cannot take `value` while all in `lhs` and all constraints in `because` hold."""

    because: list[str]


class DynABT(ABT, DynamicProtocol):
    """One agent of DynABT. State besides that of ABT: `proof`, the explanation of a derived empty nogood."""

    messages = Ok | Nogood | AddLink
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Omomowo, Arana, Ahriz 2008",
        dynamic=True,
        privacy="constraints of lower robots",
        use_when="the problem changes during the run",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.proof: Explanation = NO_EXPLANATION
        self.uninformed = list(self.lower)
        """Lower robots to which this robot has never sent its value."""

    def start(self) -> None:
        """Choose a first value and send it."""
        self.uninformed = []
        super().start()

    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        """Adapt the state to the changed problem: the propagation phase."""
        for agent in invalidated.agents:
            self._update(agent, None)
        self.store.drop(invalidated.keys)
        if not invalidated.keys.isdisjoint(self.proof):
            self.verdict, self.proof = None, NO_EXPLANATION
        self._adjust_nogoods(problem, order, invalidated)
        known = (
            {*self.lower} - invalidated.agents - {*self.uninformed}
        )  # a change may follow another before the search continues
        self.higher = {*problem.parents, *(self.higher - invalidated.agents)}
        # Robots that requested the value, and are still present, continue to receive it, even if its variables have
        # changed. A robot of the same name that has joined instead does not know the value yet.
        self.lower = list(dict.fromkeys((*problem.children, *(robot for robot in self.lower if robot in order.rank))))
        self.uninformed = [robot for robot in self.lower if robot not in known]
        self.problem, self.order = problem, order

    def resume(self, *, lossless: bool) -> None:
        """Send the information that other robots may have missed, and check the view."""
        if not lossless:
            for agent in sorted(self.higher.difference(self.problem.parents), key=self.order.rank.__getitem__):
                self.send(agent, AddLink())
        before = self.value
        self._check_agent_view()
        current = self._current()
        if current is not None and self.value == before:
            for child in self.uninformed if lossless else self.lower:
                self.send(child, Ok(current))
        self.uninformed = []

    def _adjust_nogoods(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        """Move the nogoods and the value to their indices in the changed domain."""
        old, self.store = self.store, NogoodStore(order, len(problem.values))
        known = {} if problem.agent in invalidated.agents else {value: i for i, value in enumerate(self.problem.values)}
        for index, value in enumerate(problem.values):
            place = known.get(value)
            lhs = None if place is None else old[place]
            if place is not None and lhs is not None:
                self.store.add(index, lhs, old.because(place))
        current = self._current() if known else None
        self.value = None if current is None or current not in problem.values else problem.values.index(current)

    # ABT's procedures, with explanations

    def _backtrack(self) -> None:
        super()._backtrack()
        if self.verdict == Verdict.NO_SOLUTION:
            self.proof = self._explanation()

    def _nogood(self, lhs: dict[str, Value], value: Value) -> Nogood:
        return Nogood(lhs, value, sorted(self._explanation()))

    def _learn(self, nogood: PlainNogood) -> None:
        because = frozenset(nogood.because) if isinstance(nogood, Nogood) else NO_EXPLANATION
        for index in self.problem.interchangeable(nogood.value):
            self.store.add(index, nogood.lhs, because)

    def _consistent(self, index: int, view: Mapping[str, Value]) -> bool:
        if self.store[index] is not None:
            return False
        conflict = self.problem.conflict_with_key(index, view)
        if conflict is None:
            return True
        lhs, key = conflict
        self.store.add(index, lhs, frozenset({key}))
        return False

    def _explanation(self) -> Explanation:
        return self.store.explanation() | {domain_key(self.problem.agent)}
