"""What a trace is made of: runs, notes, and the columns of messages and steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec

from robochoc.journal.events import AnyEvent, Given, Granted, Improved, Lost, Refused


class RunRecord(msgspec.Struct, frozen=True):
    """One run, or epoch: its first message and step, and what its robots were given; None: nothing says so.

    `files` are their XML files by name, also those that had been given before.
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
    """Something beside messages and decisions: `step` is the number of the step in which `robot` did it.

    Of what no robot did in a step, as losses and refusals, it is the number of the step that comes next.
    """

    t: float
    step: int
    kind: str
    robot: str
    text: str


class Messages(NamedTuple):
    """The columns of the messages; see `columns.py` for their kinds.

    `taken` is the step in which each was taken in, or `NOT_YET`: it changes. `sequence` counts, from 1 on, what its
    sender has said in the run.
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
    """The columns of the steps; `packet_end` and `said_end` count the messages taken in, and said, up to its end."""

    t: Any
    clock: Any
    checks: Any
    packet_end: Any
    robot: Any
    run: Any
    said_end: Any


def note_of(event: AnyEvent, step: int) -> Note | None:
    """What is to be noted of an event in which no robot speaks; None: nothing."""
    match event:
        case Improved():
            return Note(event.t, step, "improved", "", f"the cheapest so far costs {event.cost}")
        case Lost():
            return Note(event.t, step, "lost", event.robot, f"{event.robot} was lost: {event.why}")
        case Refused():
            return Note(event.t, step, "refused", event.who, f"{event.who} was refused {event.what}: {event.why}")
        case Granted():
            return Note(event.t, step, "granted", event.who, f"{event.who} was granted {event.what}")
        case _:
            return None
