"""The interface of protocols: a state machine that receives and sends messages.

A host (see `communication/host.py`) drives it: it calls `start` once, then for each packet of waiting messages
`receive` for each message, and `settle` when the inbox has been drained. Sent messages collect in `outbox`, which the
host empties. A protocol never reads the time or draws random numbers by itself, and behaves the same in a simulator and
on a robot.
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
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class Protocol(ABC):
    """One robot's side of a protocol.

    Subclasses declare `messages`, the union of the message types that they receive, and their `traits`: properties and
    capabilities. The docstring of their module is shown by `robochoc protocols NAME`.
    """

    messages: ClassVar[Any]
    traits: ClassVar[Traits] = Traits()
    settings: ClassVar[Settings] = NO_SETTINGS
    """The defaults; the host replaces them by the given settings before `start`."""
    chance: Callable[[], float]
    """Draws from [0, 1), seeded for each robot; set by the host before `start`. Secrets must not depend on it."""
    secret: Callable[[int], int]
    """Draws a number of the given bits, for keys (`protocols/key_stream.py`); set by the host before `start`."""
    numbered_values: ClassVar[bool] = False
    """True if the robots never receive others' values, only numbers of assignments; `view` contains these numbers."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self.problem = problem
        self.order = order
        self.outbox: list[tuple[str, Message]] = []
        """Receivers and messages."""
        self.checks_at_send: list[int] = []
        """For each message in the outbox: `problem.checks` at the time of sending. The host computes the message's
        clock from it: the sender's clock at sending (Meisels et al. 2002), not at the end of its step."""
        self.value: int | None = None
        """This robot's value, as its place in `problem.values`; None: unassigned. Messages contain the value itself."""
        self.verdict: Verdict | None = None
        """Set when this robot alone can decide the result of the search, for example by deriving the empty nogood."""

    @abstractmethod
    def start(self) -> None:
        """Start the search; called once, before any message."""

    @abstractmethod
    def receive(self, sender: str, message: Message) -> None:
        """Process one message."""

    def settle(self) -> None:  # noqa: B027 - optional
        """Decide on the whole view; called when the inbox has been drained."""

    def miss(self, sender: str) -> None:  # noqa: B027 - optional
        """Record that a message of `sender` is lost; its next message follows the lost one."""

    def go_on(self) -> bool:
        """Continue without the awaited messages, as no more will arrive. Return False if that is impossible.

        It must return False after finitely many calls.
        """
        return False

    def send(self, receiver: str, message: Message) -> None:
        """Send `message` to `receiver`; its clock does not include later checks."""
        # A replay has its own kind of list: for a `list`, mypyc would not call its `append`.
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
        """This robot's knowledge of the whole search besides its own value. May be read at any time."""
        return NO_FINDINGS

    # Optional: what a replay shows of the state (`replay/inspection.py`), which finds agent views, nogood stores,
    # contexts and partial assignments by itself. None of these may check constraints or change the state.

    @property
    def checked_against(self) -> Mapping[str, Value] | None:
        """The values of others against which this robot's values are checked; None: all that it knows."""
        return None

    @property
    def kept_nogoods(self) -> Iterable[Mapping[str, Value]]:
        """The nogoods outside a `NogoodStore`: assignments that cannot all hold, this robot's included."""
        return ()

    def value_notes(self, index: int) -> Mapping[str, float]:  # noqa: ARG002 - used by overrides
        """Return this robot's notes on its value at `index`, by name: `{"LB": 3, "UB": 7}`."""
        return {}

    def tried(self, index: int) -> bool:  # noqa: ARG002 - used by overrides
        """Return whether the value at `index` has been tried without success for the current view."""
        return False
