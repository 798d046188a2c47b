"""Tools for tests of protocols: protocol objects without a runtime, schedules of messages, and checks.

>>> import robochoc
>>> from robochoc.protocols.satisfaction.abt import ABT
>>> from robochoc.testing import deliver, protocol_objects, start
>>> model = robochoc.Model()
>>> x = [model.robot(f"r{i}").variable("x", range(2)) for i in range(2)]
>>> rule = model.add(x[0] != x[1])
>>> robots = protocol_objects(model.team, ABT)
>>> start(robots)
>>> [(sender, receiver, type(message).__name__) for sender, receiver, message in deliver(robots)]
[('r0', 'r1', 'Ok')]
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from robochoc.verification.checker import violations

__all__ = [
    "Concurrent",
    "RandomChannels",
    "Schedule",
    "Simulation",
    "agent_problems",
    "deliver",
    "protocol_objects",
    "start",
    "violations",
]

_Kind = TypeVar("_Kind", bound=Protocol)


def protocol_objects(team: Team, protocol: type[_Kind]) -> dict[str, _Kind]:
    """Return a protocol object for each robot, by name. The protocols are not started yet.

    Args:
        team: The team, in priority order.
        protocol: The class of the protocol. Set its class attribute `settings` for other settings.
    """
    order = PriorityOrder(team.order)
    known = agent_problems(team, shared_scopes=protocol.traits.shared_scopes)
    return {name: protocol(LocalProblem(part), order) for name, part in known.items()}


def start(robots: Mapping[str, Protocol]) -> None:
    """Start all robots. Their first messages are in their outboxes."""
    for robot in robots.values():
        robot.start()


def deliver(robots: Mapping[str, Protocol]) -> list[tuple[str, str, Message]]:
    """Deliver all messages in the outboxes once. The robots' answers stay in the outboxes.

    Returns:
        The delivered messages, each with its sender and receiver.
    """
    sent = [(name, receiver, message) for name, robot in robots.items() for receiver, message in robot.outbox]
    for robot in robots.values():
        robot.outbox.clear()
    for sender, receiver, message in sent:
        robots[receiver].receive(sender, message)
    return sent
