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
- The paper's messages hold all of `y` and `z`. Here they hold what the receiver has not been told yet, and the receiver
  keeps what was said of the rest: Table I is applied to all tasks at each message. Where both ends say the same of a
  task, none of its rows changes anything; so only those are looked at where they do not.
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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, assert_never, cast

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.auctions.cbaa import WinningBid, winning_bid_in_words, winning_bids_prove
from robochoc.protocols.auctions.market import NO_LIMIT, Auction
from robochoc.protocols.disclosure import Hearing, Proof
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.compiled import LocalProblem
from robochoc.system.plain_text import listed


class Bundles(wire.Message, frozen=True):
    """The winning bids and agents (`y`, `z`) that are new to the receiver, and how new all that was said is (`s`).

    The winner of a task that nobody has is empty. `stamps` has the number of the last message that the sender has taken
    in of each robot that can do a task which both ends can do, in priority order; that of the sender is the number of
    this message.
    """

    standings: list[WinningBid]
    stamps: list[int]

    act = Act(Performative.INFORM, "the receiver comes to know who has which task as far as the sender knows")
    shareable = True

    def in_words(self, words: Wording) -> str:
        return listed([winning_bid_in_words(words, *one) for one in self.standings])

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what the sender has bid itself."""
        return winning_bids_prove(self.standings, hearing)


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


@dataclass(frozen=True)
class Rivalry:
    """The rivals that share the same tasks with this robot. They are told the same.

    Attributes:
        tasks: These tasks.
        near: All robots that can do one of them, in priority order, this one among them: their numbers `s` are told.
        place: The place of each of these robots in `near`.
        told: What these rivals know that this robot says of each task. What is not here is nobody's.
    """

    tasks: frozenset[int]
    near: tuple[str, ...]
    place: Mapping[str, int]
    told: dict[int, Standing]


@dataclass(frozen=True)
class Stamps:
    """The numbers `s` of a message, by robot."""

    place: Mapping[str, int]
    numbers: Sequence[int]

    def __getitem__(self, robot: str) -> int:
        """Return the number of `robot`'s last message that the sender has taken in, directly or through others."""
        return self.numbers[self.place[robot]]


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
        rivals = self.market.rivals
        self.standings = [NOBODY] * len(rivals)
        self.rivalries = self._rivalries()
        self.s = dict.fromkeys([name for one in self.rivalries.values() for name in one.near], 0)
        seats = {names: {name: seat for seat, name in enumerate(names)} for names in rivals}
        self._seats = [seats[names] for names in rivals]
        """By task the place of each rival among those of the task."""
        self._said = [[NOBODY] * len(names) for names in rivals]
        """By task what each rival has said last of it."""
        self._differing: dict[str, set[int]] = {rival: set() for rival in self.rivalries}
        """By rival the tasks of which it has said something else than this robot would say now."""
        self._credited: dict[str, set[int]] = {rival: set() for rival in self.rivalries}
        """By rival the tasks that this robot has, as the rival has said last."""
        self._heard: dict[str, int] = {}
        """By rival whose message came in this step, the number of the last message of this robot that it knew of."""
        self._numbers = dict.fromkeys(self.rivalries, 0)
        """By rival the number of the last message to it."""
        self._news: set[int] = set()
        """The tasks of which something may have changed since the last step."""

    def _rivalries(self) -> dict[str, Rivalry]:
        """Return by rival what it shares with this robot."""
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
        self._tell()

    def receive(self, sender: str, message: Message) -> None:
        """Resolve conflicts with the sender, task by task (phase 2)."""
        bundles = cast("Bundles", message)
        rivalry = self.rivalries.get(sender)
        if rivalry is None or len(bundles.stamps) != len(rivalry.near):
            raise ValueError(f"{sender} does not say how new its information of each robot is")
        for lot, winner, amount in bundles.standings:
            self._listen(sender, self.market.task(sender, lot), winner, amount)
        stamps = Stamps(rivalry.place, bundles.stamps)
        for task in [*self._differing[sender]]:
            told = self._said[task][self._seats[task][sender]]
            self._apply(self._action(sender, task, told, stamps), task, told)
        own, s = self.problem.agent, self.s
        before = s[own]
        for name, number in zip(rivalry.near, bundles.stamps, strict=True):
            if number > s[name]:  # noqa: PLR1730 - faster
                s[name] = number
        s[own] = before
        self._heard[sender] = stamps[own]

    def _listen(self, sender: str, task: int, winner: str, amount: int) -> None:
        """Keep what a rival says of a task."""
        told = self.standings[task]
        if told == (winner, amount):
            self._differing[sender].discard(task)
        else:
            told = Standing(winner, amount)
            if told != NOBODY:
                self.refuse_winner(task, winner, amount)
            self._differing[sender].add(task)
        self._said[task][self._seats[task][sender]] = told
        if winner == self.problem.agent:
            self._credited[sender].add(task)
        else:
            self._credited[sender].discard(task)

    def know(self, task: int, standing: Standing) -> None:
        """Change what this robot knows of a task."""
        if standing != self.standings[task]:
            self.standings[task] = standing
            self._news.add(task)
            for rival, said in zip(self.market.rivals[task], self._said[task], strict=True):
                if said == standing:
                    self._differing[rival].discard(task)
                else:
                    self._differing[rival].add(task)

    def _action(self, sender: str, task: int, told: Standing, stamps: Stamps) -> Action:
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

    def _is_newer(self, robot: str, stamps: Stamps) -> bool:
        """Return whether the sender has newer information of `robot` than this one (s_k > s_i)."""
        return stamps[robot] > self.s[robot]

    def _is_higher(self, told: Standing, task: int) -> bool:
        """Return whether a bid that was told is above the one that is known (y_k > y_i)."""
        known = self.standings[task]
        return self.outbids(told.winner, told.amount, known.winner or None, known.amount)

    def _sender_says_sender(self, sender: str, task: int, told: Standing, stamps: Stamps) -> Action:
        known = self.standings[task].winner
        if known == self.problem.agent:
            return Action.UPDATE if self._is_higher(told, task) else Action.LEAVE
        if known in {sender, ""}:
            return Action.UPDATE
        return Action.UPDATE if self._is_newer(known, stamps) or self._is_higher(told, task) else Action.LEAVE

    def _sender_says_receiver(self, sender: str, task: int, stamps: Stamps) -> Action:
        known = self.standings[task].winner
        if known in {self.problem.agent, ""}:
            return Action.LEAVE
        return Action.RESET if known == sender or self._is_newer(known, stamps) else Action.LEAVE

    def _sender_says_another(self, sender: str, task: int, told: Standing, stamps: Stamps) -> Action:
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
        return Action.RESET if known_is_older and stamps[winner] < self.s[winner] else Action.LEAVE

    def _sender_says_nobody(self, sender: str, task: int, stamps: Stamps) -> Action:
        known = self.standings[task].winner
        if known in {self.problem.agent, ""}:
            return Action.LEAVE
        return Action.UPDATE if known == sender or self._is_newer(known, stamps) else Action.LEAVE

    def _apply(self, action: Action, task: int, told: Standing) -> None:
        match action:
            case Action.UPDATE:
                self.know(task, told)
            case Action.RESET:
                self.know(task, NOBODY)
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
            self.know(task, NOBODY)
        for task, bid in bids.items():
            self.know(task, bid)
        self.choose_bundle()

    def _released(self) -> set[int]:
        """Return the tasks that are given up: all of the bundle that nobody else has won.

        They come into it again, unless bids counted on what is lost.
        """
        return {task for task in self.bundle if self.standings[task].winner == self.problem.agent}

    def _tell(self) -> None:
        """Tell each rival what is new; and what is so still, if the rival is wrong about what this robot has."""
        own = self.problem.agent
        number = self.s[own] + 1
        said: dict[int, Bundles | None] = {}
        for rival, rivalry in self.rivalries.items():
            key = id(rivalry)
            if key not in said:
                said[key] = self._message(rivalry, self._unknown(rivalry), number)
            message = said[key]
            if message is None and rival in self._heard:
                message = self._message(rivalry, self._mistaken(rival), number)
            if message is not None:
                self.s[own] = self._numbers[rival] = number
                self.send(rival, message)
        self._news.clear()
        self._heard.clear()

    def _unknown(self, rivalry: Rivalry) -> list[int]:
        """Return the tasks of which these rivals have not been told what this robot knows; they will be."""
        told = rivalry.told
        tasks = [task for task in self._news & rivalry.tasks if self.standings[task] != told.get(task, NOBODY)]
        told.update({task: self.standings[task] for task in tasks})
        return tasks

    def _mistaken(self, rival: str) -> list[int]:
        """Return the tasks of which the rival, in a message of this step, says something wrong of what this robot has.

        None if a message is under way to it that says so already.
        """
        if self._heard[rival] < self._numbers[rival]:
            return []
        claimed = self.rivalries[rival].tasks.intersection(self.bundle)
        return [*(self._credited[rival] | claimed) & self._differing[rival]]

    def _message(self, rivalry: Rivalry, tasks: list[int], number: int) -> Bundles | None:
        """Return what is said of `tasks`, with the number of this message; None if there are none."""
        if not tasks:
            return None
        standings = [(self.market.lot(task), *self.standings[task]) for task in sorted(tasks)]
        stamps = [self.s[name] for name in rivalry.near]
        stamps[rivalry.place[self.problem.agent]] = number
        return Bundles(standings, stamps)
