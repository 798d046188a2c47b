"""One protocol object, alone: how it starts, what it sends after a packet, and its value."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import pytest

from robochoc.model.problem import Team
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.cases import cases

P = TypeVar("P", bound=Protocol)


def robot_of(
    protocol: type[P], team: Team, name: str, *chances: float, parameters: RunParameters = DEFAULT_PARAMETERS
) -> P:
    """Return the protocol object of one robot, not yet started, which draws `chances`, and then 0 for ever."""
    traits = protocol.traits
    part = agent_problems(team, parameters, shared_scopes=traits.shared_scopes, tree=traits.tree)[name]
    robot = protocol(LocalProblem(part), PriorityOrder(part.order, part.known.links))
    robot.chance = itertools.chain(chances, itertools.repeat(0.0)).__next__
    return robot


def started(robot: Protocol) -> list[tuple[str, Message]]:
    """Start `robot` and return its first messages."""
    robot.start()
    return sent(robot)


def started_robot(
    protocol: type[P],
    team: Team,
    name: str,
    *packet: tuple[str, Message],
    chances: Sequence[float] = (),
    parameters: RunParameters = DEFAULT_PARAMETERS,
) -> P:
    """Return the same as `robot_of`, started, after it has read `packet` (if any); what it has sent is gone."""
    robot = robot_of(protocol, team, name, *chances, parameters=parameters)
    started(robot)
    if packet:
        replies(robot, *packet)
    return robot


def sent(robot: Protocol) -> list[tuple[str, Message]]:
    """Return the messages in the outbox of `robot`, and empty it."""
    messages = list(robot.outbox)
    robot.outbox.clear()
    return messages


def replies(robot: Protocol, *packet: tuple[str, Message]) -> list[tuple[str, Message]]:
    """Return what `robot` sends after a packet."""
    for sender, message in packet:
        robot.receive(sender, message)
    robot.settle()
    return sent(robot)


def after(robot: P, *packet: tuple[str, Message]) -> P:
    """Return `robot` after it has read `packet`; its messages so far are gone."""
    replies(robot, *packet)
    return robot


def assert_refused(make: Callable[[], Protocol], wrong: Iterable[tuple[str, Message]], match: str) -> None:
    """Check that a new robot raises `ValueError` for each of the packets `wrong`, one message each."""
    with cases() as each:
        for sender, message in wrong:
            with each(message), pytest.raises(ValueError, match=match):
                replies(make(), (sender, message))


def value(robot: Protocol) -> Value | None:
    """Return its value, as others see it."""
    return None if robot.value is None else robot.problem.values[robot.value]
