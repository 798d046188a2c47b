"""The interface of protocols: a state machine that receives and sends messages.

A host (see `communication/host.py`) drives the protocol: it calls `start` once; then, for each packet of waiting
messages, it calls `receive` for each message, and `settle` when the inbox has been drained. Sent messages are collected
in `outbox`, which the host empties. A protocol never reads the time or draws random numbers by itself, and behaves the
same in a simulator and on a robot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, MutableSequence
from typing import Any, ClassVar

from robochoc.model.outcome import Verdict
from robochoc.protocols.findings import NO_FINDINGS, Findings, Incumbent
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import NO_SETTINGS, Settings
from robochoc.protocols.traits import Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr, separate_subclass_cache


@mypyc_attr(allow_interpreted_subclasses=True)
class Protocol(ABC):
    """The part of a protocol that runs on one robot.

    Subclasses declare `messages`, the union of the message types that they receive, and `traits`, their properties and
    capabilities. `robochoc protocols NAME` shows the docstring of their module.
    """

    messages: ClassVar[Any]
    traits: ClassVar[Traits] = Traits()
    settings: ClassVar[Settings] = NO_SETTINGS
    """The default settings; the host replaces them by the given settings before `start`."""
    chance: Callable[[], float]
    """Draws a number from [0, 1), seeded for each robot; set by the host before `start`. Secrets must not depend on it.
    """
    secret: Callable[[int], int]
    """Draws a number of the given bit length, for keys (`protocols/key_stream.py`); set by the host before `start`."""
    numbered_values: ClassVar[bool] = False
    """True if robots never receive the values of other robots, only indices of assignments; `view` contains these."""

    def __init_subclass__(cls, **options: Any) -> None:  # noqa: ANN401 - of any class
        super().__init_subclass__(**options)
        separate_subclass_cache(cls)

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self.problem = problem
        self.order = order
        self.outbox: list[tuple[str, Message]] = []
        """The receivers and messages that wait to be sent."""
        self.checks_at_send: list[int] = []
        """For each message in the outbox: `problem.checks` at the time of sending. The host computes the message's
        clock from it: the sender's clock at sending (Meisels et al. 2002), not at the end of its step."""
        self.value: int | None = None
        """This robot's value, as its index in `problem.values`; None: unassigned. Messages contain the value itself."""
        self.verdict: Verdict | None = None
        """Set when this robot alone can decide the result of the search, for example by deriving the empty nogood."""

    @abstractmethod
    def start(self) -> None:
        """Start the search; called once, before any message is received."""

    @abstractmethod
    def receive(self, sender: str, message: Message) -> None:
        """Process one message."""

    def settle(self) -> None:  # noqa: B027 - optional
        """Decide, based on the whole view; called when the inbox has been drained."""

    def miss(self, sender: str) -> None:  # noqa: B027 - optional
        """Record that a message from `sender` was lost; the next message from `sender` follows the lost one."""

    def go_on(self) -> bool:
        """Continue without the awaited messages, because none will arrive. Return False if that is impossible.

        After finitely many calls, the method must return False.
        """
        return False

    def send(self, receiver: str, message: Message) -> None:
        """Send `message` to `receiver`; the clock of the message does not include later checks."""
        # A replay uses its own kind of list: on a `list`, mypyc would bypass an overridden `append`.
        outbox: MutableSequence[tuple[str, Message]] = self.outbox
        outbox.append((receiver, message))
        self.checks_at_send.append(self.problem.checks)

    def conclude(self, verdict: Verdict) -> None:
        """End the search of the whole team with `verdict`.

        Raises:
            ValueError: if `verdict` is not one of `traits.concludes`.
        """
        fault = self.traits.conclusion_error(verdict)
        if fault:
            raise ValueError(fault)
        self.verdict = verdict

    @property
    def assignment(self) -> dict[str, int]:
        """The decided values of this robot's variables; empty while unassigned."""
        return {} if self.value is None else self.problem.solution(self.value)

    @property
    def incumbent(self) -> Incumbent | None:
        """The cheapest assignment of all robots that this robot knows or has found; None if there is none."""
        return None

    @property
    def findings(self) -> Findings:
        """This robot's knowledge about the whole search, except its own value. It may be read at any time."""
        return NO_FINDINGS

    @property
    def most_above_bound(self) -> float | None:
        """At the end of the search, the maximum by which the cost of the robots' values exceeds `findings.bound`.

        If several robots report bounds, bounds and excesses are summed. None: the protocol guarantees nothing, or this
        robot reports no bound.
        """
        return None

    # Optional: the state that a replay shows (`replay/inspection.py`). The replay finds agent views, nogood stores,
    # contexts and partial assignments by itself. None of these methods may check constraints or change the state.

    @property
    def checked_against(self) -> Mapping[str, Value] | None:
        """The other robots' values against which this robot's values are checked; None: all values that it knows."""
        return None

    @property
    def kept_nogoods(self) -> Iterable[Mapping[str, Value]]:
        """The nogoods outside a `NogoodStore`: assignments, including this robot's, that cannot all hold."""
        return ()

    def value_notes(self, index: int) -> Mapping[str, float]:  # noqa: ARG002 - used by overrides
        """Return this robot's notes on its value at `index`, by name: `{"LB": 3, "UB": 7}`."""
        return {}

    def tried(self, index: int) -> bool:  # noqa: ARG002 - used by overrides
        """Return whether the value at `index` has been tried without success for the current view."""
        return False
