"""A robot's side of a run across machines: load its identity, compile its domain, register, search."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from robochoc.authority.enrolment import EnrolmentError, NotReachableError, enrol, renew
from robochoc.authority.identity import Identity, IdentityError, default_identity_folder
from robochoc.authority.names import check_member_name
from robochoc.communication.network.following import follow
from robochoc.communication.network.masters import Masters
from robochoc.communication.network.robot import Ending
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.robot_votes import RobotVotes
from robochoc.formats import check_robot
from robochoc.model.costs import NormalizationError, normalized_robot
from robochoc.model.problem import Robot
from robochoc.run.networked.address import Address
from robochoc.run.registry import protocol_or_stage
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.errors import UnsupportedError

PATIENCE_S = 30.0
"""The longest time for which the master may be unreachable, in seconds."""
_TRY_AGAIN_S = 0.5
VOTES = "votes.json"
"""The file of a robot's votes for masters, in the folder of its identity."""


def identity_of(
    name: str, place: Address, folder: Path | None = None, token: str | None = None, patience_s: float = PATIENCE_S
) -> Identity:
    """Return the identity of a robot. With a token, enrol the robot. Renew an identity after half of its lifetime.

    Args:
        name: The robot's name.
        place: The address of the master.
        folder: The folder of the identity (None: the default).
        token: A token with which the robot enrols.
        patience_s: With a token, the seconds to wait for a master that does not listen yet.

    Raises:
        InvalidNameError: if the name is not a valid robot's name.
        IdentityError: if the folder has no identity, or the identity of another robot.
        TokenError: if the token is invalid.
        NotTrustedError: if the master's Authority has not issued the token.
        EnrolmentError: if the robot is not enrolled.
        OSError: if the identity cannot be written.
    """
    check_member_name(name)
    folder = folder or default_identity_folder(name)
    if token:
        return _enrolled(name, place, folder, token, patience_s)
    identity = Identity.load(folder)
    if identity.name != name:
        raise IdentityError(
            f"{folder} is the identity of {identity.name}, not of {name}; choose another folder by --identity"
        )
    if not identity.is_due():
        return identity
    try:
        return renew(identity, place.host, place.enrolment_port)
    except EnrolmentError:
        return identity  # the old identity is still valid


def _enrolled(name: str, place: Address, folder: Path, token: str, patience_s: float) -> Identity:
    until = time.monotonic() + patience_s
    while True:
        try:
            return enrol(place.host, place.enrolment_port, token, folder, name, max(patience_s, _TRY_AGAIN_S))
        except NotReachableError:
            if time.monotonic() + _TRY_AGAIN_S > until:
                raise
            time.sleep(_TRY_AGAIN_S)


def _normalized(robot: Robot) -> Robot:
    """Return `robot` with costs in the internal units of the protocols. Raises `UnsupportedError`."""
    try:
        return normalized_robot(robot, robot.costs, {one.name: one.domain for one in robot.variables})
    except NormalizationError as error:
        raise UnsupportedError(f"{error}; the domains of other robots are not known across machines") from None


def join(
    robot: Robot, places: Sequence[Address], identity: Identity, settings: RobotSettings, compiler: Compiler
) -> Ending:
    """Participate in one run, as the robot `robot`. If its master is gone, follow the next master that leads.

    Args:
        robot: The robot, as read from its file.
        places: The addresses of the masters, by priority.
        identity: The robot's identity. With several masters, the robot's votes are stored in its folder.
        settings: The settings of the robot.
        compiler: Compiles the robot's domain.

    Returns:
        The end of the run, as seen by the robot.

    Raises:
        InvalidInputError: if the robot is invalid.
        CannotConnectError: if no master answers.
        UnsupportedError: if the cost of one of the robot's functions is unbounded.
        CompileError: if the robot's domain cannot be compiled. The other errors of `Compiler.compile` are raised too.
    """
    check_robot(robot)
    robot = _normalized(robot)
    settings.stage("compiling")
    settings = replace(settings, compiled=lambda shown: compiler.compile(shown).domain)
    own = CompiledRobot(robot, settings.compiled)
    masters = Masters(list(map(str, places)), settings.patience_s)
    votes = RobotVotes(identity.folder / VOTES if masters.several else None, several=masters.several)
    return follow(own, identity, masters, votes, settings, protocol_or_stage)
