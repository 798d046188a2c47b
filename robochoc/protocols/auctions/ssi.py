"""Sequential Single-Item auctions (SSI).

Tasks are sold one after the other. Each robot bids for the task that is worth most to it, given the tasks that it has
won before; the highest bid wins. Then all robots bid again.

- **When to use**: for task allocation, if a good result with few messages is enough. Two robots are never assigned the
  same task, so the result can be used at any moment.
- **Guarantees**: incomplete: no proof of optimality. The outcome is that of the sequential greedy algorithm. If scores
  have diminishing marginal gain (`market.py`), the gain is at least half of the optimum, as for greedy allocation to
  submodular bidders (Lehmann, Lehmann, Nisan, GEB 55, 2006). With loads and capacities there is no bound.
- **References**: Koenig, Tovey, Lagoudakis, Markakis, Kempe, Keskinocak, Kleywegt, Meyerson, Jain: "The power of
  sequential single-item auctions for agent coordination", AAAI 2006; Lagoudakis et al.: "Auction-based multi-robot
  routing", RSS 2005.

The papers' procedure:

    each robot bids on the target that costs it least more     `_bid`
    the robot with the best of all bids wins that target       `_has_the_best_bid`, `_buy`
    the winner is told to all, and the next round begins       `_send_sales`, `_sell`

Choices that the papers leave open, and differences:

- There are no rounds. A robot's bids never rise, so the last bids of the robots that can do the same task bound their
  future bids. As soon as a robot's bid is above all of these, it buys the task. So independent sales happen at the same
  time, and the outcome is the same as with rounds.
- A bid does not name its task: no robot needs to know the task before the sale.
- Bids of 0 or less are not made. If bids are equal, the robot with higher priority wins.
- Bids might rise if scores lack diminishing marginal gain, so they are warped (`market.py`).
- The papers' robots plan tours, and minimise costs. Here a task's score is computed from the constraints.
- A robot that shares no task with others chooses its cheapest value.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.tasks import tasks
>>> from robochoc.model.costs import normalized
>>> result = Simulation(normalized(tasks(4, 4)), SSI, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Bid': 15, 'Won': 9}
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never, cast

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.auctions.market import (
    NO_LIMIT,
    Auction,
    Lot,
    Offer,
    lot_in_words,
    proofs_of_next_bid,
    proofs_of_task,
)
from robochoc.protocols.disclosure import Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import listed


def _next_bid_in_words(amount: int) -> str:
    return f"I bid {amount:,} for the next task that I want" if amount else "I bid for nothing more"


class Bid(wire.Message, frozen=True):
    """The sender's highest bid, for an unnamed task; 0 means that it bids for no other task."""

    amount: int

    act = Act(Performative.PROPOSE, "the highest bid is to win")

    def in_words(self, _: Wording) -> str:
        return _next_bid_in_words(self.amount)

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return proofs_of_next_bid(reception.sender, self.amount, reception)


class Won(wire.Message, frozen=True):
    """The sender has won the tasks that it calls `lots`; `amount` is its highest bid for the other tasks."""

    lots: list[Lot]
    amount: int

    act = Act(Performative.INFORM, "the receiver learns that a task is the sender's")

    def in_words(self, words: Wording) -> str:
        lots = listed([lot_in_words(words, words.sender, lot) for lot in self.lots])
        return f"{lots} {'is' if len(self.lots) == 1 else 'are'} mine, and {_next_bid_in_words(self.amount)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The sender can do the tasks. Its former bids for these tasks may be unknown.
        won = [proof for lot in self.lots for proof in proofs_of_task(reception.sender, lot, reception)]
        return [*won, *proofs_of_next_bid(reception.sender, self.amount, reception)]


class SSI(Auction):
    """One agent of SSI.

    State: this robot's `offer`, the `sold` tasks (including its own), and the last `bids` of the other robots.
    """

    messages = Bid | Won
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Koenig et al. 2006; Lagoudakis et al. 2005",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        allocates=True,
        privacy="what tasks are worth, but for bids",
        share_of_optimum=0.5,
        use_when="tasks are to be allocated, with short messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.offer: Offer | None = None
        self.sold: set[int] = set()
        self.bids: dict[str, int] = {}
        self._limit = NO_LIMIT
        self._last_sent = -1

    def start_auction(self) -> None:
        """Make the first bid."""
        self._bid()
        self._send_sales([])

    def receive(self, sender: str, message: Message) -> None:
        """Store another robot's bid, and the tasks that it has won."""
        if self.verdict is not None:
            return
        match cast("Bid | Won", message):
            case Bid(amount):
                pass
            case Won(lots, amount):
                self._sell(sender, lots)
            case never:
                assert_never(never)
        if sender not in self.market.shared or amount < 0:
            raise ValueError(f"{sender} bids {amount}, but shares {len(self.market.shared.get(sender, ()))} tasks")
        self.bids[sender] = amount

    def settle(self) -> None:
        """Bid again if the task is sold, buy as long as this robot's bid is the best, and send the sales."""
        if self.verdict is not None or not self.market.shared:
            return
        if self.offer and self.offer.task in self.sold:
            self._bid()
        bought = []
        while self.offer and self._has_the_best_bid(self.offer):
            bought.append(self.offer.task)
            self._buy(self.offer)
        self._send_sales(bought)

    def _sell(self, sender: str, lots: list[tuple[int, int]]) -> None:
        for lot in lots:
            task = self.market.task(sender, lot)
            if task in self.sold:
                raise ValueError(f"{sender} has won a task that is already sold")
            self.sold.add(task)

    def _bid(self) -> None:
        """Find the task that is worth most, among the tasks for sale."""
        self.offer = self.market.best(self.bundle, self._limit, lambda task, _: task not in self.sold)

    def _has_the_best_bid(self, offer: Offer) -> bool:
        """Return whether no robot that can do the task has an equally good bid, or can have one later."""
        own = self.problem.agent
        rivals = self.market.rivals[offer.task]
        return all(rival in self.bids and self.outbids(own, offer.amount, rival, self.bids[rival]) for rival in rivals)

    def _buy(self, offer: Offer) -> None:
        self.bundle.append(offer.task)
        self.sold.add(offer.task)
        self._limit = offer.amount
        self.choose_bundle()
        self._bid()

    def _send_sales(self, bought: list[int]) -> None:
        """Send the bought tasks to the robots that can do them, and a changed bid to all rivals."""
        amount = self.offer.amount if self.offer else 0
        if not bought and amount == self._last_sent:
            return
        for rival, shared in self.market.shared.items():
            lots = [self.market.lot(task) for task in bought if task in shared]
            if lots:
                self.send(rival, Won(lots, amount))
            elif amount != self._last_sent:
                self.send(rival, Bid(amount))
        self._last_sent = amount
