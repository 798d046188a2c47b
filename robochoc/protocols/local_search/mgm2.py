"""Coordinated Maximum Gain Message (MGM-2).

MGM in which two neighbours may also move together. In each cycle a robot is an offerer with probability `threshold`
(the paper's q). An offerer sends one random neighbour an offer: its gain for each pair of their values. The receiver
adds its gain on constraints that do not include the offerer, so shared constraints count once. The receiver accepts the
best offer if its total gain is positive; then both robots are committed to the joint move. As in MGM, the robot with
the largest gain among its neighbours moves. A committed pair moves if both have the largest gain, each among its
neighbours without the partner.

- **When to use**: like MGM, if better results are worth more messages.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises from
  one cycle to the next (anytime). A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `threshold` (q; default 0.5), `cycles` (default 100).
- **References**: Maheswaran, Pearce, Tambe: "Distributed algorithms for DCOP: a graphical-game-based approach", PDCS
  2004, Section 3 (SCA-2 and MGM-2); Pearce, "Local optimization in cooperative agent networks", PhD thesis, 2007.

The phases of a cycle:

    value messages                              `exchange_values`, `_offer`
    offers (offerers), to one neighbour each    `_offer`, `_answer`
    accept, reject                              `_answer`, `_receive_answer`
    gain messages                               `_send_gain`, `_decide`
    go, no go (of committed robots)             `_decide`, `_receive_go`

Choices that the paper leaves open, and differences:

- An offer contains all pairs of values, including pairs with which the offerer alone does not gain. Without these, as
  in the paper, some moves that save the team costs are missed. With them, a team in which no robot or pair can gain is
  at a 2-optimum.
- A robot that is not an offerer, or has no offer for a neighbour, sends an empty offer, because its neighbours wait for
  all offers.
- First values, equally good values and equal gains are treated as in `mgm`. Constraints may be n-ary.
- If a value is lost, the neighbour's last known value is used. A neighbour whose domain or value is unknown receives no
  offer; a lost answer counts as a rejection; a robot that misses a gain, or its partner's `Go`, stays. If only one
  robot in a pair moves, the cost may rise. In this case the message types distinguish the phases, because answers and
  `Go` are sent to some neighbours only.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), MGM2, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Accept': 6, 'Domain': 56, 'Gain': 5600, 'Go': 12, 'Offer': 5600, 'Reject': 446, 'Value': 5600}
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import INFINITE, NOTHING, Pays, Proof, Reception
from robochoc.protocols.local_search.mgm import Gain, Gainers, saving_in_words
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, CycleSettings, Domain, Then, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted


class MGM2Settings(CycleSettings, frozen=True):
    """`threshold` (q): the probability of being an offerer. `cycles`: the number of cycles."""

    threshold: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.threshold <= 1:
            raise ValueError(f"threshold is {self.threshold:g}; it must be from 0 to 1")


Gains = list[list[tuple[int, int | float]]]


class Offer(wire.Message, frozen=True):
    """An offer of a joint move: a row for each of the receiver's values, with a gain for each of the sender's values.

    A gain is a pair: broken hard constraints, and costs. None: no offer (`offer`).
    """

    gains: Gains | None

    act = Act(Performative.PROPOSE, "the gains of both robots' joint moves")

    def in_words(self, _: Wording) -> str:
        if self.gains is None:
            return "I have no offer for you"
        best = max(saving for row in self.gains for saving in row)
        many = f"{counted(len(self.gains), 'value')} of yours and {len(self.gains[0]):,} of mine"
        if best <= (0, 0):
            return f"let us move together: of {many}, no two would save me anything"
        return f"let us move together: of {many}, the best two would save me {saving_in_words(*best)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the costs of pairs of values above the cheapest pair, if they involve no other robot's value."""
        own = reception.last(Domain, reception.receiver, reception.sender)
        theirs = reception.last(Domain, reception.sender, reception.receiver)
        if own is None or theirs is None or not self.gains or not reception.is_only_neighbour():
            return NOTHING
        most_broken = max(broken for row in self.gains for broken, _ in row)
        most = max(cost for row in self.gains for _, cost in row)
        return [
            Pays(
                reception.sender,
                value,
                {reception.receiver: received},
                INFINITE if broken < most_broken else most - cost,
                INFINITE,
            )
            for received, row in zip(own.values, self.gains, strict=True)
            for value, (broken, cost) in zip(theirs.values, row, strict=True)
        ]


class Accept(wire.Message, frozen=True):
    """The acceptance of an offer: the receiver's value at index `place`, and the total gain (`accept`)."""

    place: int
    broken: int
    cost: int | float

    act = acts.ACCEPT
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        saved = saving_in_words(self.broken, self.cost)
        return f"I take your offer: you take your value number {self.place + 1}, and we save {saved} in all"


class Reject(wire.Message, frozen=True):
    """The rejection of an offer (`reject`)."""

    act = Act(Performative.REJECT_PROPOSAL, "the proposed offer is rejected")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "I do not take your offer"


class Go(wire.Message, frozen=True):
    """A committed robot's decision on the joint move: whether its gain is the largest among its neighbours.

    The paper's messages are `go` and `no go`.
    """

    go: bool

    act = Act(Performative.INFORM, "the receiver learns whether the sender's gain is the largest")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        if self.go:
            return "go: of my neighbours, nobody is to move before us"
        return "no go: one of my neighbours is to move instead"


_DOMAINS, _VALUES, _OFFERS, _ANSWERS, _GAINS, _GO = range(-1, 5)
"""The phases: the first occurs once, the others in each cycle."""
_PHASES = 5
"""The phases of a cycle."""
_MOST_AHEAD = 2
"""The maximum number of phases that a neighbour can be ahead, since it waits for this robot in three of five phases."""


def _phase_of(message: wire.Message) -> int:
    """Return the phase of a message; for messages about the best cycle, the phase of values."""
    match message:
        case Domain():
            return _DOMAINS
        case Offer():
            return _OFFERS
        case Accept() | Reject():
            return _ANSWERS
        case Gain():
            return _GAINS
        case Go():
            return _GO
        case _:
            return _VALUES


class JointMove(NamedTuple):
    """A joint move: its gain, the partner, and the indices of both values."""

    gain: LexicographicCost
    partner: str
    own: int
    place: int


def offered_gains(
    problem: LocalProblem, present: int, view: Mapping[str, wire.Value], partner: str, domain: Sequence[wire.Value]
) -> Gains:
    """Return the gain for each of the partner's values and each of this robot's values."""
    rows = [problem.lexicographic_costs({**view, partner: value}) for value in domain]
    now = rows[domain.index(view[partner])][present]
    return [[gain(now, cost) for cost in row] for row in rows]


def joint_moves(
    problem: LocalProblem, present: int, view: Mapping[str, wire.Value], offerer: str, gains: Gains
) -> Iterator[JointMove]:
    """Yield all offered moves with the total gain of both robots.

    The total gain is the offerer's gain plus this robot's gain on constraints that do not include the offerer.
    """
    costs = problem.lexicographic_costs({name: value for name, value in view.items() if name != offerer})
    now = costs[present]
    for own, (own_cost, row) in enumerate(zip(costs, gains, strict=True)):
        broken, cost = gain(now, own_cost)
        for place, offered in enumerate(row):
            yield JointMove((broken + offered[0], cost + offered[1]), offerer, own, place)


@mypyc_attr(allow_interpreted_subclasses=True)
class MGM2(Gainers):
    """One agent of MGM-2. State: neighbours' `domains`, the `view`, and the `partner` that it is committed to."""

    messages: ClassVar[Any] = Domain | Value | Offer | Accept | Reject | Gain | Go | AnytimeMessage
    settings: ClassVar[MGM2Settings] = MGM2Settings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Maheswaran, Pearce, Tambe 2004",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        arrays=True,
        bears_loss=True,
        cost_never_rises=True,
        privacy="constraints among others",
        use_when="as MGM: better answers, more messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.domains: dict[str, list[wire.Value]] = {}
        self.view: dict[str, wire.Value] = {}
        self.partner: str | None = None
        self._wins = False
        self._phase = _DOMAINS

    def start_cycles(self) -> None:
        """Choose a random value and send the domain."""
        self.choose(self.any_value())
        self.multicast(self.problem.neighbours, Domain(list(self.problem.values)))
        self.listen_for(_DOMAINS, self.problem.neighbours, self._start_first_cycle)

    def _start_first_cycle(self, messages: Mapping[str, wire.Message]) -> None:
        """Start the first cycle, once all neighbours' domains are known."""
        self.domains = self.checked_domains(messages)
        self._send_value()

    def _send_value(self) -> None:
        self.multicast(self.problem.neighbours, Value(self.problem.values[self.present]))
        self.listen_for(_VALUES, self.problem.neighbours, self._offer)

    def _offer(self, messages: Mapping[str, wire.Message]) -> None:
        """Become an offerer with the given probability, once all neighbours' values are known."""
        self.view = self.checked_values(messages)
        self.partner = None
        if self.chance() < self.settings.threshold:
            neighbours = self.problem.neighbours
            partner = neighbours[int(self.chance() * len(neighbours))]
            if partner in self.domains and partner in self.view:
                self.partner = partner
        for name in self.problem.neighbours:
            self.send(name, Offer(self._gains(name) if name == self.partner else None))
        self.listen_for(_OFFERS, self.problem.neighbours, self._answer)

    def _gains(self, partner: str) -> Gains:
        """Return the gain for each of the partner's values and each of this robot's values."""
        return offered_gains(self.problem, self.present, self.view, partner, self.domains[partner])

    def _answer(self, messages: Mapping[str, wire.Message]) -> None:
        """Answer all offers: an offerer rejects them; other robots accept the best offer if its gain is positive."""
        offers = {name: offer.gains for name, offer in messages.items() if isinstance(offer, Offer) and offer.gains}
        if self.partner is not None:
            self.multicast(offers, Reject())
            self.listen_for(_ANSWERS, (self.partner,), self._receive_answer)
        else:
            self.partner = self._commit(offers)
            self.multicast([name for name in offers if name != self.partner], Reject())
            self._send_gain()

    def _commit(self, offers: Mapping[str, Gains]) -> str | None:
        """Accept the best offer if its total gain is positive; return its sender."""
        problem, present, view = self.problem, self.present, self.view
        moves = [move for name, gains in offers.items() for move in joint_moves(problem, present, view, name, gains)]
        self.gain = max((move.gain for move in moves), default=NO_GAIN)
        if self.gain <= NO_GAIN:
            return None
        move = self.any_of([move for move in moves if move.gain == self.gain])
        self.target = move.own
        self.send(move.partner, Accept(move.place, *move.gain))
        return move.partner

    def _receive_answer(self, messages: Mapping[str, wire.Message]) -> None:
        """Commit to the partner if it accepted the offer; otherwise use this robot's best move alone."""
        answer = next(iter(messages.values()), None)
        if isinstance(answer, Accept):
            self.target, self.gain = answer.place, (answer.broken, answer.cost)
        else:
            self.partner = None
        self._send_gain()

    def _send_gain(self) -> None:
        if self.partner is None:
            self.best_unilateral(self.view)
        self.multicast(self.problem.neighbours, Gain(*self.gain))
        self.listen_for(_GAINS, self.problem.neighbours, self._decide)

    def _decide(self, messages: Mapping[str, wire.Message]) -> None:
        """Move alone, or send the partner `Go`, once all neighbours' gains are known."""
        complete = len(messages) == len(self.problem.neighbours)
        wins = complete and self.wins({name: message for name, message in messages.items() if name != self.partner})
        if self.partner is None:
            self._end_cycle(move=wins)
        else:
            self.send(self.partner, Go(wins))
            self._wins = wins
            self.listen_for(_GO, (self.partner,), self._receive_go)

    def _receive_go(self, messages: Mapping[str, wire.Message]) -> None:
        """Make the joint move if both robots allow it."""
        answer = next(iter(messages.values()), None)
        self._end_cycle(move=self._wins and isinstance(answer, Go) and answer.go)

    def _end_cycle(self, *, move: bool) -> None:
        self.choose(self.target if move else self.present)
        if not self.finished:
            self._send_value()

    # Phases when messages are lost

    def listen_for(self, phase: int, names: Sequence[str], then: Then) -> None:
        """Listen for messages of a phase from the robots in `names`."""
        self._phase = phase
        self.listen(names, then)

    def may_be_late(self, message: wire.Message) -> bool:
        """Return whether the message's phase is over."""
        phase = _phase_of(message)
        if phase == _DOMAINS:
            return self._phase != _DOMAINS
        return self._phase != _DOMAINS and (phase - self._phase) % _PHASES > _MOST_AHEAD

    def next_messages(self) -> list[tuple[str, wire.Message | None]] | None:
        """Remove and return the next messages of this phase; messages of later phases stay stored."""
        waiting = [self._waiting[name] for name in self._names]
        for name, queue in zip(self._names, waiting, strict=True):
            while queue and (first := queue[0]) is not None and self.may_be_late(first):
                self.receive_late(name, first)
                del queue[0]
        self._missing = waiting.count([])
        if self._missing:
            return None
        return [
            (name, queue.pop(0) if queue[0] is None or _phase_of(queue[0]) == self._phase else None)
            for name, queue in zip(self._names, waiting, strict=True)
        ]

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Store the new information in a message whose phase is over."""
        super().receive_late(sender, message)
        if isinstance(message, Domain):
            self.domains.update(self.checked_domains({sender: message}))
