"""Cooperative Constraint Approximation (CoCoA).

No cycles: each robot takes one value, once. Before that it asks all neighbours that have none what each of its values
would cost them at least, and takes the value for which the sum is least. If too many values are equally good, it waits
(HOLD) until a neighbour has taken a value. If nobody around can go on, it accepts more equally good values.

- **When to use**: costs, also asymmetric ones, few messages: a fair answer from a number of messages that does not
  depend on cycles.
- **Guarantees**: incomplete, no proof of optimality. It always ends: a robot with d neighbours and v values becomes
  active at most d + v times, so it sends at most 2 d (d + v) messages, and as many answers as it is asked for; with
  asymmetric costs d questions more. No robot changes its value. A robot with an empty domain proves that there is no
  solution.
- **Parameters**: none.
- **Reference**: van Leeuwen, Pawelczak: "CoCoA: a non-iterative approach to a local search (A)DCOP solver", AAAI 2017.

Its states and steps:

    IDLE      not asked to act yet                          an active robot asks its neighbours      `_activate`
    ACTIVE    waits for its neighbours' answers             a neighbour answers                      `_answer`
    HOLD      too many values are equally good              it chooses, or waits                     `_decide`
    DONE      has its value                                 beta, the bound on equally good values   `bound`

Choices that the paper leaves open, and differences:

- Robots that have a higher priority than all their neighbours begin. So each part of the team has one that begins; it
  may have several, which does no harm.
- An idle robot becomes active when a neighbour has chosen, and also when one waits. Otherwise the search could stop.
- Neighbours that are DONE are not asked, as the robot itself knows what they charge. They have told their value before
  any answer arrives that is still under way, and that answer is not used.
- If all neighbours are DONE, nothing more can become known: one of the best values is chosen by lot, however many
  there are.
- A constraint of more than two robots counts when all but one or two have values, once: unknown robots charge nothing.
- Asymmetric costs (ADCOP): an answer counts the neighbour's own side only, and names the neighbour's value with which
  it is least. The asker adds its own side at this value. A neighbour that is DONE is asked, too, once: its own side for
  its value is nobody else's to know. If it is DONE only after its answer, it is asked again.
- Fewer violated hard constraints are always better, so plain DisCSPs work, too.

It ends: of the robots of a part of the team, the last one to choose or to wait finds all its neighbours DONE or in
HOLD, and goes on. So nobody is left in HOLD, nor IDLE beside a robot that is not.

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
    Hearing,
    PartPays,
    Proof,
    SomeValuePays,
    StandsAt,
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
"""Broken hard constraints, and the cost of all others."""


class Inquiry(wire.Message, frozen=True):
    """A question: what would each of the sender's `values` cost the receiver at least?

    `known` are the final values of other robots that the sender knows. The sender is active from now on.
    """

    values: list[wire.Value]
    known: dict[str, wire.Value]

    act = Act(Performative.QUERY_REF, "the sender asks what its values would cost the receiver")

    def in_words(self, words: Wording) -> str:
        so_far = f"; so far {words.assigned(self.known.items())}" if self.known else ""
        return f"what would each of my {counted(len(self.values), 'value')} cost you at least?{so_far}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [HasOnly(hearing.sender, tuple(self.values)), *(can_take(*known) for known in self.known.items())]


class Costs(wire.Message, frozen=True):
    """The answer to an inquiry: for each value that was asked for, the least that it would cost the sender."""

    burdens: list[Burden]

    act = Act(Performative.INFORM, "the receiver comes to know what its values would cost the sender")

    def in_words(self, _: Wording) -> str:
        if not self.burdens:
            return "you have asked for no value"
        place = self.burdens.index(min(self.burdens))
        price = saving_in_words(*self.burdens[place])
        return f"of your {counted(len(self.burdens), 'value')}, number {place + 1} would cost me least: {price}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what values cost the sender, given others' final values.

        Where it shares constraints with the receiver alone, and has no final value, all its values cost that much.
        """
        asked = hearing.last(Inquiry, hearing.receiver, hearing.sender)
        if asked is None:
            return NOTHING
        alone = hearing.is_only_neighbour() and hearing.last(SetValue, hearing.sender, hearing.receiver) is None
        found: list[Proof] = []
        for value, (broken, cost) in zip(asked.values, self.burdens, strict=False):
            view = {hearing.receiver: value}
            if not broken:
                found.append(SomeValuePays(hearing.sender, view, cost))
            if alone:
                found.append(EveryValuePays(hearing.sender, view, INFINITE if broken else cost))
        return found


class CostsAt(Costs, frozen=True):
    """The answer where both sides of a constraint have costs of their own (ADCOP): the sender's side only.

    `values` are the sender's own values with which it costs the sender least, one for each value that was asked for.
    """

    values: list[wire.Value]

    act = Act(Performative.INFORM, "the receiver comes to know what its values would cost the sender, and with which")

    def in_words(self, words: Wording) -> str:
        told = super().in_words(words)
        if not self.burdens or len(self.values) != len(self.burdens):
            return told
        return f"{told}, with {words.own_value(self.values[self.burdens.index(min(self.burdens))])}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [*super().proves(hearing), *(can_take(hearing.sender, value) for value in dict.fromkeys(self.values))]


class FinalSide(wire.Message, frozen=True):
    """The answer of a robot that has its value (ADCOP): what its parts charge for each value that was asked for."""

    burdens: list[Burden]

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's parts charge for its values")

    def in_words(self, _: Wording) -> str:
        if not self.burdens:
            return "you have asked for no value"
        place = self.burdens.index(min(self.burdens))
        price = saving_in_words(*self.burdens[place])
        return f"of your {counted(len(self.burdens), 'value')}, number {place + 1} costs my side least: {price}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender's parts, for its value and all that were asked."""
        asked = hearing.last(Inquiry, hearing.receiver, hearing.sender)
        stands = hearing.last(SetValue, hearing.sender, hearing.receiver)
        if asked is None or stands is None:
            return NOTHING
        return [
            PartPays(hearing.sender, stands.value, hearing.receiver, value, INFINITE if broken else cost)
            for value, (broken, cost) in zip(asked.values, self.burdens, strict=False)
        ]


class Hold(wire.Message, frozen=True):
    """The sender waits: too many of its values are equally good."""

    act = Act(Performative.INFORM, "the receiver comes to know that it may choose before the sender")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "I wait: too many of my values are equally good"


class SetValue(wire.Message, frozen=True):
    """The sender's value, which is final."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} for good"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [StandsAt(hearing.sender, self.value)]


class State(StrEnum):
    """The states of a robot."""

    IDLE = "idle"
    ACTIVE = "active"
    HOLD = "hold"
    DONE = "done"


_AT_REST = (State.HOLD, State.DONE)


@mypyc_attr(allow_interpreted_subclasses=True)
class CoCoA(Protocol):
    """One agent of CoCoA.

    State: the own `state` and the neighbours' (`states`), the final values of neighbours (`view`), `answers` to the
    last inquiry, and `bound`: the number of equally good values among which it chooses (beta). `sides` are what the
    parts of neighbours that are DONE charge for each own value.
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
        use_when="costs, few messages: each robot takes one value, once",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.state = State.IDLE
        self.states = dict.fromkeys(problem.neighbours, State.IDLE)
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
        """Note a neighbour's state or answer; answer its inquiry."""
        if self.verdict is not None:
            return
        if sender not in self.states:
            raise ValueError(f"{sender} is no neighbour of {self.problem.agent}")
        match cast("Inquiry | Costs | CostsAt | FinalSide | Hold | SetValue", message):
            case Inquiry(values, known):
                self._refuse([*((sender, value) for value in values), *known.items()])
                self.states[sender] = State.ACTIVE
                self._answer(sender, values, known)
            case CostsAt(burdens, values):
                self._refuse_number(sender, values)
                own = self._own_sides(sender, values)
                self._keep(sender, burdens)
                self.answers[sender] = _sums(own, burdens)
            case Costs(burdens):
                self._keep(sender, burdens)
            case FinalSide(burdens):
                if self.states[sender] != State.DONE:
                    raise ValueError(f"{sender} has told {self.problem.agent} no value that is final")
                self._keep(sender, burdens)
                self.sides[sender] = burdens
            case Hold():
                self.states[sender] = State.HOLD
            case SetValue(value):
                self._refuse([(sender, value)])
                self.states[sender] = State.DONE
                self.view[sender] = value
                self._ask_again(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Go on as far as what is known allows."""
        while self.verdict is None and self._goes_on():
            pass

    def _goes_on(self) -> bool:
        """Take the next step, if there is one: begin to ask, or decide."""
        match self.state:
            case State.ACTIVE if len(self.answers) == len(self._asked):
                self._decide()
            case State.IDLE if any(state in _AT_REST for state in self.states.values()):
                self._activate()
            case State.HOLD if len(self.view) > self._done_before:
                self._activate()
            case State.HOLD if all(state in _AT_REST for state in self.states.values()):
                self.bound += 1
                self._activate()
            case _:
                return False
        return True

    def _activate(self) -> None:
        """Ask neighbours what the own values would cost them: all that have no value, and parts that are not told."""
        self.state = State.ACTIVE
        self._done_before = len(self.view)
        self.answers = {}
        self._asked = tuple(name for name, state in self.states.items() if state != State.DONE or self._lacks(name))
        inquiry = Inquiry(list(self.problem.values), dict(self.view))
        for name in self._asked:
            self.send(name, inquiry)

    def _lacks(self, name: str) -> bool:
        """Return whether a neighbour that is DONE has not told yet what its parts charge."""
        return name not in self.sides and self.problem.shares_parts_with(name)

    def _ask_again(self, name: str) -> None:
        """Ask a neighbour that has taken its value after its answer for what its parts charge now."""
        if self.state == State.ACTIVE and name in self.answers and self._lacks(name):
            del self.answers[name]
            self.send(name, Inquiry(list(self.problem.values), dict(self.view)))

    def _answer(self, sender: str, values: list[wire.Value], known: Mapping[str, wire.Value]) -> None:
        """Send the least cost of each of the sender's values: over all own values, or for the final one."""
        divided = self.problem.shares_parts_with(sender)
        if divided and self.value is not None:
            own = self.value
            self.send(sender, FinalSide([self.problem.own_side(own, sender, value) for value in values]))
            return
        view = {**known, **self.view}
        view.pop(self.problem.agent, None)
        totals = [self.problem.lexicographic_costs({**view, sender: value}) for value in values]
        least = [self._least(burdens) for burdens in totals]
        if divided:
            at = [burdens.index(cost) for burdens, cost in zip(totals, least, strict=True)]
            self.send(sender, CostsAt(least, [self.problem.values[place] for place in at]))
        else:
            self.send(sender, Costs(least))

    def _own_sides(self, sender: str, values: list[wire.Value]) -> list[Burden]:
        """Return what the own parts charge for each own value, where the sender has the value of the same place."""
        return [self.problem.own_side(place, sender, value) for place, value in enumerate(values)]

    def _refuse(self, told: Iterable[tuple[str, wire.Value]]) -> None:
        """Raise `ValueError` for a value that a neighbour cannot have; what others have means nothing here."""
        for name, value in told:
            if name in self.states:
                self.problem.refuse_value(name, value)

    def _least(self, burdens: list[Burden]) -> Burden:
        return min(burdens) if self.value is None else burdens[self.value]

    def _keep(self, sender: str, burdens: list[Burden]) -> None:
        """Store an answer; raise `ValueError` if it was not asked for, or is not about the own values."""
        asked = self.state == State.ACTIVE and sender in self._asked and sender not in self.answers
        if not asked:
            raise ValueError(f"{sender} tells costs that {self.problem.agent} has not asked for")
        self._refuse_number(sender, burdens)
        self.answers[sender] = burdens

    def _refuse_number(self, sender: str, told: Sequence[object]) -> None:
        """Raise `ValueError` for an answer that is not about the own values."""
        if len(told) != len(self.problem.values):
            raise ValueError(f"{sender} tells costs that {self.problem.agent} has not asked for")

    def _decide(self) -> None:
        """Choose one of the best values, or wait if too many are equally good."""
        totals = self.problem.lexicographic_costs(self.view)
        waiting = [name for name in self._asked if name not in self.view]
        for told in (*self.sides.values(), *(self.answers[name] for name in waiting)):
            totals = _sums(totals, told)
        least = min(totals)
        best = [place for place, total in enumerate(totals) if total == least]
        if len(best) <= self.bound or not waiting:
            self.state = State.DONE
            self.value = one_of(self.chance, best)
            self._tell(SetValue(self.problem.values[self.value]))
        else:
            self.state = State.HOLD
            self._tell(Hold())

    def _tell(self, message: wire.Message) -> None:
        """Tell all neighbours that have no value yet."""
        for name, state in self.states.items():
            if state != State.DONE:
                self.send(name, message)


def _sums(some: Sequence[Burden], others: Sequence[Burden]) -> list[Burden]:
    return [(a + c, b + d) for (a, b), (c, d) in zip(some, others, strict=True)]
