"""Maximum Gain Message (MGM).

Local search in cycles: distributed breakout (Yokoo, Hirayama 1996) without weights. All robots send their values, then
the gain of their best move. Among neighbours only the robot with the largest gain moves. So a move saves the team as
much as it saves the robot.

- **When to use**: like DSA, if the cost must never rise. The search ends in a local optimum.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises from
  one cycle to the next (anytime). A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `cycles` (default 100).
- **References**: Maheswaran, Pearce, Tambe: "Distributed algorithms for DCOP: a graphical-game-based approach", PDCS
  2004, Section 3; Pearce, "Local optimization in cooperative agent networks", PhD thesis, 2007.

The paper's procedures (Algorithm MGM, `allNeighbors`, `currentContext`):

    SendValueMessage, GetValueMessages   `exchange_values`, `_send_gain`
    BestUnilateralGain                   `best_unilateral`
    SendGainMessage, GetGainMessages     `_send_gain`, `_move`
    if gain > max(neighbours' gains)     `_move`

Choices that the paper leaves open:

- The first value is chosen at random; if there are several best values, one of them is chosen at random.
- If neighbours have the same gain, the first of them in the priority order moves.
- Constraints may be n-ary, because all robots in a scope are neighbours.
- A gain is a pair, violated hard constraints first. So the search also works on plain DisCSPs.
- If a value is lost, the neighbour's last known value is used; a robot that misses a gain stays. Then the cost may
  rise.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), MGM, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Gain': 15200, 'Value': 15200}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, CycleProtocol, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted, listed


def saving_in_words(broken: int, cost: float) -> str:
    """Return the gain of a move in words: `1 broken constraint and 3 of cost`, or `nothing`."""
    saved = [counted(broken, "broken constraint")] if broken else []
    return listed([*saved, f"{cost_text(cost)} of cost"] if cost else saved) or "nothing"


class Gain(wire.Message, frozen=True):
    """The gain of the sender's best move: broken hard constraints, and costs (`gain`)."""

    broken: int
    cost: int | float

    act = Act(Performative.INFORM, "the receiver learns the saving by the sender's move")
    # A gain may belong to two robots that move together (MGM-2), be weighted (GDBA), or contain transferred costs
    # (MCS-MGM). So it does not bound the sender's cost.
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"my move would save {saving_in_words(self.broken, self.cost)}"


@mypyc_attr(allow_interpreted_subclasses=True)
class Gainers(CycleProtocol):
    """The common base of MGM, MGM-2 and GDBA: a cycle begins with values, and gains decide which neighbour moves.

    `target` is the value of this robot's best move, and `gain` the gain of that move.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.target = 0
        self.gain: LexicographicCost = NO_GAIN

    def best_unilateral(self, view: Mapping[str, wire.Value]) -> None:
        """Find the best move of this robot alone, which may be to stay (BestUnilateralGain)."""
        self.find_best_move(self.problem.lexicographic_costs(view))

    def find_best_move(self, costs: Sequence[LexicographicCost]) -> None:
        """Find the best move, given the cost of each of this robot's values."""
        least = min(costs)
        self.gain = gain(costs[self.present], least)
        self.target = self.present
        if self.gain > NO_GAIN:
            self.target = self.any_of([place for place, cost in enumerate(costs) if cost == least])

    def wins(self, gains: Mapping[str, wire.Message]) -> bool:
        """Return whether this robot's gain is positive and the largest; ties go to the first robot in the order."""
        rank = self.order.rank
        return self.gain > NO_GAIN and all(
            (self.gain, rank[name]) > ((message.broken, message.cost), rank[self.problem.agent])
            for name, message in gains.items()
            if isinstance(message, Gain)
        )


@mypyc_attr(allow_interpreted_subclasses=True)
class MGM(Gainers):
    """One agent of MGM. A cycle has two phases: all robots send their values, then their gains."""

    messages: ClassVar[Any] = Value | Gain | AnytimeMessage
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Maheswaran, Pearce, Tambe 2004",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        arrays=True,
        bears_loss=True,
        cost_never_rises=True,
        optimal_groups=1,
        privacy="constraints among others",
        use_when="as DSA, and the cost never rises; ends in a local optimum",
    )

    def start_cycles(self) -> None:
        """Choose a random value."""
        self.choose(self.any_value())
        self.exchange_values(self._send_gain)

    def _send_gain(self, messages: Mapping[str, wire.Message]) -> None:
        """Send the gain of this robot's best move, once all neighbours' values are known."""
        self.best_unilateral(self.checked_values(messages))
        self.multicast(self.problem.neighbours, Gain(*self.gain))
        self.listen(self.problem.neighbours, self._move)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Move if this robot's gain is the largest among all neighbours; stay if one of their gains is lost."""
        moves = len(messages) == len(self.problem.neighbours) and self.wins(messages)
        self.choose(self.target if moves else self.present)
        if not self.finished:
            self.exchange_values(self._send_gain)
