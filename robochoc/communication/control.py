"""The control messages between a parent and a robot's process, sent through their control pipe.

The parent is the paper's master: it waits for the confirmation of all robots before it orders the start, opens
queues between robots that request them, detects quiescence, and ends each epoch. It does not transport protocol
messages. When the parent closes the pipe, the robot ends.
"""

from __future__ import annotations

import msgspec

from robochoc.journal.events import AnyEvent
from robochoc.model.outcome import Metrics
from robochoc.protocols.findings import Findings
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.explanation import Invalidated

QUEUES_AT_ONCE = 16
"""The maximum number of queues that a robot requests at once. Meanwhile the parent needs this many more descriptors."""


class _Control(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


class EpochMessage(_Control, frozen=True):
    """A message that is outdated when its epoch is over."""

    epoch: int


# From a robot to the parent


class Ready(EpochMessage, frozen=True):
    """The robot is running and has compiled its problem."""


class OpenQueues(EpochMessage, frozen=True):
    """The request for queues to `receivers`, at most `QUEUES_AT_ONCE` of them. Repeated in each epoch."""

    receivers: list[str]


class Counters(EpochMessage, frozen=True):
    """The robot's counts of protocol messages in this epoch: the answer to `wave`, or (0) sent when it is idle."""

    wave: int
    sent: int
    received: int


class Conclusion(EpochMessage, frozen=True):
    """A verdict that the robot found alone. If sent before `Ready`, the verdict holds in spite of the changes."""

    verdict: str


class WentOn(EpochMessage, frozen=True):
    """The answer to `GoOn`: whether the robot has continued without a missing message."""

    went: bool


class RobotSnapshot(EpochMessage, frozen=True, tag="Snapshot"):
    """The answer to `TakeSnapshot`: values, findings and the number of dropped messages. The robot continues."""

    number: int
    assignment: dict[str, int]
    lost: int
    findings: Findings


class Events(_Control, frozen=True):
    """Events for the observer, in chronological order."""

    events: list[AnyEvent]


class EpochReport(EpochMessage, frozen=True):
    """The end of an epoch: the values of the robot's variables, its counts, and its findings about the whole team."""

    assignment: dict[str, int]
    metrics: Metrics
    findings: Findings


class RobotFailed(_Control, frozen=True, tag="Failed"):
    """The robot cannot continue. `unsupported`: the cause is the robot's problem, not a failure.

    `elsewhere`: another protocol may be able to solve the problem (`TooLargeError`).
    """

    why: str
    unsupported: bool = False
    elsewhere: bool = False


# From the parent to a robot


class Begin(_Control, frozen=True):
    """The order to search, sent when all robots are ready. `began` is the start of the run, on the monotonic clock.

    `lossless`: no message of the previous epoch was lost.
    """

    began: float
    lossless: bool


class Pause(_Control, frozen=True):
    """The order to stop and report, because this epoch's search is over."""


class EpochChange(_Control, frozen=True):
    """A new epoch. `change` contains the robot's `AgentProblem` and the `Invalidated` results (see `pack_change`).

    Robots in `gone` have left. If new robots have the same names, queues to and from these robots are opened again.
    """

    epoch: int
    change: bytes
    gone: list[str]


class QueuesTo(_Control, frozen=True):
    """The write ends of the queues to `robots` are attached to this message, in this order."""

    robots: list[str]


class QueueFrom(_Control, frozen=True):
    """The read end of the queue from `robot` is attached to this message."""

    robot: str


class CounterWave(_Control, frozen=True, tag="Wave"):
    """The order to report the counters."""

    number: int


class TakeSnapshot(_Control, frozen=True):
    """The order to report a snapshot and to continue the search. The answer has the same `number`."""

    number: int


class GoOn(_Control, frozen=True):
    """The order to continue without the messages that a robot waits for, since no message is in transit any more."""


def prepare_changes() -> None:
    """Import what changes need, once for all robots, before the fork."""
    import pickle  # noqa: F401, PLC0415 - start-up: most problems do not change


def pack_change(part: AgentProblem, invalidated: Invalidated) -> bytes:
    """Return the content of an `EpochChange`."""
    import pickle  # noqa: PLC0415 - as above

    return pickle.dumps((part, invalidated))


def unpack_change(change: bytes) -> tuple[AgentProblem, Invalidated]:
    """Return the arguments of `pack_change`. The bytes must come from this process's parent.

    Processes are started by the same means (`multiprocessing`). Protocol messages are never unpickled.
    """
    import pickle  # noqa: PLC0415 - as above

    part, invalidated = pickle.loads(change)  # noqa: S301 - written by our parent process
    return part, invalidated


RobotMessage = Ready | Counters | Conclusion | WentOn | RobotSnapshot | Events
"""A robot's message to the master during a search, in every runtime. The final report differs between runtimes."""
FromRobot = RobotMessage | OpenQueues | EpochReport | RobotFailed
FromParent = Begin | Pause | EpochChange | QueuesTo | QueueFrom | CounterWave | TakeSnapshot | GoOn
