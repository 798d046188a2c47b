"""The control messages between the parent and a robot's process, over their control pipe.

The parent is the paper's master: it waits for the confirmation of all robots before it orders the start, opens
queues between robots that want to talk, finds out when all is quiet, and ends each epoch. It carries no protocol
message. When it closes the pipe, the robot ends.
"""

from __future__ import annotations

import pickle

import msgspec

from robochoc.journal.events import AnyEvent
from robochoc.model.outcome import Metrics
from robochoc.protocols.findings import Findings
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.explanation import Invalidated

QUEUES_AT_ONCE = 16
"""The number of queues that a robot requests at once. Meanwhile, the parent holds as many more descriptors."""


class _Control(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


class OfEpoch(_Control, frozen=True):
    """Messages that have no meaning once their epoch is over."""

    epoch: int


# From a robot to the parent


class Ready(OfEpoch, frozen=True):
    """The robot is there, with its problem compiled."""


class OpenQueues(OfEpoch, frozen=True):
    """The robot needs queues to `receivers`, at most `QUEUES_AT_ONCE` of them. Asked again in each epoch."""

    receivers: list[str]


class Counters(OfEpoch, frozen=True):
    """The robot's protocol messages of this epoch, in answer to wave `wave`, or (0) as it is idle."""

    wave: int
    sent: int
    received: int


class Conclusion(OfEpoch, frozen=True):
    """The robot alone has found how the search ends. Before `Ready`: a verdict stands in spite of the changes."""

    verdict: str


class WentOn(OfEpoch, frozen=True):
    """The answer to `GoOn`: whether the robot has gone on without something that it had waited for."""

    went: bool


class Snapshot(OfEpoch, frozen=True):
    """The answer to `TakeSnapshot`: what the robot has, and how many messages it has dropped; the search goes on."""

    number: int
    assignment: dict[str, int]
    lost: int
    findings: Findings


class Events(_Control, frozen=True):
    """Events for the observer, oldest first."""

    events: list[AnyEvent]


class Report(OfEpoch, frozen=True):
    """The end of an epoch: the values of the robot's variables, its counts, and what it knows of the whole team."""

    assignment: dict[str, int]
    metrics: Metrics
    findings: Findings


class Failed(_Control, frozen=True):
    """The robot cannot continue; `unsupported`: because of its problem, not because something broke.

    `elsewhere`: another protocol may be able to (`TooLargeError`).
    """

    why: str
    unsupported: bool = False
    elsewhere: bool = False


# From the parent to a robot


class Begin(_Control, frozen=True):
    """The order to search, as all robots are there. `began` is the run's beginning, on the monotonic clock.

    `lossless`: no message of the epoch before was lost.
    """

    began: float
    lossless: bool


class Pause(_Control, frozen=True):
    """The order to be silent and report, as this epoch's search is over."""


class Change(_Control, frozen=True):
    """A new epoch. `change` holds the robot's `AgentProblem` and what is `Invalidated` (see `sealed`).

    Robots in `gone` have left; if there are others of their names, queues to and from them are to be opened anew.
    """

    epoch: int
    change: bytes
    gone: list[str]


class QueuesTo(_Control, frozen=True):
    """The write ends of the queues to `robots` come with this, in their order."""

    robots: list[str]


class QueueFrom(_Control, frozen=True):
    """The read end of the queue from `robot` comes with this."""

    robot: str


class Wave(_Control, frozen=True):
    """The order to report the counters."""

    number: int


class TakeSnapshot(_Control, frozen=True):
    """The order to tell what the robot has, and to search on. The answer has the same `number`."""

    number: int


class GoOn(_Control, frozen=True):
    """The order to go on without the messages that a robot waits for: nothing is under way any more."""


def sealed(part: AgentProblem, invalidated: Invalidated) -> bytes:
    """Return the content of a `Change`."""
    return pickle.dumps((part, invalidated))


def unsealed(change: bytes) -> tuple[AgentProblem, Invalidated]:
    """Return the arguments of `sealed`. Only for bytes from the own parent, over the socket that only the two have.

    A process is started with the same means (`multiprocessing`); no message of a protocol ever comes here.
    """
    part, invalidated = pickle.loads(change)  # noqa: S301 - our own, as said above
    return part, invalidated


RobotMessage = Ready | Counters | Conclusion | WentOn | Snapshot | Events
"""A robot's message to the runtime during a search, in every runtime. Runtimes differ in the report of the end."""
FromRobot = RobotMessage | OpenQueues | Report | Failed
FromParent = Begin | Pause | Change | QueuesTo | QueueFrom | Wave | TakeSnapshot | GoOn
