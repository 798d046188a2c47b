"""Consensus-Based Bundle Algorithm (CBBA).

Each robot builds a bundle of tasks: it repeatedly adds the task that is worth most, given the bundle, among those for
which its bid is above the highest known bid. Robots send each other the winner and the bid of each task. A robot that
is outbid gives up the task, and all tasks that it added later, because those bids depended on it.

- **When to use**: for task allocation in which robots do several tasks, and any robot may learn the others' bids.
- **Guarantees**: incomplete: no proof of optimality. It ends with the outcome of the sequential greedy algorithm. If
  scores have diminishing marginal gain (`market.py`), the gain is at least half of the optimum. With loads and
  capacities there is no bound. If messages arrive in rounds, it needs at most `N_t D` rounds, for `N_t` tasks and a
  network of diameter `D`. Two robots may have the same task for a while.
- **Reference**: Choi, Brunet, How: "Consensus-based decentralized auctions for robust task allocation", IEEE
  Transactions on Robotics 25(4), 2009, Section IV and Table I.

The paper's procedure:

    phase 1, bundle construction (Algorithm 3)          `_build`
    phase 2, conflict resolution (Table I)              `_action`, `_apply`
    outbid tasks are released (Equation (6))            `_release`
    b, y, z, s                                          `bundle`, `y`, `z`, `s`

Choices that the paper leaves open, and differences:

- A robot executes both phases when messages arrive, not at fixed times. So it sends only news, and corrections to a
  robot that is wrong about this robot's tasks, because that robot has reset them (Table I).
- The paper's messages contain all of `y` and `z`. Here they contain what was not sent to the receiver before, and the
  receiver stores it: Table I is applied to all tasks at each message. If sender and receiver agree on a task, no row of
  the table changes anything; so only the other tasks are examined.
- There is no clock: `s` counts each robot's messages. Information from a later message of the same sender is newer.
- A robot rebuilds its bundle from the first task on. The paper's robots keep the tasks before a lost one, and append to
  them. If a task becomes free that they would have added earlier, their outcome depends on delays.
- If bids are equal, the robot with higher priority wins.
- Robots send their bids for a task only to robots that can do the task: all of these send messages to each other.
- Tasks have no order within a bundle: a task's score does not depend on when it is done, and there is no path (`p`).
- If scores lack diminishing marginal gain, bids are warped (`market.py`), so that the search also ends then.
- A robot that shares no task with others chooses its cheapest value.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.tasks import tasks
>>> from robochoc.model.costs import normalized
>>> result = Simulation(normalized(tasks(4, 4)), CBBA, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Bundles': 24}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple, assert_never, cast

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.auctions.cbaa import WinningBid, winning_bid_in_words, winning_bids_prove
from robochoc.protocols.auctions.market import NO_LIMIT, Auction
from robochoc.protocols.disclosure import Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed


class Bundles(wire.Message, frozen=True):
    """The winning bids and agents (`y`, `z`) that are new to the receiver, and the age of all information so far (`s`).

    The winner of a task that no robot has is empty. `stamps` are for the robots that can do a task which both ends can
    do, in priority order: the number of the last message of each that the sender has processed; for the sender, the
    number of this message.
    """

    standings: list[WinningBid]
    stamps: list[int]

    act = Act(Performative.INFORM, "the receiver learns which robot has which task as far as the sender knows")
    shareable = True

    def in_words(self, words: Wording) -> str:
        return listed([winning_bid_in_words(words, *one) for one in self.standings])

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return winning_bids_prove(self.standings, reception)


class TableAction(Enum):
    """An action in Table I: a change of the receiver's standing of a task."""

    UPDATE = "update"
    LEAVE = "leave"
    RESET = "reset"


class Standing(NamedTuple):
    """The winner of a task and its bid; an empty name if no robot has the task."""

    winner: str = ""
    amount: int = 0


NOBODY = Standing()


@dataclass(frozen=True)
class Rivalry:
    """The rivals that share the same tasks with this robot. All of them receive the same information.

    Attributes:
        tasks: The shared tasks.
        near: All robots that can do one of these tasks, in priority order, including this robot. Messages contain their
            `s`.
        place: The index of each of these robots in `near`.
        sent: The standing of each task that was last sent to these rivals; a task without an entry has no winner.
    """

    tasks: frozenset[int]
    near: tuple[str, ...]
    place: Mapping[str, int]
    sent: dict[int, Standing]


@dataclass(frozen=True)
class Stamps:
    """The numbers `s` in a message, by robot."""

    place: Mapping[str, int]
    numbers: Sequence[int]

    def __getitem__(self, robot: str) -> int:
        """Return the number of `robot`'s last message whose contents the sender knows, directly or through others."""
        return self.numbers[self.place[robot]]


class CBBA(Auction):
    """One agent of CBBA.

    State: the `standings`, which are the winning bid and its robot for each task (`y` and `z`), and, for each robot,
    the number of its last message whose contents have reached this robot (`s`).
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
        share_of_optimum=0.5,
        use_when="tasks are to be allocated, several to a robot",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        rivals = self.market.rivals
        self.standings = [NOBODY] * len(rivals)
        self.rivalries = self._rivalries()
        self.s = dict.fromkeys([name for one in self.rivalries.values() for name in one.near], 0)
        seats = {names: {name: seat for seat, name in enumerate(names)} for names in rivals}
        self._seats = [seats[names] for names in rivals]
        """For each task, the index of each rival among the task's rivals."""
        self._last_standings = [[NOBODY] * len(names) for names in rivals]
        """For each task, the last standing that each rival sent."""
        self._differing: dict[str, set[int]] = {rival: set() for rival in self.rivalries}
        """For each rival, the tasks for which its last standing differs from this robot's."""
        self._credited: dict[str, set[int]] = {rival: set() for rival in self.rivalries}
        """For each rival, the tasks that this robot has according to the rival's last message."""
        self._acknowledged: dict[str, int] = {}
        """For each rival with a message in this step, this robot's last message that the rival had processed."""
        self._numbers = dict.fromkeys(self.rivalries, 0)
        """For each rival, the number of the last message sent to it."""
        self._news: set[int] = set()
        """The tasks that may have changed since the last step."""

    def _rivalries(self) -> dict[str, Rivalry]:
        """Return, for each rival, the tasks that it shares with this robot."""
        found: dict[frozenset[int], Rivalry] = {}
        for tasks in map(frozenset, self.market.shared.values()):
            if tasks not in found:
                names = {self.problem.agent}.union(*(self.market.rivals[task] for task in tasks))
                near = tuple(sorted(names, key=self.order.rank.__getitem__))
                found[tasks] = Rivalry(tasks, near, {name: place for place, name in enumerate(near)}, {})
        return {rival: found[frozenset(tasks)] for rival, tasks in self.market.shared.items()}

    def start_auction(self) -> None:
        """Build a first bundle."""
        self._build()
        self._send_news()

    def receive(self, sender: str, message: Message) -> None:
        """Resolve conflicts with the sender, task by task (phase 2)."""
        bundles = cast("Bundles", message)
        rivalry = self.rivalries.get(sender)
        if rivalry is None or len(bundles.stamps) != len(rivalry.near):
            raise ValueError(f"{sender} sent {len(bundles.stamps)} stamps, not one for each rival")
        for lot, winner, amount in bundles.standings:
            self._record(sender, self.market.task(sender, lot), winner, amount)
        stamps = Stamps(rivalry.place, bundles.stamps)
        for task in [*self._differing[sender]]:
            received = self._last_standings[task][self._seats[task][sender]]
            self._apply(self._action(sender, task, received, stamps), task, received)
        own, s = self.problem.agent, self.s
        before = s[own]
        for name, number in zip(rivalry.near, bundles.stamps, strict=True):
            if number > s[name]:  # noqa: PLR1730 - faster
                s[name] = number
        s[own] = before
        self._acknowledged[sender] = stamps[own]

    def _record(self, sender: str, task: int, winner: str, amount: int) -> None:
        """Store a rival's standing of a task."""
        received = self.standings[task]
        if received == (winner, amount):
            self._differing[sender].discard(task)
        else:
            received = Standing(winner, amount)
            if received != NOBODY:
                self.refuse_winner(task, winner, amount)
            self._differing[sender].add(task)
        self._last_standings[task][self._seats[task][sender]] = received
        if winner == self.problem.agent:
            self._credited[sender].add(task)
        else:
            self._credited[sender].discard(task)

    def set_standing(self, task: int, standing: Standing) -> None:
        """Change this robot's standing of a task."""
        if standing != self.standings[task]:
            self.standings[task] = standing
            self._news.add(task)
            for rival, sent in zip(self.market.rivals[task], self._last_standings[task], strict=True):
                if sent == standing:
                    self._differing[rival].discard(task)
                else:
                    self._differing[rival].add(task)

    def _action(self, sender: str, task: int, received: Standing, stamps: Stamps) -> TableAction:
        """Return the action from Table I, where `sender` is the paper's agent k, and this robot is agent i."""
        match received.winner:
            case self.problem.agent:
                return self._sender_names_receiver(sender, task, stamps)
            case "":
                return self._sender_names_nobody(sender, task, stamps)
            case winner if winner == sender:
                return self._sender_names_sender(sender, task, received, stamps)
            case _:
                return self._sender_names_another(sender, task, received, stamps)

    def _is_newer(self, robot: str, stamps: Stamps) -> bool:
        """Return whether the sender has newer information about `robot` than this robot (s_k > s_i)."""
        return stamps[robot] > self.s[robot]

    def _is_higher(self, received: Standing, task: int) -> bool:
        """Return whether a received bid is above the known bid (y_k > y_i)."""
        known = self.standings[task]
        return self.outbids(received.winner, received.amount, known.winner or None, known.amount)

    def _sender_names_sender(self, sender: str, task: int, received: Standing, stamps: Stamps) -> TableAction:
        known = self.standings[task].winner
        if known == self.problem.agent:
            return TableAction.UPDATE if self._is_higher(received, task) else TableAction.LEAVE
        if known in {sender, ""}:
            return TableAction.UPDATE
        return (
            TableAction.UPDATE
            if self._is_newer(known, stamps) or self._is_higher(received, task)
            else TableAction.LEAVE
        )

    def _sender_names_receiver(self, sender: str, task: int, stamps: Stamps) -> TableAction:
        known = self.standings[task].winner
        if known in {self.problem.agent, ""}:
            return TableAction.LEAVE
        return TableAction.RESET if known == sender or self._is_newer(known, stamps) else TableAction.LEAVE

    def _sender_names_another(self, sender: str, task: int, received: Standing, stamps: Stamps) -> TableAction:
        known, winner = self.standings[task].winner, received.winner
        is_newer = self._is_newer(winner, stamps)
        if known == self.problem.agent:
            return TableAction.UPDATE if is_newer and self._is_higher(received, task) else TableAction.LEAVE
        if known == sender:
            return TableAction.UPDATE if is_newer else TableAction.RESET
        if known in {winner, ""}:
            return TableAction.UPDATE if is_newer else TableAction.LEAVE
        known_is_older = self._is_newer(known, stamps)
        if is_newer and (known_is_older or self._is_higher(received, task)):
            return TableAction.UPDATE
        return TableAction.RESET if known_is_older and stamps[winner] < self.s[winner] else TableAction.LEAVE

    def _sender_names_nobody(self, sender: str, task: int, stamps: Stamps) -> TableAction:
        known = self.standings[task].winner
        if known in {self.problem.agent, ""}:
            return TableAction.LEAVE
        return TableAction.UPDATE if known == sender or self._is_newer(known, stamps) else TableAction.LEAVE

    def _apply(self, action: TableAction, task: int, received: Standing) -> None:
        match action:
            case TableAction.UPDATE:
                self.set_standing(task, received)
            case TableAction.RESET:
                self.set_standing(task, NOBODY)
            case TableAction.LEAVE:
                pass
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Rebuild the bundle, and send the news (phase 1)."""
        if self.verdict is None and self.market.shared:
            self._build()
            self._send_news()

    def _build(self) -> None:
        """Add tasks to the bundle, the best first, as long as this robot's bid for one is the highest."""
        own = self.problem.agent
        released = self._released()
        limit, bids = NO_LIMIT, dict[int, Standing]()

        def is_highest(task: int, amount: int) -> bool:
            known = NOBODY if task in released else self.standings[task]
            return self.outbids(own, amount, known.winner or None, known.amount)

        self.bundle.clear()
        while offer := self.market.best(self.bundle, limit, is_highest):
            limit = offer.amount
            self.bundle.append(offer.task)
            bids[offer.task] = Standing(own, limit)
        for task in released - bids.keys():
            self.set_standing(task, NOBODY)
        for task, bid in bids.items():
            self.set_standing(task, bid)
        self.choose_bundle()

    def _released(self) -> set[int]:
        """Return the tasks to release: those in the bundle that no other robot has won.

        They are added again, unless their bids depended on lost tasks.
        """
        return {task for task in self.bundle if self.standings[task].winner == self.problem.agent}

    def _send_news(self) -> None:
        """Send each rival the news, and a correction if the rival is wrong about this robot's tasks."""
        own = self.problem.agent
        number = self.s[own] + 1
        messages: dict[int, Bundles | None] = {}
        for rival, rivalry in self.rivalries.items():
            key = id(rivalry)
            if key not in messages:
                messages[key] = self._message(rivalry, self._unknown(rivalry), number)
            message = messages[key]
            if message is None and rival in self._acknowledged:
                message = self._message(rivalry, self._mistaken(rival), number)
            if message is not None:
                self.s[own] = self._numbers[rival] = number
                self.send(rival, message)
        self._news.clear()
        self._acknowledged.clear()

    def _unknown(self, rivalry: Rivalry) -> list[int]:
        """Return the tasks whose standings these rivals do not know; mark them as sent."""
        sent = rivalry.sent
        tasks = [task for task in self._news & rivalry.tasks if self.standings[task] != sent.get(task, NOBODY)]
        sent.update({task: self.standings[task] for task in tasks})
        return tasks

    def _mistaken(self, rival: str) -> list[int]:
        """Return the tasks for which the rival, in a message of this step, is wrong about this robot's tasks.

        Returns none if a message in transit to the rival already corrects them.
        """
        if self._acknowledged[rival] < self._numbers[rival]:
            return []
        claimed = self.rivalries[rival].tasks.intersection(self.bundle)
        return [*(self._credited[rival] | claimed) & self._differing[rival]]

    def _message(self, rivalry: Rivalry, tasks: list[int], number: int) -> Bundles | None:
        """Return a message about `tasks`, with its `number`; None if there are no tasks."""
        if not tasks:
            return None
        standings = [(self.market.lot(task), *self.standings[task]) for task in sorted(tasks)]
        stamps = [self.s[name] for name in rivalry.near]
        stamps[rivalry.place[self.problem.agent]] = number
        return Bundles(standings, stamps)
