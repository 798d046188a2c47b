"""A robot's process: its main function, and the robot, which exchanges messages through queues.

The process ends when the parent orders it, or immediately when the parent is gone for any reason.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import NamedTuple, assert_never

from robochoc.communication.control import (
    QUEUES_AT_ONCE,
    Begin,
    CounterWave,
    EpochChange,
    EpochReport,
    FromParent,
    FromRobot,
    GoOn,
    OpenQueues,
    Pause,
    QueueFrom,
    QueuesTo,
    RobotFailed,
    TakeSnapshot,
    unpack_change,
)
from robochoc.communication.host import Host
from robochoc.communication.processes.control_pipe import ControlPipe
from robochoc.communication.processes.queues import LARGEST_BODY, QueueReader, QueueWriter
from robochoc.communication.resources import own_memory, resident_memory
from robochoc.communication.robot_loop import IDLE_S, RobotLoop
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.solver.local_problem import MIN_TABLE_VALUES
from robochoc.system.signals import leave_ctrl_c_to_the_parent

MOST_IDLE_S = 0.032
"""The longest wait for a message before a robot reports its counters, in seconds.

The wait begins with `IDLE_S` and doubles with each report in a search: if many robots share few cores, each robot waits
for the processor, and early reports are soon outdated.
"""
Action = Callable[[list[Envelope]], None]
"""The reaction to an event on a descriptor. Messages that the action reads are added to the packet."""


class QueueRobot(RobotLoop):
    """Runs the robot of `host` in its own process, with queues to other robots and the control pipe `link`.

    One loop waits for all events: messages, orders from the parent, a full pipe that is writable again, the end of the
    parent. All messages waiting when the loop wakes up form one packet. The robot ends when the pipe ends, or when one
    of the descriptors in `parent` is readable. If `measured`, or if it has grown, the robot reports its private memory.
    Every message is stamped with its epoch; outdated messages are dropped.
    """

    bundle_bytes = LARGEST_BODY // 4

    def __init__(
        self,
        host: Host,
        link: ControlPipe,
        epoch: int,
        *,
        observed: bool,
        bounds: bool = False,
        measured: bool = True,
        parent: Sequence[int] = (),
    ) -> None:
        super().__init__(epoch, observed=observed, bounds=bounds)
        self._name = host.name
        self._measured = measured
        self._memory_before = resident_memory()
        self._link = link
        self._readers: dict[str, QueueReader] = {}
        self._writers: dict[str, QueueWriter] = {}
        self._link_is_full = False
        self._running = True
        self._patience_s = IDLE_S
        self._watch = DescriptorWatch()
        self._watch.add(link.fileno(), self._read_orders)
        for sentinel in parent:
            self._watch.add(sentinel, self._end)
        self.confirm(host)

    def run(self) -> None:
        """Handle events until the parent closes the pipe or is gone."""
        while self._running:
            self.turn(self._watch.wait(self._patience_s if self.is_restless else None))

    def turn(self, actions: Sequence[Action]) -> None:
        """Handle the events that were waiting; without any, report that the robot is idle."""
        if not actions:
            self.report_idle()
            self._patience_s = min(2 * self._patience_s, MOST_IDLE_S)
            return
        packet: list[Envelope] = []
        for act in actions:
            act(packet)
        self.receive(packet)

    # Messages

    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        touched = {}
        unopened = []
        for envelope in envelopes:
            writer = self._writers.get(envelope.receiver)
            if writer is None:
                writer = self._writers[envelope.receiver] = QueueWriter()
                unopened.append(envelope.receiver)
            writer.put_stamped(self.epoch, envelope.clock, envelope.content)
            touched[envelope.receiver] = writer
        for start in range(0, len(unopened), QUEUES_AT_ONCE):
            self._send_to_master(OpenQueues(self.epoch, unopened[start : start + QUEUES_AT_ONCE]))
        for writer in touched.values():
            self._flush(writer)

    def _flush(self, writer: QueueWriter) -> None:
        if writer.flush() or writer.fd is None:
            return
        if writer.fd not in self._watch:
            self._watch.add(writer.fd, lambda _packet: self._flush_later(writer), write=True)

    def _flush_later(self, writer: QueueWriter) -> None:
        if writer.flush() and writer.fd is not None:
            self._watch.remove(writer.fd)

    def _read(self, sender: str, reader: QueueReader, packet: list[Envelope]) -> None:
        if self._readers.get(sender) is not reader:
            return  # an order in the same iteration has closed it
        for epoch, clock, content in reader.get_stamped():
            if epoch == self.epoch:
                envelope = Envelope(sender, self._name, content, clock)
                if self.admit(envelope):
                    packet.append(envelope)
        if reader.ended:  # the sender is gone; the parent reacts to the loss
            self._close_reader(reader)

    # The parent

    def _send_to_master(self, message: FromRobot) -> None:
        if not self._link.send(message) and not self._link_is_full:
            self._link_is_full = True
            self._watch.watch_writing(self._link.fileno(), wanted=True)

    def _read_orders(self, _packet: list[Envelope]) -> None:
        if self._link_is_full and self._link.flush():
            self._link_is_full = False
            self._watch.watch_writing(self._link.fileno(), wanted=False)
        for order in self._link.orders():
            self._obey(order)
        if self._link.ended:
            self._running = False

    def _end(self, _packet: list[Envelope]) -> None:
        self._running = False

    def _obey(self, order: FromParent) -> None:
        match order:
            case Begin(began, lossless):
                self.start(began, lossless=lossless)
            case QueuesTo(robots):
                for robot in robots:
                    self._writers[robot].open(self._link.take_fd())
                    self._flush(self._writers[robot])
            case QueueFrom(robot):
                self._open_reader(robot, QueueReader(self._link.take_fd()))
            case CounterWave(number):
                self.report_counters(number)
            case TakeSnapshot(number):
                self.report_snapshot(number)
            case GoOn():
                self.go_on()
            case Pause():
                self.pause()
            case EpochChange():
                self._change(order)
            case never:
                assert_never(never)

    def _report_end(self) -> None:
        if self._host is not None:
            assignment, findings = self._known_to_master(self._host)
            metrics = self._host.metrics()
            if self._measured or resident_memory() - self._memory_before > GROWTH:
                metrics = replace(metrics, memory=own_memory())
            self._send_to_master(EpochReport(self.epoch, assignment, metrics, findings))

    def _change(self, order: EpochChange) -> None:
        """Start the next epoch, with a changed problem and no messages in transit."""
        part, invalidated = unpack_change(order.change)
        for name in order.gone:
            if name in self._readers:
                self._close_reader(self._readers[name])
            if name in self._writers:
                self._close_writer(self._writers.pop(name))
        # The parent ignores requests for queues that it had not opened before this order.
        self._writers = {name: writer for name, writer in self._writers.items() if writer.fd is not None}
        self.epoch = order.epoch
        self._patience_s = IDLE_S
        self._reset()
        if self._host is not None:
            self._host.change(part, invalidated)
            self.confirm(self._host)

    # Queues

    def _open_reader(self, sender: str, reader: QueueReader) -> None:
        self._readers[sender] = reader
        self._watch.add(reader.fd, lambda packet: self._read(sender, reader, packet))

    def _close_reader(self, reader: QueueReader) -> None:
        self._readers = {name: other for name, other in self._readers.items() if other is not reader}
        self._watch.remove(reader.fd)
        reader.close()

    def _close_writer(self, writer: QueueWriter) -> None:
        if writer.fd is not None and writer.fd in self._watch:
            self._watch.remove(writer.fd)
        writer.close()


class DescriptorWatch:
    """Watches descriptors, each of which has an action.

    It is simpler than `selectors`, because a robot waits after each message, and each robot copies the pages it
    executes.
    """

    def __init__(self) -> None:
        self._actions: dict[int, Action] = {}
        if sys.platform == "linux":
            self._poll = select.epoll()
        else:
            self._poll = select.poll()

    def __contains__(self, fd: int | None) -> bool:
        """Return whether `fd` is watched."""
        return fd in self._actions

    def add(self, fd: int, action: Action, *, write: bool = False) -> None:
        """Watch `fd`, which is not yet watched, for reading, or with `write` for writing."""
        self._poll.register(fd, select.POLLOUT if write else select.POLLIN)
        self._actions[fd] = action

    def watch_writing(self, fd: int, wanted: bool) -> None:  # noqa: FBT001 - the only option
        """Start or stop watching `fd` for writing. It must already be watched for reading."""
        self._poll.modify(fd, select.POLLIN | (select.POLLOUT if wanted else 0))

    def remove(self, fd: int) -> None:
        """Stop watching `fd`, which must still be open."""
        self._poll.unregister(fd)
        del self._actions[fd]

    def wait(self, patience_s: float | None) -> list[Action]:
        """Wait for events and return their actions; empty after `patience_s` seconds (None: wait without limit).

        A closed end counts as readable and writable.
        """
        if sys.platform == "linux":
            ready = self._poll.poll(patience_s, len(self._actions) or 1)
        else:
            ready = self._poll.poll(None if patience_s is None else patience_s * 1000)
        actions = self._actions
        return [actions[fd] for fd, _ in ready]


LOWEST_NICE = 19
MEASURED = 8
"""The maximum number of robots that always measure their memory, spread evenly over the order: it takes 1 ms."""
GROWTH = 1 << 20
"""The other robots measure their memory if it has grown by more than this number of bytes."""
REHEARSED = 32
"""The maximum number of robots in a rehearsal. Python 3.11 specializes a function at its 8th call and later."""
REHEARSAL_S = 0.05
"""The longest rehearsal, in seconds."""
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None
"""Looked up once, before the fork, for all robots."""


class RobotStart(NamedTuple):
    """The arguments with which a robot's process starts.

    Attributes:
        part: The robot's part of the problem.
        protocol: The protocol of the robot.
        epoch: The number of the current epoch.
        observed: True if the robot reports events.
        bounds: True if the events include lower bounds.
    """

    part: AgentProblem
    protocol: type[Protocol]
    epoch: int
    observed: bool
    bounds: bool = False


def rehearse(protocol: type[Protocol], parts: Iterable[AgentProblem]) -> None:
    """Build a few robots in the parent and discard them, before all robots are forked.

    Python specializes bytecode during its first calls. Bytecode specialized before the fork is not copied for each
    robot. Users' protocols are excluded, because their errors must occur in a robot. Large domains are excluded too,
    because they need numpy, which can start threads, and take a long time.
    """
    if not protocol.__module__.startswith("robochoc."):
        return
    until = time.monotonic() + REHEARSAL_S
    with suppress(UnsupportedError):  # a robot will report this error
        for part in islice((part for part in parts if len(part.domain.values) < MIN_TABLE_VALUES), REHEARSED):
            Host.create(protocol, part)
            if time.monotonic() > until:
                break


def robot_process(start: RobotStart, control: socket.socket, parent: Sequence[int] = ()) -> None:
    """Run one robot in this process until the run ends.

    Ctrl-C reaches the whole process group, and is handled by the parent.

    Args:
        start: The robot's arguments.
        control: The robot's end of its control pipe.
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
        import traceback  # noqa: PLC0415 - start-up

        where = traceback.extract_tb(error.__traceback__)[-1]
        link.send(RobotFailed(f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"))
    link.finish()


def served_robot_process(start: RobotStart, control: socket.socket) -> None:
    """Run one robot in a process started by a fork server. The parent process is that server, not our process."""
    import multiprocessing  # noqa: PLC0415 - already imported by the fork server, and needed only here

    parent = multiprocessing.parent_process()
    robot_process(start, control, () if parent is None else (parent.sentinel,))


def _end_with_the_parent() -> None:
    """Let the kernel kill this process when the parent dies (Linux).

    A waiting robot sees the end of its control pipe. A robot that computes, or waits for a busy processor, would notice
    the end late. Strictly, the signal is sent when the parent's thread that runs the team ends.
    """
    if _prctl is not None:
        _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _set_process_name(name: str) -> None:
    """Show the robot's name, shortened to 15 letters, in process lists (Linux)."""
    if _prctl is not None:
        _prctl(_PR_SET_NAME, name.encode())


def _set_niceness(place: int, robots: int) -> None:
    """Let the scheduler prefer robots that come earlier in the priority order: `nice` from 0 to `LOWEST_NICE`.

    Decisions based on an outdated view waste the work of all lower robots. On two cores, this reduces the number of
    messages of 121 robots to a tenth (docs/explanation/design/runtimes.md, "Processes").
    """
    os.nice(LOWEST_NICE * place // robots)
