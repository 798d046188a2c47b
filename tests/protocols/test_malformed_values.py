"""Values that a robot cannot have, from a neighbour that says anything: each is refused by a `ValueError`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import combinations
from typing import get_type_hints

import msgspec
import pytest

from robochoc.model.problem import Constraint
from robochoc.protocols.message import Message, Value
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.shared.cycles import CycleProtocol
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.agents import robot_of
from tests.support.cases import looped
from tests.support.problems import team_of
from tests.support.small_teams import DIFFERENT

TRIANGLE = [Constraint("C", DIFFERENT, pair, pair) for pair in combinations("ABC", 2)]
TEAM = team_of(dict.fromkeys("ABC", (1, 2, 3)), TRIANGLE)
MOST = 200
"""Messages in a run."""
BAD: dict[str, Callable[[Value], Value]] = {
    "short": lambda value: value[1:],
    "long": lambda value: (*value, *value),
    "unknown": lambda _: (99,),
}


FIELDS = {"value": Value, "values": list[Value]}


def with_changed(message: Message, changed: Callable[[Value], Value]) -> Message | None:
    """Return the message with other values of its sender; None if it has none."""
    for name, kind in FIELDS.items():
        if kind == get_type_hints(type(message)).get(name):
            told = getattr(message, name)
            other = changed(told) if name == "value" else [changed(value) for value in told]
            return msgspec.structs.replace(message, **{name: other})
    return None


def after(protocol: type[Protocol], number: int, changed: Callable[[Value], Value]) -> bool:
    """Run until all is said, with the value changed that is told as number `number`; return whether there was one."""
    robots = {name: robot_of(protocol, TEAM, name, 0.3, 0.7, 0.1) for name in TEAM.order}
    waiting: deque[tuple[str, str, Message]] = deque()

    def collect(name: str) -> None:
        waiting.extend((name, receiver, message) for receiver, message in robots[name].outbox)
        robots[name].outbox.clear()

    for name, robot in robots.items():
        robot.start()
        collect(name)
    told = 0
    for _ in range(MOST):
        if not waiting:
            break
        sender, receiver, message = waiting.popleft()
        other = with_changed(message, changed)
        if other is not None:
            message = other if told == number else message
            told += 1
        robots[receiver].receive(sender, message)
        robots[receiver].settle()
        collect(receiver)
    return told > number


CYCLES = tuple(name for name in protocol_names() if issubclass(protocol_named(name), CycleProtocol))


@looped("bad", BAD)
@looped("name", [*CYCLES, "async-maxsum", "bounded-maxsum", "cocoa", "d-gibbs"])
def test_a_value_that_the_sender_cannot_have_is_refused(name: str, bad: str) -> None:
    protocol = protocol_named(name)
    with pytest.raises(ValueError, match=r"has 1 part|cannot be 99"):
        after(protocol, 0, BAD[bad])
    for number in (1, 4, 11):
        try:
            assert not after(protocol, number, BAD[bad])
        except ValueError:
            continue
