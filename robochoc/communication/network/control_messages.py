"""The control messages between the master and robots across machines. Frames (`framing.py`) carry them.

The master is the paper's: it registers robots, waits until all are there, orders the start, finds out when all is
quiet, and stops all (Figure 3). Of robots' files it knows what their profiles say. Protocol messages
(`ProtocolMessage`) go from robot to robot, and it never sees them. Messages that the runtime of processes has as well
are in `communication/control.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import msgspec

from robochoc.communication.control import (
    Conclusion,
    Counters,
    EpochMessage,
    Events,
    Failed,
    GoOn,
    Pause,
    Ready,
    Report,
    Snapshot,
    TakeSnapshot,
    Wave,
    WentOn,
)
from robochoc.communication.network.profile import Profile, Ranges
from robochoc.model.message import Value
from robochoc.solver.encoding import Cost

LATEST = 2**53
"""The largest clock of constraint checks. A robot reports its own, and must not overflow another's."""


class _Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


# From a robot to the master


class Register(_Message, frozen=True):
    """Registers the robot of `profile`.

    `incarnation` names this process of the robot: one that is started again has another.
    """

    profile: Profile
    incarnation: str


class Joined(_Message, frozen=True):
    """Confirms the welcome of an incarnation; sent for each welcome, as an answer may get lost.

    `card` holds the robot's keys of this run (`KeyCard`; empty: no filter needs any).
    """

    incarnation: str
    card: bytes


class DomainAnswer(_Message, frozen=True):
    """The domains that the master asked for."""

    variables: dict[str, Ranges]


class Exchanged(NamedTuple):
    """Protocol messages with one other robot: `sent` to it, `received` from it, and the latest `clock` these had."""

    sent: int = 0
    received: int = 0
    clock: int = 0


class DetailedReport(Report, frozen=True):
    """A report with what the master needs to check it. In private runs `assignment` and findings stay empty.

    `assigned` says whether the robot has values. `exchanged` counts the messages with each other robot, so that what
    one robot says is held against what another says.
    """

    assigned: bool
    exchanged: dict[str, Exchanged] = msgspec.field(default_factory=dict)


class Charge(NamedTuple):
    """The total cost of `holder`'s totally known constraints over the same `variables`."""

    holder: str
    variables: tuple[str, ...]
    constraints: int
    price: int | float


class CheckResult(EpochMessage, frozen=True):
    """The cost of the robot's constraints for the decided values. `allowed`: none is violated.

    `held` is their number. Of these, `shared` are those that others may know too; `copies` are constraints of others
    that the robot knows. `snapshot` is the number of the snapshot that was checked; 0: what was reported at the end.
    """

    allowed: bool
    cost: int | float
    held: int = 0
    shared: tuple[Charge, ...] = ()
    copies: tuple[Charge, ...] = ()
    snapshot: int = 0


class Objection(_Message, frozen=True):
    """A report that the robot has refused `what` of `who`."""

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
    """Asks for the domains of variables that parts of partially known constraints look at."""

    variables: tuple[str, ...]


class Task(EpochMessage, frozen=True):
    """A search: what all robots know of each other (see `solver/agent_problem.py`), and how they search."""

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
    """The order to begin, as all robots are ready."""


class Recall(EpochMessage, frozen=True):
    """Asks for a `Snapshot` of this `number`: what the robot has now.

    With a `cycle`: what it had in that cycle of its protocol. With a `value`: what is behind that value, as others see
    it.
    """

    number: int
    cycle: int | None = None
    value: Value | None = None


class CheckRequest(EpochMessage, frozen=True):
    """The decided values of those that share constraints with the robot: it checks them, with its own.

    `snapshot`: they are those of that snapshot (0: those that were reported at the end).
    """

    values: Mapping[str, int]
    snapshot: int = 0


class Adopt(EpochMessage, frozen=True):
    """The order to keep what the robot had at the snapshot `number`, the best so far (0: what it reported at the end).

    With a `why`, it is the robot's decision until it hears otherwise: the verdict, in a few words.
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
    """The run is over. `failed`: it could not be completed, because of `why`; otherwise that is the verdict."""

    why: str
    failed: bool


# From robot to robot


class ProtocolMessage(EpochMessage, frozen=True):
    """A protocol's message, as the filters have sealed it, with the sender's NCCC clock."""

    clock: Annotated[int, msgspec.Meta(ge=0, le=LATEST)]
    content: bytes


class Copies(EpochMessage, frozen=True):
    """The totally known constraints of the sender whose scopes the receiver is in, for protocols with shared scopes.

    `content` holds `SharedRecord`s, as the filters have sealed it.
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
    | Snapshot
    | Events
    | DetailedReport
    | CheckResult
    | Failed
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
    | Task
    | StartSearch
    | Wave
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
