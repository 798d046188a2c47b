"""The answers to requests of a page about a trace: JSON, or columns of numbers (little-endian).

    about       JSON: the run, the robots, the number of messages, the outcome
    columns     messages: t, clock (8 bytes, floating point), step, bytes (4), sender, receiver, kind, run (2)
    steps       t, clock, checks (8), packet_end (4), the packets (4), robot, run (2)
    decisions   JSON: [[step, {variable: value}], ...]
    details     JSON: the contents of messages, in words and as FIPA ACL
    search      JSON: the messages with a text, and the number of the first message that was not searched

Steps and messages are numbered (`trace.py`). Each answer has a maximum number of rows.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any, assert_never

import msgspec

from robochoc.formats.headline import describe_outcome
from robochoc.formats.result import result_json
from robochoc.model.cost_units import cost_shown
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.priorities import natural_key
from robochoc.sniffer.acl import text
from robochoc.sniffer.acl_messages import AclMessages
from robochoc.sniffer.columns import packed_columns
from robochoc.sniffer.recorded_messages import RunProtocols
from robochoc.sniffer.sentences import sentence
from robochoc.sniffer.team_names import TeamNames
from robochoc.sniffer.trace import RunRecord, Trace, TraceNote
from robochoc.system.errors import RobochocError

FORMAT = 1
MOST_ROWS = 1 << 16
"""The maximum number of messages, steps or decisions in one answer."""
DETAILS = 1024
"""The number of messages in one chunk of message contents."""
STATES = 64
"""The number of steps in one chunk of a robot's states."""
MOST_NOTES = 1000
"""The maximum number of notes on improvements, and likewise of all other notes."""
MOST_EPOCHS = 8
"""The maximum number of epochs whose results the verdict shows."""

SEARCH_S = 0.2
"""The time after which a search returns the hits so far: other requests are answered, and it can be cancelled."""
_SEARCHED_AT_ONCE = 1024
_MOST_SEARCHED = 100_000
"""The maximum number of different messages whose results are cached during a search."""

_OFTEN = {"heard", "improved"}

_encode = msgspec.json.Encoder(enc_hook=str).encode


class BadRequestError(RobochocError, ValueError):
    """A request for data that do not exist, or for too many data."""


def message_columns(trace: Trace, first: int, end: int) -> bytes:
    """Return the columns for the messages from `first` up to, but not including, `end`."""
    of = trace.messages
    columns = (of.t, of.clock, of.step, of.bytes, of.sender, of.receiver, of.kind, of.run)
    return packed_columns(column[first:end] for column in columns)


def step_columns(trace: Trace, first: int, end: int) -> bytes:
    """Return the columns for the steps from `first` up to, but not including, `end`, with their received messages."""
    of = trace.steps
    packets = trace.packets[_end_before(of.packet_end, first) : _end_before(of.packet_end, end)]
    columns = (of.t[first:end], of.clock[first:end], of.checks[first:end], of.packet_end[first:end], packets)
    return packed_columns((*columns, of.robot[first:end], of.run[first:end]))


def _end_before(ends: Sequence[int], step: int) -> int:
    return ends[step - 1] if step else 0


class PageData:
    """The answers to requests about one trace. `live`: whether the trace may still grow.

    `chosen`: names or patterns (`patterns.py`) of the robots that are shown at first. Empty: all robots.
    """

    def __init__(self, trace: Trace, *, live: bool = False, chosen: Sequence[str] = ()) -> None:
        self.trace = trace
        self._live = live
        self._chosen = list(chosen)
        self.protocols = RunProtocols(trace)
        self.names = TeamNames(trace, self.protocols)
        self.acl_messages = AclMessages(trace, self.protocols)
        self._searched = ""
        self._found: dict[tuple[int, int, int, int, bytes], bool] = {}

    def about(self) -> bytes:
        """Return the description of the run, the robots, and the progress, as JSON."""
        trace, header = self.trace, self.trace.header
        order = None if header.order is msgspec.UNSET else header.order
        return _encode(
            {
                "format": FORMAT,
                **self.news(),
                "title": f"{header.protocol} on {header.team}",
                "team": header.team,
                "protocol": header.protocol,
                "runtime": header.runtime,
                "seed": header.seed,
                "order": order if order is None or isinstance(order, str) else "listed",
                "channel": None if header.channel is msgspec.UNSET else header.channel,
                "robots": [{"name": name, "variables": self.names.variables(name)} for name in trace.robots],
                "kinds": [self._kind(name) for name in trace.kinds],
                "runs": [_run(run) for run in trace.runs],
                "outcome": msgspec.Raw(result_json(trace.outcome)) if trace.outcome is not None else None,
                "notes": [_note_of(note) for note in _last_notes(trace.notes)],
                "replay": self.cannot_replay(),
                "chosen": self._chosen,
                "live": self._live,
            }
        )

    def news(self) -> dict[str, Any]:
        """Return the parts of `about` that change during a run, as numbers and words.

        If the counts differ from those of a page, the page requests `about` again.
        """
        trace = self.trace
        return {
            "generation": trace.generation,
            "messages": len(trace.messages.t),
            "steps": len(trace.steps.t),
            "decisions": len(trace.decisions),
            "robots_count": len(trace.robots),
            "kinds_count": len(trace.kinds),
            "runs_count": len(trace.runs),
            "notes_count": len(trace.notes),
            "over": trace.over,
            "verdict": verdict_of(trace),
            "damage": trace.damage,
            "unseen": trace.unseen,
        }

    def cannot_replay(self) -> str:
        """Return the reason why robots' states are unavailable, or an empty text if they are available."""
        if not self.trace.runs:
            return "no run has started"
        for number, run in enumerate(self.trace.runs):
            if run.given is None or run.given.why:
                return run.given.why if run.given else "the journal does not contain the robots' problems"
            found = self.protocols.of_run(number)
            if found and found[1].traits.no_replay:
                return found[1].traits.no_replay
        return ""

    def columns(self, first: int, end: int) -> bytes:
        """Return the columns for messages. Raises `BadRequestError`, as the other methods do."""
        _check(first, end, len(self.trace.messages.t))
        return message_columns(self.trace, first, end)

    def steps(self, first: int, end: int) -> bytes:
        """Return the columns for steps, with the messages they received."""
        _check(first, end, len(self.trace.steps.t))
        return step_columns(self.trace, first, end)

    def decisions(self, first: int, end: int) -> bytes:
        """Return the decisions."""
        _check(first, end, len(self.trace.decisions))
        return _encode([(step, self.names.labelled(values)) for step, values in self.trace.decisions[first:end]])

    def details(self, chunk: int) -> bytes:
        """Return the contents of the messages in a chunk."""
        first = chunk * DETAILS
        count = len(self.trace.messages.t)
        if chunk < 0 or first >= max(count, 1):
            raise BadRequestError(f"chunk {chunk} of details does not exist")
        return _encode([self.detail(message) for message in range(first, min(first + DETAILS, count))])

    def search(self, query: str, first: int, end: int, within_s: float = SEARCH_S) -> bytes:
        """Return the messages from `first` with the text `query`, in any case, and the message where the search ended.

        The text can be in the words, the names, the type, or the content. Equal messages are searched once.
        """
        _check(first, end, len(self.trace.messages.t), most=end)
        if query != self._searched:
            self._searched, self._found = query, {}
        deadline = time.monotonic() + within_s
        hits: list[int] = []
        while first < end:
            following = min(first + _SEARCHED_AT_ONCE, end)
            hits += self._hits(query.lower(), first, following)
            first = following
            if time.monotonic() > deadline:
                break
        return _encode({"hits": hits, "to": first})

    def _hits(self, query: str, first: int, end: int) -> Iterator[int]:
        of, found, packed = self.trace.messages, self._found, self.trace.packed_content
        columns = (column[first:end] for column in (of.run, of.sender, of.receiver, of.kind))
        for message, said in enumerate(zip(*columns, map(packed, range(first, end)), strict=True), first):
            hit = found.get(said)
            if hit is None:
                if len(found) >= _MOST_SEARCHED:
                    found.clear()
                hit = found[said] = query in self._searched_text(message)
            if hit:
                yield message

    def _searched_text(self, message: int) -> str:
        trace, of = self.trace, self.trace.messages
        kind = trace.kinds[of.kind[message]]
        names = f"{trace.robots[of.sender[message]]} {trace.robots[of.receiver[message]]}"
        content = _encode(self.acl_messages.plain(message)).decode()
        act = self.protocols.act_of_type(kind).performative
        return f"{self.words(message)}\n{names}\n{kind} {act}\n{content}".lower()

    def detail(self, message: int) -> dict[str, Any]:
        """Return the content of a message: in fields, in words, and as FIPA ACL."""
        acl = self.acl_messages.acl_of(message)
        return {
            "content": self.acl_messages.plain(message),
            "words": self.words(message),
            "acl": text(acl),
            "fields": self.acl_messages.fields(acl),
        }

    def words(self, message: int) -> str:
        """Return a message in words."""
        trace, of = self.trace, self.trace.messages
        run = of.run[message]
        words = self.names.wording(run, trace.robots[of.sender[message]], trace.robots[of.receiver[message]])
        kind = trace.kinds[of.kind[message]]
        return sentence(kind, trace.content(message), words, self.protocols.type_of(message))

    def _kind(self, name: str) -> dict[str, str]:
        act = self.protocols.act_of_type(name)
        return {"name": name, "performative": str(act.performative), "why": act.why}


def _check(first: int, end: int, count: int, most: int = MOST_ROWS) -> None:
    if not 0 <= first <= end <= count:
        raise BadRequestError(f"rows {first} to {end} do not exist; there are {count}")
    if end - first > most:
        raise BadRequestError(f"{end - first} rows are too many for one request; the maximum is {most}")


def _run(run: RunRecord) -> dict[str, Any]:
    return {
        "number": run.number,
        "protocol": run.protocol,
        "epoch": run.epoch,
        "opened_by": run.opened_by,
        "message": run.message,
        "step": run.step,
    }


def _last_notes(notes: Sequence[TraceNote]) -> list[TraceNote]:
    """Return the last notes in order. Frequent notes on improvements do not displace losses and refusals."""
    often = [place for place, note in enumerate(notes) if note.kind in _OFTEN]
    seldom = [place for place, note in enumerate(notes) if note.kind not in _OFTEN]
    return [notes[place] for place in sorted([*often[-MOST_NOTES:], *seldom[-MOST_NOTES:]])]


def _note_of(note: TraceNote) -> dict[str, Any]:
    return {"t": note.t, "step": note.step, "kind": note.kind, "robot": note.robot, "text": note.text}


def verdict_of(trace: Trace) -> str:
    """Return the result of the run in words, or of each epoch if there are several."""
    outcome = trace.outcome
    if outcome is None:
        return "The run ended without an outcome." if trace.over else "The run continues."
    last = _ending(trace, outcome)
    return f"{_epochs(outcome.epochs)} The last: {last}" if len(outcome.epochs) > 1 else last


def _ending(trace: Trace, outcome: Outcome) -> str:
    reason = f": {outcome.reason}" if outcome.reason else ""
    out = f"; lost: {_cut(outcome.lost)}" if outcome.lost else ""
    if outcome.withdrawn_alive:
        witness = f", as {outcome.ruled_out}" if outcome.ruled_out else ""
        headline = describe_outcome(outcome, len(trace.robots))
        why = f": no solution for all{witness}" if outcome.deadline is None else ", by the deadline"
        return f"{headline}{why}; withdrawn: {_cut(outcome.withdrawn_alive)}{out}."
    said = _verdict_words(outcome.verdict)
    cost = f", of cost {cost_shown(outcome.cost)}" if outcome.cost else ""
    return f"{said[0].upper()}{said[1:]}{cost}{_by(outcome)}{reason}{out}."


def _verdict_words(verdict: Verdict) -> str:
    match verdict:
        case Verdict.SOLUTION:
            return "a solution"
        case Verdict.OPTIMAL:
            return "the best solution"
        case Verdict.NO_SOLUTION:
            return "no solution"
        case Verdict.UNKNOWN:
            return "no verdict"
        case never:
            assert_never(never)


def _by(outcome: Outcome) -> str:
    """Return the robot that concluded alone, in words. The reason names a robot that gave up, so it is not repeated."""
    if outcome.witness is None or outcome.verdict == Verdict.UNKNOWN:
        return ""
    return f", as {outcome.ruled_out if outcome.verdict == Verdict.NO_SOLUTION else f'{outcome.witness} has concluded'}"


def _epochs(epochs: Sequence[EpochOutcome]) -> str:
    """Return the number of epochs and the results of the first ones, in words."""
    ends = [
        f"{_cut(epoch.lost, 3)} lost" if epoch.lost else _verdict_words(epoch.verdict) for epoch in epochs[:MOST_EPOCHS]
    ]
    more = len(epochs) - len(ends)
    return f"{len(epochs):,} epochs: {', '.join(ends)}{f' and {more:,} more' if more else ''}."


def _cut(names: Sequence[str], most: int = 8) -> str:
    shown = sorted(names, key=natural_key)
    more = f" and {len(shown) - most} more" if len(shown) > most else ""
    return ", ".join(shown[:most]) + more
