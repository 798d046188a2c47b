"""The Distributed Breakout Algorithm (DBA), for problems without costs.

Local search in cycles: hill climbing on weighted violations. All robots send their values, then by how much their best
move would reduce the weight of what they violate; among neighbours the one with the largest reduction moves. In a
quasi-local minimum, where neither a robot nor one of its neighbours can reduce anything, the robot's violated
constraints weigh one more from then on, until it is worth moving away. Robots find out by themselves that all
constraints hold, by a termination counter.

- **When to use**: a large team without costs, where a solution surely exists.
- **Guarantees**: incomplete; a solution is one, as all robots know that no constraint is violated when they stop. It
  never proves that there is none (but for a robot with an empty domain), and gives up after `cycles` cycles. On a
  constraint graph without cycles it finds a solution if there is one (Zhang, Wittenburg 2002).
- **Parameters (`--set`)**: `cycles` (after so many without a solution it gives up; default 1000).
- **References**: Yokoo, Hirayama: "Distributed breakout algorithm for solving distributed constraint satisfaction
  problems", ICMAS 1996; Hirayama, Yokoo: "The distributed breakout algorithms", AIJ 161, 2005; Zhang, Wittenburg:
  "Distributed breakout revisited", AAAI 2002.

The papers' procedures:

    wait_ok? mode, send_improve      `tell_value`, `_weigh`
    wait_improve? mode, send_ok      `_weigh`, `_move`
    my_termination_counter           `counter`, `_distance`
    weights of constraints           `weights`
    quasi-local minimum              `_move`

The counter: a robot without violations, whose neighbours have none, adds one to the least counter among them and
itself; any violation sets it to 0. So a counter of c says that all robots within distance c have had none for long
enough, and once c is as large as any distance, nobody has. The papers leave that bound to the user; one that is too
small stops wrongly. Here it is the number of robots less one, which no distance exceeds. Then all counters of connected
robots reach it in the same cycle, so nobody has to be told the end.

Choices that the papers leave open, and differences:

- A weight belongs to a constraint, and each of its robots has a weight of its own for it.
- The first value is chosen at random, and so is one of several best values.
- Of equal reductions, that of the first robot in the priority order counts.
- Constraints may be n-ary, as all robots of a scope are neighbours.
- Where a value is lost, the last one known stands for it, and the robot tells that something may be violated; one that
  misses a reduction stays, and counts from 0. So counters seldom get far. A robot that has missed anything does not
  give up for all, and the best cycle is the answer, if it passes the check.

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

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import FINITE, NOTHING, Hearing, Pays, Proof
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.model.wording import Wording, counted
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleProtocol, CycleSettings, Value
from robochoc.protocols.traits import Traits
from robochoc.solver.compiled import Charged, LocalProblem


class DBASettings(CycleSettings, frozen=True):
    """`cycles`: the number of cycles after which it gives up."""

    cycles: int = 1000


Count = Annotated[int, msgspec.Meta(ge=0)]


class Improve(wire.Message, frozen=True):
    """By how much the sender's best move reduces the weight of what it violates (`improve`).

    `weight` is the weight of what it violates now, `counter` its termination counter.
    """

    reduction: Count
    weight: Count
    counter: Count

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's move would save")

    def in_words(self, _: Wording) -> str:
        if not self.weight:
            return f"I violate nothing; for {counted(self.counter, 'cycle')} nobody near me has"
        return f"what I violate weighs {self.weight:,}, and my move would make that {self.reduction:,} less"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: whether the sender's present value goes with the own one.

        That it does not, only where no other robot's value is in it.
        """
        own = hearing.last(Value, hearing.receiver, hearing.sender)
        told = hearing.last(Value, hearing.sender, hearing.receiver)
        if own is None or told is None:
            return NOTHING
        view = {hearing.receiver: own.value}
        if not self.weight:
            return [Pays(hearing.sender, told.value, view, 0, FINITE)]
        return [Pays(hearing.sender, told.value, view, INFINITE, INFINITE)] if hearing.is_only_neighbour() else NOTHING


class DBA(CycleProtocol):
    """One agent of DBA. A cycle has two phases: all robots send their values, then their reductions.

    `weights` are those of the constraints by number, where they are not 1. `counter` is the termination counter.
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
        self._told = Improve(0, 0, 0)
        self._target = 0
        self._missed = False

    def begin(self) -> None:
        """Take a random value."""
        self.take(self.any_value())
        self.tell_value(self._weigh)

    def _weigh(self, messages: Mapping[str, wire.Message]) -> None:
        """Send the reduction by the best own move, with all neighbours' values known."""
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
        self._told = Improve(now - least, now if complete else max(now, 1), self.counter)
        self.tell(self.problem.neighbours, self._told)
        self.listen(self.problem.neighbours, self._move)

    def _weight(self, charged: list[Charged], place: int) -> int:
        """Return the weight of all that the value at `place` violates (eval)."""
        return sum(self.weights.get(one.number, 1) for one in charged if one.costs[place] == INFINITE)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Stop, move, or let violated constraints weigh more, with all neighbours' reductions known."""
        told = {name: said for name, said in messages.items() if isinstance(said, Improve)}
        complete = self._are_complete(messages)
        if not complete:
            self.counter = 0
        elif self._has_ended([self._told, *told.values()]):
            self.finish()
            return
        if complete and not max(said.reduction for said in (self._told, *told.values())):
            for number in self._violated:
                self.weights[number] = self.weights.get(number, 1) + 1
        self.take(self._target if complete and self._wins(told) else self.present)
        if not self.over:
            self.tell_value(self._weigh)
        elif not self._missed:
            self.conclude(Verdict.UNKNOWN)

    def _are_complete(self, messages: Mapping[str, wire.Message]) -> bool:
        """Return whether a message of each neighbour has come in this phase, and note if not."""
        complete = len(messages) == len(self.problem.neighbours)
        self._missed = self._missed or not complete
        return complete

    def _has_ended(self, told: list[Improve]) -> bool:
        """Count on, or begin again; return whether no robot of the component violates anything."""
        self.counter = min(said.counter for said in told)
        if any(said.weight for said in told):
            return False
        self.counter += 1
        return self.counter >= self._distance

    def _wins(self, told: Mapping[str, Improve]) -> bool:
        """Return whether the own reduction is positive and the largest; ties go to the first robot in the order."""
        rank, own = self.order.rank, self._told.reduction
        return own > 0 and all(
            (own, rank[name]) > (said.reduction, rank[self.problem.agent]) for name, said in told.items()
        )
