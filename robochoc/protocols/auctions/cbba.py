"""Consensus-Based Bundle Algorithm (CBBA).

Each robot builds a bundle of tasks: again and again it adds the one that is worth most, given the bundle, of those
where its bid is above the highest that it knows. Robots tell each other who has which task at what bid. Who is outbid
gives up the task, and all that it added later, as these bids counted on it.

- **When to use**: for task allocation, where robots do several tasks. Robots may be told others' bids by anybody.
- **Guarantees**: incomplete: no proof of optimality. It ends with the outcome of the sequential greedy algorithm. Where
  scores have diminishing marginal gain (`market.py`), the gain is at least half of the optimum. With loads and
  capacities there is no bound. If messages arrive in rounds, it takes `N_t D` rounds at most, of `N_t` tasks and a
  network of diameter `D`. Two robots may take the same task for a while.
- **Reference**: Choi, Brunet, How: "Consensus-based decentralized auctions for robust task allocation", IEEE
  Transactions on Robotics 25(4), 2009, Section IV and Table I.

The paper's procedure:

    phase 1, bundle construction (Algorithm 3)          `_build`
    phase 2, conflict resolution (Table I)              `_action`, `_apply`
    outbid tasks are released (Equation (6))            `_release`
    b, y, z, s                                          `bundle`, `y`, `z`, `s`

Choices that the paper leaves open, and differences:

- A robot does both phases when messages come, not at fixed times. So it tells something only if it is new; and to a
  robot that is wrong about what this one has, as that has reset it (Table I).
- There is no clock: `s` counts each robot's messages. What a later message says of its sender is newer.
- A robot builds its bundle anew from the first task on. The paper's robots keep what stands before a task that is lost,
  and append to it. Where a task comes free that they would have added earlier, their outcome depends on delays.
- Of equal bids that of the robot of higher priority counts.
- Robots tell of a task those only that can do it: they all write to each other.
- Tasks have no order within a bundle: a task's score does not depend on when it is done, and there is no path (`p`).
- Where scores lack diminishing marginal gain, bids are warped (`market.py`), so that it ends then, too.
- A robot that shares no task with others takes its cheapest value.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.tasks import tasks
>>> from robochoc.model.costs import normalized
>>> result = Simulation(normalized(tasks(4, 4)), CBBA, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Bundles': 24}
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, assert_never, cast

from robochoc.model.message import Message
from robochoc.protocols.auctions.market import NO_LIMIT, Auction
from robochoc.protocols.auctions.messages.cbba import Bundles
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem


class Action(Enum):
    """An action of Table I: how a receiver changes its standing of a task."""

    UPDATE = "update"
    LEAVE = "leave"
    RESET = "reset"


class Standing(NamedTuple):
    """The winner of a task and its bid; an empty name: nobody has it."""

    winner: str = ""
    amount: int = 0


NOBODY = Standing()


class CBBA(Auction):
    """One agent of CBBA.

    State: the `standings`, by task the winning bid and its robot (`y` and `z`), and by robot the number of its last
    message whose contents have come to this one (`s`).
    """

    messages = Bundles
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Choi, Brunet, How 2009",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        allocates=True,
        privacy="what tasks are worth, but for bids",
        use_when="tasks are to be allocated, several to a robot",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.standings = [NOBODY] * len(self.market.rivals)
        self.s: dict[str, int] = {}
        self._heard: dict[str, tuple[list[Standing], int]] = {}
        """By rival what its last message has said of the tasks that are shared with it, if that came in this step; and
        the number of the last message of this robot that it knew of."""
        self._told = {rival: ([NOBODY] * len(tasks), 0) for rival, tasks in self.market.shared.items()}
        """By rival what it was told last of these tasks, and the number of that message."""

    def begin(self) -> None:
        """Build a first bundle."""
        self._build()
        self._tell()

    def receive(self, sender: str, message: Message) -> None:
        """Resolve conflicts with the sender, task by task (phase 2)."""
        bundles = cast("Bundles", message)
        heard = {self.market.task(sender, lot): Standing(winner, amount) for lot, winner, amount in bundles.standings}
        if {*heard} != {*self.market.shared.get(sender, ())}:
            raise ValueError(f"{sender} does not speak of all tasks that are shared with it")
        for task, told in heard.items():
            if told != NOBODY:
                self.refuse_winner(task, *told)
            self._apply(self._action(sender, task, told, bundles.stamps), task, told)
        for robot, number in bundles.stamps.items():
            if robot != self.problem.agent:
                self.s[robot] = max(number, self.s.get(robot, 0))
        seen = bundles.stamps.get(self.problem.agent, 0)
        self._heard[sender] = [heard[task] for task in self.market.shared[sender]], seen

    def _action(self, sender: str, task: int, told: Standing, stamps: dict[str, int]) -> Action:
        """Return what Table I says, where `sender` is the paper's agent k, and this robot is agent i."""
        match told.winner:
            case self.problem.agent:
                return self._sender_says_receiver(sender, task, stamps)
            case "":
                return self._sender_says_nobody(sender, task, stamps)
            case winner if winner == sender:
                return self._sender_says_sender(sender, task, told, stamps)
            case _:
                return self._sender_says_another(sender, task, told, stamps)

    def _is_newer(self, robot: str, stamps: dict[str, int]) -> bool:
        """Return whether the sender has newer information of `robot` than this one (s_k > s_i)."""
        return stamps.get(robot, 0) > self.s.get(robot, 0)

    def _is_higher(self, told: Standing, task: int) -> bool:
        """Return whether a bid that was told is above the one that is known (y_k > y_i)."""
        known = self.standings[task]
        return self.outbids(told.winner, told.amount, known.winner or None, known.amount)

    def _sender_says_sender(self, sender: str, task: int, told: Standing, stamps: dict[str, int]) -> Action:
        known = self.standings[task].winner
        if known == self.problem.agent:
            return Action.UPDATE if self._is_higher(told, task) else Action.LEAVE
        if known in {sender, ""}:
            return Action.UPDATE
        return Action.UPDATE if self._is_newer(known, stamps) or self._is_higher(told, task) else Action.LEAVE

    def _sender_says_receiver(self, sender: str, task: int, stamps: dict[str, int]) -> Action:
        known = self.standings[task].winner
        if known in {self.problem.agent, ""}:
            return Action.LEAVE
        return Action.RESET if known == sender or self._is_newer(known, stamps) else Action.LEAVE

    def _sender_says_another(self, sender: str, task: int, told: Standing, stamps: dict[str, int]) -> Action:
        known, winner = self.standings[task].winner, told.winner
        is_newer = self._is_newer(winner, stamps)
        if known == self.problem.agent:
            return Action.UPDATE if is_newer and self._is_higher(told, task) else Action.LEAVE
        if known == sender:
            return Action.UPDATE if is_newer else Action.RESET
        if known in {winner, ""}:
            return Action.UPDATE if is_newer else Action.LEAVE
        known_is_older = self._is_newer(known, stamps)
        if is_newer and (known_is_older or self._is_higher(told, task)):
            return Action.UPDATE
        return Action.RESET if known_is_older and stamps.get(winner, 0) < self.s.get(winner, 0) else Action.LEAVE

    def _sender_says_nobody(self, sender: str, task: int, stamps: dict[str, int]) -> Action:
        known = self.standings[task].winner
        if known in {self.problem.agent, ""}:
            return Action.LEAVE
        return Action.UPDATE if known == sender or self._is_newer(known, stamps) else Action.LEAVE

    def _apply(self, action: Action, task: int, told: Standing) -> None:
        match action:
            case Action.UPDATE:
                self.standings[task] = told
            case Action.RESET:
                self.standings[task] = NOBODY
            case Action.LEAVE:
                pass
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Build the bundle again, and tell (phase 1)."""
        if self.verdict is None and self.market.shared:
            self._build()
            self._tell()

    def _build(self) -> None:
        """Add tasks to the bundle, the best first, as long as there is one where the own bid is the highest."""
        own = self.problem.agent
        self._release()
        limit = NO_LIMIT
        while offer := self.market.best(
            self.bundle, limit, lambda task, amount: self._is_higher(Standing(own, amount), task)
        ):
            limit = offer.amount
            self.bundle.append(offer.task)
            self.standings[offer.task] = Standing(own, limit)
        self.take()

    def _release(self) -> None:
        """Give up the bundle: what nobody else has won comes into it again, unless bids counted on what is lost."""
        for task in self.bundle:
            if self.standings[task].winner == self.problem.agent:
                self.standings[task] = NOBODY
        self.bundle.clear()

    def _tell(self) -> None:
        """Tell each rival what is new; and what is so still, if the rival is wrong about what this robot has."""
        own = self.problem.agent
        number = self.s.get(own, 0) + 1
        for rival, tasks in self.market.shared.items():
            news = [self.standings[task] for task in tasks]
            told, _ = self._told[rival]
            if news != told or self._is_wrong(rival, news):
                near = {rival}.union(*(self.market.rivals[task] for task in tasks))
                stamps = {name: heard for name, heard in self.s.items() if name in near}
                self.s[own] = stamps[own] = number
                self._told[rival] = news, number
                lots = map(self.market.lot, tasks)
                self.send(rival, Bundles([(lot, *one) for lot, one in zip(lots, news, strict=True)], stamps))
        self._heard.clear()

    def _is_wrong(self, rival: str, standings: list[Standing]) -> bool:
        """Return whether the rival, in a message of this step, says something wrong of what this robot has.

        Not if a message is under way to it that says so already.
        """
        own = self.problem.agent
        heard, seen = self._heard.get(rival, (standings, 0))
        return seen >= self._told[rival][1] and any(
            (theirs.winner == own) != (ours.winner == own) or (theirs.winner == own and theirs != ours)
            for theirs, ours in zip(heard, standings, strict=True)
        )
