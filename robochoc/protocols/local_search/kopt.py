"""k-optimal local search in rounds (KOPT).

MGM for groups: in each cycle every robot, as the centre of a group, finds the best joint move of at most `k` connected
robots, itself among them. Of moves that would touch each other only the one with the largest gain is made. So the cost
falls by the gain of each move, until no `k` connected robots can gain.

- **When to use**: as MGM or MGM-2, for better answers: a bound on how good a k-optimum is grows with k. A robot
  enumerates the values of k robots, and learns the constraints of those around it.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises from
  one cycle to the next (anytime). When no move is found any more, no k connected robots can do better by moving
  together (k-optimum). A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `k` (default 3), `cycles` (default 100).
- **References**: Katagishi, Pearce: "KOPT: Distributed DCOP algorithm for arbitrary k-optima with monotonically
  increasing utility", DCR workshop, 2007; for the asynchronous DALO, which uses locks instead of rounds: Kiekintveld,
  Yin, Kumar, Tambe: "Asynchronous algorithms for approximate distributed constraint optimization with quality bounds",
  AAMAS 2010.

Everything spreads from robot to robot, a link further in each phase. With r = k // 2, all k connected robots are at
most r links from one of them, their centre:

    once: domains; then constraints      to robots r + 1 links away     `_tell_part`, `_survey`
    values of those who have moved       r + 1 links                    `_tell_values`
    the best move of each centre         2 r + 1 links                  `_offer`, `_choose`
    moves that are made                  r links                        `_choose`, `_move`

That is 4 r + 2 messages to each neighbour in a cycle. With k = 1 it is MGM.

Choices that the papers leave open, and differences:

- A centre alone decides whether its group moves: it sees all moves that touch its own, those that move one of its
  robots or a neighbour of them. Of equal gains the one of the first centre in the priority order wins. In KOPT the
  robots of a group vote.
- The first value is chosen at random. Of moves with equal gains a centre offers one with the fewest robots.
- Constraints may be n-ary: all robots of a scope are one link apart.
- A gain is a pair, violated hard constraints first. So the search also works on plain DisCSPs.
- Constraints are sent as tables, each by the highest robot of its scope. A group whose values have more than 2^20
  combinations, or a robot in more than 20,000 groups, ends the run before the search begins.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), KOpt, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Domain': 12, 'MoveTogether': 1200, 'Offers': 3600, 'Region': 24, 'Values': 2400}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar, TypeVar

import msgspec

from robochoc.model import message as wire
from robochoc.protocols.local_search.kopt_groups import Neighbourhood
from robochoc.protocols.local_search.messages.kopt import MoveTogether, Offer, Offers, Part, Region, Table, Values
from robochoc.protocols.local_search.settings.kopt import KOptSettings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import NO_GAIN, CycleProtocol
from robochoc.protocols.shared.messages.anytime import AnytimeMessage
from robochoc.protocols.shared.messages.cycles import Domain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LexicographicCost, LocalProblem
from robochoc.solver.exact_costs import check_exact

T = TypeVar("T")


class KOpt(CycleProtocol):
    """One agent of k-opt. State: the `region` that it knows, the `places` of the values there, and its own `offer`."""

    messages = Domain | Region | Values | Offers | MoveTogether | AnytimeMessage
    settings: ClassVar[KOptSettings] = KOptSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Katagishi & Pearce 2007",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        use_when="as MGM-2: better answers, more to compute",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.region: Neighbourhood | None = None
        self.places: dict[str, int] = {}
        self.offer: Offer | None = None

    @property
    def radius(self) -> int:
        """The most links between a group's centre and a robot of the group."""
        return self.settings.k // 2

    def begin(self) -> None:
        """Take a random value, and send the domain."""
        self.take(self.any_value())
        self.tell(self.problem.neighbours, Domain(list(self.problem.values)))
        self.listen(self.problem.neighbours, self._tell_part)

    def _spread(
        self,
        what: Callable[[dict[str, T]], wire.Message],
        items: Mapping[str, T],
        links: int,
        then: Callable[[dict[str, T]], None],
    ) -> None:
        """Tell `items` to all robots at most `links` away, then call `then` with those of all these robots."""
        known = dict(items)

        def tell(new: Mapping[str, T], left: int) -> None:
            if left == 0:
                then(known)
                return
            self.tell(self.problem.neighbours, what(dict(new)))
            self.listen(self.problem.neighbours, lambda messages: hear(messages, left - 1))

        def hear(messages: Mapping[str, wire.Message], left: int) -> None:
            new: dict[str, T] = {}
            for name, message in messages.items():
                if type(message) is not what:
                    raise ValueError(f"{name} tells something else than it should in this phase")
                told: Mapping[str, T]
                (told,) = msgspec.structs.astuple(message)
                new |= {key: item for key, item in told.items() if key not in known}
            known.update(new)
            tell(new, left)

        tell(items, links)

    # Once, before the search

    def _tell_part(self, messages: Mapping[str, wire.Message]) -> None:
        """Send the own part of the problem, with all neighbours' domains known."""
        own = self.order.rank[self.problem.agent]
        domains = self.checked_domains(messages)
        lower = {name: values for name, values in domains.items() if self.order.rank[name] > own}
        tables = []
        for table in self.problem.tables(lower):
            costs: list[float] = table.charges.reshape(-1, len(self.problem.values)).T.ravel().tolist()
            tables.append(Table([self.problem.agent, *table.agents], [self._exact(cost) for cost in costs]))
        part = Part(list(self.problem.charges), tables)
        self._spread(Region, {self.problem.agent: part}, self.radius + 1, self._survey)

    def _exact(self, cost: float) -> int | float:
        """Return a cost as an integer, where it is finite."""
        if cost == float("inf"):
            return cost
        check_exact(int(cost))
        return int(cost)

    def _survey(self, parts: dict[str, Part]) -> None:
        """Find the groups, with the parts of all robots around known."""
        settings = self.settings
        self.region = Neighbourhood(self.problem.agent, parts, self.order.rank, settings.k, self.radius)
        self._tell_values({self.problem.agent: self.present})

    # A cycle

    def _tell_values(self, moved: Mapping[str, int]) -> None:
        self._spread(Values, moved, self.radius + 1, self._offer)

    def _offer(self, moved: dict[str, int]) -> None:
        """Send the best move of a group around this robot, with all values around known."""
        region = self._known_region
        for name, place in moved.items():
            if place >= region.sizes.get(name, 0):
                raise ValueError(f"{name} has no value number {place + 1}")
        self.places |= moved
        if self.places.keys() != region.sizes.keys():
            raise ValueError(f"{self.problem.agent} has not been told all values around")
        move = region.best(self.places)
        self.offer = Offer(*move.gain, move.moves) if move.gain > NO_GAIN else None
        offers = {self.problem.agent: self.offer} if self.offer else {}
        self._spread(Offers, offers, 2 * self.radius + 1, self._choose)

    def _choose(self, offers: dict[str, Offer]) -> None:
        """Let the own group move if no other move that touches it gains more."""
        moves = self.offer.moves if self.offer and self._wins(self.offer, offers) else {}
        self._spread(MoveTogether, moves, self.radius, self._move)

    def _wins(self, own: Offer, offers: Mapping[str, Offer]) -> bool:
        touched = self._known_region.touched(own.moves)
        rivals = {name: offer for name, offer in offers.items() if not touched.keys().isdisjoint(offer.moves)}
        return all(self._strength(self.problem.agent, own) >= self._strength(*rival) for rival in rivals.items())

    def _strength(self, centre: str, offer: Offer) -> tuple[LexicographicCost, int]:
        return (offer.broken, offer.cost), -self.order.rank[centre]

    def _move(self, moves: dict[str, int]) -> None:
        """Take the new value, if there is one, and begin the next cycle."""
        place = moves.get(self.problem.agent, self.present)
        if place >= len(self.problem.values):
            raise ValueError(f"{self.problem.agent} has no value number {place + 1}")
        moved = {self.problem.agent: place} if place != self.value else {}
        self.take(place)
        if not self.over:
            self._tell_values(moved)

    @property
    def _known_region(self) -> Neighbourhood:
        assert self.region is not None  # noqa: S101 - for mypy: `_survey` has made it
        return self.region
