"""The parts of a trace: runs, notes, and the columns of messages and steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec

from robochoc.journal.events import AnyEvent, DroppedOut, Given, Granted, Improved, Lost, Refused
from robochoc.model.cost_units import cost_shown


class RunRecord(msgspec.Struct, frozen=True):
    """One run, or epoch: its first message and step, and what its robots were given (None: unknown).

    `files` are their XML files by name, also those given in earlier runs.
    """

    number: int
    protocol: str
    epoch: int | None
    opened_by: str | None
    message: int
    step: int
    given: Given | None = None
    files: Mapping[str, str] = {}


class Note(msgspec.Struct, frozen=True):
    """An event other than messages and decisions: `step` is the number of the step in which `robot` did it.

    For events outside of steps, such as losses and refusals, it is the number of the next step.
    """

    t: float
    step: int
    kind: str
    robot: str
    text: str


class Messages(NamedTuple):
    """The columns of the messages; see `columns.py` for their kinds.

    `taken` is the step that received the message, or `NOT_YET`; it changes. `sequence` numbers the messages of each
    sender in a run, from 1 on.
    """

    t: Any
    clock: Any
    step: Any
    bytes: Any
    sender: Any
    receiver: Any
    kind: Any
    run: Any
    taken: Any
    sequence: Any


class Steps(NamedTuple):
    """The columns of the steps; `packet_end` and `said_end` count messages received and sent up to its end."""

    t: Any
    clock: Any
    checks: Any
    packet_end: Any
    robot: Any
    run: Any
    said_end: Any


def note_of(event: AnyEvent, step: int) -> Note | None:
    """Return a note for an event other than a message. None: the event needs no note."""
    match event:
        case Improved():
            return Note(event.t, step, "improved", "", f"the cheapest so far costs {cost_shown(event.cost)}")
        case DroppedOut():
            return Note(event.t, step, "lost", event.robot, f"{event.robot} has dropped out: {event.why}")
        case Lost():
            return Note(event.t, step, "lost", event.robot, f"{event.robot} was lost: {event.why}")
        case Refused():
            return Note(event.t, step, "refused", event.who, f"{event.who} was refused {event.what}: {event.why}")
        case Granted():
            return Note(event.t, step, "granted", event.who, f"{event.who} was granted {event.what}")
        case _:
            return None
