"""k-optimal local search in rounds (KOPT).

MGM for groups: in each cycle every robot, as the centre of a group, finds the best joint move of at most `k` connected
robots, including itself. Among moves that would affect each other, only the move with the largest gain is made. So the
cost falls by the gain of each move, until no `k` connected robots can gain.

- **When to use**: as MGM or MGM-2, for better results: the guaranteed quality of a k-optimum grows with k. A robot
  enumerates the values of k robots, and learns the constraints of the robots around it.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises from
  one cycle to the next (anytime). When no more moves are found, no k connected robots can do better by moving
  together (k-optimum). A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `k` (default 3), `cycles` (default 100).
- **References**: Katagishi, Pearce: "KOPT: Distributed DCOP algorithm for arbitrary k-optima with monotonically
  increasing utility", DCR workshop, 2007; for the asynchronous DALO, which uses locks instead of rounds: Kiekintveld,
  Yin, Kumar, Tambe: "Asynchronous algorithms for approximate distributed constraint optimization with quality bounds",
  AAMAS 2010.

All information spreads from robot to robot, one link further in each phase. With r = k // 2, all k connected robots are
at most r links from one of them, their centre:

    once: domains; then constraints      to robots r + 1 links away     `_send_part`, `_find_groups`
    values of robots that have moved     r + 1 links                    `_send_values`
    the best move of each centre         2 r + 1 links                  `_offer`, `_select_move`
    selected moves                       r links                        `_select_move`, `_move`

This takes 4 r + 2 messages to each neighbour in a cycle. With k = 1 it is MGM.

Choices that the papers leave open, and differences:

- A centre alone decides whether its group moves: it knows all moves that affect its own, which move one of its robots
  or their neighbours. If gains are equal, the first centre in the priority order wins. In KOPT the robots in a group
  vote.
- The first value is chosen at random. Among moves with equal gains, a centre offers one with the fewest robots.
- Constraints may be n-ary: all robots in a scope are one link apart.
- A gain is a pair, violated hard constraints first. So the search also works on plain DisCSPs.
- Constraints are sent as tables, each by the robot of highest priority in its scope. If the values of a group have more
  than 2^20 combinations, or a robot is in more than 20,000 groups, the run ends before the search starts.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), KOpt, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Domain': 12, 'MoveTogether': 1200, 'Offers': 3600, 'Region': 24, 'Values': 2400}
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from operator import add
from typing import Annotated, ClassVar, Generic, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Pays, Proof, Reception
from robochoc.protocols.local_search.mgm import saving_in_words
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, CycleProtocol, CycleSettings, Domain, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import check_exact
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.plain_text import counted, listed

MOST = 8
"""The largest `k`: more robots at once are a search problem of their own."""


class KOptSettings(CycleSettings, frozen=True):
    """`k`: the maximum number of robots that may move together. `cycles`: the number of cycles."""

    k: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.k <= MOST:
            raise ValueError(f"k is {self.k}; it must be from 1 to {MOST}")


Place = Annotated[int, msgspec.Meta(ge=0)]


class CostList(msgspec.Struct, frozen=True, array_like=True):
    """The costs of a constraint for all combinations of values of `scope`; the last robot's index changes first.

    The robots are in priority order. `inf` means a violated hard constraint.
    """

    scope: list[str]
    costs: list[int | float]


class ProblemPart(msgspec.Struct, frozen=True, array_like=True):
    """A robot's part of the problem: the cost of each of its values, and the constraints in which it is the highest."""

    charges: list[int | float]
    tables: list[CostList]


class Region(wire.Message, frozen=True):
    """The parts of the problem that are new to the sender, by robot."""

    parts: dict[str, ProblemPart]

    act = Act(Performative.INFORM, "the receiver learns the constraints of robots around")

    def in_words(self, _: Wording) -> str:
        if not self.parts:
            return "I have heard of no other robots' constraints"
        tables = sum(len(part.tables) for part in self.parts.values())
        return f"{counted(tables, 'constraint')} of {listed(self.parts)}, value by value"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the costs of single values and of pairs of robots' values.

        Constraints between more robots are left out, because other messages may contain other constraints of the same
        robots.
        """
        return [proof for robot, part in self.parts.items() for proof in _part_proves(robot, part, reception)]


class Values(wire.Message, frozen=True):
    """The values of robots that have moved, as indices, if they are new to the sender."""

    places: dict[str, Place]

    act = acts.TELL_VALUE
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        moved = [f"{robot} has its value number {place + 1}" for robot, place in self.places.items()]
        return listed(moved) or "I have heard of nobody who has moved"


class Offer(msgspec.Struct, frozen=True, array_like=True):
    """A move of several robots: the indices of their new values, and the gain (broken hard constraints, and costs)."""

    broken: int
    cost: int | float
    moves: dict[str, Place]


class Offers(wire.Message, frozen=True):
    """The best moves that robots have found, by robot, if they are new to the sender."""

    offers: dict[str, Offer]

    act = Act(Performative.PROPOSE, "the savings of robots around by moving together")
    proves_nothing = True  # the moves involve several robots

    def in_words(self, _: Wording) -> str:
        if not self.offers:
            return "I have heard of no move that saves anything"
        moves = [
            f"{listed(offer.moves)} would save {saving_in_words(offer.broken, offer.cost)}"
            for offer in self.offers.values()
        ]
        return f"{'; '.join(moves)}"


class MoveTogether(wire.Message, frozen=True):
    """The selected moves: the indices of the robots' new values, if they are new to the sender."""

    moves: dict[str, Place]

    act = Act(Performative.REQUEST, "the robots of a group are to move")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"go: {listed(self.moves)}" if self.moves else "I have heard of no move that is made"


def _part_proves(robot: str, part: ProblemPart, reception: Reception) -> Iterator[Proof]:
    """Yield the proofs in a robot's part, if the receiver knows the values that its indices refer to."""
    values = reception.values(robot)
    if values is None:
        return
    for value, charge in zip(values, part.charges, strict=True):
        yield Pays(robot, value, {}, charge, charge)
    for other, costs in _pairs(robot, part).items():
        theirs = reception.values(other) or ()
        rows = itertools.product(zip(values, part.charges, strict=True), theirs)
        for ((value, charge), their), cost in zip(rows, costs, strict=False):
            yield Pays(robot, value, {other: their}, charge + cost, charge + cost)


def _pairs(robot: str, part: ProblemPart) -> dict[str, list[int | float]]:
    """Return, for each other robot, the total costs of all constraints over exactly these two robots."""
    found: dict[str, list[int | float]] = {}
    for table in part.tables:
        if len(table.scope) == len((robot, "other")):
            other = table.scope[-1]
            before = found.get(other)
            found[other] = table.costs if before is None else list(map(add, before, table.costs))
    return found


MOST_COMBINATIONS = 1 << 20
"""The maximum number of combinations of a group's values: more would need gigabytes and minutes."""


MOST_GROUPS = 20_000


_LARGEST = np.iinfo(np.int64).max


Counts = NDArray[np.int64]


Group = tuple[str, ...]
"""A group of robots, in priority order."""


class ConstraintCosts(NamedTuple):
    """The costs of a constraint, with an axis for each robot in `scope`: broken hard constraints, and other costs."""

    scope: Group
    broken: Counts
    cost: Counts

    def in_group(self, group: Group, sizes: Mapping[str, int], view: Mapping[str, int]) -> tuple[Counts, Counts]:
        """Return the costs with an axis for each robot in `group`; all others keep their values in `view`."""
        index = tuple(slice(None) if name in group else view[name] for name in self.scope)
        shape = [sizes[name] if name in self.scope else 1 for name in group]
        return self.broken[index].reshape(shape), self.cost[index].reshape(shape)


class GroupMove(NamedTuple):
    """A joint move: its gain, and the indices of the new values of the moving robots."""

    gain: LexicographicCost
    moves: dict[str, int]


class Neighbourhood:
    """The problem of the robots around a centre, and the groups that the centre may lead.

    `groups` are the largest connected groups of at most `k` robots that include the centre and are at most `radius`
    links away. Smaller groups are contained in them, because robots in a group may keep their values.
    """

    def __init__(
        self, centre: str, parts: Mapping[str, ProblemPart], rank: Mapping[str, int], k: int, radius: int
    ) -> None:
        self._centre = centre
        self._rank = rank
        self.sizes = {name: len(part.charges) for name, part in parts.items()}
        self._on: dict[str, list[ConstraintCosts]] = {name: [] for name in parts}
        for name, part in parts.items():
            self._add(_constraint_costs((name,), part.charges, self.sizes))
            for table in part.tables:
                self._add(self._checked(name, table))
        self._within = self._reached(radius)
        self.groups = self._connected(k)

    def _checked(self, owner: str, table: CostList) -> ConstraintCosts | None:
        """Return the costs of a constraint; None if it reaches further than this region."""
        scope = tuple(table.scope)
        if scope[:1] != (owner,) or len(set(scope)) < len(scope):
            raise ValueError(f"{owner} sent a constraint of {', '.join(scope)}; its scope must begin with {owner}")
        return _constraint_costs(scope, table.costs, self.sizes) if all(name in self.sizes for name in scope) else None

    def _add(self, costs: ConstraintCosts | None) -> None:
        if costs is not None:
            for name in costs.scope:
                self._on[name].append(costs)

    def touched(self, group: Iterable[str]) -> dict[str, None]:
        """Return the robots in a group and all that share a constraint with them, in a fixed order."""
        return {name: None for member in group for costs in self._on[member] for name in costs.scope}

    def _reached(self, radius: int) -> dict[str, None]:
        """Return the robots at most `radius` links away, the centre first."""
        found = {self._centre: None}
        for _ in range(radius):
            found |= self.touched(found)
        return found

    def _connected(self, k: int) -> list[Group]:
        """Return the connected groups of `k` robots, or the group of all robots if there are fewer than `k`."""
        groups: dict[Group, None] = {(self._centre,): None}
        for _ in range(k - 1):
            larger: dict[Group, None] = {}
            for group in groups:
                others = [name for name in self.touched(group) if name in self._within and name not in group]
                larger |= {tuple(sorted((*group, name), key=self._rank.__getitem__)): None for name in others}
                if len(larger) > MOST_GROUPS:
                    raise TooLargeError(
                        f"{self._centre} is in more than {MOST_GROUPS:,} groups of {k} robots: lower k (--set k=NUMBER)"
                    )
            groups = larger or groups
        return [self._fitting(group) for group in groups]

    def _fitting(self, group: Group) -> Group:
        """Return a group; raise `TooLargeError` if its values have too many combinations."""
        if math.prod(self.sizes[name] for name in group) > MOST_COMBINATIONS:
            raise TooLargeError(
                f"{len(group)} robots around {self._centre} have more than {MOST_COMBINATIONS:,} combinations of"
                " values: lower k (--set k=NUMBER)"
            )
        return group

    def best(self, view: Mapping[str, int]) -> GroupMove:
        """Return the move with the largest gain; if there are several, the first one with the fewest robots."""
        moves = (self.best_of(group, view) for group in self.groups)
        return max(moves, key=lambda move: (move.gain, -len(move.moves)))

    def best_of(self, group: Group, view: Mapping[str, int]) -> GroupMove:
        """Return the best move of one group, if all other robots keep their values."""
        shape = [self.sizes[name] for name in group]
        broken, cost = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
        for constraint in {id(one): one for member in group for one in self._on[member]}.values():
            more_broken, more_cost = constraint.in_group(group, self.sizes, view)
            broken += more_broken
            cost += more_cost
        now = tuple(view[name] for name in group)
        ranked = np.where(broken == broken.min(), cost, _LARGEST)
        best = np.unravel_index(int(np.where(ranked == ranked.min(), _movers(shape, now), _LARGEST).argmin()), shape)
        before, after = ((int(broken[place]), int(cost[place])) for place in (now, best))
        if after >= before:
            return GroupMove((0, 0), {})
        changed = {name: int(new) for name, old, new in zip(group, now, best, strict=True) if new != old}
        return GroupMove(gain(before, after), changed)


def _movers(shape: Sequence[int], now: Sequence[int]) -> Counts:
    """Return the number of robots that move, for each combination of values."""
    moving = np.zeros(shape, np.int64)
    for axis, (size, place) in enumerate(zip(shape, now, strict=True)):
        others = [1] * len(shape)
        others[axis] = size
        moving += (np.arange(size) != place).reshape(others)
    return moving


def _constraint_costs(scope: Group, costs: Sequence[float], sizes: Mapping[str, int]) -> ConstraintCosts:
    """Return the received costs with their axes; raise `ValueError` if they cannot be those of `scope`."""
    shape = [sizes[name] for name in scope]
    if len(costs) != math.prod(shape) or not all(cost >= 0 for cost in costs):
        wanted = f"{math.prod(shape):,} costs, each 0 or more"
        raise ValueError(f"invalid costs of {', '.join(scope)}: there must be {wanted}")
    broken = np.array([cost == math.inf for cost in costs], np.int64).reshape(shape)
    return ConstraintCosts(
        scope, broken, np.array([0 if cost == math.inf else cost for cost in costs], np.int64).reshape(shape)
    )


T = TypeVar("T")


class _Flood(NamedTuple, Generic[T]):
    """Items that robots pass on: the type of the messages, the items known so far, and what is done with them."""

    message_type: Callable[[dict[str, T]], wire.Message]
    known: dict[str, T]
    then: Callable[[dict[str, T]], None]


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
        cost_never_rises=True,
        optimal_groups="k",
        use_when="as MGM-2: better answers, more to compute",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.region: Neighbourhood | None = None
        self.places: dict[str, int] = {}
        self.offer: Offer | None = None

    @property
    def radius(self) -> int:
        """The maximum number of links between a group's centre and a robot in the group."""
        return self.settings.k // 2

    def start_cycles(self) -> None:
        """Choose a random value, and send the domain."""
        self.choose(self.any_value())
        self.multicast(self.problem.neighbours, Domain(list(self.problem.values)))
        self.listen(self.problem.neighbours, self._send_part)

    def _spread(
        self,
        message_type: Callable[[dict[str, T]], wire.Message],
        items: Mapping[str, T],
        links: int,
        then: Callable[[dict[str, T]], None],
    ) -> None:
        """Send `items` to all robots at most `links` away, then call `then` with the items of all these robots."""
        self._send_new(_Flood(message_type, dict(items), then), items, links)

    def _send_new(self, flood: _Flood[T], new: Mapping[str, T], left: int) -> None:
        """Send `new`, the items that arrived last, over the next of the `left` links."""
        if left == 0:
            flood.then(flood.known)
            return
        self.multicast(self.problem.neighbours, flood.message_type(dict(new)))
        self.listen(self.problem.neighbours, partial(self._receive_new, flood, left - 1))

    def _receive_new(self, flood: _Flood[T], left: int, messages: Mapping[str, wire.Message]) -> None:
        new: dict[str, T] = {}
        for name, message in messages.items():
            if type(message) is not flood.message_type:
                raise ValueError(f"{name} sent an unexpected message in this phase")
            received: Mapping[str, T]
            (received,) = msgspec.structs.astuple(message)
            new |= {key: item for key, item in received.items() if key not in flood.known}
        flood.known.update(new)
        self._send_new(flood, new, left)

    # Once, before the search

    def _send_part(self, messages: Mapping[str, wire.Message]) -> None:
        """Send this robot's part of the problem, once all neighbours' domains are known."""
        own = self.order.rank[self.problem.agent]
        domains = self.checked_domains(messages)
        lower = {name: values for name, values in domains.items() if self.order.rank[name] > own}
        tables = []
        for table in self.problem.tables(lower):
            costs: list[float] = table.joined().reshape(-1, len(self.problem.values)).T.ravel().tolist()
            tables.append(CostList([self.problem.agent, *table.agents], [self._exact(cost) for cost in costs]))
        part = ProblemPart(list(self.problem.charges), tables)
        self._spread(Region, {self.problem.agent: part}, self.radius + 1, self._find_groups)

    def _exact(self, cost: float) -> int | float:
        """Return a cost as an integer, if it is finite."""
        if cost == float("inf"):
            return cost
        check_exact(int(cost))
        return int(cost)

    def _find_groups(self, parts: dict[str, ProblemPart]) -> None:
        """Find the groups, once the parts of all robots around are known."""
        settings = self.settings
        self.region = Neighbourhood(self.problem.agent, parts, self.order.rank, settings.k, self.radius)
        self._send_values({self.problem.agent: self.present})

    # A cycle

    def _send_values(self, moved: Mapping[str, int]) -> None:
        self._spread(Values, moved, self.radius + 1, self._offer)

    def _offer(self, moved: dict[str, int]) -> None:
        """Send the best move of a group around this robot, once all values around it are known."""
        region = self._known_region
        for name, place in moved.items():
            if place >= region.sizes.get(name, 0):
                raise ValueError(f"{name} has no value number {place + 1}")
        self.places |= moved
        if self.places.keys() != region.sizes.keys():
            missing = ", ".join(name for name in region.sizes if name not in self.places)
            raise ValueError(f"{self.problem.agent} has not received the values of {missing}")
        move = region.best(self.places)
        self.offer = Offer(*move.gain, move.moves) if move.gain > NO_GAIN else None
        offers = {self.problem.agent: self.offer} if self.offer else {}
        self._spread(Offers, offers, 2 * self.radius + 1, self._select_move)

    def _select_move(self, offers: dict[str, Offer]) -> None:
        """Let this robot's group move if no other move that affects it has a larger gain."""
        moves = self.offer.moves if self.offer and self._wins(self.offer, offers) else {}
        self._spread(MoveTogether, moves, self.radius, self._move)

    def _wins(self, own: Offer, offers: Mapping[str, Offer]) -> bool:
        touched = self._known_region.touched(own.moves)
        rivals = {name: offer for name, offer in offers.items() if not touched.keys().isdisjoint(offer.moves)}
        return all(self._strength(self.problem.agent, own) >= self._strength(*rival) for rival in rivals.items())

    def _strength(self, centre: str, offer: Offer) -> tuple[LexicographicCost, int]:
        return (offer.broken, offer.cost), -self.order.rank[centre]

    def _move(self, moves: dict[str, int]) -> None:
        """Change to the new value, if there is one, and start the next cycle."""
        place = moves.get(self.problem.agent, self.present)
        if place >= len(self.problem.values):
            raise ValueError(f"{self.problem.agent} has no value number {place + 1}")
        moved = {self.problem.agent: place} if place != self.value else {}
        self.choose(place)
        if not self.finished:
            self._send_values(moved)

    @property
    def _known_region(self) -> Neighbourhood:
        assert self.region is not None  # noqa: S101 - for mypy: `_find_groups` has made it
        return self.region
