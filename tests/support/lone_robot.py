"""One robot, RB, between a parent RA and a child RC; a script says what it is told."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import cast

from robochoc.authority.identity import Identity
from robochoc.communication.network.control_messages import (
    ControlMessage,
    Leave,
    Register,
    Task,
    Welcome,
)
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item, PresenceChanged, WakeUp
from robochoc.communication.network.members import Members
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.transport import Transport
from robochoc.formats import PREDEFINED
from robochoc.model.message import encode
from robochoc.model.problem import Constraint, Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.messages.abt import Ok
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.in_memory_network import RUN, ScriptedTransport
from tests.support.problems import team_of

UNPROVEN = cast("Identity", None)
PATIENCE_S = 5.0
LEAVE = Leave("over", failed=False)


def chain_of_three() -> Team:
    pairs = [("A", "B"), ("B", "C")]
    return team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("C", PREDEFINED["ne"], pair, pair) for pair in pairs])


def task(protocol: type[Protocol] = ABT, epoch: int = 1) -> Task:
    members = Members()
    for robot in chain_of_three().robots:
        members.register(robot.name, profile_of(robot), "incarnation")
    return members.tasks(epoch, protocol.__name__, protocol.traits, DEFAULT_PARAMETERS)["RB"]


def ok(value: int) -> bytes:
    return encode(Ok((value,)))


Script = Callable[[ScriptedTransport, ControlMessage], Iterable[ControlMessage | Item]]


def played(
    script: Script, protocol: type[Protocol] = ABT, patience_s: float = PATIENCE_S
) -> tuple[Ending, ScriptedTransport]:
    """How RB fares when all its words to the master are answered by `script`; it is welcomed, as a rule."""

    def answers(word: ControlMessage) -> Iterator[Item]:
        if isinstance(word, Register) and len(transport.heard) == 1:
            yield transport.frame(Welcome(word.incarnation, RUN, (), observed=False, private=False))
        for said in script(transport, word):
            yield (
                said
                if isinstance(said, FrameArrived | FramesLost | PresenceChanged | WakeUp)
                else transport.frame(said)
            )

    def named(name: str) -> type[Protocol]:
        if name != protocol.__name__:
            raise LookupError(f"no protocol {name!r}")
        return protocol

    transport = ScriptedTransport("RB", answers)
    robot = NetworkRobot(
        CompiledRobot(chain_of_three()["RB"]), UNPROVEN, cast("Transport", transport), named, RobotSettings(patience_s)
    )
    return robot.run(), transport
