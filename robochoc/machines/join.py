"""A robot's side of a run: read its file, compile it, prove who it is, register, search."""

from __future__ import annotations

from pathlib import Path

from robochoc.authority.enrolment import EnrolmentFailed, enrol, renew
from robochoc.authority.identity import BadIdentity, Identity, default_folder
from robochoc.communication.network.post import Post
from robochoc.communication.network.robot import Ending, Manner, NetworkRobot
from robochoc.formats import read_robot
from robochoc.machines.place import Place
from robochoc.machines.speaking import spoken
from robochoc.solver.compile import Compiler

PATIENCE_S = 30.0
"""How long the master may be out of reach."""


def identity_of(name: str, place: Place, folder: Path | None = None, token: str | None = None) -> Identity:
    """The identity of `name` in `folder`: enrolled now, if there is a `token`; renewed, if half of its life is over.

    Raises `BadIdentity`, `BadToken`, `NotTrusted`, `EnrolmentFailed`, `OSError`.
    """
    folder = folder or default_folder(name)
    if token:
        return enrol(place.host, place.enrolment_port, token, folder, name)
    identity = Identity.load(folder)
    if identity.name != name:
        raise BadIdentity(f"{folder} is the identity of {identity.name}, not of {name}; say --identity")
    if not identity.is_due():
        return identity
    try:
        return renew(identity, place.host, place.enrolment_port)
    except EnrolmentFailed:
        return identity  # it is good for a while yet


def join(file: Path, place: Place, identity: Identity, manner: Manner, compiler: Compiler) -> Ending:
    """Be the robot of `file` in one run of the master at `place`. `compiler` compiles its domain.

    Raises `InvalidInput`, `CannotConnect`, and what compiling raises.
    """
    robot = read_robot(file)
    manner.stage("compiling")
    domain = compiler.compile(robot).domain
    manner.stage(f"looking for the master at {place}")
    with Post(str(place), identity, watch=(), patience_s=manner.patience_s) as post:
        return NetworkRobot(robot, domain, identity, post, spoken, manner).run()
