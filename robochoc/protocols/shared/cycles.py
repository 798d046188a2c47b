"""The common base class of synchronous local search protocols.

All robots go through cycles, and each cycle has phases. In each phase, a robot sends one message to each robot that
waits for one. Then it waits for a message from each robot that it listens to, and continues when all these messages
have arrived. Messages are not numbered, because the messages from one robot arrive in the order of their phases. A
message from a neighbour that is ahead is stored until its phase.

If a message is lost, the next message from the same robot shows the gap; if no further message follows, a robot
continues once no more messages arrive. In both cases it executes the phase with the messages that it has. If a message
arrives after its phase, the robot only stores the new information. So the robots' phases stay synchronised, and the
search continues each time that no more messages arrive.

The course of the search does not depend on delays. No robot knows the total cost, so each robot records its values
(`Trail`), and the cheapest cycle is computed from the collected trails. With the setting `anytime` the robots find it
themselves (`anytime.py`).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import ClassVar, Literal, TypeVar

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.chance import one_of
from robochoc.protocols.disclosure import HasOnly, Proof, Reception, can_take
from robochoc.protocols.findings import Findings, Trail
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.anytime import Anytime, Best, Paid, Place, Step
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.compiling import mypyc_attr


class CycleCount(Settings, frozen=True):
    """`cycles`: the number of cycles after which all robots stop."""

    cycles: int = 100

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise ValueError(f"cycles is {self.cycles}; it must be 1 or more")


class CycleSettings(CycleCount, frozen=True):
    """`cycles`: the number of cycles after which all robots stop.

    `anytime`: true if the robots find the best cycle themselves, by messages, and end with their values in that cycle.
    """

    anytime: Literal["no", "yes"] = "no"


class Value(wire.Message, frozen=True):
    """The sender's value (`value`)."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} in this cycle"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The sender may change its value after the last cycle without another message.
        return [can_take(reception.sender, self.value)]


class Domain(wire.Message, frozen=True):
    """The sender's domain, sent first; later messages refer to indices in it."""

    values: list[wire.Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return words.domain(self.values)

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values))]


T = TypeVar("T")

Then = Callable[[Mapping[str, wire.Message]], None]
"""Called with one message from each robot passed to `listen`, in the order of these robots, without lost messages."""


@mypyc_attr(allow_interpreted_subclasses=True)
class CycleProtocol(Protocol):
    """One agent in a synchronous local search. Its state is the current `cycle`, and its value in this cycle.

    Subclasses choose a first value and send it in `start_cycles`; then they `choose` one value per cycle until the
    search is `finished`. They call `listen` with the robots whose messages they need, and a function that processes
    these messages. `messages` includes `AnytimeMessage`, unless `settings` has no `anytime`.
    """

    settings: ClassVar[CycleCount] = CycleSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.cycle = -1
        self._trail: list[tuple[int, int]] = []
        self._waiting: dict[str, list[wire.Message | None]] = {name: [] for name in problem.neighbours}
        """Each queue is short: a robot that is ahead soon waits for this one. None: a lost message."""
        self._given_up: dict[str, int] = {}
        """For each neighbour, the number of its messages that belong to phases already executed without them."""
        self._last_values: dict[str, wire.Value] = {}
        """The last values of the neighbours."""
        self._names: tuple[str, ...] = ()
        self._awaited: frozenset[str] = frozenset()
        self._missing = 0
        self._then: Then | None = None
        self._anytime: Anytime | None = None
        self._checked: dict[str, set[wire.Value]] = {name: set() for name in problem.neighbours}
        """The checked values of each neighbour: most values are sent repeatedly."""

    @abstractmethod
    def start_cycles(self) -> None:
        """Choose and send a first value. Called for robots that have at least one value and one neighbour."""

    def start(self) -> None:
        """Start. With an empty domain, end the search; without neighbours, choose the cheapest value."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.problem.neighbours:
            costs = self.problem.lexicographic_costs({})
            self.choose(costs.index(min(costs)))
            self.cycle = self.settings.cycles
        elif isinstance(self.settings, CycleSettings) and self.settings.anytime == "yes":
            self._anytime = Anytime(self.problem, self.order, self.settings.cycles)
            self._send_each(self._anytime.tree.start())
        else:
            self.start_cycles()
            self.settle()

    def receive(self, sender: str, message: wire.Message) -> None:
        """Store the message for its phase; process a message about the best cycle at once."""
        if isinstance(message, Place | Step | Paid | Best):
            self._receive_report(sender, message)
        elif self._given_up and self._was_given_up(sender, message):
            self.receive_late(sender, message)
        else:
            self._store(sender, message)

    def miss(self, sender: str) -> None:
        """Record that the message of a phase is lost."""
        if not self._was_given_up(sender):
            self._store(sender, None)

    def go_on(self) -> bool:
        """Execute the current phase without the missing messages."""
        if self._then is None or not self._missing or self.verdict is not None:
            return False
        for name in self._names:
            if not self._waiting[name]:
                self._given_up[name] = self._given_up.get(name, 0) + 1
                self._store(name, None)
        self.settle()
        return True

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Store the new information in a message that arrived after its phase."""
        if isinstance(message, Value):
            self.check_value(sender, message.value)
            self._last_values[sender] = message.value

    def _was_given_up(self, sender: str, message: wire.Message | None = None) -> bool:
        """Return whether the next message from `sender` belongs to a phase executed without it; if so, count it off."""
        many = self._given_up.pop(sender, 0)
        if many and message is not None and not self.may_be_late(message):
            return False  # the awaited messages were never sent
        if many > 1:
            self._given_up[sender] = many - 1
        return many > 0

    def may_be_late(self, message: wire.Message) -> bool:  # noqa: ARG002 - for messages that contain their phase
        """Return whether a message may belong to an earlier phase, after a message from its sender was given up."""
        return True

    def _store(self, sender: str, message: wire.Message | None) -> None:
        waiting = self._waiting[sender]
        if not waiting and sender in self._awaited:
            self._missing -= 1
        waiting.append(message)

    def settle(self) -> None:
        """Execute all phases whose messages have arrived."""
        while self._then and not self._missing and self.verdict is None and not self._is_ahead:
            arrived = self.next_messages()
            if arrived is None:
                return
            messages = {name: message for name, message in arrived if message is not None}
            then, self._then = self._then, None
            then(messages)

    def next_messages(self) -> list[tuple[str, wire.Message | None]] | None:
        """Remove and return the next message from each awaited robot; None if messages are still missing."""
        return [(name, self._waiting[name].pop(0)) for name in self._names]

    def listen(self, names: Sequence[str], then: Then) -> None:
        """Wait for a message from each robot in `names`, then call `then` with the messages that were not lost."""
        if names is not self._names:  # most phases use the same names
            self._names, self._awaited = tuple(names), frozenset(names)
        self._then = then
        self._missing = [self._waiting[name] for name in names].count([])

    def multicast(self, names: Iterable[str], message: wire.Message) -> None:
        """Send the same message to several robots."""
        sent = [(name, message) for name in names]
        self.outbox += sent
        self.checks_at_send += [self.problem.checks] * len(sent)

    def exchange_values(self, then: Then) -> None:
        """Send this robot's value to all neighbours, wait for their values, then call `then`."""
        self.multicast(self.problem.neighbours, Value(self.problem.values[self.present]))
        self.listen(self.problem.neighbours, then)

    def choose(self, index: int) -> None:
        """Set this robot's value for the next cycle; it may be the current value."""
        self.cycle += 1
        if index != self.value:
            self.value = index
            self._trail.append((self.cycle, index))
        if self._anytime:
            self._send_each(self._anytime.record(self.cycle, index))
            self._choose_best()

    def finish(self) -> None:
        """End the search before its last cycle; all connected robots do so in the same cycle."""
        if self._anytime:
            self._anytime.last = self.cycle
            self._choose_best()
        self.cycle = self.settings.cycles

    def checked_values(self, messages: Mapping[str, wire.Message]) -> dict[str, wire.Value]:
        """Return the values in the messages from a phase in which every robot sends a `Value`.

        For a lost message, the sender's last known value is used, if there is one.

        Raises:
            ValueError: if a message has another type, or a value is not in the sender's domain.
        """
        values: dict[str, wire.Value] = {}
        known = self._checked
        for name, message in messages.items():
            if not isinstance(message, Value):
                raise ValueError(f"{name} did not send its value in this phase")  # noqa: TRY004 - as any
            value = values[name] = message.value
            if value not in known[name]:
                self.check_value(name, value)
        if len(values) < len(self._names):
            values = {name: values.get(name, self._last_values.get(name, ())) for name in self._names}
            values = {name: value for name, value in values.items() if value}
        self._last_values = values
        return values

    def checked_domains(self, messages: Mapping[str, wire.Message]) -> dict[str, list[wire.Value]]:
        """Return the domains in the messages from a phase in which every robot sends a `Domain`.

        Raises:
            ValueError: if a message has another type, or a value is not in the sender's domain.
        """
        domains = {name: message.values for name, message in messages.items() if isinstance(message, Domain)}
        for name in messages:
            if name not in domains:
                raise ValueError(f"{name} did not send its domain in this phase")
            for value in domains[name]:
                self.problem.refuse_value(name, value)
        return domains

    def check_value(self, name: str, value: wire.Value) -> None:
        """Raise `ValueError` if `value` is not in the domain of the robot called `name`."""
        self.problem.refuse_value(name, value)
        self._checked[name].add(value)

    def any_value(self) -> int:
        """Return the first value of the search: the start value if it is known, else a random value."""
        start = self.problem.start
        return self.any_of(range(len(self.problem.values))) if start is None else start

    def any_of(self, choices: Sequence[T]) -> T:
        """Return a random element of `choices`; if there is only one, draw no random number."""
        return one_of(self.chance, choices)

    @property
    def present(self) -> int:
        """This robot's current value; available after `start_cycles`."""
        assert self.value is not None  # noqa: S101 - for mypy: `start_cycles` chooses one
        return self.value

    @property
    def finished(self) -> bool:
        """True if this was the last cycle."""
        return self.cycle >= self.settings.cycles

    def _receive_report(self, sender: str, message: Place | Step | Paid | Best) -> None:
        """Process a message about the best cycle; start the search once the tree is complete."""
        if self.verdict is not None:
            return
        if self._anytime is None:
            raise ValueError(f"{sender} looks for the best cycle, this robot does not: use --set anytime=yes for all")
        self._send_each(self._anytime.receive(sender, message))
        if self.cycle < 0 and self._then is None and self._anytime.tree.height is not None:
            self.start_cycles()
        self._choose_best()

    def _choose_best(self) -> None:
        """Choose this robot's value in the best cycle, once the costs of all cycles are known."""
        anytime = self._anytime
        if anytime and anytime.news == anytime.last and anytime.best is not None:
            self.value = anytime.best

    def _send_each(self, sent: Iterable[tuple[str, wire.Message]]) -> None:
        for name, message in sent:
            self.send(name, message)

    @property
    def _is_ahead(self) -> bool:
        return self._anytime is not None and self._anytime.is_ahead(self.cycle)

    @property
    def findings(self) -> Findings:
        """This robot's value in every cycle."""
        return Findings(trail=Trail(list(self._trail), self.cycle))


NO_GAIN: LexicographicCost = (0, 0)


def gain(before: LexicographicCost, after: LexicographicCost) -> LexicographicCost:
    """Return the reduction from `before` to `after`: a pair of differences, which compare lexicographically."""
    return before[0] - after[0], before[1] - after[1]
