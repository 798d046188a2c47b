"""A robot that follows the leading master: if the master is gone, it registers with the next one that leads."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from robochoc.authority.identity import Identity
from robochoc.communication.network.masters import Masters
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.robot_votes import RobotVotes
from robochoc.communication.network.transport import CannotConnectError, Transport
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot


def follow(
    own: CompiledRobot,
    identity: Identity,
    masters: Masters,
    votes: RobotVotes,
    settings: RobotSettings,
    protocol_named: Callable[[str], type[Protocol]],
) -> Ending:
    """Participate in one run, as the robot `own`. Return the end of the run, as seen by the robot.

    Args:
        own: The compiled robot.
        identity: The robot's identity.
        masters: The masters that the robot knows.
        votes: The robot's votes for masters.
        settings: The settings of the robot.
        protocol_named: Finds the protocol that a master requests; raises `LookupError`.

    Raises:
        CannotConnectError: if no master answers.
    """
    while True:
        place = masters.current
        settings.stage(f"searching for the master at {place}")
        try:
            transport = Transport(place, identity, watch=(), patience_s=masters.attempt_s)
        except CannotConnectError:
            if not masters.several:
                raise
        else:
            with ExitStack() as closing:
                closing.callback(transport.close)
                ending = NetworkRobot(own, identity, transport, protocol_named, settings, votes, masters).run()
                if not ending.elsewhere:
                    return ending
                closing.pop_all()
            transport.abandon()
            settings.lost_master(place, ending.why)
        masters.leave()
        if masters.is_over:
            raise CannotConnectError(masters.failure)
