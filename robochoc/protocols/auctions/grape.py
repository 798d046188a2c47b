"""GRoup Agent Partitioning and placing Event (GRAPE).

Each robot joins the coalition for one task, or none. What a task gains a robot falls as its coalition grows. All robots
keep a partition into coalitions; who would gain more elsewhere moves there, and tells the new partition. Of several
partitions that with the most moves counts, and of equally many one that is drawn at random.

- **When to use**: for task allocation where several robots may do a task, the more the less it gains each. The only
  such protocol here; where a task is for one robot, `ssi` and `cbaa` gain more.
- **Guarantees**: incomplete: no proof of optimality. It ends in a Nash stable partition: no robot gains by moving
  alone. Where the gain of a coalition never falls as robots join it, all gain at least half of the optimum together
  (as in any valid utility game: Vetta, FOCS 2002). Where robots exclude each other there is no bound.
- **Reference**: Jang, Shin, Tsourdos: "Anonymous hedonic game for task allocation in a large-scale multiple agent
  system", IEEE Transactions on Robotics 34(6), 2018.

The paper's procedure:

    decision making (Algorithm 1)             `_decide`
    D-Mutex (Algorithm 2)                     `settle`
    Pi, r, s, satisfied                       `partition`, whose fields they are; `satisfied`
    u_i(t_j, |S_j|)                           `_utility`

Choices that the paper leaves open, and differences:

- A robot's utility in a task is what the task saves it alone, less half of what its pairs with the others there cost.
  So the utilities of all robots add up to what the team saves. It is kept twice as large, and so an integer.
- All start with no task. A robot that gains as much elsewhere stays.
- Robots tell a partition to those they share tasks with, when they have moved, or have taken it over.
- Stamps have 32 bits. Of equal ones the robot of higher priority counts.
- A robot that shares no task with others takes its cheapest value.

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
from robochoc.protocols.auctions.market import Auction, Lot, does_proves, lot_in_words
from robochoc.protocols.disclosure import Hearing, Proof
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.compiled import LocalProblem
from robochoc.system.plain_text import listed


class Partition(wire.Message, frozen=True):
    """A partition of the robots into coalitions, and how new it is (`Pi`, `r`, `s`).

    `evolution` counts the moves that have led to it, `stamp` is the random number of the last one, which `mover` has
    made. `coalitions` has each robot that does a task, with that robot's name for it.
    """

    evolution: int
    stamp: int
    mover: str
    coalitions: dict[str, Lot]

    act = Act(Performative.INFORM, "the receiver comes to know who does what as far as the sender knows")

    def in_words(self, words: Wording) -> str:
        who = [f"{robot} does {lot_in_words(words, robot, lot)}" for robot, lot in self.coalitions.items()]
        return f"after move {self.evolution:,}, which was {self.mover}'s, {listed(who) or 'nobody does anything'}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what each robot can do that does something."""
        return [proof for robot, lot in self.coalitions.items() for proof in does_proves(robot, lot, hearing)]


STAMPS = 1 << 32


class GRAPE(Auction):
    """One agent of GRAPE. State: the `partition` that counts, as far as it knows, and whether it is `satisfied`."""

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
        self._heard: dict[str, Partition] = {}
        """The partitions that rivals have told in this step."""

    def start_auction(self) -> None:
        """Join the best coalition."""
        if self._decide():
            self._tell()

    def receive(self, sender: str, message: Message) -> None:
        """Keep a partition until all waiting messages are there.

        Raises:
            ValueError: where it is none of these robots.
        """
        partition = cast("Partition", message)
        own = partition.coalitions.get(self.problem.agent)
        if sender not in self.market.shared or not {partition.mover, *partition.coalitions} <= self.order.rank.keys():
            raise ValueError(f"{sender} speaks of robots that are not there, or shares no task")
        if partition.evolution < 1 or not 0 <= partition.stamp < STAMPS:
            raise ValueError(f"{sender} tells a partition that nobody has made")
        if own is not None and own not in self._own:
            raise ValueError(f"{sender} says that {self.problem.agent} does a task that it cannot do")
        if sender not in self._heard or self._age(partition) > self._age(self._heard[sender]):
            self._heard[sender] = partition

    def settle(self) -> None:
        """Take over the partition that counts, and move if that gains (D-Mutex)."""
        if self.verdict is not None or not self._heard:
            return
        newest = max(self._heard.values(), key=self._age)
        if self._age(newest) > self._age(self.partition):
            self.partition, self.satisfied = newest, False
        if not self.satisfied:
            moved = self._decide()
            told = {rival for rival, heard in self._heard.items() if heard == self.partition and not moved}
            self._tell(told)
        self._heard.clear()

    def _age(self, partition: Partition) -> tuple[int, int, int]:
        """Return what makes a partition count: the more of it, the newer."""
        return partition.evolution, partition.stamp, -self.order.rank.get(partition.mover, -1)

    def _decide(self) -> bool:
        """Join the coalition with the highest utility; return whether that is a move."""
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
        """Return twice what the robot gains by `task`, in the present partition; None: by none."""
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

    def _tell(self, but: set[str] | None = None) -> None:
        """Tell the partition to all rivals `but` those that know it."""
        for rival in self.market.shared:
            if rival not in (but or ()):
                self.send(rival, self.partition)
