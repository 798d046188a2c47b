"""Cooperative Constraint Approximation (CoCoA).

Without cycles: each robot chooses one value, once. Before that it asks all neighbours without a value for the least
cost to them of each of its values, and chooses the value with the least sum. If too many values are equally good, it
waits (HOLD) until a neighbour has chosen a value. If no robot around it can continue, it accepts more equally good
values.

- **When to use**: costs, also asymmetric ones, few messages: a fair result from a number of messages that does not
  depend on cycles.
- **Guarantees**: incomplete, no proof of optimality. It always ends: a robot with d neighbours and v values becomes
  active at most d + v times, so it sends at most 2 d (d + v) messages, and one answer for each inquiry that it
  receives; with asymmetric costs it sends d more inquiries. No robot changes its value. A robot with an empty domain
  proves that there is no solution.
- **Parameters**: none.
- **Reference**: van Leeuwen, Pawelczak: "CoCoA: a non-iterative approach to a local search (A)DCOP solver", AAAI 2017.

The states and steps:

    IDLE      not asked to act yet                          an active robot asks its neighbours      `_activate`
    ACTIVE    waits for its neighbours' answers             a neighbour answers                      `_answer`
    HOLD      too many values are equally good              it chooses, or waits                     `_choose_or_wait`
    DONE      has its value                                 beta, the bound on equally good values   `bound`

Choices that the paper leaves open, and differences:

- Robots that have a higher priority than all their neighbours start. So each connected part of the team has at least
  one such robot; several do no harm.
- An idle robot becomes active when a neighbour has chosen a value, and also when a neighbour waits. Otherwise the
  search could stop.
- Neighbours that are DONE are not asked, because the robot itself knows the costs of their common constraints. Their
  value arrives before any answer that is still in transit, and that answer is not used.
- If all neighbours are DONE, nothing more can become known: one of the best values is chosen at random, however many
  there are.
- A constraint between more than two robots counts when all but one or two have values, and it counts once: unknown
  robots add no cost.
- Asymmetric costs (ADCOP): an answer counts the neighbour's side only, and contains the neighbour's value for which
  this cost is least. The asking robot adds its own side at this value. A neighbour that is DONE is asked, too, once:
  only this neighbour knows its side for its value. If the neighbour becomes DONE only after its answer, it is asked
  again.
- Fewer violated hard constraints are always better, so plain DisCSPs work, too.

Why it ends: in a connected part of the team, the last robot to choose or to wait finds all its neighbours DONE or in
HOLD, and continues. So no robot remains in HOLD, or remains IDLE next to a robot that is not IDLE.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), CoCoA, Concurrent(seed=0)).search()
>>> result.metrics.messages["SetValue"], sum(map(len, result.assignments.values()))  # of 16 robots
(85, 16)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.chance import one_of
from robochoc.protocols.disclosure import (
    INFINITE,
    NOTHING,
    EveryValuePays,
    HasOnly,
    HasValue,
    PartPays,
    Proof,
    Reception,
    SomeValuePays,
    can_take,
)
from robochoc.protocols.local_search.mgm import saving_in_words
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted

Burden = tuple[int, int | float]
"""Broken hard constraints, and the cost of all other constraints."""


class Inquiry(wire.Message, frozen=True):
    """A question: what is the least cost to the receiver of each of the sender's `values`?

    `known` are the final values of other robots that the sender knows. The sender is active from now on.
    """

    values: list[wire.Value]
    known: dict[str, wire.Value]

    act = Act(Performative.QUERY_REF, "the sender asks for the costs of its values to the receiver")

    def in_words(self, words: Wording) -> str:
        so_far = f"; so far {words.assigned(self.known.items())}" if self.known else ""
        return f"what would each of my {counted(len(self.values), 'value')} cost you at least?{so_far}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values)), *(can_take(*known) for known in self.known.items())]


class Costs(wire.Message, frozen=True):
    """The answer to an inquiry: for each value in the inquiry, the least cost to the sender."""

    burdens: list[Burden]

    act = Act(Performative.INFORM, "the receiver learns the costs of its values to the sender")

    def in_words(self, _: Wording) -> str:
        if not self.burdens:
            return "you have asked for no value"
        place = self.burdens.index(min(self.burdens))
        price = saving_in_words(*self.burdens[place])
        return f"of your {counted(len(self.burdens), 'value')}, number {place + 1} would cost me least: {price}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the sender's costs for the receiver's values, given others' final values.

        If the sender shares constraints with the receiver only, and has no final value, all its values cost at least
        that much.
        """
        asked = reception.last(Inquiry, reception.receiver, reception.sender)
        if asked is None:
            return NOTHING
        alone = reception.is_only_neighbour() and reception.last(SetValue, reception.sender, reception.receiver) is None
        found: list[Proof] = []
        for value, (broken, cost) in zip(asked.values, self.burdens, strict=False):
            view = {reception.receiver: value}
            if not broken:
                found.append(SomeValuePays(reception.sender, view, cost))
            if alone:
                found.append(EveryValuePays(reception.sender, view, INFINITE if broken else cost))
        return found


class CostsAt(Costs, frozen=True):
    """The answer if both sides of a constraint have their own costs (ADCOP): the sender's side only.

    `values`: for each value in the inquiry, the sender's value with the least cost to the sender.
    """

    values: list[wire.Value]

    act = Act(Performative.INFORM, "the receiver learns the costs of its values to the sender, and with which value")

    def in_words(self, words: Wording) -> str:
        text = super().in_words(words)
        if not self.burdens or len(self.values) != len(self.burdens):
            return text
        return f"{text}, with {words.own_value(self.values[self.burdens.index(min(self.burdens))])}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [
            *super().proves(reception),
            *(can_take(reception.sender, value) for value in dict.fromkeys(self.values)),
        ]


class FinalSide(wire.Message, frozen=True):
    """The answer of a robot that is DONE (ADCOP): the cost of its side for each value in the inquiry."""

    burdens: list[Burden]

    act = Act(Performative.INFORM, "the receiver learns the costs of the sender's side for the receiver's values")

    def in_words(self, _: Wording) -> str:
        if not self.burdens:
            return "you have asked for no value"
        place = self.burdens.index(min(self.burdens))
        price = saving_in_words(*self.burdens[place])
        return f"of your {counted(len(self.burdens), 'value')}, number {place + 1} costs my side least: {price}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the costs of the sender's side, for its value and all values in the inquiry."""
        asked = reception.last(Inquiry, reception.receiver, reception.sender)
        final = reception.last(SetValue, reception.sender, reception.receiver)
        if asked is None or final is None:
            return NOTHING
        return [
            PartPays(reception.sender, final.value, reception.receiver, value, INFINITE if broken else cost)
            for value, (broken, cost) in zip(asked.values, self.burdens, strict=False)
        ]


class Hold(wire.Message, frozen=True):
    """The sender waits: too many of its values are equally good."""

    act = Act(Performative.INFORM, "the receiver learns that it may choose before the sender")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "I wait: too many of my values are equally good"


class SetValue(wire.Message, frozen=True):
    """The sender's value, which is final."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} for good"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasValue(reception.sender, self.value)]


class SearchState(StrEnum):
    """The states of a robot."""

    IDLE = "idle"
    ACTIVE = "active"
    HOLD = "hold"
    DONE = "done"


_AT_REST = (SearchState.HOLD, SearchState.DONE)


@mypyc_attr(allow_interpreted_subclasses=True)
class CoCoA(Protocol):
    """One agent of CoCoA.

    State: this robot's `state` and its neighbours' (`states`), the final values of neighbours (`view`), `answers` to
    the last inquiry, and `bound`: the number of equally good values among which it chooses (beta). `sides` are the
    costs of each of its values in the sides of neighbours that are DONE.
    """

    messages: ClassVar[Any] = Inquiry | Costs | CostsAt | FinalSide | Hold | SetValue
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="van Leeuwen & Pawelczak 2017",
        complete=False,
        costs=True,
        partially_known=True,
        asymmetric=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, large team, few messages: one value each, once",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.state = SearchState.IDLE
        self.states = dict.fromkeys(problem.neighbours, SearchState.IDLE)
        self.view: dict[str, wire.Value] = {}
        self.answers: dict[str, list[Burden]] = {}
        self.sides: dict[str, list[Burden]] = {}
        self.bound = 1
        self._asked: tuple[str, ...] = ()
        self._done_before = 0

    def start(self) -> None:
        """Become active if no neighbour has a higher priority; a robot with an empty domain ends the search."""
        rank = self.order.rank
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif all(rank[name] > rank[self.problem.agent] for name in self.problem.neighbours):
            self._activate()
            self.settle()

    def receive(self, sender: str, message: wire.Message) -> None:
        """Store a neighbour's state or answer; answer its inquiry."""
        if self.verdict is not None:
            return
        if sender not in self.states:
            raise ValueError(f"{sender} is not a neighbour of {self.problem.agent}")
        match cast("Inquiry | Costs | CostsAt | FinalSide | Hold | SetValue", message):
            case Inquiry(values, known):
                self._check_values([*((sender, value) for value in values), *known.items()])
                self.states[sender] = SearchState.ACTIVE
                self._answer(sender, values, known)
            case CostsAt(burdens, values):
                self._check_number(sender, values)
                own = self._own_sides(sender, values)
                self._store_answer(sender, burdens)
                self.answers[sender] = _sums(own, burdens)
            case Costs(burdens):
                self._store_answer(sender, burdens)
            case FinalSide(burdens):
                if self.states[sender] != SearchState.DONE:
                    raise ValueError(f"{sender} sent FinalSide to {self.problem.agent}, but no final value before")
                self._store_answer(sender, burdens)
                self.sides[sender] = burdens
            case Hold():
                self.states[sender] = SearchState.HOLD
            case SetValue(value):
                self._check_values([(sender, value)])
                self.states[sender] = SearchState.DONE
                self.view[sender] = value
                self._ask_again(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Make all steps for which the messages have arrived."""
        while self.verdict is None and self._make_step():
            pass

    def _make_step(self) -> bool:
        """Make the next step, if there is one: send inquiries, or choose; return whether there was a step."""
        match self.state:
            case SearchState.ACTIVE if len(self.answers) == len(self._asked):
                self._choose_or_wait()
            case SearchState.IDLE if any(state in _AT_REST for state in self.states.values()):
                self._activate()
            case SearchState.HOLD if len(self.view) > self._done_before:
                self._activate()
            case SearchState.HOLD if all(state in _AT_REST for state in self.states.values()):
                self.bound += 1
                self._activate()
            case _:
                return False
        return True

    def _activate(self) -> None:
        """Send an inquiry to all neighbours that have no value, or whose side is missing."""
        self.state = SearchState.ACTIVE
        self._done_before = len(self.view)
        self.answers = {}
        self._asked = tuple(
            name for name, state in self.states.items() if state != SearchState.DONE or self._lacks(name)
        )
        inquiry = Inquiry(list(self.problem.values), dict(self.view))
        for name in self._asked:
            self.send(name, inquiry)

    def _lacks(self, name: str) -> bool:
        """Return whether the side of a neighbour that is DONE is still missing."""
        return name not in self.sides and self.problem.shares_parts_with(name)

    def _ask_again(self, name: str) -> None:
        """Ask a neighbour that became DONE after its answer for its side."""
        if self.state == SearchState.ACTIVE and name in self.answers and self._lacks(name):
            del self.answers[name]
            self.send(name, Inquiry(list(self.problem.values), dict(self.view)))

    def _answer(self, sender: str, values: list[wire.Value], known: Mapping[str, wire.Value]) -> None:
        """Send the least cost of each of the sender's values: over all values of this robot, or for its final one."""
        divided = self.problem.shares_parts_with(sender)
        if divided and self.value is not None:
            own = self.value
            self.send(sender, FinalSide([self.problem.own_side(own, sender, value) for value in values]))
            return
        view = {**known, **self.view}
        view.pop(self.problem.agent, None)
        totals = [self.problem.lexicographic_costs({**view, sender: value}) for value in values]
        least = [self._least(costs) for costs in totals]
        if divided:
            at = [costs.index(cost) for costs, cost in zip(totals, least, strict=True)]
            self.send(sender, CostsAt(least, [self.problem.values[place] for place in at]))
        else:
            self.send(sender, Costs(least))

    def _own_sides(self, sender: str, values: list[wire.Value]) -> list[Burden]:
        """Return the cost of this robot's side for each of its values, with the sender's value at the same index."""
        return [self.problem.own_side(place, sender, value) for place, value in enumerate(values)]

    def _check_values(self, values: Iterable[tuple[str, wire.Value]]) -> None:
        """Raise `ValueError` for a value outside a neighbour's domain; values of other robots are not used here."""
        for name, value in values:
            if name in self.states:
                self.problem.refuse_value(name, value)

    def _least(self, costs: list[Burden]) -> Burden:
        return min(costs) if self.value is None else costs[self.value]

    def _store_answer(self, sender: str, burdens: list[Burden]) -> None:
        """Store an answer; raise `ValueError` if there was no inquiry, or the number of values is wrong."""
        asked = self.state == SearchState.ACTIVE and sender in self._asked and sender not in self.answers
        if not asked:
            raise ValueError(f"{sender} sent costs without an inquiry from {self.problem.agent}")
        self._check_number(sender, burdens)
        self.answers[sender] = burdens

    def _check_number(self, sender: str, answer: Sequence[object]) -> None:
        """Raise `ValueError` for an answer without exactly one element for each of this robot's values."""
        if len(answer) != len(self.problem.values):
            own = f"{self.problem.agent} has {counted(len(self.problem.values), 'value')}"
            raise ValueError(f"{sender} sent costs of {len(answer):,}, but {own}")

    def _choose_or_wait(self) -> None:
        """Choose one of the best values, or wait if too many are equally good."""
        totals = self.problem.lexicographic_costs(self.view)
        waiting = [name for name in self._asked if name not in self.view]
        for costs in (*self.sides.values(), *(self.answers[name] for name in waiting)):
            totals = _sums(totals, costs)
        least = min(totals)
        best = [place for place, total in enumerate(totals) if total == least]
        if len(best) <= self.bound or not waiting:
            self.state = SearchState.DONE
            self.value = self._chosen(one_of(self.chance, best))
            self._send_to_undecided(SetValue(self.problem.values[self.value]))
        else:
            self.state = SearchState.HOLD
            self._send_to_undecided(Hold())

    def _chosen(self, place: int) -> int:
        """Return the index of this robot's final value; `place` is that of one of the best values."""
        return place

    def _send_to_undecided(self, message: wire.Message) -> None:
        """Send a message to all neighbours that have no value yet."""
        for name, state in self.states.items():
            if state != SearchState.DONE:
                self.send(name, message)


def _sums(some: Sequence[Burden], others: Sequence[Burden]) -> list[Burden]:
    return [(a + c, b + d) for (a, b), (c, d) in zip(some, others, strict=True)]
