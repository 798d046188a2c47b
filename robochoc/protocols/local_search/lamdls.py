"""Latency-aware Monotonic Distributed Local Search (LAMDLS).

Local search in which neighbours never move at the same time. First the robots colour themselves: neighbours have
different colours. Then in each cycle a robot waits until its neighbours of smaller colours have moved, and takes its
best value against what all neighbours have now. Robots of one colour move at the same time, and nobody waits for more
than its neighbours.

- **When to use**: as MGM: the cost never rises. A cycle takes half of MGM's messages, and every robot may move in it.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises from
  one cycle to the next (anytime), and it ends in a local optimum if there are cycles enough. The course of the search
  does not depend on how long messages take. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `cycles` (default 100).
- **Reference**: Rachmut, Zivan, Yeoh: "Communication-aware local search for distributed constraint optimization",
  IJCAI 2022.

Its two phases:

    the robots colour themselves       `_colour`, `_meet`
    a step, once all neighbours of     `_wait_for_earlier`, `_move`, `_wait_for_later`
      smaller colours have made it

Choices that the paper leaves open, and differences:

- A robot chooses its colour when all neighbours of higher priority have theirs: the smallest that is free. The first
  value, chosen at random, is sent with the colour.
- A robot that cannot gain keeps its value. One of several best values is chosen at random.
- Values need no step number: from each neighbour they arrive in the order of its steps.
- Constraints may be n-ary, as all robots of a scope are neighbours.
- Fewer violated hard constraints are always better, so plain DisCSPs work, too.
- Where messages are lost, the last value known of a neighbour stands for the one that is missing. One whose colour is
  lost goes before or after by its priority. Then neighbours may move at the same time, and the cost may rise.

Why the cost never rises: when a robot moves, it knows the values that its neighbours have now, and none of them can
move before it has told its own. So each move saves the team what it saves the robot.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), LAMDLS, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Colour': 152, 'Value': 15200}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

import msgspec

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Hearing, Proof, can_take
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleProtocol, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class Colour(wire.Message, frozen=True):
    """The sender's first value, and its colour: a number that no neighbour has."""

    value: wire.Value
    colour: Annotated[int, msgspec.Meta(ge=0)]

    act = Act(Performative.INFORM, "the receiver comes to know when the sender will move")

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} at first, and my colour is number {self.colour + 1}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [can_take(hearing.sender, self.value)]


class LAMDLS(CycleProtocol):
    """One agent of LAMDLS.

    State: the own `colour`, the neighbours of smaller colours (`earlier`) and of larger ones (`later`), and the `view`:
    the values that the neighbours have.
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
        use_when="as MGM: the cost never rises; half the messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        own = order.rank[problem.agent]
        self.colour: int | None = None
        self.earlier = tuple(name for name in problem.neighbours if order.rank[name] < own)
        """At first those of higher and lower priority: that is the order of colouring."""
        self.later = tuple(name for name in problem.neighbours if order.rank[name] > own)
        self.view: dict[str, wire.Value] = {}
        self._colours: dict[str, int] = {}

    def start_cycles(self) -> None:
        """Take a random value, and wait for the colours of all neighbours of higher priority."""
        self.choose(self.any_value())
        self.listen(self.earlier, self._colour)

    def _colour(self, messages: Mapping[str, wire.Message]) -> None:
        """Choose the smallest colour that is free, and tell it."""
        self._note(messages)
        taken = {*self._colours.values()}
        self.colour = next(colour for colour in range(len(taken) + 1) if colour not in taken)
        self.multicast(self.problem.neighbours, Colour(self.problem.values[self.present], self.colour))
        self.listen(self.later, self._meet)

    def _meet(self, messages: Mapping[str, wire.Message]) -> None:
        """Begin with the first step, with all neighbours' colours known."""
        self._note(messages)
        neighbours = self.problem.neighbours
        higher = {*self.earlier}
        before = {name: self._is_before(name, higher=name in higher) for name in neighbours}
        self.earlier = tuple(name for name in neighbours if before[name])
        self.later = tuple(name for name in neighbours if not before[name])
        self._wait_for_earlier()

    def _is_before(self, name: str, *, higher: bool) -> bool:
        """Return whether a neighbour moves first: by its colour; where that is lost, or the same, by its priority."""
        colour, own = self._colours.get(name), self.colour
        return higher if colour is None or own is None or colour == own else colour < own

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Note the value in a message whose phase is over."""
        super().receive_late(sender, message)
        if isinstance(message, Colour):
            self.check_value(sender, message.value)
        if isinstance(message, Colour | Value):
            self.view[sender] = message.value

    def _note(self, messages: Mapping[str, wire.Message]) -> None:
        """Store first values and colours."""
        for name, message in messages.items():
            if not isinstance(message, Colour):
                raise ValueError(f"{name} tells no colour, and that comes first")  # noqa: TRY004 - as any bad message
            self.check_value(name, message.value)
            self.view[name] = message.value
            self._colours[name] = message.colour

    def _wait_for_earlier(self) -> None:
        self.listen(self.earlier, self._move)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Take the best value against the neighbours' values, and tell it."""
        self.view |= self.checked_values(messages)
        burdens = self.problem.lexicographic_costs(self.view)
        least = min(burdens)
        index = self.present
        if burdens[index] > least:
            index = self.any_of([place for place, burden in enumerate(burdens) if burden == least])
        self.choose(index)
        self.multicast(self.problem.neighbours, Value(self.problem.values[index]))
        if not self.finished:
            self.listen(self.later, self._wait_for_later)

    def _wait_for_later(self, messages: Mapping[str, wire.Message]) -> None:
        """Go on with the next step, once all neighbours of larger colours have made the last one."""
        self.view |= self.checked_values(messages)
        self._wait_for_earlier()
