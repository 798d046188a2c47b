"""The control messages between the master and robots across machines. Frames (`framing.py`) carry them.

The master is the paper's: it registers robots, waits until all are present, orders the start, detects quiescence, and
stops all (Figure 3). It knows only the profiles of robots' files. Protocol messages (`ProtocolMessage`) go from robot
to robot, and never to the master. Messages shared with the runtime of processes are in `communication/control.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import msgspec

from robochoc.communication.control import (
    Conclusion,
    Counters,
    CounterWave,
    EpochMessage,
    EpochReport,
    Events,
    GoOn,
    Pause,
    Ready,
    RobotFailed,
    RobotSnapshot,
    TakeSnapshot,
    WentOn,
)
from robochoc.communication.network.profile import Profile, Ranges
from robochoc.protocols.message import Value
from robochoc.solver.encoding import Cost

LATEST = 2**53
"""The largest clock of constraint checks. A robot reports its clock, which must not overflow another robot's."""


class _Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


# From a robot to the master


class Register(_Message, frozen=True):
    """Registers the robot of `profile`.

    `incarnation` names this process of the robot: a restarted robot has another one.
    """

    profile: Profile
    incarnation: str


class Joined(_Message, frozen=True):
    """Confirms the welcome of an incarnation; sent for each welcome, as an answer may get lost.

    `card` contains the robot's keys of this run (`KeyCard`; empty: no filter needs keys).
    """

    incarnation: str
    card: bytes


class DomainAnswer(_Message, frozen=True):
    """The domains that the master has requested."""

    variables: dict[str, Ranges]


class Exchanged(NamedTuple):
    """Protocol messages with one other robot: `sent` to it, `received` from it, and the latest `clock` of these."""

    sent: int = 0
    received: int = 0
    clock: int = 0


class DetailedReport(EpochReport, frozen=True):
    """A report with data for its check by the master. In private runs `assignment` and findings are empty.

    `assigned`: the robot has values. `exchanged` counts the messages with each other robot, so that the master can
    compare the reports of two robots.
    """

    assigned: bool
    exchanged: dict[str, Exchanged] = msgspec.field(default_factory=dict)


class Charge(NamedTuple):
    """The total cost of the totally known constraints of `holder` over the same `variables`."""

    holder: str
    variables: tuple[str, ...]
    constraints: int
    price: int | float


class CheckResult(EpochMessage, frozen=True):
    """The cost of the robot's constraints for the decided values. `allowed`: none is violated.

    `held` is their number. `shared` are those of them that others may also know; `copies` are constraints of others
    that the robot knows. `snapshot` is the number of the checked snapshot; 0: the final reports.
    """

    allowed: bool
    cost: int | float
    held: int = 0
    shared: tuple[Charge, ...] = ()
    copies: tuple[Charge, ...] = ()
    snapshot: int = 0


class Objection(_Message, frozen=True):
    """A report that the robot has refused `what` from `who`."""

    who: str
    what: str
    why: str


class LostFrames(_Message, frozen=True):
    """A report that this number of `frames` from `who` to the robot are lost for good."""

    who: str
    frames: Annotated[int, msgspec.Meta(ge=1, le=2**53)]


class DirectoryRequest(_Message, frozen=True):
    """A request to the Directory Facilitator, in SL0. Answers have the same `number`.

    `subscribe`: answer now, and whenever the result of this search changes.
    """

    number: int
    content: str
    subscribe: bool = False


class JournalRequest(_Message, frozen=True):
    """A request for the journal of the run. The answer has the same `number`."""

    number: int


class Bye(_Message, frozen=True):
    """Confirms that the run is over."""


# From the master to a robot


class Welcome(_Message, frozen=True):
    """Confirms the registration of an incarnation for the run `run`, whose messages go through `filters`."""

    incarnation: str
    run: str
    filters: tuple[str, ...]
    observed: bool
    private: bool


class RegistrationDenied(_Message, frozen=True):
    """Refuses a registration."""

    incarnation: str
    why: str


class DomainRequest(_Message, frozen=True):
    """Requests the domains of variables that occur in parts of partially known constraints."""

    variables: tuple[str, ...]


class SearchTask(EpochMessage, frozen=True, tag="Task"):
    """A search: the robots' common knowledge (see `solver/agent_problem.py`), the protocol, and its parameters."""

    protocol: str
    order: tuple[str, ...]
    interfaces: Mapping[str, tuple[str, ...]]
    domains: Mapping[str, Ranges]
    links: Mapping[str, tuple[str, ...]] | None
    secretive: tuple[str, ...]
    seed: int
    settings: Mapping[str, str]
    aside: Cost | None
    cards: tuple[bytes, ...]
    message_loss: float = 0.0


class StartSearch(EpochMessage, frozen=True):
    """The order to start, as all robots are ready."""


class Recall(EpochMessage, frozen=True):
    """Requests a `RobotSnapshot` with this `number`: the robot's present values.

    With a `cycle`: its values in that cycle of its protocol. With a `value`: the values of its variables behind this
    value, which others see.
    """

    number: int
    cycle: int | None = None
    value: Value | None = None


class CheckRequest(EpochMessage, frozen=True):
    """The order to check the decided values of robots that share constraints with the robot, together with its own.

    `snapshot`: the number of the snapshot that contains them (0: the final reports).
    """

    values: Mapping[str, int]
    snapshot: int = 0


class Adopt(EpochMessage, frozen=True):
    """The order to keep the values of the snapshot `number`, the best so far (0: those of the final report).

    With a `why`, the verdict in a few words, they are the robot's decision until a further order.
    """

    number: int
    why: str = ""


class Revoked(_Message, frozen=True):
    """The order to accept nothing more from `name`."""

    name: str


class DirectoryAnswer(_Message, frozen=True):
    """The Directory Facilitator's answer: a performative, and content in SL0."""

    number: int
    performative: str
    content: str


class JournalAnswer(_Message, frozen=True):
    """The answer to a `JournalRequest`: the run's name, or why the journal is refused."""

    number: int
    run: str
    why: str


class Leave(_Message, frozen=True):
    """The run is over. `failed`: it could not be completed, because of `why`; otherwise `why` is the verdict."""

    why: str
    failed: bool


# From robot to robot


class ProtocolMessage(EpochMessage, frozen=True):
    """A protocol's message, sealed by the filters, with the sender's NCCC clock."""

    clock: Annotated[int, msgspec.Meta(ge=0, le=LATEST)]
    content: bytes


class Copies(EpochMessage, frozen=True):
    """The sender's totally known constraints over the receiver's variables, for protocols with shared scopes.

    `content` contains `SharedRecord`s, sealed by the filters.
    """

    content: bytes


ToMaster = (
    Register
    | Joined
    | DomainAnswer
    | Ready
    | Counters
    | Conclusion
    | WentOn
    | RobotSnapshot
    | Events
    | DetailedReport
    | CheckResult
    | RobotFailed
    | Objection
    | LostFrames
    | DirectoryRequest
    | JournalRequest
    | Bye
)
ToRobot = (
    Welcome
    | RegistrationDenied
    | DomainRequest
    | SearchTask
    | StartSearch
    | CounterWave
    | TakeSnapshot
    | GoOn
    | Pause
    | Recall
    | CheckRequest
    | Adopt
    | Revoked
    | DirectoryAnswer
    | JournalAnswer
    | Leave
)
ToPeer = ProtocolMessage | Copies
ControlMessage = ToMaster | ToRobot | ToPeer
