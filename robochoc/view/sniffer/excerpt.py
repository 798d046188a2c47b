"""A part of a trace as a trace: some of its messages, and all of its steps."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

import msgspec

from robochoc.view.sniffer.trace import Trace


def excerpt(trace: Trace, messages: Sequence[int]) -> Trace:
    """The trace without other messages than `messages`, which are in order; they are numbered anew.

    Steps, decisions and notes are all there, so what robots did stays as it was.
    """
    part = Trace(trace.header, trace.generation)
    part.robots, part.kinds = trace.robots, trace.kinds
    part.runs = [msgspec.structs.replace(run, message=bisect_left(messages, run.message)) for run in trace.runs]
    part.variables, part.decisions, part.notes = trace.variables, trace.decisions, trace.notes
    part.over, part.outcome, part.damage = trace.over, trace.outcome, trace.damage
    anew = {message: number for number, message in enumerate(messages)}
    for old, new in zip(trace.messages, part.messages, strict=True):
        new.extend(old[message] for message in messages)
    part.keep_contents(trace, messages)
    for old, new in zip(trace.steps, part.steps, strict=True):
        new.extend(old)
    said = taken = 0
    for step in range(len(trace.steps.t)):
        kept = [anew[message] for message in trace.packet(step) if message in anew]
        part.packets.extend(kept)
        said += sum(message in anew for message in trace.said(step))
        taken += len(kept)
        part.steps.packet_end[step], part.steps.said_end[step] = taken, said
    return part
