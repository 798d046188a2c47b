"""A robot's side of a run across machines: show its identity, compile its domain, register, search."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from robochoc.authority.enrolment import EnrolmentError, NobodyThereError, enrol, renew
from robochoc.authority.identity import Identity, IdentityError, default_identity_folder
from robochoc.authority.names import check_member_name
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.transport import Transport
from robochoc.formats import check_robot
from robochoc.model.costs import UnboundedCostError, normalized_robot
from robochoc.model.problem import Robot
from robochoc.run.networked.address import Address
from robochoc.run.registry import protocol_or_stage
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.errors import UnsupportedError

PATIENCE_S = 30.0
"""The longest time for which the master may be out of reach, in seconds."""
_TRY_AGAIN_S = 0.5


def identity_of(
    name: str, place: Address, folder: Path | None = None, token: str | None = None, patience_s: float = PATIENCE_S
) -> Identity:
    """Return the identity of a robot. It is enrolled now if there is a token, and renewed if half of its life is over.

    Args:
        name: The robot's name.
        place: The address of the master.
        folder: The folder of the identity (None: the default).
        token: A token with which the robot enrols.
        patience_s: How many seconds to wait, with a token, for a master that does not listen yet.

    Raises:
        InvalidNameError: when the name cannot be a robot's.
        IdentityError: when the folder has no identity, or that of another robot.
        TokenError: when the token is none.
        NotTrustedError: when the master's Authority is not the one that the token is from.
        EnrolmentError: when the robot is not enrolled.
        OSError: when the identity cannot be written.
    """
    check_member_name(name)
    folder = folder or default_identity_folder(name)
    if token:
        return _enrolled(name, place, folder, token, patience_s)
    identity = Identity.load(folder)
    if identity.name != name:
        raise IdentityError(f"{folder} is the identity of {identity.name}, not of {name}; say --identity")
    if not identity.is_due():
        return identity
    try:
        return renew(identity, place.host, place.enrolment_port)
    except EnrolmentError:
        return identity  # it is good for a while yet


def _enrolled(name: str, place: Address, folder: Path, token: str, patience_s: float) -> Identity:
    until = time.monotonic() + patience_s
    while True:
        try:
            return enrol(place.host, place.enrolment_port, token, folder, name, max(patience_s, _TRY_AGAIN_S))
        except NobodyThereError:
            if time.monotonic() + _TRY_AGAIN_S > until:
                raise
            time.sleep(_TRY_AGAIN_S)


def _normalized(robot: Robot) -> Robot:
    """Return `robot` with costs as protocols count them. Raises `UnsupportedError`."""
    try:
        return normalized_robot(robot, robot.costs, {one.name: one.domain for one in robot.variables})
    except UnboundedCostError as error:
        raise UnsupportedError(f"{error}; the domains of other robots are not known across machines") from None


def join(robot: Robot, place: Address, identity: Identity, settings: RobotSettings, compiler: Compiler) -> Ending:
    """Take part as `robot` in one run of a master.

    Args:
        robot: The robot, as its file says.
        place: The address of the master.
        identity: The robot's identity.
        settings: How the robot takes part.
        compiler: Compiles the robot's domain.

    Returns:
        How the run ended for the robot.

    Raises:
        InvalidInputError: when the robot is not valid by itself.
        CannotConnectError: when no master answers.
        UnsupportedError: when nothing bounds the cost of one of its functions.
        CompileError: when its domain cannot be compiled, and the others of `Compiler.compile`.
    """
    check_robot(robot)
    robot = _normalized(robot)
    settings.stage("compiling")
    settings = replace(settings, compiled=lambda shown: compiler.compile(shown).domain)
    own = CompiledRobot(robot, settings.compiled)
    settings.stage(f"looking for the master at {place}")
    with Transport(str(place), identity, watch=(), patience_s=settings.patience_s) as transport:
        return NetworkRobot(own, identity, transport, protocol_or_stage, settings).run()
