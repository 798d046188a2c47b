"""Conversations in forms that other programs read: FIPA ACL as text, a table (CSV), a diagram (mermaid).

The table is of RFC 4180, in UTF-8. What a spreadsheet would take for a formula is left as it is: the table is data.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence

import msgspec

from robochoc.sniffer.acl import text
from robochoc.sniffer.columns import NOT_YET
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace
from robochoc.system.plain_text import printable

HEADINGS = (
    "message", "run", "step", "sent_at", "taken_at", "taken_in_step", "sender", "receiver", "type", "performative",
    "bytes", "clock", "taken_clock", "causes", "words", "content",
)  # fmt: skip
"""`message`, `step` and `causes` are numbers from 0 on, `run` from 1 on; clocks are NCCC clocks."""
MOST_ARROWS = 400
"""The maximum for readable diagrams, far below Mermaid's limit of 50,000 characters."""
MOST_CHARACTERS = 50_000
_LONGEST_LABEL = 60
_encode = msgspec.json.encode


class TooMuchToDrawError(ValueError):
    """A selection with more messages than a diagram can have."""


def acl_texts(data: PageData, messages: Sequence[int]) -> Iterator[bytes]:
    """Yield the messages in FIPA ACL as text (FIPA00070), each on a line of its own."""
    for message in messages:
        yield f"{text(data.acl_messages.acl_of(message))}\n".encode()


def table(data: PageData, messages: Sequence[int]) -> Iterator[bytes]:
    """Yield the messages as CSV: a header, then a row for each."""
    yield _row(HEADINGS)
    trace, of, steps = data.trace, data.trace.messages, data.trace.steps
    for message in messages:
        taken = of.taken[message]
        seen = taken != NOT_YET
        yield _row(
            (
                message,
                of.run[message] + 1,
                of.step[message],
                of.t[message],
                steps.t[taken] if seen else "",
                taken if seen else "",
                trace.robots[of.sender[message]],
                trace.robots[of.receiver[message]],
                trace.kinds[of.kind[message]],
                data.protocols.act_of(message).performative,
                of.bytes[message],
                int(of.clock[message]),
                int(steps.clock[taken]) if seen else "",
                " ".join(map(str, trace.causes(message))),
                data.words(message),
                _encode(data.acl_messages.plain(message)).decode(),
            )
        )


def _row(cells: Sequence[object]) -> bytes:
    line = io.StringIO()
    csv.writer(line).writerow(cells)
    return line.getvalue().encode()


def mermaid(data: PageData, messages: Sequence[int]) -> bytes:
    """Return the messages as a mermaid sequence diagram, with notes for decisions; Markdown pages can hold it.

    Raises:
        TooMuchToDrawError: if there are too many messages.
    """
    if len(messages) > MOST_ARROWS:
        raise TooMuchToDrawError(f"{len(messages):,} messages are too many for a diagram: at most {MOST_ARROWS}")
    trace, of = data.trace, data.trace.messages
    robots = sorted({*(of.sender[one] for one in messages), *(of.receiver[one] for one in messages)})
    lines = ["sequenceDiagram"]
    lines += [f"    participant R{robot} as {_label(trace.robots[robot])}" for robot in robots]
    drawn = {*robots}
    notes = _notes(data, messages)
    for message in messages:
        while notes and notes[0][0] <= of.step[message]:
            lines += _note(trace, *notes.pop(0), drawn)
        sender, receiver = of.sender[message], of.receiver[message]
        arrow = "->>" if of.taken[message] != NOT_YET else "-x"
        lines.append(f"    R{sender}{arrow}R{receiver}: {_label(f'{message} {trace.kinds[of.kind[message]]}')}")
    for note in notes:
        lines += _note(trace, *note, drawn)
    diagram = "\n".join([*lines, ""])
    if len(diagram) > MOST_CHARACTERS:
        raise TooMuchToDrawError(
            f"the diagram has {len(diagram):,} characters: mermaid takes {MOST_CHARACTERS:,} at most"
        )
    return diagram.encode()


def drawable(data: PageData, messages: Sequence[int]) -> Sequence[int]:
    """Return the first of `messages`, as many as a diagram can hold."""
    part = messages[:MOST_ARROWS]
    while part:
        try:
            mermaid(data, part)
        except TooMuchToDrawError:
            part = part[: len(part) // 2]
        else:
            break
    return part


def _notes(data: PageData, messages: Sequence[int]) -> list[tuple[int, Mapping[str, int | str]]]:
    """Return the decisions between the first message and the last one."""
    if not messages:
        return []
    trace = data.trace
    first, last = trace.messages.step[messages[0]], trace.messages.step[messages[-1]]
    return [(step, data.names.labelled(taken)) for step, taken in trace.decisions if first <= step <= last]


def _note(trace: Trace, step: int, assignment: Mapping[str, int | str], drawn: set[int]) -> list[str]:
    robot = trace.steps.robot[step]
    if robot not in drawn:
        return []
    values = [f"{name} = {value}" for name, value in assignment.items()]
    more = [f"{len(values) - 3} more"] if len(values) > 4 else []  # noqa: PLR2004 - as many as fit
    told = ", ".join([*values[:3], *more] if more else values) or "no value"
    return [f"    Note over R{robot}: {_label(told)}"]


def _label(words: str) -> str:
    """Return `words` with mermaid's special characters escaped by their numbers."""
    shown = printable(words)
    if len(shown) > _LONGEST_LABEL:
        shown = f"{shown[: _LONGEST_LABEL - 1]}…"
    return "".join(sign if sign.isalnum() or sign in " ._=,…-" else f"#{ord(sign)};" for sign in shown)
