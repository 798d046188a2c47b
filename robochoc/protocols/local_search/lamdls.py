"""Latency-aware Monotonic Distributed Local Search (LAMDLS).

Local search in which neighbours never move at the same time. First the robots colour themselves so that neighbours have
different colours. Then in each cycle a robot waits until its neighbours with smaller colours have moved, and chooses
its best value given the present values of all neighbours. Robots with the same colour move at the same time, and no
robot waits for robots other than its neighbours.

- **When to use**: like MGM, if the cost must never rise. A cycle needs half as many messages as in MGM, and every robot
  may move in a cycle.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises from
  one cycle to the next (anytime), and it ends in a local optimum after enough cycles. The course of the search
  does not depend on message delays. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `cycles` (default 100).
- **Reference**: Rachmut, Zivan, Yeoh: "Communication-aware local search for distributed constraint optimization",
  IJCAI 2022.

The two phases:

    the robots colour themselves          `_choose_colour`, `_start_first_step`
    a step, after the same step of all    `_wait_for_earlier`, `_move`, `_wait_for_later`
      neighbours of smaller colours

Choices that the paper leaves open, and differences:

- A robot chooses its colour when all neighbours with higher priority have theirs: the smallest free colour. The first
  value, chosen at random, is sent with the colour.
- A robot that cannot gain keeps its value. If there are several best values, one is chosen at random.
- Values need no step number: from each neighbour they arrive in the order of its steps.
- Constraints may be n-ary, because all robots in a scope are neighbours.
- Fewer violated hard constraints are always better, so plain DisCSPs work, too.
- If a value is lost, the neighbour's last known value is used. A neighbour whose colour is lost moves before or after
  this robot depending on its priority. Then neighbours may move at the same time, and the cost may rise.

The cost never rises, because a robot that moves knows its neighbours' present values, and none of them can move before
it has sent its value. So each move saves the team as much as it saves the robot.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), LAMDLS, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Colour': 152, 'Value': 15200}
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Mapping, Sequence
from typing import Annotated

import msgspec

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleProtocol, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class Colour(wire.Message, frozen=True):
    """The sender's first value, and its colour: a number that none of its neighbours has."""

    value: wire.Value
    colour: Annotated[int, msgspec.Meta(ge=0)]

    act = Act(Performative.INFORM, "the receiver learns when the sender will move")

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} at first, and my colour is number {self.colour + 1}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class LAMDLS(CycleProtocol):
    """One agent of LAMDLS.

    State: this robot's `colour`, the neighbours with smaller colours (`earlier`) and with larger ones (`later`), and
    the `view`: the neighbours' present values.
    """

    messages = Colour | Value | AnytimeMessage
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Rachmut, Zivan, Yeoh 2022",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        cost_never_rises=True,
        use_when="as MGM: the cost never rises; half the messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        own = order.rank[problem.agent]
        self.colour: int | None = None
        self.earlier = tuple(name for name in problem.neighbours if order.rank[name] < own)
        """At first these are the neighbours with higher and lower priority: the order of colouring."""
        self.later = tuple(name for name in problem.neighbours if order.rank[name] > own)
        self.view: dict[str, wire.Value] = {}
        self.colours: dict[str, int] = {}

    def start_cycles(self) -> None:
        """Choose a random value, and wait for the colours of all neighbours with higher priority."""
        self.choose(self.any_value())
        self.listen(self.earlier, self._choose_colour)

    def _choose_colour(self, messages: Mapping[str, wire.Message]) -> None:
        """Choose the smallest free colour, and send it."""
        self._store_colours(messages)
        taken = {*self.colours.values()}
        self.colour = least_free(taken)
        self.multicast(self.problem.neighbours, Colour(self.problem.values[self.present], self.colour))
        self.listen(self.later, self._start_first_step)

    def _start_first_step(self, messages: Mapping[str, wire.Message]) -> None:
        """Start the first step, once all neighbours' colours are known."""
        self._store_colours(messages)
        neighbours = self.problem.neighbours
        higher = {*self.earlier}
        before = {name: self._is_before(name, higher=name in higher) for name in neighbours}
        self.earlier = tuple(name for name in neighbours if before[name])
        self.later = tuple(name for name in neighbours if not before[name])
        self._wait_for_earlier()

    def _is_before(self, name: str, *, higher: bool) -> bool:
        """Return whether a neighbour moves first: by its colour, or, if that is lost or the same, by its priority."""
        colour, own = self.colours.get(name), self.colour
        return higher if colour is None or own is None or colour == own else colour < own

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Store the value in a message whose phase is over."""
        super().receive_late(sender, message)
        if isinstance(message, Colour):
            self.check_value(sender, message.value)
        if isinstance(message, Colour | Value):
            self.view[sender] = message.value

    def _store_colours(self, messages: Mapping[str, wire.Message]) -> None:
        """Store first values and colours."""
        for name, message in messages.items():
            if not isinstance(message, Colour):
                raise ValueError(f"{name} sent no colour, which must come first")  # noqa: TRY004 - as any bad message
            self.check_value(name, message.value)
            self.view[name] = message.value
            self.colours[name] = message.colour

    def _wait_for_earlier(self) -> None:
        self.listen(self.earlier, self._move)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Choose the best value given the neighbours' values, and send it."""
        self.view |= self.checked_values(messages)
        self.choose(index := self.best_response())
        self.multicast(self.problem.neighbours, Value(self.problem.values[index]))
        if not self.finished:
            self.listen(self.later, self._wait_for_later)

    def best_response(self) -> int:
        """Return the best value given the neighbours' values: the present one, if no value is better."""
        costs = self.problem.lexicographic_costs(self.view)
        least = min(costs)
        if costs[self.present] == least:
            return self.present
        return self.any_of([place for place, cost in enumerate(costs) if cost == least])

    def _wait_for_later(self, messages: Mapping[str, wire.Message]) -> None:
        """Start the next step, once all neighbours with larger colours have made the last one."""
        self.view |= self.checked_values(messages)
        self._wait_for_earlier()


def least_free(taken: Container[int]) -> int:
    """Return the smallest colour that is not `taken`."""
    return next(colour for colour in itertools.count() if colour not in taken)
