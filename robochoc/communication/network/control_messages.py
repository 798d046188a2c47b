"""The control messages between the master and robots across machines. They are sent in frames (`framing.py`).

The master is the paper's: it registers robots, waits until all are present, orders the start, detects quiescence, and
stops all robots (Figure 3). It knows only the profiles of the robots' files. Protocol messages (`ProtocolMessage`) are
sent from robot to robot, never to the master. Messages also used by the process runtime: `communication/control.py`.
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
from robochoc.communication.network.leadership import NO_TERM, Term
from robochoc.communication.network.profile import Profile, Ranges
from robochoc.protocols.message import Value
from robochoc.solver.encoding import Cost

LATEST = 2**53
"""The largest NCCC clock. A robot reports its clock, which must not overflow the clocks of others."""


class _Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


class TeamDecision(NamedTuple):
    """A decision without the robots' values, which each robot stores itself.

    Attributes:
        run: The run of the master that has found the decision.
        robots: The robots whose values in that run are the decision; the others were lost.
        outcome: The outcome without values, as JSON.
        words: The outcome in a few words.
    """

    run: str
    robots: tuple[str, ...]
    outcome: str
    words: str


class Spent(NamedTuple):
    """The messages sent and the seconds spent in a search so far, also under earlier masters."""

    messages: Annotated[int, msgspec.Meta(ge=0)] = 0
    seconds: Annotated[float, msgspec.Meta(ge=0)] = 0.0


class AcceptedDecision(NamedTuple):
    """A decision, and the latest term in which a robot has accepted it. See `leadership.Acceptance`."""

    term: Term
    decision: TeamDecision


class Standing(NamedTuple):
    """The mission of a robot that knows several masters: the runs of these masters that together make one decision.

    Attributes:
        mission: The run of the master that closed the team; empty before that.
        team: The names of the robots in the team.
        promised: The latest term that the robot has promised in the mission.
    """

    mission: str = ""
    team: tuple[str, ...] = ()
    promised: Term = NO_TERM


# From a robot to the master


class Register(_Message, frozen=True):
    """Registers the robot of `profile`.

    `incarnation` names this process of the robot: a restarted robot has another one. `standing`: the robot knows
    several masters.
    """

    profile: Profile
    incarnation: str
    standing: Standing | None = None


class Promised(_Message, frozen=True):
    """The answer to `Lead`: the robot's latest promise, and the decision that it has accepted before, if any.

    `values` are the robot's last values in each run of the mission, the latest run last; empty in private runs.
    """

    term: Term
    promised: Term
    accepted: AcceptedDecision | None
    values: dict[str, dict[str, int]]


class Accepted(_Message, frozen=True):
    """The answer to `Propose`: the robot's latest promise, which is `term` if it has accepted the decision."""

    term: Term
    promised: Term


class Joined(_Message, frozen=True):
    """Confirms the welcome of an incarnation. It is sent for each welcome, since an answer may get lost.

    `card` contains the robot's keys for this run (`KeyCard`; empty: no filter needs keys).
    """

    incarnation: str
    card: bytes


class DomainAnswer(_Message, frozen=True):
    """Contains the domains that the master has requested. For `symbolic` and `real_places` see `Profile`."""

    variables: dict[str, Ranges]
    symbolic: tuple[str, ...] = ()
    real_places: dict[str, int] = {}


class Exchanged(NamedTuple):
    """The messages exchanged with one other robot: `sent` to it, `received` from it, and the latest `clock` in them."""

    sent: int = 0
    received: int = 0
    clock: int = 0


class DetailedReport(EpochReport, frozen=True):
    """A report with data that lets the master check it. In private runs `assignment` and findings are empty.

    `assigned`: the robot has values. `exchanged` counts the messages exchanged with each other robot, so that the
    master can compare two robots' reports.
    """

    assigned: bool
    exchanged: dict[str, Exchanged] = msgspec.field(default_factory=dict)


class Charge(NamedTuple):
    """The total cost of the totally known constraints of `holder` that have the same `variables`."""

    holder: str
    variables: tuple[str, ...]
    constraints: int
    price: int | float


class CheckResult(EpochMessage, frozen=True):
    """The cost of the robot's constraints under the decided values. `allowed`: no constraint is violated.

    `held` is the number of these constraints. `shared` are those that other robots may know too; `copies` are
    constraints of other robots that this robot knows. `snapshot` is the number of the checked snapshot; 0: the final
    reports. `hard` is the number of hard constraints among those held, and `broken` the number of violated ones.
    """

    allowed: bool
    cost: int | float
    held: int = 0
    shared: tuple[Charge, ...] = ()
    copies: tuple[Charge, ...] = ()
    snapshot: int = 0
    hard: int = 0
    broken: int = 0


class Objection(_Message, frozen=True):
    """Reports that the robot has refused `what` from `who`."""

    who: str
    what: str
    why: str


class LostFrames(_Message, frozen=True):
    """Reports that a number of `frames` from `who` to the robot are permanently lost."""

    who: str
    frames: Annotated[int, msgspec.Meta(ge=1, le=2**53)]


class DirectoryRequest(_Message, frozen=True):
    """A request to the Directory Facilitator, in SL0. The answers have the same `number`.

    `subscribe`: answer now, and whenever the search result changes.
    """

    number: int
    content: str
    subscribe: bool = False


class JournalRequest(_Message, frozen=True):
    """A request for the journal of the run. The answer has the same `number`."""

    number: int


class StandbyRequest(_Message, frozen=True):
    """A standby master's request for a `StandbyAnswer`. `over`: it knows that the run is over."""

    over: bool = False


class Bye(_Message, frozen=True):
    """Confirms that the run is over."""


# From the master to a robot


class Welcome(_Message, frozen=True):
    """Confirms the registration of an incarnation for the run `run`, whose messages pass through `filters`."""

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
    """Requests the domains of variables that occur in this robot's parts of partially known constraints."""

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
    start: Mapping[str, int | None] = {}
    upper_bound: Cost | None = None


class StartSearch(EpochMessage, frozen=True):
    """The order to start, sent when all robots are ready."""


class Recall(EpochMessage, frozen=True):
    """Requests a `RobotSnapshot` with this `number`, containing the robot's current values.

    With a `cycle`: its values in that cycle of the protocol. With a `value`: the values of its variables that
    correspond to this value, which is visible to others.
    """

    number: int
    cycle: int | None = None
    value: Value | None = None


class CheckRequest(EpochMessage, frozen=True):
    """The order to check the decided values: those of this robot, and those of robots that share constraints with it.

    `snapshot`: the number of the snapshot that contains the values (0: the final reports).
    """

    values: Mapping[str, int]
    snapshot: int = 0


class Adopt(EpochMessage, frozen=True):
    """The order to keep the values in the snapshot `number`, the best so far (0: those in the final report).

    With a `why`, the verdict in a few words, these values are the robot's decision until a further order.
    """

    number: int
    why: str = ""


class Revoked(_Message, frozen=True):
    """The order to accept no more messages from `name`."""

    name: str


class DirectoryAnswer(_Message, frozen=True):
    """The answer of the Directory Facilitator: a performative, and content in SL0."""

    number: int
    performative: str
    content: str


class JournalAnswer(_Message, frozen=True):
    """The answer to a `JournalRequest`: the name of the run, or the reason why the journal is refused."""

    number: int
    run: str
    why: str


class Leave(_Message, frozen=True):
    """The run is over. `failed`: it was not completed, for the reason `why`; otherwise `why` is the verdict.

    `elsewhere`: another master may complete it.
    """

    why: str
    failed: bool
    elsewhere: bool = False


class Lead(_Message, frozen=True):
    """The request to promise the `term` in which this master leads the `team` in the `mission`."""

    term: Term
    mission: str
    team: tuple[str, ...]


class Propose(_Message, frozen=True):
    """The request to accept a decision in the master's term."""

    term: Term
    decision: TeamDecision


class Heartbeat(_Message, frozen=True):
    """A sign of life for robots that know several masters."""


class StandbyAnswer(_Message, frozen=True):
    """Shows a standby master that this master leads, and whom the Authority admits.

    Attributes:
        names: By role, the admitted names, including those that have a token.
        sniffers: The names that may follow runs.
        over: The result of the run in words, if it is over.
        failed: True if the run is over, and was not completed.
        resigned: True if this master does not lead any more, so that another one may.
        closed: True if the team is complete, so that its robots look for another master if this one is gone.
        spent: The messages and the time of the search so far, which count for the limits of a later master.
    """

    names: dict[str, tuple[str, ...]]
    sniffers: tuple[str, ...]
    over: str = ""
    failed: bool = False
    resigned: bool = False
    closed: bool = False
    spent: Spent = Spent()


# From robot to robot


class ProtocolMessage(EpochMessage, frozen=True):
    """A protocol message sealed by the filters, with the sender's NCCC clock."""

    clock: Annotated[int, msgspec.Meta(ge=0, le=LATEST)]
    content: bytes


class Copies(EpochMessage, frozen=True):
    """The sender's totally known constraints that contain the receiver's variables, for protocols with shared scopes.

    `content` contains `SharedRecord` objects, sealed by the filters.
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
    | Promised
    | Accepted
    | StandbyRequest
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
    | Lead
    | Propose
    | Heartbeat
    | StandbyAnswer
    | Leave
)
ToPeer = ProtocolMessage | Copies
ControlMessage = ToMaster | ToRobot | ToPeer
