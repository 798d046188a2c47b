"""The report of `robochoc journal show` about a journal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from msgspec import UNSET

from robochoc.formats import on_one_line
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import RunRecord, Trace

_MOST_RUNS = 20
_MOST_ROBOTS = 12
_WIDTH = 10


def journal_report(trace: Trace) -> Iterator[str]:
    """Yield lines of text. Unprintable characters are escaped, since names in a journal are untrusted input."""
    for heading, text in _facts(trace):
        yield on_one_line(f"{heading:<{_WIDTH}} {text}")


def _facts(trace: Trace) -> Iterator[tuple[str, str]]:
    header, data = trace.header, PageData(trace)
    yield "team", header.team
    order = "" if header.order is UNSET else f", order {header.order if isinstance(header.order, str) else 'listed'}"
    channel = "" if header.channel is UNSET else f", channel {header.channel}"
    yield "protocol", f"{header.protocol} ({header.runtime}, seed {header.seed}{order}{channel})"
    yield "outcome", data.news()["verdict"]
    yield "robots", f"{len(trace.robots):,}: {_some(trace.robots)}" if trace.robots else "none"
    yield "messages", f"{len(trace.messages.t):,}, {sum(trace.messages.bytes):,} bytes"
    counts = Counter(trace.messages.kind)
    for kind, count in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        yield "", f"{trace.kinds[kind]} {count:,}"
    yield "steps", f"{len(trace.steps.t):,}; decisions {len(trace.decisions):,}"
    for place, run in enumerate(trace.runs[:_MOST_RUNS]):
        end = trace.runs[place + 1].message if place + 1 < len(trace.runs) else len(trace.messages.t)
        yield f"run {run.number + 1}", _run(run, end - run.message)
    if len(trace.runs) > _MOST_RUNS:
        yield "", f"and {len(trace.runs) - _MOST_RUNS:,} more runs"
    for note in [note for note in trace.notes if note.kind in {"lost", "refused"}][:_MOST_RUNS]:
        yield "note", note.text
    cannot = data.cannot_replay()
    yield "replay", f"not possible: {cannot}" if cannot else "possible"
    if trace.unseen:
        yield "unseen", f"{trace.unseen:,} messages were received whose sending is not recorded"
    yield "complete", f"no: {trace.damage}" if trace.damage else "yes"


def _run(run: RunRecord, messages: int) -> str:
    epoch = "" if run.epoch is None else f", epoch {run.epoch}"
    opened = "" if run.opened_by is None else f", opened by {run.opened_by}"
    return f"{run.protocol}{epoch}{opened}: {messages:,} messages"


def _some(names: list[str]) -> str:
    more = f" and {len(names) - _MOST_ROBOTS:,} more" if len(names) > _MOST_ROBOTS else ""
    return ", ".join(names[:_MOST_ROBOTS]) + more
