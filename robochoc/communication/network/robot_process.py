"""A robot's process for `--runtime network`. It is separate from `local.py`, as the fork server imports no master."""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import multiprocessing.forkserver
import os
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import wait
from typing import NamedTuple

from robochoc.authority.identity import Identity, IdentityTexts
from robochoc.communication.network.following import follow
from robochoc.communication.network.masters import Masters
from robochoc.communication.network.robot import NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.robot_votes import RobotVotes
from robochoc.communication.network.transport import CannotConnectError, Transport
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.system.plain_text import on_one_line
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned

START_S = 60.0
"""The longest wait for robots to connect, in seconds."""
_LOWEST_NICE = 19
_PR_SET_NAME = 15


class NetworkRobotStart(NamedTuple):
    """The arguments with which a robot's process starts."""

    own: CompiledRobot
    identity: IdentityTexts
    endpoint: str
    protocols: Callable[[str], type[Protocol]]
    """Returns the protocol of a phase, by its name."""
    patience_s: float
    lease_ms: int
    standbys: tuple[str, ...] = ()
    """The endpoints of standby masters, by priority."""


def only_protocol(protocol: type[Protocol], _name: str) -> type[Protocol]:
    """Return `protocol`, for robots whose search has one phase (with `partial`: processes receive no lambda)."""
    return protocol


def network_robot_process(given: NetworkRobotStart) -> None:
    """Run one robot in this process. Ctrl-C reaches the whole process group, and is handled by the parent."""
    end_with_the_parent()
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)
        libc.prctl(_PR_SET_NAME, given.own.robot.name.encode())
    identity = Identity.from_texts(given.identity)

    def set_niceness(rank: int, size: int) -> None:
        """Let the scheduler prefer robots that come earlier in the order, like `processes/robot_process.py`."""
        wanted = _LOWEST_NICE * rank // size
        os.setpriority(os.PRIO_PROCESS, 0, max(wanted, os.getpriority(os.PRIO_PROCESS, 0)))

    try:
        if given.standbys:
            _follow(given, identity, set_niceness)
            return
        with Transport(given.endpoint, identity, watch=(), patience_s=START_S, lease_ms=given.lease_ms) as transport:
            settings = RobotSettings(given.patience_s, set_rank=set_niceness)
            NetworkRobot(given.own, identity, transport, given.protocols, settings).run()
    except CannotConnectError as error:
        sys.exit(str(error))


def _follow(given: NetworkRobotStart, identity: Identity, set_niceness: Callable[[int, int], None]) -> None:
    """Follow the master that leads. The votes are only in memory, since the process is not restarted."""
    name, log = given.own.robot.name, logging.getLogger("robochoc")
    settings = RobotSettings(
        given.patience_s,
        set_rank=set_niceness,
        lost_master=lambda place, why: log.warning("%s: left the master at %s: %s", name, place, on_one_line(why)),
    )
    masters = Masters((given.endpoint, *given.standbys), given.patience_s)
    follow(given.own, identity, masters, RobotVotes(several=True), settings, given.protocols)


def end_with_the_parent() -> None:
    """Leave Ctrl-C to the parent of this process of the fork server, and end this process if the parent ends."""
    leave_ctrl_c_to_the_parent()
    _end_with_the_fork_server()
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_fork_server() -> None:
    """Let the kernel kill this process when the fork server ends, which it does when the parent is gone.

    Otherwise the fork server would wait for its children, each of which inherits an end of its pipe to the parent. A
    stopped fork server (SIGSTOP) would not notice that the parent is gone.
    """
    signal_when_orphaned(signal.SIGKILL)
    alive = getattr(multiprocessing.forkserver, "_forkserver", None)
    descriptor = getattr(alive, "_forkserver_alive_fd", None)
    if descriptor is not None:
        os.close(descriptor)
        setattr(alive, "_forkserver_alive_fd", None)  # noqa: B010 - a private attribute


def _end_with_the_parent() -> None:
    """End with the parent even if the fork server is blocked."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
