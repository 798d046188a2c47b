"""The Distributed Breakout Algorithm (DBA), for problems without costs.

Local search in cycles: hill climbing on weighted violations. All robots send their values, then the reduction of their
violated weight by their best move; among neighbours the robot with the largest reduction moves. In a quasi-local
minimum, in which neither a robot nor any of its neighbours can reduce anything, the weights of the robot's violated
constraints grow by one, until a move reduces them. Robots detect by a termination counter that all constraints hold.

- **When to use**: a large team without costs, if a solution surely exists.
- **Guarantees**: incomplete; a solution is correct, because all robots know that no constraint is violated when they
  stop. It never proves that there is no solution (except for a robot with an empty domain), and gives up after `cycles`
  cycles. On a constraint graph without cycles it finds a solution if there is one (Zhang, Wittenburg 2002).
- **Parameters (`--set`)**: `cycles` (the number of cycles after which it gives up; default 1000).
- **References**: Yokoo, Hirayama: "Distributed breakout algorithm for solving distributed constraint satisfaction
  problems", ICMAS 1996; Hirayama, Yokoo: "The distributed breakout algorithms", AIJ 161, 2005; Zhang, Wittenburg:
  "Distributed breakout revisited", AAAI 2002.

The papers' procedures:

    wait_ok? mode, send_improve      `exchange_values`, `_weigh`
    wait_improve? mode, send_ok      `_weigh`, `_move`
    my_termination_counter           `counter`, `_distance`
    weights of constraints           `weights`
    quasi-local minimum              `_move`

The counter: a robot without violations, whose neighbours have none, adds one to the least counter among them and
itself; any violation sets it to 0. So a counter of c means that all robots within distance c have had no violation for
long enough, and once c is as large as any distance, there is no violation. The papers leave that bound to the user;
with a bound that is too small the search stops wrongly. Here it is the number of robots less one, which no distance
exceeds. Then the counters of all connected robots reach it in the same cycle, so no message has to announce the end.

Choices that the papers leave open, and differences:

- A weight belongs to a constraint, and each robot in the constraint has its own weight for it.
- The first value is chosen at random; if there are several best values, one of them is chosen at random.
- If reductions are equal, the first robot in the priority order wins.
- Constraints may be n-ary, because all robots in a scope are neighbours.
- If a value is lost, the last known one is used, and the robot reports a possible violation; a robot that misses a
  reduction does not move, and counts from 0. So with losses counters rarely grow large. A robot that has missed
  anything does not end the search for all, and the best cycle is the answer if it passes the check.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), DBA, Concurrent(seed=0)).search()
>>> result.verdict.value
'unknown'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import FINITE, NOTHING, Pays, Proof, Reception
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleProtocol, CycleSettings, Value
from robochoc.protocols.traits import Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import Charged, LocalProblem
from robochoc.system.plain_text import counted


class DBASettings(CycleSettings, frozen=True):
    """`cycles`: the number of cycles after which it gives up."""

    cycles: int = 1000


Count = Annotated[int, msgspec.Meta(ge=0)]


class Improve(wire.Message, frozen=True):
    """The reduction of the sender's violated weight by its best move (`improve`).

    `weight` is the total weight of its violated constraints, `counter` its termination counter.
    """

    reduction: Count
    weight: Count
    counter: Count

    act = Act(Performative.INFORM, "the receiver learns the saving by the sender's move")

    def in_words(self, _: Wording) -> str:
        if not self.weight:
            return f"I violate nothing; for {counted(self.counter, 'cycle')} nobody near me has"
        return f"what I violate weighs {self.weight:,}, and my move would make that {self.reduction:,} less"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # True if the two values are consistent. An inconsistency is proven only if no other robot can have caused it.
        own = reception.last(Value, reception.receiver, reception.sender)
        theirs = reception.last(Value, reception.sender, reception.receiver)
        if own is None or theirs is None:
            return NOTHING
        view = {reception.receiver: own.value}
        if not self.weight:
            return [Pays(reception.sender, theirs.value, view, 0, FINITE)]
        return (
            [Pays(reception.sender, theirs.value, view, INFINITE, INFINITE)]
            if reception.is_only_neighbour()
            else NOTHING
        )


class DBA(CycleProtocol):
    """One agent of DBA. A cycle has two phases: all robots send their values, then their reductions.

    `weights` are the weights of the constraints, by number, that are not 1. `counter` is the termination counter.
    """

    messages = Value | Improve | AnytimeMessage
    settings: ClassVar[DBASettings] = DBASettings()
    traits = Traits(
        concludes=(Verdict.NO_SOLUTION, Verdict.UNKNOWN),
        paper="Yokoo & Hirayama 1996; Hirayama & Yokoo 2005",
        complete=False,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="large team, and a solution surely exists",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.weights: dict[int, int] = {}
        self.counter = 0
        self._distance = len(order.names) - 1
        self._violated: list[int] = []
        self._sent = Improve(0, 0, 0)
        self._target = 0
        self._missed = False

    def start_cycles(self) -> None:
        """Choose a random value."""
        self.choose(self.any_value())
        self.exchange_values(self._weigh)

    def _weigh(self, messages: Mapping[str, wire.Message]) -> None:
        """Once all neighbours' values are known, send the reduction by this robot's best move."""
        charged = self.problem.charged(self.checked_values(messages))
        complete = self._are_complete(messages)
        weighed = [self._weight(charged, place) for place in range(len(self.problem.values))]
        now, least = weighed[self.present], min(weighed)
        self._violated = [one.number for one in charged if one.costs[self.present] == INFINITE]
        self._target = self.present
        if least < now:
            self._target = self.any_of([place for place, weight in enumerate(weighed) if weight == least])
        if now or not complete:
            self.counter = 0
        self._sent = Improve(now - least, now if complete else max(now, 1), self.counter)
        self.multicast(self.problem.neighbours, self._sent)
        self.listen(self.problem.neighbours, self._move)

    def _weight(self, charged: list[Charged], place: int) -> int:
        """Return the weight of all constraints that the value at `place` violates (eval)."""
        return sum(self.weights.get(one.number, 1) for one in charged if one.costs[place] == INFINITE)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Stop, move, or increase the weights of violated constraints, once all neighbours' reductions are known."""
        theirs = {name: improve for name, improve in messages.items() if isinstance(improve, Improve)}
        complete = self._are_complete(messages)
        if not complete:
            self.counter = 0
        elif self._has_ended([self._sent, *theirs.values()]):
            self.finish()
            return
        if complete and not max(improve.reduction for improve in (self._sent, *theirs.values())):
            for number in self._violated:
                self.weights[number] = self.weights.get(number, 1) + 1
        self.choose(self._target if complete and self._wins(theirs) else self.present)
        if not self.finished:
            self.exchange_values(self._weigh)
        elif not self._missed:
            self.conclude(Verdict.UNKNOWN)

    def _are_complete(self, messages: Mapping[str, wire.Message]) -> bool:
        """Return whether a message from each neighbour has arrived in this phase; record that one is missing."""
        complete = len(messages) == len(self.problem.neighbours)
        self._missed = self._missed or not complete
        return complete

    def _has_ended(self, theirs: list[Improve]) -> bool:
        """Increment or reset the counter; return whether no robot in the component violates anything."""
        self.counter = min(improve.counter for improve in theirs)
        if any(improve.weight for improve in theirs):
            return False
        self.counter += 1
        return self.counter >= self._distance

    def _wins(self, theirs: Mapping[str, Improve]) -> bool:
        """Return whether this robot's reduction is positive and largest; ties go to the first robot in the order."""
        rank, own = self.order.rank, self._sent.reduction
        return own > 0 and all(
            (own, rank[name]) > (improve.reduction, rank[self.problem.agent]) for name, improve in theirs.items()
        )
