"""The trace: whatever order events come in, and whatever is missing, causes are right and nothing is made up."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Began, Decided, Received, Refused, Sent, Settled
from robochoc.journal.journal import Header, Journal
from robochoc.run import Options, Runtime, ScheduleName
from robochoc.sniffer.columns import NOT_YET
from robochoc.sniffer.page_data import message_columns, step_columns
from robochoc.sniffer.trace import MOST_COUNTED, MOST_NAMES, Trace, TraceTooLargeError
from tests.support.cases import cases
from tests.support.examples import examples
from tests.support.recorded_journals import record, recorded

HEADER = Header(team="a team", protocol="abt", runtime="simulator", seed=0)
Key = tuple[int, str, int]
"""A message: its run, its sender, and which of that one's it is."""


@dataclass
class Naive:
    """What a trace has to say, computed step by step without columns: by message, its causes."""

    causes: dict[Key, list[Key]] = field(default_factory=dict)
    taken: set[Key] = field(default_factory=set)

    def __init__(self, events: Iterable[AnyEvent]) -> None:
        self.causes, self.taken = {}, set()
        run = -1
        for event in events:
            match event:
                case Began():
                    run += 1
                    said: dict[str, int] = defaultdict(int)
                    channels: dict[tuple[str, str], deque[Key]] = defaultdict(deque)
                    packets: dict[str, list[Key]] = defaultdict(list)
                case Received():
                    key = channels[event.sender, event.receiver].popleft()
                    packets[event.receiver].append(key)
                    self.taken.add(key)
                case Sent():
                    said[event.sender] += 1
                    key = (run, event.sender, said[event.sender])
                    channels[event.sender, event.receiver].append(key)
                    self.causes[key] = list(packets[event.sender])
                case Settled():
                    packets[event.robot].clear()
                case _:
                    pass


def key_of(trace: Trace, message: int) -> Key:
    of = trace.messages
    return of.run[message], trace.robots[of.sender[message]], of.sequence[message]


def causes(trace: Trace) -> dict[Key, list[Key]]:
    return {
        key_of(trace, message): [key_of(trace, cause) for cause in trace.causes(message)]
        for message in range(len(trace.messages.t))
    }


def is_sound(trace: Trace) -> None:
    """What holds of every trace: causes come first, columns fit together."""
    of, steps = trace.messages, trace.steps
    assert len({len(column) for column in of}) == len({len(column) for column in steps}) == 1
    assert list(of.step) == sorted(of.step)
    for message, taken in enumerate(of.taken):
        if taken != NOT_YET:
            assert of.step[message] < taken
            assert message in trace.packet(taken)
            assert steps.robot[taken] == of.receiver[message]
            assert steps.run[taken] == of.run[message] == steps.run[of.step[message]]
        assert message in trace.sent_in(of.step[message])
        assert steps.robot[of.step[message]] == of.sender[message]
        for effect in trace.consequences(message):
            assert message in trace.causes(effect)
    assert len(trace.packets) == sum(taken != NOT_YET for taken in of.taken)


def whole(events: Sequence[AnyEvent]) -> Trace:
    return Trace.of(Journal(HEADER, tuple(events), None))


def test_causes_are_those_of_the_steps_one_by_one() -> None:
    with cases() as each:
        for protocol, schedule in product(("abt", "afc", "adopt", "mgm", "dpop", "awc"), ScheduleName):
            with each((protocol, schedule)):
                journal = recorded(protocol, schedule=schedule)
                trace, naive = Trace.of(journal), Naive(journal.events)
                is_sound(trace)
                assert causes(trace) == naive.causes
                taken = {key_of(trace, one) for one, step in enumerate(trace.messages.taken) if step != NOT_YET}
                assert taken == naive.taken
                assert trace.unseen == 0


def test_processes_too() -> None:
    journal = record(queens3d(3), Options(protocol="abt", runtime=Runtime.PROCESSES, cache=False))
    trace = Trace.of(journal)
    is_sound(trace)
    assert causes(trace) == Naive(journal.events).causes
    assert list(trace.steps.t) == sorted(trace.steps.t)


def test_what_a_message_and_a_step_were_stands_in_their_rows() -> None:
    journal = recorded("abt")
    trace = Trace.of(journal)
    sent = [event for event in journal.events if isinstance(event, Sent)]
    rows = {key_of(trace, message): message for message in range(len(sent))}
    counts: dict[str, int] = defaultdict(int)
    for event in sent:
        counts[event.sender] += 1
        row = rows[0, event.sender, counts[event.sender]]
        of = trace.messages
        assert (of.t[row], of.clock[row], of.bytes[row]) == (event.t, event.clock, event.bytes)
        assert (trace.robots[of.receiver[row]], trace.kinds[of.kind[row]]) == (event.receiver, event.type)
        assert trace.content(row) == event.content
    settled = [(event.robot, event.t, event.clock, event.checks) for event in journal.events if type(event) is Settled]
    steps = trace.steps
    names = [trace.robots[robot] for robot in steps.robot]
    assert sorted(zip(names, steps.t, steps.clock, steps.checks, strict=True)) == sorted(settled)
    decided = [(event.robot, event.assignment) for event in journal.events if isinstance(event, Decided)]
    told = [(trace.robots[steps.robot[step]], taken) for step, taken in trace.decisions]
    for robot in trace.robots:
        assert [taken for name, taken in told if name == robot] == [taken for name, taken in decided if name == robot]


@given(st.integers(0, 1 << 32))
@examples(40)
def test_any_order_that_keeps_each_robots_own_gives_the_same_causes(seed: int) -> None:
    chance = Random(seed)
    events = recorded("abt").events
    queues: dict[str, deque[AnyEvent]] = defaultdict(deque)
    for event in events:
        if isinstance(event, Began):
            continue
        queues[_whose(event)].append(event)
    shuffled: list[AnyEvent] = [event for event in events if isinstance(event, Began)]
    trace = Trace(HEADER)
    while queues:
        robot = chance.choice(sorted(queues))
        bundle = min(chance.choice((1, 1, 5, 1000)), len(queues[robot]))
        shuffled.extend(queues[robot].popleft() for _ in range(bundle))
        if not queues[robot]:
            del queues[robot]
        if chance.random() < 0.1:
            trace.add(shuffled)
            shuffled = []
    trace.add(shuffled)
    trace.end()
    is_sound(trace)
    assert causes(trace) == Naive(events).causes
    assert (trace.unseen, trace.outdated) == (0, False)


def _whose(event: AnyEvent) -> str:
    match event:
        case Sent():
            return event.sender
        case Received():
            return event.receiver
        case _:
            return str(getattr(event, "robot", ""))


@given(st.data())
@examples(60)
def test_a_journal_that_ends_early_is_a_shorter_one(data: st.DataObject) -> None:
    events = recorded("abt").events
    events = events[: data.draw(st.integers(0, len(events)))]
    trace = whole(events)
    is_sound(trace)
    assert causes(trace) == Naive(events).causes
    assert trace.unseen == 0


@given(st.integers(0, 1 << 32), st.floats(0, 0.3))
@examples(40)
def test_a_journal_with_holes_loses_what_is_missing_and_no_more(seed: int, share: float) -> None:
    chance = Random(seed)
    events = [event for event in recorded("abt").events if isinstance(event, Began) or chance.random() >= share]
    trace = whole(events)
    is_sound(trace)
    assert len(trace.messages.t) == sum(isinstance(event, Sent) for event in events)
    received = sum(isinstance(event, Received) for event in events)
    assert len(trace.packets) + trace.unseen <= received
    assert trace.outdated or len(trace.packets) + trace.unseen == received


def sent(sender: str, receiver: str, t: float = 0) -> Sent:
    return Sent(t=t, sender=sender, receiver=receiver, type="Ok", content={"value": [1]}, bytes=5, clock=0)


def taken(sender: str, receiver: str, t: float = 1) -> Received:
    return Received(t=t, sender=sender, receiver=receiver, type="Ok", clock=0)


def settled(robot: str, t: float = 1) -> Settled:
    return Settled(t=t, robot=robot, clock=0, checks=0)


def test_what_an_epoch_did_not_take_in_is_lost_with_it() -> None:
    said: list[AnyEvent] = [sent("a", "b"), sent("a", "b"), settled("a")]
    epoch: list[AnyEvent] = [Began(t=0, protocol="ABT"), *said, taken("a", "b"), settled("b")]
    trace = whole([*epoch, *epoch])
    assert list(trace.messages.taken) == [1, NOT_YET, 3, NOT_YET]
    assert list(trace.messages.sequence) == [1, 2, 1, 2]
    assert [(run.message, run.step) for run in trace.runs] == [(0, 0), (2, 2)]


def test_who_took_in_what_nobody_has_sent_yet_waits_and_so_do_those_it_speaks_to() -> None:
    trace = Trace(HEADER)
    trace.add(
        [Began(t=0, protocol="ABT"), taken("a", "b"), sent("b", "c"), settled("b"), taken("b", "c"), settled("c")]
    )
    assert len(trace.steps.t) == 0
    trace.add([sent("a", "b"), settled("a")])
    assert [trace.robots[robot] for robot in trace.steps.robot] == ["a", "b", "c"]
    assert trace.causes(1) == [0]
    assert list(trace.consequences(0)) == [1]


def test_what_was_given_up_is_not_mistaken_for_what_comes_later() -> None:
    trace = Trace(HEADER)
    trace.add([Began(t=0, protocol="ABT"), taken("a", "b"), settled("b")])
    trace.flush()
    assert (trace.unseen, len(trace.steps.t)) == (1, 1)
    trace.add([sent("a", "b"), sent("a", "b"), settled("a"), taken("a", "b"), settled("b")])
    assert trace.outdated
    assert (trace.unseen, list(trace.messages.taken)) == (0, [NOT_YET, 2])


def test_a_step_that_was_not_seen_to_end_has_ended_with_the_run() -> None:
    trace = whole([Began(t=0, protocol="ABT"), settled("a"), sent("a", "b", 5)])
    assert list(trace.messages.step) == [1]
    assert list(trace.steps.t) == [1, 5]


def test_events_without_a_run_are_taken_in() -> None:
    trace = whole([Refused(t=3, who="x", what="to join", why="no certificate"), sent("a", "b"), settled("a")])
    assert [note.text for note in trace.notes] == ["x was refused to join: no certificate"]
    assert [run.protocol for run in trace.runs] == ["abt"]


def test_counts_that_nobody_has_counted_are_cut() -> None:
    huge = 10**400
    trace = whole([replace_clock(sent("a", "b"), huge), Settled(t=1, robot="a", clock=huge, checks=-huge)])
    assert (trace.steps.clock[0], trace.steps.checks[0]) == (MOST_COUNTED, 0)
    assert (trace.messages.clock[0], trace.messages.bytes[0]) == (MOST_COUNTED, NOT_YET)


def replace_clock(event: Sent, number: int) -> Sent:
    return Sent(
        t=event.t, sender=event.sender, receiver=event.receiver, type="Ok", content={}, bytes=number, clock=number
    )


def test_more_names_than_can_be_told_apart_are_refused() -> None:
    trace = Trace(HEADER)
    trace.add(settled(f"r{number}") for number in range(MOST_NAMES))
    with pytest.raises(TraceTooLargeError, match="65535 robots or types"):
        trace.add([settled("one more")])


def test_contents_of_any_kind_come_back() -> None:
    contents: list[dict[str, Any]] = [
        {"a": {(1, 2): [None, True, 1.5, b"x"]}},
        {},
        {"s": "\N{SNOWMAN}" * 3},
        {"n": 2**63},
    ]
    events = [Sent(t=0, sender="a", receiver="b", type="X", content=one, bytes=1, clock=0) for one in contents]
    large = Sent(t=0, sender="a", receiver="b", type="X", content={"b": bytes(5 << 20)}, bytes=1, clock=0)
    trace = whole([*events, large, *events, settled("a")])
    assert [trace.content(one) for one in range(4)] == contents
    assert trace.content(4) == large.content
    assert [trace.content(one) for one in range(5, 9)] == contents
    endless = Sent(t=0, sender="a", receiver="b", type="X", content={"n": 2**70}, bytes=1, clock=0)
    assert whole([endless, settled("a")]).content(0) == {"n": str(2**70)}


def test_columns_are_little_endian_one_after_the_other() -> None:
    trace = Trace.of(recorded("abt"))
    first, end = 3, 40
    content, rows = message_columns(trace, first, end), end - first
    place = 0
    for name, kind in zip(
        ("t", "clock", "step", "bytes", "sender", "receiver", "kind", "run"),
        ["f8", "f8", "u4", "u4", "u2", "u2", "u2", "u2"],
        strict=True,
    ):
        column = np.frombuffer(content, f"<{kind}", rows, place)
        assert column.tolist() == list(getattr(trace.messages, name)[first:end])
        place += column.nbytes
    assert place == len(content)


def test_steps_travel_with_what_they_took_in() -> None:
    trace = Trace.of(recorded("abt"))
    count = len(trace.steps.t)
    for first, end in ((0, count), (5, 20), (7, 7)):
        content, rows = step_columns(trace, first, end), end - first
        ends = np.frombuffer(content, "<u4", rows, 24 * rows).tolist()
        assert ends == list(trace.steps.packet_end[first:end])
        begin = trace.steps.packet_end[first - 1] if first else 0
        packets = np.frombuffer(content, "<u4", (ends[-1] if ends else begin) - begin, 28 * rows)
        assert packets.tolist() == [one for step in range(first, end) for one in trace.packet(step)]
        assert len(content) == 32 * rows + 4 * len(packets)
        assert np.frombuffer(content, "<u2", rows, len(content) - 2 * rows).tolist() == list(trace.steps.run[first:end])
