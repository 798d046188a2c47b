"""GRoup Agent Partitioning and placing Event (GRAPE).

Each robot joins the coalition for one task, or none. The gain of a robot from a task falls as its coalition grows. All
robots store a partition into coalitions; a robot that would gain more elsewhere moves there, and sends the new
partition. Among several partitions the one with the most moves is valid; a random number breaks ties.

- **When to use**: for task allocation in which several robots may do a task, and each robot gains less the more robots
  do it. It is the only such protocol here; if each task is for one robot, `ssi` and `cbaa` gain more.
- **Guarantees**: incomplete: no proof of optimality. It ends in a Nash stable partition: no robot gains by moving
  alone. If the gain of a coalition never falls as robots join it, the total gain is at least half of the optimum
  (as in any valid utility game: Vetta, FOCS 2002). If robots exclude each other there is no bound.
- **Reference**: Jang, Shin, Tsourdos: "Anonymous hedonic game for task allocation in a large-scale multiple agent
  system", IEEE Transactions on Robotics 34(6), 2018.

The paper's procedure:

    decision making (Algorithm 1)             `_decide`
    D-Mutex (Algorithm 2)                     `settle`
    Pi, r, s, satisfied                       `partition`, whose fields they are; `satisfied`
    u_i(t_j, |S_j|)                           `_utility`

Choices that the paper leaves open, and differences:

- A robot's utility from a task is the cost that the task saves it alone, minus half of the cost of its pairs with the
  other robots at the task. So the utilities of all robots add up to the total saving of the team. Utilities are
  doubled, to be integers.
- All robots start without a task. A robot that gains equally much elsewhere stays.
- Robots send a partition to the robots with which they share tasks, when they have moved or adopted it.
- Stamps have 32 bits. If stamps are equal, the robot with higher priority wins.
- A robot that shares no task with others chooses its cheapest value.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.tasks import tasks
>>> from robochoc.model.costs import normalized
>>> result = Simulation(normalized(tasks(4, 4)), GRAPE, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Partition': 24}
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.auctions.market import Auction, Lot, lot_in_words, proofs_of_task
from robochoc.protocols.disclosure import Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import listed


class Partition(wire.Message, frozen=True):
    """A partition of the robots into coalitions, with its age (`Pi`, `r`, `s`).

    `evolution` counts the moves that have led to it, `stamp` is the random number of the last move, which `mover` made.
    `coalitions` contains each robot that does a task, with that robot's name for the task.
    """

    evolution: int
    stamp: int
    mover: str
    coalitions: dict[str, Lot]

    act = Act(Performative.INFORM, "the receiver learns which robots do which tasks as far as the sender knows")

    def in_words(self, words: Wording) -> str:
        who = [f"{robot} does {lot_in_words(words, robot, lot)}" for robot, lot in self.coalitions.items()]
        return f"after move {self.evolution:,}, which was {self.mover}'s, {listed(who) or 'nobody does anything'}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [proof for robot, lot in self.coalitions.items() for proof in proofs_of_task(robot, lot, reception)]


STAMPS = 1 << 32


class GRAPE(Auction):
    """One agent of GRAPE. State: the valid `partition`, as far as it knows, and whether it is `satisfied`."""

    messages = Partition
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Jang, Shin, Tsourdos 2018",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        allocates=True,
        congestion=True,
        privacy="what tasks are worth",
        use_when="several robots may do a task, the more the less it gains",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.partition = Partition(0, 0, "", {})
        self.satisfied = False
        self._own = {self.market.lot(task): task for task in range(len(self.market.rivals))}
        self._received: dict[str, Partition] = {}
        """The partitions that rivals have sent in this step."""

    def start_auction(self) -> None:
        """Join the best coalition."""
        if self._decide():
            self._send_partition()

    def receive(self, sender: str, message: Message) -> None:
        """Store a partition until all waiting messages have been received.

        Raises:
            ValueError: for a partition that these robots cannot have made.
        """
        partition = cast("Partition", message)
        own = partition.coalitions.get(self.problem.agent)
        if sender not in self.market.shared or not {partition.mover, *partition.coalitions} <= self.order.rank.keys():
            raise ValueError(f"{sender} sent a partition of unknown robots, or shares no task with this robot")
        if partition.evolution < 1 or not 0 <= partition.stamp < STAMPS:
            raise ValueError(f"{sender} sent a partition without a move or with an invalid stamp: {partition.stamp}")
        if own is not None and own not in self._own:
            raise ValueError(f"{sender} assigns a task to {self.problem.agent} that it cannot do")
        if sender not in self._received or self._age(partition) > self._age(self._received[sender]):
            self._received[sender] = partition

    def settle(self) -> None:
        """Adopt the valid partition, and move if that gains (D-Mutex)."""
        if self.verdict is not None or not self._received:
            return
        newest = max(self._received.values(), key=self._age)
        if self._age(newest) > self._age(self.partition):
            self.partition, self.satisfied = newest, False
        if not self.satisfied:
            moved = self._decide()
            informed = {rival for rival, known in self._received.items() if known == self.partition and not moved}
            self._send_partition(informed)
        self._received.clear()

    def _age(self, partition: Partition) -> tuple[int, int, int]:
        """Return the key that orders partitions: the partition with the greatest key is valid."""
        return partition.evolution, partition.stamp, -self.order.rank.get(partition.mover, -1)

    def _decide(self) -> bool:
        """Join the coalition with the highest utility; return whether this robot has moved."""
        own = self.problem.agent
        now = self.partition.coalitions.get(own)
        present = None if now is None else self._own[now]
        best, most = present, self._utility(present)
        for task in (None, *range(len(self.market.rivals))):
            utility = self._utility(task)
            if utility > most:
                best, most = task, utility
        self.satisfied = True
        self.bundle = [] if best is None else [best]
        self.choose_bundle()
        if best == present:
            return False
        others = {name: lot for name, lot in self.partition.coalitions.items() if name != own}
        joined = others if best is None else {**others, own: self.market.lot(best)}
        number = self.partition.evolution + 1
        self.partition = Partition(number, int(self.chance() * STAMPS), own, joined)
        return True

    def _utility(self, task: int | None) -> float:
        """Return twice the robot's gain from `task` in the present partition; None means without a task."""
        score = 0 if task is None else self.market.score(task)
        if score is None:
            return -INFINITE
        if task is None:
            return score
        others = sum(self._does(rival, task) for rival in self.market.rivals[task])
        return 2 * score - (others * self.market.congestion[task] if others else 0)

    def _does(self, robot: str, task: int) -> bool:
        lot = self.partition.coalitions.get(robot)
        return lot is not None and self.market.names(robot, lot) == task

    def _send_partition(self, but: set[str] | None = None) -> None:
        """Send the partition to all rivals except those in `but`, which know it already."""
        for rival in self.market.shared:
            if rival not in (but or ()):
                self.send(rival, self.partition)
