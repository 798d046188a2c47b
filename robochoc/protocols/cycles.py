"""Synchronous local search: what its protocols have in common.

All robots go through cycles, and a cycle through phases. In each phase a robot says one message to those who wait for
one, then waits for one of each of those that it listens to itself, and goes on when it has them all. So messages need
no number: from one robot to another they arrive in the order of their phases. One that comes before its phase, from a
neighbour that is ahead, is kept until then.

Whatever the delays, the course of the search is the same. Nobody sees how good it is as a whole, so each robot keeps
the values that it has had (`Trail`), and whoever collects them finds the cheapest cycle.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

from robochoc.model import message as wire
from robochoc.model.outcome import Verdict
from robochoc.model.wording import Wording
from robochoc.protocols import acts
from robochoc.protocols.findings import Findings, Trail
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol, Settings
from robochoc.solver.compiled import LexicographicCost, LocalProblem

T = TypeVar("T")

Then = Callable[[Mapping[str, wire.Message]], None]
"""What to do with one message of each robot that was listened to, in the order of their names as they were given."""


class Value(wire.Message, frozen=True):
    """The sender's value (`value`)."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} in this cycle"


class Domain(wire.Message, frozen=True):
    """All values that the sender may take, the first thing it says; later messages name their places in it."""

    values: list[wire.Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.domain(self.values)


class CycleSettings(Settings, frozen=True):
    """`cycles`: after so many of them all robots stop."""

    cycles: int = 100

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise ValueError(f"cycles is {self.cycles}; it must be 1 or more")


class CycleProtocol(Protocol):
    """One agent of a synchronous local search. State: `cycle`, and the own value in it.

    Subclasses take a first value and speak in `begin`; then they `take` one value a cycle until the search is `over`.
    It is up to them whom they `listen` to, and what they do then.
    """

    settings: CycleSettings = CycleSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.cycle = -1
        self._trail: list[tuple[int, int]] = []
        self._waiting: dict[str, deque[wire.Message]] = {name: deque() for name in problem.neighbours}
        self._awaited: Sequence[str] = ()
        self._missing = 0
        self._then: Then | None = None

    @abstractmethod
    def begin(self) -> None:
        """The search begins, for a robot that has values and neighbours."""

    def start(self) -> None:
        """Who has no value at all ends the search; who has no neighbours takes its cheapest and is done."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.problem.neighbours:
            burdens = self.problem.lexicographic_costs({})
            self.take(burdens.index(min(burdens)))
            self.cycle = self.settings.cycles
        else:
            self.begin()
            self.settle()

    def receive(self, sender: str, message: wire.Message) -> None:
        """Keep the message for its phase."""
        waiting = self._waiting[sender]
        if not waiting and sender in self._awaited:
            self._missing -= 1
        waiting.append(message)

    def settle(self) -> None:
        """Go on as far as all that is waited for has come."""
        while self._then and not self._missing and self.verdict is None:
            heard = {name: self._waiting[name].popleft() for name in self._awaited}
            then, self._then = self._then, None
            then(heard)

    def listen(self, names: Sequence[str], then: Then) -> None:
        """Wait for a message of each robot in `names`, and `then` go on with them."""
        self._awaited, self._then = names, then
        self._missing = sum(not self._waiting[name] for name in names)

    def tell(self, names: Iterable[str], message: wire.Message) -> None:
        """Say the same to several robots."""
        for name in names:
            self.send(name, message)

    def tell_value(self, then: Then) -> None:
        """Say the own value to all neighbours, and `then` go on with theirs."""
        self.tell(self.problem.neighbours, Value(self.problem.values[self.present]))
        self.listen(self.problem.neighbours, then)

    def take(self, index: int) -> None:
        """The own value of the next cycle, which may be the present one."""
        self.cycle += 1
        if index != self.value:
            self.value = index
            self._trail.append((self.cycle, index))

    def any_value(self) -> int:
        """A value drawn from the whole domain: where local search begins."""
        return self.any_of(range(len(self.problem.values)))

    def any_of(self, choices: Sequence[T]) -> T:
        """One of several that are equally good; no lot is drawn where there is but one."""
        return choices[0] if len(choices) == 1 else choices[int(self.chance() * len(choices))]

    @property
    def present(self) -> int:
        """The own value, once there is one."""
        assert self.value is not None  # noqa: S101 - for mypy: `begin` takes one
        return self.value

    @property
    def over(self) -> bool:
        """Whether this was the last cycle."""
        return self.cycle >= self.settings.cycles

    @property
    def findings(self) -> Findings:
        """All own values, cycle by cycle."""
        return Findings(trail=Trail(list(self._trail), self.cycle))


NO_GAIN: LexicographicCost = (0, 0)


def gain(before: LexicographicCost, after: LexicographicCost) -> LexicographicCost:
    """By how much `after` is less. Pairs of differences compare like what they are differences of."""
    return before[0] - after[0], before[1] - after[1]


def said(heard: Mapping[str, wire.Message]) -> dict[str, wire.Value]:
    """What all have said in a phase in which everybody says a `Value`."""
    return {name: message.value for name, message in heard.items() if isinstance(message, Value)}
