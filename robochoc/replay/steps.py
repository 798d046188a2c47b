"""Groups the events in a journal by run, and the events in a run by the steps of its robots.

In a step, a robot processes one packet: it receives the messages, decides, sends messages, and settles. The start of a
robot is a step without received messages. The last step may be incomplete if the journal or the robot ends early.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import takewhile
from typing import NamedTuple

from robochoc.journal.events import (
    AnyEvent,
    Began,
    Concluded,
    Decided,
    Given,
    Heard,
    Received,
    Sent,
    Settled,
    actor,
)

RobotEvent = Received | Heard | Decided | Concluded | Sent | Settled
"""The events of one robot, in the order of that robot."""


class RecordedRun(NamedTuple):
    """A run or an epoch, counted from 0. A run in a master's journal has no `Began` and no `Given`."""

    number: int
    began: Began | None
    given: Given | None
    events: list[AnyEvent]


class RecordedStep(NamedTuple):
    """One step of one robot: the received messages, the events after them, and whether the step is complete."""

    robot: str
    received: Sequence[Received]
    done: Sequence[RobotEvent]
    is_complete: bool


def runs_of(events: Iterable[AnyEvent]) -> Iterator[RecordedRun]:
    """Yield the runs in order, omitting runs without problems and without events of robots."""
    number = 0
    run = RecordedRun(0, None, None, [])
    for event in events:
        if isinstance(event, Began):
            if _is_one(run):
                yield run
                number += 1
            run = RecordedRun(number, event, None, [])
        elif isinstance(event, Given):
            run = run._replace(given=event)
        else:
            run.events.append(event)
    if _is_one(run):
        yield run


def _is_one(run: RecordedRun) -> bool:
    """Return whether the run has problems or events of robots."""
    return run.given is not None or any(actor(event) is not None for event in run.events)


def steps_of(events: Iterable[AnyEvent]) -> Iterator[RecordedStep]:
    """Yield the steps in one run in the order of their ends, then the incomplete steps."""
    open_still: dict[str, list[RobotEvent]] = {}
    for event in events:
        robot = actor(event)
        if robot is None:
            continue
        own = open_still.setdefault(robot, [])
        own.append(event)  # type: ignore[arg-type]  # it has an actor
        if isinstance(event, Settled):
            del open_still[robot]
            yield _step(robot, own, whole=True)
    for robot, own in open_still.items():
        yield _step(robot, own, whole=False)


def _step(robot: str, events: Sequence[RobotEvent], *, whole: bool) -> RecordedStep:
    received = list(takewhile(lambda one: isinstance(one, Received), events))
    return RecordedStep(robot, received, events[len(received) :], whole)  # type: ignore[arg-type]  # see takewhile
