"""Journals as rows and columns of plain values, for pandas, polars and similar libraries."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from robochoc.journal.events import AnyEvent, Began, Bounded, Improved, Sent, actor
from robochoc.journal.reader import read_journal

COLUMNS = (
    *("run", "epoch", "event", "t", "robot", "other", "type", "content", "bytes", "clock", "checks", "cost"),
    *("assignment", "verdict"),
)
"""The keys of each row, in this order."""

Row = dict[str, Any]
"""An event as texts and numbers by key. Values that do not exist for this kind of event are None."""


def rows(path: Path | str) -> list[Row]:
    """Return the events in a journal in order, one row per event.

    All rows have the same keys: the number of the `run` and its `epoch`, the kind of `event` (`Sent`, `Received`,
    `Settled`, `Decided`, ...), its time `t`, the acting `robot`, the `other` robot of a message, the message's `type`,
    its `content` and an `assignment` as JSON text, `bytes`, `clock` (NCCCs), `checks`, `cost`, `verdict`. If the
    journal is damaged, a warning contains the place, and the rows before it are returned.

    Args:
        path: The journal file, as written by `--journal`.

    Raises:
        JournalError: if the file is not a journal.
        OSError: if the file cannot be read.
    """
    journal = read_journal(Path(path).read_bytes())
    if journal.damage:
        warnings.warn(f"{path}: {journal.damage}", stacklevel=2)
    found, run, epoch = [], -1, 0
    for event in journal.events:
        if isinstance(event, Began):
            run += 1
            epoch = event.epoch if isinstance(event.epoch, int) else 0
        found.append(_row(event, max(run, 0), epoch))
    return found


def by_column(path: Path | str) -> dict[str, list[Any]]:
    """Return the events in a journal as columns, with the keys of `rows`."""
    found = rows(path)
    return {name: [row[name] for row in found] for name in COLUMNS}


def cost_rows(events: Iterable[AnyEvent]) -> list[Row]:
    """Return a row for each improvement of the team's assignment: its time, the messages sent until then, the cost.

    `run` is the number of the run or epoch, from 1, as in other exports.
    """
    found: list[Row] = []
    run, messages = 0, 0
    for event in events:
        match event:
            case Began():
                run, messages = run + 1, 0
            case Sent():
                messages += 1
            case Improved():
                found.append({"run": max(run, 1), "t": event.t, "messages": messages, "cost": event.cost})
            case _:
                pass
    return found


def _row(event: AnyEvent, run: int, epoch: int) -> Row:
    fields: dict[str, Any] = msgspec.structs.asdict(event)
    robot = actor(event) or fields.get("robot")
    pair = [fields[side] for side in ("sender", "receiver") if side in fields]
    row: Row = dict.fromkeys(COLUMNS)
    copied = ("t", "type", "bytes", "clock", "checks", "cost", "verdict")
    row.update((name, fields[name]) for name in copied if name in fields)
    row.update(run=run, epoch=epoch, event=type(event).__name__, robot=robot)
    row.update(other=next((name for name in pair if name != robot), robot if pair else None))
    if isinstance(event, Bounded):
        row["cost"] = event.bound
    for name in ("content", "assignment"):
        if name in fields:
            row[name] = msgspec.json.encode(fields[name]).decode()
    return row
