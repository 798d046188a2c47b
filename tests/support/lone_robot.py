"""One robot, RB, between a parent RA and a child RC; a script says what it is told."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, cast

from robochoc.authority.identity import Identity
from robochoc.communication.control import Counters, Ready
from robochoc.communication.network.control_messages import (
    ControlMessage,
    Joined,
    Leave,
    Register,
    SearchTask,
    StartSearch,
    Welcome,
)
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item, PresenceChanged, WakeUp
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.transport import Transport
from robochoc.formats import PREDEFINED
from robochoc.model.problem import Constraint, Team
from robochoc.protocols.message import encode
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import Ok
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


def task(protocol: type[Protocol] = ABT, epoch: int = 1) -> SearchTask:
    members = NetworkMembers()
    for robot in chain_of_three().robots:
        members.register(robot.name, profile_of(robot), "incarnation")
    return members.tasks(epoch, protocol.__name__, protocol.traits, DEFAULT_PARAMETERS)["RB"]


def ok(value: int) -> bytes:
    return encode(Ok((value,)))


Script = Callable[[ScriptedTransport, ControlMessage], Iterable[ControlMessage | Item]]
Asked = type[ControlMessage] | ControlMessage | Callable[[ControlMessage], bool]
"""A kind of message of the robot, a message, or a condition."""


class From(NamedTuple):
    """A message of another robot."""

    sender: str
    word: ControlMessage


Answers = Sequence[ControlMessage | Item | From]
"""Messages of the master, other items of the robot's inbox, and messages of others."""


def answering(*rows: tuple[Asked, Answers]) -> Script:
    """Return the script in which the first row that a message fits has its answers."""

    def fits(asked: Asked, word: ControlMessage) -> bool:
        if isinstance(asked, type):
            return isinstance(word, asked)
        return asked(word) if callable(asked) else asked == word

    def script(transport: ScriptedTransport, word: ControlMessage) -> Iterator[ControlMessage | Item]:
        answers: Answers = next((answers for asked, answers in rows if fits(asked, word)), ())
        for one in answers:
            yield transport.frame(one.word, one.sender) if isinstance(one, From) else one

    return script


def searching(*answers: ControlMessage | Item | From, taken: int = 1) -> Script:
    """Return the script of a search that is over once RB has taken so many of these messages."""
    begun: Answers = [StartSearch(1), *answers]
    return answering((Joined, [task()]), (Ready, begun), (counted(taken), [LEAVE]))


def counted(received: int, epoch: int = 1) -> Callable[[ControlMessage], bool]:
    """Return whether a message is the robot's report of so many messages received, outside a wave."""
    return lambda word: isinstance(word, Counters) and (word.epoch, word.wave, word.received) == (epoch, 0, received)


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
