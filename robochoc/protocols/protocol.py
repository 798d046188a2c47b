"""What every protocol is: a state machine that is told messages and says messages.

A host (see `communication/host.py`) drives it: `start` once, then for each packet of waiting messages `receive`
one by one and `settle` when the inbox has been drained. What it says collects in `outbox`, which the host
empties. A protocol never asks the time, draws a lot, or knows whether it runs in a simulator or on a robot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import msgspec

from robochoc.model.message import Message
from robochoc.model.outcome import Verdict
from robochoc.protocols.findings import NOTHING, Best, Findings
from robochoc.protocols.inspectable import Inspectable
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import Traits
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.explanation import Invalidated


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What can be set of a protocol (`--set NAME=VALUE`): fields of simple types, each with its default.

    A subclass's docstring says what they mean; `robochoc protocols NAME` shows it. `__post_init__` raises
    `ValueError` where a value will not do.
    """


NO_SETTINGS = Settings()


class Said(tuple[str, Message]):  # noqa: SLOT001 - no subclass of tuple can have slots with anything in them
    """The receiver and the message, of what was said.

    `checks` is how many constraint checks the speaker had done by then: from it the host makes the clock that the
    message carries, which is the speaker's when it says it (Meisels et al. 2002), not when its step is over.
    """

    checks: int = 0


class Protocol(Inspectable, ABC):
    """One robot's side of a protocol.

    Subclasses declare `messages`, the union of the message types that they receive, and their `traits`: what they
    are and what they can take. Their module's docstring is what `robochoc protocols NAME` shows.
    """

    messages: ClassVar[Any]
    traits: ClassVar[Traits] = Traits()
    settings: Settings = NO_SETTINGS
    """The defaults; the host puts what was asked for in their place before `start`."""
    chance: Callable[[], float]
    """Draws from [0, 1): the host's, seeded for each robot. There before `start`."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self.problem = problem
        self.order = order
        self.outbox: list[tuple[str, Message]] = []
        """Receivers and messages, each pair as a `Said`."""
        self.value: int | None = None
        """The own value, as its place in the compiled domain; None: unassigned."""
        self.verdict: Verdict | None = None
        """Set when this robot alone can tell how the search ends, such as by deriving the empty nogood."""

    @abstractmethod
    def start(self) -> None:
        """The search begins; called once, before any message."""

    @abstractmethod
    def receive(self, sender: str, message: Message) -> None:
        """Take in one message."""

    def settle(self) -> None:
        """The inbox has been drained: the time to look at the whole view and to decide."""

    def send(self, receiver: str, message: Message) -> None:
        """Say `message` to `receiver`; checks that are done later are not on its clock."""
        said = Said((receiver, message))
        said.checks = self.problem.checks
        self.outbox.append(said)

    def conclude(self, verdict: Verdict) -> None:
        """End the search of the whole team with `verdict`, one of those in `traits.concludes`; else `ValueError`."""
        fault = self.traits.fault_of_conclusion(verdict)
        if fault:
            raise ValueError(fault)
        self.verdict = verdict

    @property
    def assignment(self) -> dict[str, int]:
        """The own variables' values as decided; empty while unassigned."""
        return {} if self.value is None else self.problem.solution(self.value)

    @property
    def heard(self) -> Best | None:
        """The cheapest assignment of all robots that this one has heard of, or has found; None: of none so far."""
        return None

    @property
    def findings(self) -> Findings:
        """What this robot knows of the whole besides its own value. May be asked at any time."""
        return NOTHING


class DynamicProtocol(Protocol):
    """A protocol that goes on when the problem changes, with what still stands of what it has found out.

    Between two epochs the host calls `change`, and once all robots have changed, `resume`. Other protocols are begun
    anew on the changed problem.
    """

    @abstractmethod
    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        """Take in the changed problem, and drop what rests on anything `invalidated`. No robot searches: send nothing.

        A verdict that stands in spite of the changes is kept, and ends the epoch at once.
        """

    @abstractmethod
    def resume(self, *, lossless: bool) -> None:
        """Go on with the search; before any message. `quiet`: no message of the epoch before was lost."""
