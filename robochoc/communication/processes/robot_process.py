"""The main function of a robot's process.

The process ends when the parent orders it, and at once when the parent is gone for any reason.
"""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import sys
import time
import traceback
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import islice
from typing import NamedTuple

from robochoc.communication.control import RobotFailed
from robochoc.communication.host import Host
from robochoc.communication.processes.control_pipe import ControlPipe
from robochoc.communication.processes.queue_robot import QueueRobot
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.solver.local_problem import MIN_TABLE_VALUES
from robochoc.system.signals import leave_ctrl_c_to_the_parent

LOWEST_NICE = 19
MEASURED = 128
"""The most robots of a team that measure their memory, evenly over the order: each measurement takes a millisecond."""
REHEARSED = 32
"""The most robots in a rehearsal. Python 3.11 specializes a function from its 8th call on, and later more of it."""
REHEARSAL_S = 0.05
"""The longest rehearsal, in seconds."""
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None
"""Looked up before the fork: once for all robots."""


class RobotStart(NamedTuple):
    """The arguments with which a robot's process starts.

    Attributes:
        part: The robot's part of the problem.
        protocol: The protocol that it runs.
        epoch: The number of the current epoch.
        observed: Whether it reports events.
        bounds: Whether the events include lower bounds.
    """

    part: AgentProblem
    protocol: type[Protocol]
    epoch: int
    observed: bool
    bounds: bool = False


def rehearse(protocol: type[Protocol], parts: Iterable[AgentProblem]) -> None:
    """Build a few robots in the parent, and discard them, before all are forked.

    Python specializes the bytecode of its first calls. Bytecode that was specialized before the fork is not copied for
    each robot. Users' protocols are excluded: their errors are to occur in a robot. So are large domains: they need
    numpy, which can start threads, and take long.
    """
    if not protocol.__module__.startswith("robochoc."):
        return
    until = time.monotonic() + REHEARSAL_S
    with suppress(UnsupportedError):  # a robot will report it
        for part in islice((part for part in parts if len(part.domain.values) < MIN_TABLE_VALUES), REHEARSED):
            Host.create(protocol, part)
            if time.monotonic() > until:
                break


def robot_process(start: RobotStart, control: socket.socket, parent: Sequence[int] = ()) -> None:
    """Run one robot in this process until the run ends.

    Ctrl-C reaches the whole process group, and is left to the parent.

    Args:
        start: The robot's arguments.
        control: Its end of its control pipe.
        parent: More descriptors that become readable when the parent is gone.
    """
    leave_ctrl_c_to_the_parent()
    _end_with_the_parent()
    name = start.part.robot.name
    _set_process_name(name)
    place, robots = start.part.known.rank[name], len(start.part.order)
    _set_niceness(place, robots)
    link = ControlPipe(name, control)
    try:
        host = Host.create(start.protocol, start.part)
        measured = place % -(-robots // MEASURED) == 0
        observed, bounds = start.observed, start.bounds
        QueueRobot(host, link, start.epoch, observed=observed, bounds=bounds, measured=measured, parent=parent).run()
    except UnsupportedError as refusal:
        link.send(RobotFailed(str(refusal), unsupported=True, elsewhere=isinstance(refusal, TooLargeError)))
    except Exception as error:  # noqa: BLE001 - the parent has to know of any error
        where = traceback.extract_tb(error.__traceback__)[-1]
        link.send(RobotFailed(f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"))
    link.finish()


def served_robot_process(start: RobotStart, control: socket.socket) -> None:
    """Run one robot in a process that a fork server has started: its parent is that server, not ours."""
    import multiprocessing  # noqa: PLC0415 - already imported by the fork server, and needed only here

    parent = multiprocessing.parent_process()
    robot_process(start, control, () if parent is None else (parent.sentinel,))


def _end_with_the_parent() -> None:
    """Have the kernel kill this process when the parent dies (Linux).

    A waiting robot sees the end of its control pipe. A robot that computes, or waits for a busy processor, would see it
    late. Strictly, the signal is sent when the parent's thread that runs the team ends.
    """
    if _prctl is not None:
        _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _set_process_name(name: str) -> None:
    """Show the robot's name (its first 15 letters) in lists of processes (Linux)."""
    if _prctl is not None:
        _prctl(_PR_SET_NAME, name.encode())


def _set_niceness(place: int, robots: int) -> None:
    """Let the scheduler favour robots that come earlier in the priority order: `nice` from 0 to `LOWEST_NICE`.

    Decisions from an outdated view waste the work of all robots below. On two cores this reduces the messages of 121
    robots to a tenth (docs/explanation/design/runtimes.md, "Processes").
    """
    os.nice(LOWEST_NICE * place // robots)
