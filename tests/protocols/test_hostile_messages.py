"""Messages that cannot be, from a neighbour that says anything: a robot refuses them in one way, whatever its protocol.

Each type of message of each registered protocol is sent once spoilt in every way that `spoilt` knows: values that are
too short, too long or not in the domain, robots that there are not, tables and costs of other sizes and signs.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from itertools import combinations
from random import Random
from typing import Any

import msgspec
import pytest

from robochoc.communication.host import BadMessageError, Host
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.search_result import RobotsLostError
from robochoc.model.problem import Constraint, Team
from robochoc.protocols.message import Envelope, Message, Value
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import AgentProblem, agent_problems
from robochoc.solver.errors import TooLargeError
from tests.support.allocation_problems import random_allocation
from tests.support.cases import cases, looped
from tests.support.problems import team_of
from tests.support.small_teams import DIFFERENT

TRIANGLE = [Constraint("C", DIFFERENT, pair, pair) for pair in combinations("ABC", 2)]
TEAMS = [team_of(dict.fromkeys("ABC", values), TRIANGLE) for values in ((1, 2, 3), (1, 2))]
"""With a solution, and without one."""
Parts = Mapping[str, AgentProblem]
MOST = 120
"""Messages in a run."""
SPOILT = {1, 4}
"""Which messages of each type are spoilt, counted from one."""


def spoilt(field: Any) -> Iterator[object]:  # noqa: ANN401 - whatever msgpack holds
    """Yield what may stand in the place of `field`, one change at a time."""
    match field:
        case bool():
            yield not field
        case int():
            yield from {99, -1, 2**40} - {field}
        case float():
            yield -1.0
        case str():
            yield "Nobody"
        case bytes():
            yield from (field[1:], field + field + b"x")
        case list():
            yield from ([], field + field if field else [1])
            for place, part in enumerate(field[:3]):
                yield from ([*field[:place], other, *field[place + 1 :]] for other in spoilt(part))
        case dict():
            yield {}
            for key, part in list(field.items())[:2]:
                yield {"Nobody" if name == key else name: value for name, value in field.items()}
                yield from ({**field, key: other} for other in spoilt(part))
        case _:
            yield 1


def versions(content: bytes) -> Iterator[bytes]:
    """Yield a message's content with one of its fields spoilt."""
    tag, *fields = msgspec.msgpack.decode(content)
    for place, field in enumerate(fields):
        for other in spoilt(field):
            yield msgspec.msgpack.encode([tag, *fields[:place], other, *fields[place + 1 :]])


def parts_of(protocol: type[Protocol], team: Team) -> Parts:
    return agent_problems(team, shared_scopes=protocol.traits.shared_scopes, tree=protocol.traits.tree)


def run(protocol: type[Protocol], parts: Parts, number: int = -1, content: bytes = b"") -> list[Envelope]:
    """Return the messages of a run, one by one; the one of this `number` has another `content`."""
    hosts = {name: Host.create(protocol, part) for name, part in parts.items()}
    waiting = deque(envelope for host in hosts.values() for envelope in host.start())
    taken: list[Envelope] = []
    while waiting and len(taken) < MOST:
        envelope = waiting.popleft()
        if len(taken) == number:
            envelope = msgspec.structs.replace(envelope, content=content)
        taken.append(envelope)
        if envelope.receiver in hosts:  # runtimes refuse others
            waiting.extend(hosts[envelope.receiver].handle([envelope]))
    return taken


def spoilt_messages(protocol: type[Protocol], parts: Parts) -> Iterator[tuple[int, bytes]]:
    """Yield the numbers of messages that are to be spoilt, with what stands in their place."""
    seen: Counter[str] = Counter()
    for number, envelope in enumerate(run(protocol, parts)):
        kind = msgspec.msgpack.decode(envelope.content)[0]
        seen[kind] += 1
        if seen[kind] in SPOILT:
            yield from ((number, content) for content in versions(envelope.content))


LONG = {"kopt", "mgm2", "p32-dpop"}
SHORT = {name for name in protocol_names() if not protocol_named(name).traits.lacks} - LONG


@pytest.mark.usefixtures("quick_encryption")
@pytest.mark.parametrize("names", [SHORT, pytest.param(LONG, marks=pytest.mark.slow)], ids=["short", "long"])
def test_a_message_that_cannot_be_is_refused_or_harmless(names: set[str]) -> None:
    with cases() as each:
        for name in sorted(names):
            with each(name):
                assert refusals(protocol_named(name))


def refusals(protocol: type[Protocol]) -> int:
    """Run the protocol with each spoilt message in turn; return how many were refused."""
    refused = 0
    allocations = (random_allocation(Random(seed), simple=True).team for seed in range(3))
    for team in allocations if protocol.traits.allocates else TEAMS:
        parts = parts_of(protocol, team)
        for number, content in spoilt_messages(protocol, parts):
            try:
                run(protocol, parts, number, content)
            except BadMessageError as bad:
                refused += "cannot be used" in str(bad)
            except TooLargeError:  # it believes a size, and says so
                continue
    return refused


BAD_VALUES: dict[Value, str] = {
    (): "ValueError: a value of RA has 1 parts, not 0",
    (99,): "ValueError: A of RA cannot be 99",
    (2**62,): "ValueError: A of RA cannot be 4611686018427387904",
}


@looped("value", BAD_VALUES)
@looped("name", ["abt", "afc", "awc", "syncbb"])
def test_the_reason_says_whose_value_it_is(name: str, value: Value) -> None:
    """Also where it is found out later than the message has come, or from what another robot passes on."""
    protocol = protocol_named(name)
    parts = parts_of(protocol, TEAMS[0])
    first = run(protocol, parts)[0]
    tag, field, *rest = msgspec.msgpack.decode(first.content)
    told = {"Ok": value, "CPA": [value], "Path": [[value, 0]]}[tag]
    assert field == {"Ok": [1], "CPA": [[1]], "Path": [[[1], 0]]}[tag]
    with pytest.raises(BadMessageError) as bad:
        run(protocol, parts, 0, msgspec.msgpack.encode([tag, told, *rest]))
    assert BAD_VALUES[value] in str(bad.value)
    assert "that cannot be used" in str(bad.value)


class Liar(ABT):
    """The first robot tells a value without parts."""

    def send(self, receiver: str, message: Message) -> None:
        super().send(receiver, Ok(()) if self.problem.agent == "RA" else message)


def test_a_run_ends_with_one_sentence() -> None:
    with pytest.raises(RobotsLostError) as lost:
        ProcessesRun(TEAMS[0], Liar).run()
    said = str(lost.value)
    why = r"BadMessageError: (RB|RC) has received messages that cannot be used: ValueError: a value of RA has 1 parts"
    assert re.search(why, said)
    assert "shared_constraint.py:" in said
    assert "\n" not in said
