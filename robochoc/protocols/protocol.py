"""The interface of protocols: a state machine that receives and sends messages.

A host (see `communication/host.py`) drives it: it calls `start` once, then for each packet of waiting messages
`receive` for each message, and `settle` when the inbox has been drained. Sent messages collect in `outbox`, which the
host empties. A protocol never reads the time or draws random numbers by itself, and does not know whether it runs in a
simulator or on a robot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, MutableSequence
from typing import Any, ClassVar

from robochoc.model.message import Message, Value
from robochoc.model.outcome import Verdict
from robochoc.protocols.findings import NOTHING, Findings, Incumbent
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import NO_SETTINGS, Settings
from robochoc.protocols.traits import Traits
from robochoc.solver.compiled import LocalProblem
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
    """The defaults; the host puts what was asked for in their place before `start`."""
    chance: Callable[[], float]
    """Draws from [0, 1): the host's, seeded for each robot. There before `start`. No secret may depend on it."""
    secret: Callable[[int], int]
    """Draws a number of so many bits, for keys (`protocols/key_stream.py`). There before `start`."""
    numbered_values: ClassVar[bool] = False
    """True if the robots never receive others' values, only numbers of assignments; `view` contains these numbers."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self.problem = problem
        self.order = order
        self.outbox: list[tuple[str, Message]] = []
        """Receivers and messages."""
        self.said_at: list[int] = []
        """Of each message in the outbox: `problem.checks` when the robot sent it. The host computes the message's clock
        from it: the sender's clock at sending (Meisels et al. 2002), not at the end of its step."""
        self.value: int | None = None
        """The own value, as its place in the compiled domain; None: unassigned."""
        self.verdict: Verdict | None = None
        """Set when this robot alone can tell how the search ends, such as by deriving the empty nogood."""

    @abstractmethod
    def start(self) -> None:
        """Begin the search; called once, before any message."""

    @abstractmethod
    def receive(self, sender: str, message: Message) -> None:
        """Process one message."""

    def settle(self) -> None:  # noqa: B027 - optional
        """Decide on the whole view; called when the inbox has been drained."""

    def miss(self, sender: str) -> None:  # noqa: B027 - optional
        """Note that a message of `sender` is lost: the one that would have come before the next."""

    def go_on(self) -> bool:
        """Continue without the messages that this robot waits for: nothing more comes. Return False if it cannot.

        It must not return True for ever.
        """
        return False

    def send(self, receiver: str, message: Message) -> None:
        """Send `message` to `receiver`; its clock does not include later checks."""
        # A replay has a list of its own: as a list's, mypyc would not call its `append`.
        outbox: MutableSequence[tuple[str, Message]] = self.outbox
        outbox.append((receiver, message))
        self.said_at.append(self.problem.checks)

    def conclude(self, verdict: Verdict) -> None:
        """End the search of the whole team with `verdict`.

        Raises:
            ValueError: if `verdict` is not one of `traits.concludes`.
        """
        fault = self.traits.fault_of_conclusion(verdict)
        if fault:
            raise ValueError(fault)
        self.verdict = verdict

    @property
    def assignment(self) -> dict[str, int]:
        """The own variables' values as decided; empty while unassigned."""
        return {} if self.value is None else self.problem.solution(self.value)

    @property
    def incumbent(self) -> Incumbent | None:
        """The cheapest assignment of all robots that this robot knows or has found; None if there is none."""
        return None

    @property
    def findings(self) -> Findings:
        """This robot's knowledge of the whole search besides its own value. May be read at any time."""
        return NOTHING

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
