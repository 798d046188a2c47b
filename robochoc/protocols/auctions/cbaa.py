"""Consensus-Based Auction Algorithm (CBAA).

Each robot does at most one task. It bids for the task that is worth most to it, among those for which its bid is above
the highest known bid. Robots send each other the highest bids that they know; a robot that is outbid bids for another
task.

- **When to use**: for task allocation with one task for each robot. If robots can do several tasks, use CBBA.
- **Guarantees**: incomplete: no proof of optimality. It ends with the outcome of the sequential greedy algorithm, which
  gains at least half of the optimum for one task per robot. If messages arrive in rounds, it needs at most `N_t D`
  rounds, for `N_t` tasks and a network of diameter `D`. Two robots may have the same task for a while.
- **Reference**: Choi, Brunet, How: "Consensus-based decentralized auctions for robust task allocation", IEEE
  Transactions on Robotics 25(4), 2009, Section III.

The paper's procedure:

    phase 1, the auction (Algorithm 1)       `_select`
    phase 2, consensus (Algorithm 2)         `receive`, `_release`
    x, y, c                                  `bundle`, `y` with `z`, what `market.best` finds

Choices that the paper leaves open, and differences:

- A robot executes both phases when messages arrive, not at fixed times, and sends only bids that the receiver may not
  know.
- A message names the winner of each bid, to distinguish equal bids. If bids are equal, the robot with higher priority
  wins.
- Robots send their bids for a task only to robots that can do the task: all of these send messages to each other.
- A robot that shares no task with others chooses its cheapest value.

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
from robochoc.protocols.auctions.market import NO_LIMIT, Auction, Lot, lot_in_words, proofs_of_bid
from robochoc.protocols.disclosure import Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import listed

WinningBid = tuple[Lot, str, int]
"""A task, identified by the sender's name for it, its winner as far as the sender knows, and the winner's bid."""


class WinningBids(wire.Message, frozen=True):
    """The highest bids that the sender knows and the receiver may not know (`y`, with the winners)."""

    bids: list[WinningBid]

    act = Act(Performative.INFORM, "the receiver learns the highest bids that the sender knows")

    def in_words(self, words: Wording) -> str:
        return listed([winning_bid_in_words(words, *bid) for bid in self.bids])

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return winning_bids_prove(self.bids, reception)


def winning_bid_in_words(words: Wording, lot: Lot, winner: str, amount: int) -> str:
    """Return a sentence about a task and its winner: `task V1 = 3 is mine for 7`, `task V1 = 3 is Robot2's for 7`."""
    task = lot_in_words(words, words.sender, lot)
    if not winner:
        return f"{task} is nobody's"
    whose = {words.sender: "mine", words.receiver: "yours"}.get(winner, f"{winner}'s")
    return f"{task} is {whose} for {amount:,}"


def winning_bids_prove(standings: Sequence[WinningBid], reception: Reception) -> list[Proof]:
    """Return the proofs in the sender's own bids in `standings`.

    Bids of other winners prove nothing, because the sender's name for a task is not the winner's.
    """
    own = [(lot, amount) for lot, winner, amount in standings if winner == reception.sender]
    return [proof for lot, amount in own for proof in proofs_of_bid(reception.sender, lot, amount, reception)]


class CBAA(Auction):
    """One agent of CBAA. State: the highest known bid for each task (`y`), and the bidder (`z`)."""

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
        share_of_optimum=0.5,
        use_when="tasks are to be allocated, one to a robot",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.y: dict[int, int] = {}
        self.z: dict[int, str] = {}
        self._sent_bids = {rival: dict[int, tuple[str, int]]() for rival in self.market.shared}
        """For each rival, the best bids that were sent to it or received from it."""

    def start_auction(self) -> None:
        """Bid for the best task."""
        self._select()
        self._send_bids()

    def receive(self, sender: str, message: Message) -> None:
        """Store the higher of the bids for each task."""
        for lot, winner, amount in cast("WinningBids", message).bids:
            task = self.market.task(sender, lot)
            self.refuse_winner(task, winner, amount)
            known = self._sent_bids[sender]
            if self.outbids(winner, amount, *known.get(task, (None, 0))):
                known[task] = winner, amount
            if self.outbids(winner, amount, self.z.get(task), self.y.get(task, 0)):
                self.y[task], self.z[task] = amount, winner

    def settle(self) -> None:
        """Give up a task that another robot has won, bid for another task, and send the bids."""
        if self.verdict is None and self.market.shared:
            self._release()
            self._select()
            self._send_bids()

    def _release(self) -> None:
        self.bundle = [task for task in self.bundle if self.z[task] == self.problem.agent]

    def _select(self) -> None:
        """If the robot has no task, choose the best task for which no known bid is as good as this robot's."""
        if not self.bundle:
            own = self.problem.agent
            offer = self.market.best(
                (), NO_LIMIT, lambda task, amount: self.outbids(own, amount, self.z.get(task), self.y.get(task, 0))
            )
            if offer is not None:
                self.bundle = [offer.task]
                self.y[offer.task], self.z[offer.task] = offer.amount, own
        self.choose_bundle()

    def _send_bids(self) -> None:
        """Send each rival the bids that are above those already sent to it or received from it."""
        for rival, tasks in self.market.shared.items():
            known = self._sent_bids[rival]
            news = [task for task in tasks if task in self.z and known.get(task) != (self.z[task], self.y[task])]
            if news:
                self.send(rival, WinningBids([(self.market.lot(task), self.z[task], self.y[task]) for task in news]))
                known.update({task: (self.z[task], self.y[task]) for task in news})
