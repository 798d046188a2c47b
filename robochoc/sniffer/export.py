"""Exports conversations: in words, as FIPA ACL text, table (CSV), diagram (Mermaid), or data embedded in a page.

The table follows RFC 4180, in UTF-8. Cells that a spreadsheet could interpret as formulas are not changed.
"""

from __future__ import annotations

import csv
import io
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import accumulate, islice

import msgspec

from robochoc.journal.journal import Journal
from robochoc.replay import CannotReplayError, TeamStates
from robochoc.sniffer.acl import text
from robochoc.sniffer.columns import NOT_YET
from robochoc.sniffer.page_data import DETAILS, STATES, PageData, message_columns, step_columns
from robochoc.sniffer.trace import Trace
from robochoc.system.errors import RobochocError
from robochoc.system.plain_text import printable

_encode = msgspec.json.encode
AT_ONCE = 1_000_000
"""The largest total size, in bytes, of answers that a page reads without unpacking, before its `load` event."""
_STORED, _COMPRESSED = 0, 6
"""Levels of zlib."""


def embedded_answers(data: PageData, journal: Journal | None = None, *, most_states: int = 20_000) -> dict[str, bytes]:
    """Return the answers about the complete trace in `data`, with the robots' states if `journal` is given.

    States are computed by replay for the robots in the order of their names, until they have `most_states` steps in
    total. Small sets of answers are stored as zlib's bytes without compression, so that a small page is drawn at once.
    """
    answers = dict(_answers(data, journal, most_states))
    level = _STORED if sum(map(len, answers.values())) <= AT_ONCE else _COMPRESSED
    return {name: zlib.compress(answer, level) for name, answer in answers.items()}


def _answers(data: PageData, journal: Journal | None, most_states: int) -> Iterator[tuple[str, bytes]]:
    trace = data.trace
    yield "about", data.about()
    yield "columns", message_columns(trace, 0, len(trace.messages.t))
    yield "steps", step_columns(trace, 0, len(trace.steps.t))
    yield "decisions", _encode([(step, data.names.labelled(values)) for step, values in trace.decisions])
    for chunk in range(-(-len(trace.messages.t) // DETAILS)):
        yield f"details:{chunk}", data.details(chunk)
    if journal and not data.cannot_replay():
        yield from _states(data, journal, most_states)


def _states(data: PageData, journal: Journal, most: int) -> Iterator[tuple[str, bytes]]:
    states = TeamStates(journal)
    for number in _replayable(data.trace, most):
        try:
            coming = states.of(data.trace.robots[number])
            chunk = 0
            while part := list(islice(coming, STATES)):
                yield f"states:{number}:{chunk}", _encode(part)
                chunk += 1
        except CannotReplayError:
            continue  # the page shows that its states are not available


def _replayable(trace: Trace, most: int) -> range:
    """Return the numbers of the first robots, which have at most `most` steps in total."""
    counts = Counter(trace.steps.robot)
    totals = accumulate(counts[robot] for robot in range(len(trace.robots)))
    return range(sum(total <= most for total in totals))


def in_words(
    data: PageData, journal: Journal, messages: Sequence[int], *, most_states: int = 20_000
) -> Iterator[bytes]:
    """Yield the robots' steps as text: the messages received, the reasons, and the messages sent, all in words.

    Without a selection, steps that send nothing are included. Reasons are computed by replay, as in
    `embedded_answers`.
    """
    trace = data.trace
    reasons = {} if data.cannot_replay() else dict(_reasons(trace, journal, most_states))
    chosen = {*messages}
    for step, robot in enumerate(trace.steps.robot):
        sent = [message for message in trace.sent_in(step) if message in chosen]
        why = reasons.get(step, [])
        if not sent and (len(chosen) < len(trace.messages.t) or not why):
            continue
        received = ", ".join(map(str, trace.packet(step)))
        name = trace.robots[robot]
        yield f"{printable(name)} {f'receives {received}' if received else 'starts'}\n".encode()
        for reason in why:
            yield f"    {printable(reason)}\n".encode()
        for message in sent:
            receiver = trace.robots[trace.messages.receiver[message]]
            words = data.words(message).removeprefix(f"{name} says: ")
            yield f"  {message} to {printable(receiver)}: {printable(words)}\n".encode()


def _reasons(trace: Trace, journal: Journal, most: int) -> Iterator[tuple[int, list[str]]]:
    """Yield the numbers of steps with the reasons of their robots."""
    steps: dict[int, list[int]] = {}
    for step, robot in enumerate(trace.steps.robot):
        steps.setdefault(robot, []).append(step)
    states = TeamStates(journal)
    for number in _replayable(trace, most):
        with suppress(CannotReplayError):
            for state in states.of(trace.robots[number]):
                if state.step < len(steps.get(number, ())):
                    yield steps[number][state.step], state.why


HEADINGS = (
    "message", "run", "step", "sent_at", "taken_at", "taken_in_step", "sender", "receiver", "type", "performative",
    "bytes", "clock", "taken_clock", "causes", "words", "content",
)  # fmt: skip
"""The columns of the table. `message`, `step` and `causes` are numbers from 0, `run` from 1; clocks are NCCC clocks."""
MOST_ARROWS = 400
"""The maximum number of arrows in a readable diagram, far below Mermaid's limit of 50,000 characters."""
MOST_CHARACTERS = 50_000
_LONGEST_LABEL = 60


class TooMuchToDrawError(RobochocError, ValueError):
    """The selection has more messages than a diagram can show."""


def acl_texts(data: PageData, messages: Sequence[int]) -> Iterator[bytes]:
    """Yield the messages as FIPA ACL text (FIPA00070), one per line."""
    for message in messages:
        yield f"{text(data.acl_messages.acl_of(message))}\n".encode()


def table(data: PageData, messages: Sequence[int]) -> Iterator[bytes]:
    """Yield the messages as CSV: a header, and a row for each message."""
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
    """Return the messages as a Mermaid sequence diagram for a Markdown page, with notes on decisions.

    Raises:
        TooMuchToDrawError: if there are too many messages.
    """
    if len(messages) > MOST_ARROWS:
        raise TooMuchToDrawError(f"{len(messages):,} messages are too many for a diagram; the maximum is {MOST_ARROWS}")
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
            f"the diagram has {len(diagram):,} characters, more than Mermaid's limit of {MOST_CHARACTERS:,}"
        )
    return diagram.encode()


def drawable(data: PageData, messages: Sequence[int]) -> Sequence[int]:
    """Return as many of the first messages as fit into a diagram."""
    part = messages[:MOST_ARROWS]
    while part:
        try:
            mermaid(data, part)
        except TooMuchToDrawError:
            part = part[: len(part) // 2]
        else:
            break
    return part


def _notes(data: PageData, messages: Sequence[int]) -> list[tuple[int, Mapping[str, float | str]]]:
    """Return the decisions between the first and the last message."""
    if not messages:
        return []
    trace = data.trace
    first, last = trace.messages.step[messages[0]], trace.messages.step[messages[-1]]
    return [(step, data.names.labelled(taken)) for step, taken in trace.decisions if first <= step <= last]


def _note(trace: Trace, step: int, assignment: Mapping[str, float | str], drawn: set[int]) -> list[str]:
    robot = trace.steps.robot[step]
    if robot not in drawn:
        return []
    values = [f"{name} = {value}" for name, value in assignment.items()]
    more = [f"{len(values) - 3} more"] if len(values) > 4 else []  # noqa: PLR2004 - as many as fit
    told = ", ".join([*values[:3], *more] if more else values) or "no value"
    return [f"    Note over R{robot}: {_label(told)}"]


def _label(words: str) -> str:
    """Return `words` with Mermaid's special characters replaced by their character codes."""
    shown = printable(words)
    if len(shown) > _LONGEST_LABEL:
        shown = f"{shown[: _LONGEST_LABEL - 1]}…"
    return "".join(sign if sign.isalnum() or sign in " ._=,…-" else f"#{ord(sign)};" for sign in shown)
