"""One protocol object, alone: what it sends after a packet, and its value."""

from __future__ import annotations

from robochoc.model.message import Message, Value
from robochoc.protocols.protocol import Protocol


def replies(robot: Protocol, *packet: tuple[str, Message]) -> list[tuple[str, Message]]:
    """Return what `robot` sends after a packet."""
    for sender, message in packet:
        robot.receive(sender, message)
    robot.settle()
    said = list(robot.outbox)
    robot.outbox.clear()
    return said


def value(robot: Protocol) -> Value | None:
    """Return its value, as others see it."""
    return None if robot.value is None else robot.problem.values[robot.value]
