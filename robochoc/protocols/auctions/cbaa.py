"""Consensus-Based Auction Algorithm (CBAA).

Each robot takes one task at most. It bids for the task that is worth most to it, of those where its bid is above the
highest that it knows. Robots tell each other the highest bids that they know; who is outbid bids for another task.

- **When to use**: for task allocation with one task for each robot. Where robots can do several, CBBA.
- **Guarantees**: incomplete: no proof of optimality. It ends with the outcome of the sequential greedy algorithm,
  which gains at least half of the optimum of one task for each robot. If messages arrive in rounds, it takes `N_t D`
  rounds at most, of `N_t` tasks and a network of diameter `D`. Two robots may take the same task for a while.
- **Reference**: Choi, Brunet, How: "Consensus-based decentralized auctions for robust task allocation", IEEE
  Transactions on Robotics 25(4), 2009, Section III.

The paper's procedure:

    phase 1, the auction (Algorithm 1)       `_select`
    phase 2, consensus (Algorithm 2)         `receive`, `_release`
    x, y, c                                  `bundle`, `y` with `z`, what `market.best` finds

Choices that the paper leaves open, and differences:

- A robot does both phases when messages come, not at fixed times, and sends only bids that the receiver may not know.
- The winner is told with each bid, as otherwise two equal bids could not be told apart. Of equal bids that of the robot
  of higher priority counts.
- Robots tell of a task those only that can do it: they all write to each other.
- A robot that shares no task with others takes its cheapest value.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.tasks import tasks
>>> from robochoc.model.costs import normalized
>>> result = Simulation(normalized(tasks(4, 4)), CBAA, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'WinningBids': 18}
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.auctions.market import NO_LIMIT, Auction, Lot, bid_proves, lot_in_words
from robochoc.protocols.disclosure import Hearing, Proof
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.compiled import LocalProblem
from robochoc.system.plain_text import listed

WinningBid = tuple[Lot, str, int]
"""A task as the sender names it, who has it as far as the sender knows, and for how much."""


class WinningBids(wire.Message, frozen=True):
    """The highest bids that the sender knows, and the receiver may not (`y`, with the winners)."""

    bids: list[WinningBid]

    act = Act(Performative.INFORM, "the receiver comes to know the highest bids that the sender knows")

    def in_words(self, words: Wording) -> str:
        return listed([winning_bid_in_words(words, *bid) for bid in self.bids])

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what the sender has bid itself."""
        return winning_bids_prove(self.bids, hearing)


def winning_bid_in_words(words: Wording, lot: Lot, winner: str, amount: int) -> str:
    """Return who has a task: `task V1 = 3 is mine for 7`, `task V1 = 3 is Robot2's for 7`."""
    task = lot_in_words(words, words.sender, lot)
    if not winner:
        return f"{task} is nobody's"
    whose = {words.sender: "mine", words.receiver: "yours"}.get(winner, f"{winner}'s")
    return f"{task} is {whose} for {amount:,}"


def winning_bids_prove(standings: Sequence[WinningBid], hearing: Hearing) -> list[Proof]:
    """Return what the bids of the sender in `standings` prove.

    Who else has won is told by the sender's name for the task, which is not the winner's.
    """
    own = [(lot, amount) for lot, winner, amount in standings if winner == hearing.sender]
    return [proof for lot, amount in own for proof in bid_proves(hearing.sender, lot, amount, hearing)]


class CBAA(Auction):
    """One agent of CBAA. State: the highest bid that it knows for each task (`y`), and whose that is (`z`)."""

    messages = WinningBids
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Choi, Brunet, How 2009",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        allocates=True,
        privacy="what tasks are worth, but for bids",
        use_when="tasks are to be allocated, one to a robot",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.y: dict[int, int] = {}
        self.z: dict[int, str] = {}
        self._known = {rival: dict[int, tuple[str, int]]() for rival in self.market.shared}
        """For each rival the best bids that it has told, or was told."""

    def start_auction(self) -> None:
        """Bid for the best task."""
        self._select()
        self._tell()

    def receive(self, sender: str, message: Message) -> None:
        """Keep the higher of the bids for each task."""
        for lot, winner, amount in cast("WinningBids", message).bids:
            task = self.market.task(sender, lot)
            self.refuse_winner(task, winner, amount)
            known = self._known[sender]
            if self.outbids(winner, amount, *known.get(task, (None, 0))):
                known[task] = winner, amount
            if self.outbids(winner, amount, self.z.get(task), self.y.get(task, 0)):
                self.y[task], self.z[task] = amount, winner

    def settle(self) -> None:
        """Give up a task that another robot has won, bid for another one, and tell."""
        if self.verdict is None and self.market.shared:
            self._release()
            self._select()
            self._tell()

    def _release(self) -> None:
        self.bundle = [task for task in self.bundle if self.z[task] == self.problem.agent]

    def _select(self) -> None:
        """Take the best task for which no bid as good is known, if the robot has none."""
        if not self.bundle:
            own = self.problem.agent
            offer = self.market.best(
                (), NO_LIMIT, lambda task, amount: self.outbids(own, amount, self.z.get(task), self.y.get(task, 0))
            )
            if offer is not None:
                self.bundle = [offer.task]
                self.y[offer.task], self.z[offer.task] = offer.amount, own
        self.choose_bundle()

    def _tell(self) -> None:
        """Tell each rival the bids that are above those that it has told, or was told."""
        for rival, tasks in self.market.shared.items():
            known = self._known[rival]
            news = [task for task in tasks if task in self.z and known.get(task) != (self.z[task], self.y[task])]
            if news:
                self.send(rival, WinningBids([(self.market.lot(task), self.z[task], self.y[task]) for task in news]))
                known.update({task: (self.z[task], self.y[task]) for task in news})
