"""What the master and robots say to each other across machines. Frames (`frames.py`) carry these words.

The master is the paper's: it registers robots, waits until all are there, orders the start, finds out when all is
quiet, and stops all (Figure 3). Of robots' files it knows what their profiles say. Protocol messages
(`ProtocolMessage`) go from robot to robot, and it never sees them. Messages that the runtime of processes has as well
are in `communication/control.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import msgspec

from robochoc.communication.control import Conclusion, Counters, Events, Failed, OfEpoch, Pause, Ready, Report, Wave
from robochoc.communication.network.profile import Profile, Ranges

LATEST = 2**53
"""The latest that a clock of constraint checks can be. Each says its own, and must not overflow another's."""


class _Word(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


# From a robot to the master


class Register(_Word, frozen=True):
    """I am there: this is what my file says to all.

    `incarnation` names this life of mine: who comes back is another.
    """

    profile: Profile
    incarnation: str


class Joined(_Word, frozen=True):
    """I, in the life `incarnation`, have read your welcome: said to each, for an answer may get lost.

    `card` holds my keys of this run (`KeyCard`; empty: no filter needs any).
    """

    incarnation: str
    card: bytes


class DomainAnswer(_Word, frozen=True):
    """The domains that you asked for."""

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
    """What all totally known constraints over the same `variables` that `holder` holds charge together."""

    holder: str
    variables: tuple[str, ...]
    constraints: int
    price: int | float


class CheckResult(OfEpoch, frozen=True):
    """What the constraints that I hold charge for the values that you told me; `allowed`: none is broken.

    `held` is how many they are. Of these, `shared` are those that others may know too; `copies` are others' constraints
    that I know.
    """

    allowed: bool
    cost: int | float
    held: int = 0
    shared: tuple[Charge, ...] = ()
    copies: tuple[Charge, ...] = ()


class Objection(_Word, frozen=True):
    """I have refused something: `who` has claimed to be allowed `what`."""

    who: str
    what: str
    why: str


class LostFrames(_Word, frozen=True):
    """So many `frames` of `who` to me are lost for good."""

    who: str
    frames: Annotated[int, msgspec.Meta(ge=1, le=2**53)]


class DirectoryRequest(_Word, frozen=True):
    """To the Directory Facilitator, in SL0; answers have the same `number`.

    `subscribe`: tell me now and whenever it changes what this search finds.
    """

    number: int
    content: str
    subscribe: bool = False


class JournalRequest(_Word, frozen=True):
    """May I have the journal of your run? The answer has the same `number`; it is asked for by `publication.py`."""

    number: int


class Bye(_Word, frozen=True):
    """I have heard that the run is over."""


# From the master to a robot


class Welcome(_Word, frozen=True):
    """You are registered, in your life `incarnation`, for the run `run`; messages go through these `filters`."""

    incarnation: str
    run: str
    filters: tuple[str, ...]
    observed: bool
    private: bool


class RegistrationDenied(_Word, frozen=True):
    """You are not registered."""

    incarnation: str
    why: str


class DomainRequest(_Word, frozen=True):
    """Parts of partially known constraints look at these variables of yours: show them."""

    variables: tuple[str, ...]


class Task(OfEpoch, frozen=True):
    """What all robots know of each other (see `solver/agent_problem.py`), and how they are to search."""

    protocol: str
    order: tuple[str, ...]
    interfaces: Mapping[str, tuple[str, ...]]
    domains: Mapping[str, Ranges]
    links: Mapping[str, tuple[str, ...]] | None
    secretive: tuple[str, ...]
    seed: int
    settings: Mapping[str, str]
    aside: float | None
    cards: tuple[bytes, ...]


class StartSearch(OfEpoch, frozen=True):
    """All robots are ready: begin."""


class CheckRequest(OfEpoch, frozen=True):
    """These are the values that all who share constraints with you have decided on, and your own: check them."""

    values: Mapping[str, int]


class Revoked(_Word, frozen=True):
    """Believe nothing that `name` says any more."""

    name: str


class DirectoryAnswer(_Word, frozen=True):
    """The Directory Facilitator's answer: a performative, and content in SL0."""

    number: int
    performative: str
    content: str


class JournalAnswer(_Word, frozen=True):
    """You may have the journal of the run `run`; or not, because of `why`."""

    number: int
    run: str
    why: str


class Leave(_Word, frozen=True):
    """The run is over. `failed`: it could not be completed, because of `why`; otherwise that is the verdict."""

    why: str
    failed: bool


# From robot to robot


class ProtocolMessage(OfEpoch, frozen=True):
    """A protocol's message, as the filters have sealed it, with the sender's NCCC clock."""

    clock: Annotated[int, msgspec.Meta(ge=0, le=LATEST)]
    content: bytes


class Copies(OfEpoch, frozen=True):
    """The totally known constraints that I hold and you are in: your protocol wants you to know them.

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
    | Pause
    | CheckRequest
    | Revoked
    | DirectoryAnswer
    | JournalAnswer
    | Leave
)
ToPeer = ProtocolMessage | Copies
ControlMessage = ToMaster | ToRobot | ToPeer
