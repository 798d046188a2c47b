"""First fit: robots without a possible value withdraw, in priority order.

Each robot waits for the decisions of its parents (neighbours with higher priority). Then it takes the first value that
its constraints with the flying parents allow, or withdraws, and sends its decision to its children.

- **When to use**: some robots may withdraw, and it does not matter which. To minimise the number of withdrawals, use a
  protocol with costs.
- **Guarantees**: it terminates after one message for each edge. The set of withdrawn robots is minimal by inclusion: no
  robot could be added, because all robots that ruled it out fly. Its size need not be the minimum.
- **Parameters**: none.
- **Reference**: paper, Section 5.2: "the robots who can't belonging to the solution will be taken from the operational
  scene. Thus only robots that will satisfy all constraints will fly to take their positions."

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), FirstFit, Concurrent(seed=0)).run()
>>> sum(bool(values) for values in result.assignments.values()), result.metrics.messages  # of 16 robots
(9, {'Placed': 76})
"""

from __future__ import annotations

from typing import Any, ClassVar, cast

from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.first_fit_messages import Placed
from robochoc.protocols.traits import Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class FirstFit(Protocol):
    """One robot. `view` contains the values of the parents that fly, `awaited` the parents without a message yet."""

    messages: ClassVar[Any] = Placed
    traits: ClassVar[Traits] = Traits(
        concludes=(),
        paper="paper, Section 5.2",
        complete=False,
        writes_to_non_neighbours=False,
        drops_only=True,
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.view: dict[str, Value] = {}
        self.awaited = set(problem.parents)

    def start(self) -> None:
        """Decide at once if there are no parents."""
        self.settle()

    def receive(self, sender: str, message: Message) -> None:
        """Store a parent's decision."""
        value = cast("Placed", message).value
        self.awaited.discard(sender)
        if value is not None:
            self.view[sender] = value

    def settle(self) -> None:
        """Decide and send the decision once all parents have decided; each robot does so exactly once."""
        if self.awaited:
            return
        places = range(len(self.problem.values))
        self.value = next((index for index in places if self.problem.conflict(index, self.view) is None), None)
        placed = Placed(None if self.value is None else self.problem.values[self.value])
        for child in self.problem.children:
            self.send(child, placed)
