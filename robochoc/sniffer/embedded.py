"""All answers of a page at once, compressed: for a page without a server.

By name: `about`, `columns`, `steps`, `decisions`, `details:CHUNK`, `states:ROBOT:CHUNK`; each is zlib's.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import islice

import msgspec

from robochoc.journal.journal import Journal
from robochoc.replay import CannotReplayError, states_of
from robochoc.sniffer.page_data import DETAILS, STATES, PageData, message_columns, step_columns

_encode = msgspec.json.encode
_LEVEL = 6


def embedded_answers(data: PageData, journal: Journal | None = None, *, most_states: int = 20_000) -> dict[str, bytes]:
    """Return the answers about the whole trace of `data`; with its `journal` also robots' states.

    States are computed by replay, for robots in the order of their names, until they have `most_states` steps together.
    """
    return {name: zlib.compress(answer, _LEVEL) for name, answer in _answers(data, journal, most_states)}


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
    counts = [0] * len(data.trace.robots)
    for robot in data.trace.steps.robot:
        counts[robot] += 1
    for number, name in enumerate(data.trace.robots):
        most -= counts[number]
        if most < 0:
            return
        try:
            coming = iter(states_of(journal, name))
            chunk = 0
            while states := list(islice(coming, STATES)):
                yield f"states:{number}:{chunk}", _encode(states)
                chunk += 1
        except CannotReplayError:
            continue  # the page says that they are not there
