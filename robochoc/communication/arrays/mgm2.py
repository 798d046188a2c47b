"""MGM-2 for all robots at once. `protocols/local_search/mgm2.py` explains the algorithm."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from robochoc.communication.arrays.array_types import Flags, Integers
from robochoc.communication.arrays.cycle_run import nth
from robochoc.communication.arrays.layout import ArrayLayout, ConstraintBlock, RobotGroup
from robochoc.communication.arrays.mgm import ArrayGainers
from robochoc.communication.arrays.tally import integer_bytes, list_bytes
from robochoc.protocols.local_search.mgm2 import Accept, Go, MGM2Settings, Offer, Reject
from robochoc.protocols.message import encode
from robochoc.protocols.shared.cycles import Domain
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class _Position:
    """The constraints in a block, sorted by the link from their owner to the robot at one position.

    The constraints on link n are at the indices from `starts[n]` to `starts[n + 1]`.
    """

    starts: Integers
    constraints: Integers
    stride: int


class _Constraints:
    """The constraints in a block: `rows` as in `Column`, and the robots at each position."""

    def __init__(self, layout: ArrayLayout, block: ConstraintBlock) -> None:
        held = block.held
        shape = held.tables.shape[1:-1]
        self.costs = block.rows
        self._base = held.which * int(np.prod(shape))
        self._others = layout.places[held.others]
        self._strides = np.array([int(np.prod(shape[place + 1 :])) for place in range(len(shape))])
        owners = layout.places[held.owners]
        self.positions = []
        for place, stride in enumerate(self._strides.tolist()):
            links = layout.link(owners, self._others[:, place])
            order = np.argsort(links, kind="stable")
            starts = np.searchsorted(links[order], np.arange(len(layout.neighbours) + 1))
            self.positions.append(_Position(starts.astype(layout.index), order, stride))

    def rows(self, values: Integers, constraints: Integers) -> Integers:
        """Return the row of costs for each of `constraints` under these `values`."""
        others = values[self._others[constraints]].astype(np.int64)
        found: Integers = self._base[constraints] + others @ self._strides
        return found


class _Meeting(NamedTuple):
    """One constraint for each of those requested pairs that have one (`pairs`, without duplicates)."""

    pairs: Integers
    rows: Integers
    stride: int
    costs: Integers


class PairConstraints:
    """The constraints of the robots in one group, by the other robots in the scope."""

    def __init__(self, layout: ArrayLayout, group: RobotGroup) -> None:
        self._constraints = [_Constraints(layout, block) for block in group.blocks]
        self.size = group.size

    def count(self, links: Integers) -> Integers:
        """Return, for each of `links`, the number of constraints that its owner has with the neighbour."""
        found = np.zeros(len(links), np.int64)
        for constraints in self._constraints:
            for position in constraints.positions:
                first, last = _span(position, links)
                found += last - first
        return found

    def without(self, links: Integers, values: Integers, value_costs: Integers) -> Integers:
        """Return `value_costs` (of each link's owner) without the constraints with the neighbour."""
        left = value_costs.copy()
        for meeting in self._meetings(links, values):
            left[meeting.pairs] -= meeting.costs[meeting.rows]
        return left

    def with_any(self, links: Integers, values: Integers, value_costs: Integers, own: Integers, many: int) -> Integers:
        """Return the `value_costs` of each link's owner for each of the `many` values that the neighbour may have.

        `own` contains the neighbours' current values.
        """
        found = np.repeat(self.without(links, values, value_costs)[:, None, :], many, axis=1)
        for meeting in self._meetings(links, values):
            first = meeting.rows - meeting.stride * own[meeting.pairs].astype(np.int64)
            for value in range(many):
                found[meeting.pairs, value] += meeting.costs[first + meeting.stride * value]
        return found

    def _meetings(self, links: Integers, values: Integers) -> Iterator[_Meeting]:
        for constraints in self._constraints:
            for position in constraints.positions:
                first, last = _span(position, links)
                for number in range(int((last - first).max(initial=0))):
                    pairs = np.flatnonzero(last - first > number)
                    met = position.constraints[first[pairs] + number]
                    yield _Meeting(pairs, constraints.rows(values, met), position.stride, constraints.costs)


def _span(position: _Position, links: Integers) -> tuple[Integers, Integers]:
    return position.starts[links].astype(np.int64), position.starts[links + 1].astype(np.int64)


_NO_OFFER = len(encode(Offer(None)))
_ACCEPT = len(encode(Accept(0, 0, 0))) - 3
"""The size of an acceptance message without its three numbers, in bytes."""


@dataclass
class _Offers:
    """The offers in one cycle: the rows of makers and receivers, and the links in both directions."""

    makers: Integers
    receivers: Integers
    links: Integers
    back: Integers


@dataclass
class _Joint:
    """Offers between two groups whose receivers make no offer: the gain of each joint move, with one row per offer.

    `offers` contains the indices of the offers. A row lists, for each value of the receiver, the maker's values
    (`width`).
    """

    offers: Integers
    gains: Integers
    width: int


class ArrayMGM2(ArrayGainers):
    """A run of MGM-2."""

    def _start_active(self) -> None:
        self.choose_first_values()
        lengths = self.layout.description.domain_bytes
        if isinstance(lengths, np.ndarray):
            lengths = lengths[self.layout.robots]
        self.tally.add(Domain.__name__, lengths, self.layout.degrees)
        if not self.layout.empty.size:
            self.send_values()

    def _step(self) -> None:
        """Run all phases of a cycle, from values to joint moves."""
        found = self.value_costs()
        self.receive()
        offers = self._offer()
        joint = self._gains(offers, found)
        self._receive_offers(offers)
        partners, targets, gains = self._answer(offers, joint)
        committed = partners >= 0
        self.count_checks(np.where(committed, 0, self.all_checks))
        alone, own = self.best_unilateral(found, ~committed)
        targets, gains = np.where(committed, targets, alone), np.where(committed, gains, own)
        self.send_gains(gains)
        self.receive()
        moves = self.wins(gains, partners)
        self._go(np.flatnonzero(committed), partners, moves)
        self.values = np.where(moves, targets, self.values).astype(self.layout.kind)
        if self.cycle + 1 < self.settings.cycles:
            self.send_values()

    # Phases

    def _offer(self) -> _Offers:
        """Let robots become offerers by chance, each with a random neighbour (`MGM2._offer`)."""
        layout = self.layout
        able = np.flatnonzero(layout.degrees)
        makers = able[self.draws.draw(able) < cast("MGM2Settings", self.settings).threshold]
        chosen = (self.draws.draw(makers) * layout.degrees[makers]).astype(np.int64)
        links = layout.starts[makers] + chosen
        receivers = layout.neighbours[links].astype(np.int64)
        return _Offers(makers, receivers, links, layout.back[links].astype(np.int64))

    def _gains(self, offers: _Offers, found: list[Integers]) -> list[_Joint]:
        """Compute the offered gains, and the receivers' joint gains (`MGM2._gains`, `MGM2._joint`)."""
        making = self._flags(offers.makers)
        sizes, joint = np.full(len(offers.makers), _NO_OFFER), []
        for number, group in enumerate(self.layout.groups):
            for other, met in enumerate(self.layout.groups):
                inside = (self._groups[offers.makers] == number) & (self._groups[offers.receivers] == other)
                chosen = np.flatnonzero(inside)
                if not chosen.size:
                    continue
                offered = self._offered_gains(offers, chosen, number, found[number], met.size)
                sizes[chosen] += self._offer_bytes(offered) - 1
                open_ = ~making[offers.receivers[chosen]]
                gains = self._joint(offers, chosen[open_], other, found[other])[:, :, None] + offered[open_]
                joint.append(_Joint(chosen[open_], gains.reshape(len(gains), met.size * group.size), group.size))
        links = int(self.layout.degrees.sum())
        self.tally.add(Offer.__name__, sizes, np.ones_like(sizes))
        self.tally.add(Offer.__name__, _NO_OFFER, links - len(sizes))
        return joint

    def _offered_gains(
        self, offers: _Offers, chosen: Integers, number: int, value_costs: Integers, many: int
    ) -> Integers:
        """Return the gains in the `chosen` offers, which were made by robots in the group `number`."""
        group = self.layout.groups[number]
        makers, receivers = offers.makers[chosen] - group.first, self.values[offers.receivers[chosen]]
        rows = self._shared[number].with_any(offers.links[chosen], self.values, value_costs[makers], receivers, many)
        return self.present(number, value_costs)[makers][:, None, None] - rows

    def _joint(self, offers: _Offers, chosen: Integers, number: int, value_costs: Integers) -> Integers:
        """Return the gains of receivers in the group `number`, on constraints without the maker."""
        group = self.layout.groups[number]
        receivers = offers.receivers[chosen] - group.first
        left = self._shared[number].without(offers.back[chosen], self.values, value_costs[receivers])
        now = left[np.arange(len(left)), group.values(self.values)[receivers]]
        gains: Integers = now[:, None] - left
        return gains

    def _answer(self, offers: _Offers, joint: list[_Joint]) -> tuple[Integers, Integers, Integers]:
        """Accept the best offers (`MGM2._answer`, `MGM2._commit`); return partners (-1: none), targets and gains."""
        best, ties = (np.zeros(len(offers.makers), np.int64) for _ in range(2))
        for one in joint:
            best[one.offers] = one.gains.max(axis=1)
            ties[one.offers] = (one.gains == best[one.offers][:, None]).sum(axis=1)
        accepted, places = self._choose(offers, best, ties)
        targets, gains = self.values.copy(), np.zeros(self.layout.many, self.layout.costs.kind)
        partners = np.full(self.layout.many, -1, np.int64)
        makers, receivers = offers.makers[accepted], offers.receivers[accepted]
        partners[makers], partners[receivers] = receivers, makers
        gains[makers] = gains[receivers] = best[accepted]
        for one in joint:
            mine = np.flatnonzero(np.isin(accepted, one.offers))
            rows = np.searchsorted(one.offers, accepted[mine])
            flags = one.gains[rows] == best[accepted[mine]][:, None]
            own, place = np.divmod(nth(flags, places[mine]), one.width)
            targets[receivers[mine]], targets[makers[mine]] = own, place
        self._send_answers(offers, makers, targets, gains)
        return partners, targets, gains

    def _choose(self, offers: _Offers, best: Integers, ties: Integers) -> tuple[Integers, Integers]:
        """Return the accepted offers, and for each offer the index of the chosen move among its best moves."""
        making = self._flags(offers.makers)
        order = np.argsort(offers.back, kind="stable")
        order = order[~making[offers.receivers[order]]]  # sorted by receiver, and then in priority order
        receivers = offers.receivers[order]
        starts = np.flatnonzero(np.diff(receivers, prepend=-1))
        if not len(starts):
            return starts, starts
        most = np.maximum.reduceat(best[order], starts)
        lengths = np.diff(starts, append=len(order))
        counted = np.where(best[order] == np.repeat(most, lengths), ties[order], 0)
        sums = np.cumsum(counted)
        takes = np.flatnonzero(most > 0)
        total = np.add.reduceat(counted, starts)[takes]
        before = (sums[starts] - counted[starts])[takes]
        wanted = before + self.draws.choose(receivers[starts[takes]], total)
        found = np.searchsorted(sums, wanted, side="right")
        return order[found], wanted - (sums[found] - counted[found])

    def _go(self, committed: Integers, partners: Integers, moves: Flags) -> None:
        """Exchange between partners whether each gains most; both must (`MGM2._decide`, `MGM2._receive_go`)."""
        self.tally.add(Go.__name__, len(encode(Go(True))), len(committed))
        if self.clocks is not None:
            self.clocks[committed] = np.maximum(self.clocks[committed], self.clocks[partners[committed]])
        moves[committed] &= moves[partners[committed]]

    # Counts

    def _offer_bytes(self, offered: Integers) -> Integers:
        costs = self.layout.costs
        numbers = integer_bytes(costs.broken(offered)) + integer_bytes(costs.paid(offered)) + 1
        heads = list_bytes(offered.shape[1]) + offered.shape[1] * list_bytes(offered.shape[2])
        total: Integers = numbers.sum(axis=(1, 2)) + heads
        return total

    def _send_answers(self, offers: _Offers, makers: Integers, targets: Integers, gains: Integers) -> None:
        """Count the answers, and advance the clocks of the offers' makers to the answers' clocks."""
        costs, offered = self.layout.costs, gains[makers]
        numbers = (
            integer_bytes(targets[makers]) + integer_bytes(costs.broken(offered)) + integer_bytes(costs.paid(offered))
        )
        self.tally.add(Accept.__name__, _ACCEPT + numbers, np.ones_like(numbers))
        self.tally.add(Reject.__name__, len(encode(Reject())), len(offers.makers) - len(makers))
        self.count_checks(self._joint_checks(offers))
        if self.clocks is not None:
            answered = self.clocks[offers.receivers]
            self.clocks[offers.makers] = np.maximum(self.clocks[offers.makers], answered)

    def _joint_checks(self, offers: _Offers) -> Integers:
        """Return the constraint checks of the receivers: for each offer, on all constraints without the maker."""
        making = self._flags(offers.makers)
        checks = np.zeros(self.layout.many, np.int64)
        for number, shared in enumerate(self._shared):
            mine = (self._groups[offers.receivers] == number) & ~making[offers.receivers]
            receivers = offers.receivers[mine]
            made = self.all_checks[receivers] - shared.count(offers.back[mine]) * shared.size
            np.add.at(checks, receivers, made)
        return checks

    def _receive_offers(self, offers: _Offers) -> None:
        """Raise clocks to those of offers: an empty offer to a robot before the partner precedes the computation."""
        layout = self.layout
        made = np.zeros(layout.many, np.int64)
        made[offers.makers] = self._sizes[offers.receivers] * self.all_checks[offers.makers]
        self.count_checks(made)
        if self.clocks is None:
            return
        sent_clocks = self.clocks - made
        before = np.zeros(layout.many, np.int64)
        before[offers.makers] = layout.robots[offers.receivers]
        clocks_after = self.clocks.copy()
        for group, lists, neighbours, _ in layout.links:
            ranks = layout.robots[group.first : group.last][lists]
            late = np.where(ranks >= before[neighbours], made[neighbours], 0)
            part = clocks_after[group.first : group.last]
            part[lists] = np.maximum(part[lists], sent_clocks[neighbours] + late)
        self.clocks = clocks_after

    # Constant data

    def _flags(self, rows: Integers) -> Flags:
        flags = np.zeros(self.layout.many, bool)
        flags[rows] = True
        return flags

    @cached_property
    def _shared(self) -> list[PairConstraints]:
        return [PairConstraints(self.layout, group) for group in self.layout.groups]

    @cached_property
    def _groups(self) -> Integers:
        """The group index of each row."""
        return np.repeat(np.arange(len(self.layout.groups)), [group.many for group in self.layout.groups])

    @cached_property
    def _sizes(self) -> Integers:
        """The number of values of the robot in each row."""
        return self.layout.description.sizes[self.layout.robots]
