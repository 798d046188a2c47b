"""LAMDLS-2: latency-aware monotonic local search, in which two neighbours may move together.

LAMDLS (see `lamdls.py`) whose steps alternate. In the first kind of step robots move one after the other in a random
order, as in LAMDLS, and colour themselves in this order: each chooses the smallest colour that no earlier neighbour
has. In the second kind, a robot whose neighbours with smaller colours have all moved offers a joint move to a neighbour
with the next colour. That neighbour accepts one offer, and both robots make their best joint move; the others whose
offers it has received, and robots without a neighbour of the next colour, move alone. Colours and pairs are different
each time, so each pair of neighbours is formed sooner or later.

- **When to use**: like MGM-2, if messages are slow: a robot waits for its neighbours only, and needs no gains.
- **Guarantees**: incomplete; it stops after `cycles` cycles (steps), without a proof of optimality. The cost never
  rises from one cycle to the next (anytime), and it ends in a 2-optimum after enough cycles. The course of the search
  does not depend on message delays. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `cycles` (default 100).
- **References**: Rachmut, Zivan, Yeoh: "Latency-aware 2-opt monotonic local search for distributed constraint
  optimization", CP 2024. Only the abstract was available; the rules are those of the authors' public simulator
  (repository benrachmut/CADCOP_2022_new).

The rules:

    order by random numbers, and colours                  `_start_colouring`, `_choose_colour`
    move alone when the colour is chosen                  `_choose_colour`
    offer to the next colour, smallest number first       `_offer_or_answer`, `_offer`
    accept one offer when all others below have moved     `_offer_or_answer`, `_accept`
    move alone after the value of a partner that refused  `_receive_answer`

Choices that the references leave open, and differences:

- In the first order, priorities replace the numbers. Later, each robot draws a number, and sends it with its colour in
  the step before.
- An offer contains the gain for each pair of values, as in `mgm2`, instead of the offerer's constraints.
- If there are several offers, that of the robot with the smallest number is accepted.
- First values, equally good values and n-ary constraints are treated as in `lamdls`. Lost messages are not supported.

No robots wait for each other in a circle: a robot that waits for an offerer to move waits for the partner of this
offerer, whose number is smaller than its own, since the offerer has preferred it.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), LAMDLS2, Concurrent(seed=0)).search()
>>> sorted(result.metrics.messages)
['Accept', 'Domain', 'NumberedColour', 'Offer', 'Value']
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated

import msgspec

from robochoc.protocols import message as wire
from robochoc.protocols.local_search.lamdls import LAMDLS, Colour, least_free
from robochoc.protocols.local_search.mgm2 import Accept, Gains, Offer, joint_moves, offered_gains
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, Domain, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class NumberedColour(Colour, frozen=True):
    """The sender's value and colour, and its `number` in the order of the next colouring."""

    number: Annotated[float, msgspec.Meta(ge=0, le=1)]

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)}, and my colour is number {self.colour + 1} this time"


class LAMDLS2(LAMDLS):
    """One agent of LAMDLS-2.

    State: as in LAMDLS, also the neighbours' `domains`, the `numbers` of all robots in the order of this colouring, and
    the `partner` to which this robot has sent an offer.
    """

    messages = Domain | NumberedColour | Value | Offer | Accept | AnytimeMessage
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Rachmut, Zivan, Yeoh 2024",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        cost_never_rises=True,
        use_when="as MGM-2, with unequal delays: pairs move, cost never rises",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        robots = (problem.agent, *problem.neighbours)
        self.domains: dict[str, list[wire.Value]] = {}
        self.numbers: dict[str, float] = {name: order.rank[name] for name in robots}
        self.partner: str | None = None
        self._next_numbers: dict[str, float] = {}

    def start_cycles(self) -> None:
        """Choose a random value, and send the domain and the value."""
        self.choose(self.any_value())
        self.multicast(self.problem.neighbours, Domain(list(self.problem.values)))
        self.listen(self.problem.neighbours, self._receive_domains)

    def _receive_domains(self, messages: Mapping[str, wire.Message]) -> None:
        self.domains = self.checked_domains(messages)
        self.exchange_values(self._receive_first_values)

    def _receive_first_values(self, messages: Mapping[str, wire.Message]) -> None:
        self._store_values(messages)
        self._start_colouring()

    # The first kind of step: colours in a random order

    def _start_colouring(self) -> None:
        """Wait for the neighbours that precede this robot in the order of the numbers."""
        own = self._turn(self.problem.agent)
        self.earlier = tuple(name for name in self.problem.neighbours if self._turn(name) < own)
        self.later = tuple(name for name in self.problem.neighbours if self._turn(name) > own)
        self.colours = {}
        self.listen(self.earlier, self._choose_colour)

    def _turn(self, name: str) -> tuple[float, int]:
        """Return the place of a robot in the order of the colouring; ties go to the higher priority."""
        return self.numbers[name], self.order.rank[name]

    def _choose_colour(self, messages: Mapping[str, wire.Message]) -> None:
        """Choose the smallest free colour, and the best value."""
        self._store_colours(messages)
        self.colour = least_free({*self.colours.values()})
        number = self._next_numbers[self.problem.agent] = self.chance()
        self.choose(index := self.best_response())
        self.multicast(self.problem.neighbours, NumberedColour(self.problem.values[index], self.colour, number))
        if not self.finished:
            self.listen(self.later, self._start_pairs)

    def _store_colours(self, messages: Mapping[str, wire.Message]) -> None:
        super()._store_colours(messages)
        for name, message in messages.items():
            if isinstance(message, NumberedColour):
                self._next_numbers[name] = message.number

    # The second kind of step: pairs

    def _start_pairs(self, messages: Mapping[str, wire.Message]) -> None:
        """Wait for the values or the offers of all neighbours with smaller colours."""
        self._store_colours(messages)
        own = self.colour or 0
        self.partner = None
        self.earlier = tuple(name for name in self.problem.neighbours if self.colours[name] < own)
        self.later = tuple(name for name in self.problem.neighbours if self.colours[name] > own)
        self.listen(self.earlier, self._offer_or_answer)

    def _offer_or_answer(self, messages: Mapping[str, wire.Message]) -> None:
        """Accept one of the received offers; without one, send an offer, or move alone."""
        offers = {name: message.gains for name, message in messages.items() if isinstance(message, Offer)}
        self._store_values({name: message for name, message in messages.items() if name not in offers})
        following = [name for name in self.later if self.colours[name] == (self.colour or 0) + 1]
        if offers:
            self._accept(min(offers, key=self._turn), offers)
        elif following:
            self._offer(min(following, key=self._turn))
        else:
            self._move_alone(self.later)

    def _offer(self, partner: str) -> None:
        """Send `partner` the gain for each pair of values."""
        self.partner = partner
        gains = offered_gains(self.problem, self.present, self.view, partner, self.domains[partner])
        self.send(partner, Offer(gains))
        self.listen((partner,), self._receive_answer)

    def _accept(self, offerer: str, offers: Mapping[str, Gains | None]) -> None:
        """Make the best joint move with `offerer`; the other offerers then move alone."""
        gains = offers[offerer]
        domain = self.domains[offerer]
        if not gains or len(gains) != len(self.problem.values) or any(len(row) != len(domain) for row in gains):
            raise ValueError(f"{offerer} sent an offer that does not fit the values of both robots")
        moves = list(joint_moves(self.problem, self.present, self.view, offerer, gains))
        most = max(move.gain for move in moves)
        own, place = self.present, domain.index(self.view[offerer])
        if most > NO_GAIN:
            best = self.any_of([move for move in moves if move.gain == most])
            own, place = best.own, best.place
        self.send(offerer, Accept(place, *max(most, NO_GAIN)))
        self.view[offerer] = domain[place]
        self._make_move(own)
        self._end_step([*(name for name in offers if name != offerer), *self.later])

    def _receive_answer(self, messages: Mapping[str, wire.Message]) -> None:
        """Make the joint move that the partner has chosen; if it has refused the offer, move alone."""
        partner = self.partner or ""
        answer = messages[partner]
        if not isinstance(answer, Accept):
            self._store_values(messages)
            self._move_alone([name for name in self.later if name != partner])
            return
        if not 0 <= answer.place < len(self.problem.values):
            raise ValueError(f"{partner} accepted an offer with the value number {answer.place}, which does not exist")
        self._make_move(answer.place, besides=partner)
        self._end_step(self.later)

    def _move_alone(self, later: Sequence[str]) -> None:
        self._make_move(self.best_response())
        self._end_step(later)

    def _make_move(self, index: int, besides: str = "") -> None:
        """Choose a value, and send it to all neighbours, except to a partner that has chosen it (`besides`)."""
        self.choose(index)
        receivers = [name for name in self.problem.neighbours if name != besides]
        self.multicast(receivers, Value(self.problem.values[index]))

    def _end_step(self, later: Iterable[str]) -> None:
        """Wait for the values of the neighbours that move later in this step."""
        if not self.finished:
            self.listen(tuple(later), self._start_next_step)

    def _start_next_step(self, messages: Mapping[str, wire.Message]) -> None:
        self._store_values(messages)
        self.numbers, self._next_numbers = self._next_numbers, {}
        self._start_colouring()

    def _store_values(self, messages: Mapping[str, wire.Message]) -> None:
        """Store the neighbours' new values."""
        for name, message in messages.items():
            if not isinstance(message, Value):
                raise ValueError(f"{name} did not send its value in this step")  # noqa: TRY004 - as any bad message
            self.check_value(name, message.value)
            self.view[name] = message.value
