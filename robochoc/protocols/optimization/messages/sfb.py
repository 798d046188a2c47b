"""The messages of SFB (see `sfb`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Self

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import HasOnly, Hearing, Pays, Proof, StandsAt, Total
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, along, cost_text, counted, incumbent_text, listed
from robochoc.protocols.optimization.interchangeable import Run, cut_off, expanded, grouped
from robochoc.protocols.optimization.sfb_rows import MOST_ROWS, bits_prove, costs_prove

Domain = tuple[Value, ...]
Charges = tuple[float, ...]


class Above(Message, frozen=True):
    """The domains of all robots above the receiver: distinct `domains`, and the `runs` of robots that have each."""

    domains: list[Domain]
    runs: list[Run]

    act = Act(Performative.INFORM, "the receiver comes to know the domains above it")

    @classmethod
    def of(cls, domains: Iterable[Domain]) -> Self:
        """Return the message for robots with these `domains`, in priority order."""
        return cls(*grouped(domains))

    def in_words(self, words: Wording) -> str:
        domains = expanded(self.domains, cut_off(self.runs, len(words.order)))
        return f"above you there are {_sizes(words.order, domains)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        domains = expanded(self.domains, cut_off(self.runs, len(hearing.order)))
        return [HasOnly(robot, tuple(values)) for robot, values in zip(hearing.order, domains, strict=False)]


class Below(Message, frozen=True):
    """The domains and charges of all robots below the receiver; `runs` map robots to the distinct ones.

    `most` is an upper bound on the sum of these charges and of the constraints whose lowest two robots are below.
    """

    domains: list[Domain]
    charges: list[Charges]
    runs: list[Run]
    most: int

    act = Act(Performative.INFORM, "the receiver comes to know the domains and charges below it")

    @classmethod
    def of(cls, robots: Iterable[tuple[Domain, Charges]], most: int) -> Self:
        """Return the message for robots with these domains and charges, in priority order."""
        kinds, runs = grouped(robots)
        return cls([domain for domain, _ in kinds], [charges for _, charges in kinds], runs, most)

    @property
    def robots(self) -> list[tuple[Domain, Charges]]:
        """The domain and charges of each robot."""
        return expanded(list(zip(self.domains, self.charges, strict=True)), self.runs)

    def in_words(self, words: Wording) -> str:
        domains = expanded(self.domains, cut_off(self.runs, len(words.order)))
        if not domains:
            return "nobody is below me"
        order = list(words.order)
        names = order[order.index(words.receiver) + 1 :] if words.receiver in order else []
        return f"below you there are {_sizes(names, domains)}; all together they cost at most {cost_text(self.most)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        below = hearing.order[hearing.order.index(hearing.receiver) + 1 :]
        found: list[Proof] = []
        for robot, (values, charges) in zip(below, self.robots, strict=False):
            paid = [Pays(robot, value, {}, cost, cost) for value, cost in zip(values, charges, strict=True)]
            found += [HasOnly(robot, tuple(values)), *paid]
        return found


class CPAs(Message, frozen=True):
    """A number (`count`) of partial assignments of all robots above the receiver (see `sfb_bounds`).

    Their lower bounds are below `least`: the cost of the best known solution, or the `ceiling`, an upper bound on all
    costs.
    """

    count: int
    rows: bytes
    least: int
    ceiling: int

    act = Act(Performative.PROPOSE, "partial assignments, for the receiver to extend or to drop")

    def in_words(self, words: Wording) -> str:
        known = incumbent_text(self.least if self.least < self.ceiling else math.inf)
        return f"{counted(self.count, 'partial assignment')} for {words.receiver} to extend; {known}"

    def proves(self, hearing: Hearing) -> Sequence[Proof] | None:
        """Return what the message proves to its receiver: each row holds what the robots from it on have to pay."""
        if self.count > MOST_ROWS:
            return None
        if hearing.minimises:
            return [*costs_prove(self.rows, self.count, self.ceiling, hearing)]
        return [*bits_prove(self.rows, self.count, hearing)]


class Explored(Message, frozen=True):
    """The end of the exploration of the oldest unanswered `CPAs` from the receiver."""

    act = Act(Performative.INFORM, "what was proposed with `CPAs` has been seen to the end")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "nothing is left of the oldest partial assignments that I have had from you and have not answered"


class Solution(Message, frozen=True):
    """A solution cheaper than all before, as the place of each robot's value in its domain."""

    cost: int
    places: list[int]

    act = Act(Performative.INFORM, "the receiver comes to know a solution that costs less")

    def in_words(self, _: Wording) -> str:
        places = listed([str(place + 1) for place in self.places])
        return (
            f"a solution costs {cost_text(self.cost)}, less than all before;"
            f" by number, robots' values in it are {places}"
        )

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        view = _chosen(hearing.order, self.places, hearing)
        return [*(StandsAt(*one) for one in view.items()), Total(view, self.cost)]


def _sizes(names: Sequence[str], domains: Sequence[Domain]) -> str:
    return listed([f"{name} ({counted(len(values), 'value')})" for name, values in along(names, domains)]) or "nobody"


def _chosen(robots: Sequence[str], places: Sequence[int], hearing: Hearing) -> dict[str, Value]:
    """Return the values of robots whose domains the receiver knows."""
    known = [(robot, hearing.values(robot), place) for robot, place in zip(robots, places, strict=False)]
    return {robot: values[place] for robot, values, place in known if values is not None}
