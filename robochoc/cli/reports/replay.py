"""The report of `robochoc replay`, as text and as JSON: the counts and the first difference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import msgspec

from robochoc.formats import on_one_line
from robochoc.journal.events import (
    AnyEvent,
    Concluded,
    Decided,
    Heard,
    Received,
    Sent,
    Settled,
)
from robochoc.journal.journal import Journal
from robochoc.replay import Contradiction, ReplayResult, StepDifference

LONGEST = 400
"""The maximum number of characters shown from a message's content."""
MOST = 20
"""The maximum number of messages shown from a packet, and of robots that could not be replayed."""


def replay_report(journal: Journal, replayed: ReplayResult) -> str:
    """Return the report as text: the counts, and the first difference if there is one."""
    header = journal.header
    lines = [f"{header.team}: {header.protocol}, runtime {header.runtime}, seed {header.seed}"]
    for what, count in _counts(replayed).items():
        lines.append(f"  {what:9} {count:>12,}")
    lines += _shortfalls(replayed)
    if replayed.difference is not None:
        lines += _difference_lines(replayed.difference)
    elif replayed.contradictions:
        lines.append("  different, although all steps are the same:" if replayed.steps else "  different:")
        lines += _contradiction_lines(replayed.contradictions)
    elif replayed.decided_before:
        witness = journal.outcome.witness if journal.outcome else ""
        lines.append(f"  no steps to compare: the run was decided before it began, as {witness} has no local solution")
    elif not replayed.steps:
        lines.append("  nothing was compared: the journal has no step of a robot that could be replayed")
    elif replayed.damage and not replayed.truncated:
        lines.append("  the same up to the damage; but the journal was altered after it was written")
    else:
        complete = replayed.ended and not (replayed.stopped or replayed.unfinished or replayed.damage)
        lines.append("  the same" if complete else "  the same, as far as the journal could be replayed")
    return "\n".join(on_one_line(line) for line in lines)


def replay_json(journal: Journal, replayed: ReplayResult) -> str:
    """Return the report as one JSON object."""
    header = journal.header
    fields: dict[str, object] = {
        "team": header.team,
        "protocol": header.protocol,
        "runtime": header.runtime,
        "seed": header.seed,
        "identical": replayed.identical,
        **_counts(replayed),
        "unfinished": replayed.unfinished,
        "stopped": replayed.stopped,
        "damage": replayed.damage,
        "truncated": replayed.truncated,
        "ended": replayed.ended,
        "difference": replayed.difference,
        "contradictions": replayed.contradictions,
        "decided_before": replayed.decided_before,
    }
    return msgspec.json.format(msgspec.json.encode(fields), indent=2).decode()


def _counts(replayed: ReplayResult) -> dict[str, int]:
    return {
        "runs": replayed.runs,
        "robots": replayed.robots,
        "steps": replayed.steps,
        "messages": replayed.messages,
    }


def _shortfalls(replayed: ReplayResult) -> Iterator[str]:
    """Yield a line for each part that could not be replayed, with the reason."""
    if replayed.damage:
        yield f"  the journal {'ends early' if replayed.truncated else 'was altered'}: {replayed.damage}"
    elif not replayed.ended:
        yield "  the journal does not contain the end of the run"
    if replayed.unfinished:
        yield f"  {replayed.unfinished:,} steps are incomplete"
    for one in replayed.stopped[:MOST]:
        yield f"  {one.robot} could be replayed up to its step {one.step} in run {one.run}: {one.why}"
    if len(replayed.stopped) > MOST:
        yield f"  and {len(replayed.stopped) - MOST:,} more robots"


def _difference_lines(difference: StepDifference) -> Iterator[str]:
    place = f"step {difference.step} of {difference.robot} in run {difference.run} ({difference.protocol})"
    yield f"  first difference: {place}"
    if difference.packet:
        for sent in difference.packet[:MOST]:
            yield f"    received  {sent.type} from {sent.sender}: {_content(sent.content)}"
        if len(difference.packet) > MOST:
            yield f"    and {len(difference.packet) - MOST:,} more"
    else:
        yield "    its start"
    yield f"    recorded  {_event_text(difference.recorded)}"
    yield f"    replayed  {_event_text(difference.replayed)}"
    names = _differing(difference.recorded, difference.replayed)
    if names:
        yield f"    differs   in {', '.join(names)}"
    if difference.raised:
        yield f"    then it raised {difference.raised}"


def _contradiction_lines(found: Sequence[Contradiction]) -> Iterator[str]:
    """Yield lines for each claim in the journal that its steps contradict: claim, recorded and replayed value."""
    for one in found:
        yield f"    {one.what}"
        yield f"      recorded  {_cut(msgspec.json.encode(one.recorded).decode())}"
        yield f"      replayed  {_cut(msgspec.json.encode(one.replayed).decode())}"


def _differing(recorded: AnyEvent | None, replayed: AnyEvent | None) -> list[str]:
    """Return the names of the fields, including those of a message's content, in which two events of a type differ."""
    if recorded is None or type(recorded) is not type(replayed):
        return []
    left, right = _fields(recorded), _fields(replayed)
    return [name for name in left if msgspec.to_builtins(left[name]) != msgspec.to_builtins(right.get(name))]


def _fields(event: object) -> dict[str, object]:
    fields = msgspec.structs.asdict(event)  # type: ignore[arg-type]  # all events are structs
    content = fields.pop("content", {})
    return {**{name: value for name, value in fields.items() if name != "t"}, **content}


def _event_text(event: AnyEvent | None) -> str:
    """Return a text that describes a robot's event."""
    match event:
        case Sent():
            text = f"sent {event.type} to {event.receiver}: {_content(event.content)}, {event.bytes:,} bytes"
        case Received():
            text = f"received {event.type} from {event.sender}"
        case Decided():
            values = ", ".join(f"{name} = {value}" for name, value in event.assignment.items())
            text = f"decided {_cut(values) or 'to have no value'}"
        case Heard():
            text = f"received an assignment of cost {event.cost:g}: {_content(event.values)}"
        case Concluded():
            text = f"concluded {event.verdict}"
        case Settled():
            text = f"ended its step, after {event.checks:,} checks"
        case _:
            text = "nothing more" if event is None else type(event).__name__
    clock = getattr(event, "clock", None)
    return text if clock is None else f"{text} (clock {clock:,})"


def _content(content: Mapping[str, object]) -> str:
    return _cut(msgspec.json.encode(content).decode())


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
