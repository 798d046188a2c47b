"""What the parent and a robot's process say to each other over their control pipe.

The parent is the paper's master: it waits for the confirmation of all robots before it orders the start, opens
queues between robots that want to talk, finds out when all is quiet, and stops the run. It carries no protocol
message.
"""

from __future__ import annotations

import msgspec

from robochoc.observers.events import AnyEvent
from robochoc.outcome import Metrics

QUEUES_AT_ONCE = 16
"""How many queues a robot asks for in one go. The parent holds so many descriptors more meanwhile."""


class _Control(msgspec.Struct, frozen=True, tag=True, array_like=True):
    pass


# From a robot to the parent


class Ready(_Control, frozen=True):
    """I am there, with my problem compiled."""


class OpenQueues(_Control, frozen=True):
    """I want to put messages to `receivers`, at most `QUEUES_AT_ONCE` of them."""

    receivers: list[str]


class Counters(_Control, frozen=True):
    """My protocol messages, `sent` and `received`; in answer to wave `wave`, or (0) because I have gone idle."""

    wave: int
    sent: int
    received: int


class Conclusion(_Control, frozen=True):
    """I alone can tell how the search ends."""

    verdict: str


class Events(_Control, frozen=True):
    """What an observer is to be told, oldest first."""

    events: list[AnyEvent]


class Report(_Control, frozen=True):
    """My last words: values of my variables, and what I have counted."""

    assignment: dict[str, int]
    metrics: Metrics


class Failed(_Control, frozen=True):
    """I cannot go on; `unsupported`: because of my problem, not because something broke."""

    why: str
    unsupported: bool = False


# From the parent to a robot


class Start(_Control, frozen=True):
    """All robots are there: begin the search. `began` is the run's beginning, on the monotonic clock."""

    began: float


class QueuesTo(_Control, frozen=True):
    """The write ends of the queues to `robots` come with this, in their order."""

    robots: list[str]


class QueueFrom(_Control, frozen=True):
    """The read end of the queue from `robot` comes with this."""

    robot: str


class Wave(_Control, frozen=True):
    """Tell me your counters."""

    number: int


class Stop(_Control, frozen=True):
    """The run is over: report and end."""


FromRobot = Ready | OpenQueues | Counters | Conclusion | Events | Report | Failed
FromParent = Start | QueuesTo | QueueFrom | Wave | Stop
