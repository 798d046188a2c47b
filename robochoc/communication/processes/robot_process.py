"""A robot's own process: its host, its queues to other robots, and its control pipe to the parent.

One loop waits for whatever comes: messages, the parent's orders, room in a pipe that was full, the parent's end.
All messages that wait when it wakes up are one packet. It ends when it is told to, and at once when the parent is
gone, however it went.
"""

from __future__ import annotations

import array
import ctypes
import multiprocessing
import os
import selectors
import signal
import socket
import struct
import sys
import time
import traceback
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, assert_never

import msgspec

from robochoc.communication.control import (
    QUEUES_AT_ONCE,
    Begin,
    Change,
    Conclusion,
    Counters,
    Events,
    Failed,
    FromParent,
    FromRobot,
    OpenQueues,
    Pause,
    QueueFrom,
    QueuesTo,
    Ready,
    Report,
    Wave,
    unsealed,
)
from robochoc.communication.host import Host
from robochoc.communication.processes.queues import LARGEST_BODY, READ_BYTES, QueueReader, QueueWriter, unpack
from robochoc.communication.resources import own_memory
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import TooLargeError, UnsupportedError

IDLE_S = 0.002
"""A robot that has heard nothing for so long reports its counters. Only when to ask; never whether it is over."""
LOWEST_NICE = 19
EVENTS_AT_ONCE = 500
BUNDLE_BYTES = LARGEST_BODY // 4
"""A bundle of events is closed once it tells of messages of so many bytes together."""
_STAMP = struct.Struct("!IQ")
_ROOM_FOR_FDS = socket.CMSG_SPACE(QUEUES_AT_ONCE * array.array("i").itemsize)
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15
_libc = ctypes.CDLL(None)
"""Loaded before the fork: once for all robots."""


class Beginning(NamedTuple):
    """With what a robot begins: its part of the problem, the protocol, the epoch, and whether it is observed."""

    part: AgentProblem
    protocol: type[Protocol]
    epoch: int
    observed: bool


def robot_process(begin: Beginning, control: socket.socket, inherited: Sequence[socket.socket]) -> None:
    """What a robot's process runs, from its first breath to its last.

    `inherited` are the parent's ends of control pipes that a fork copied: closed here, so that the others see the
    end of the parent. Ctrl-C reaches the whole process group, and is left to the parent.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    _end_with_the_parent()
    for copy in inherited:
        copy.close()
    _be_called(begin.part.robot.name)
    _take_place(begin.part.robot.name, begin.part.order)
    link = _ControlPipe(control)
    try:
        host = Host.of(begin.protocol, begin.part)
        _RobotLoop(host, link, begin.epoch, observed=begin.observed).run()
    except UnsupportedError as refusal:
        link.say(Failed(str(refusal), unsupported=True, elsewhere=isinstance(refusal, TooLargeError)))
    except Exception as error:  # noqa: BLE001 - whatever it was, the parent has to know
        where = traceback.extract_tb(error.__traceback__)[-1]
        link.say(Failed(f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"))
    link.finish()


def _end_with_the_parent() -> None:
    """Have the kernel kill this process when the parent dies (Linux).

    A robot that waits sees its control pipe end; one that computes, or that got no turn on a busy machine, would
    see it late. Strictly, it is the parent's thread that counts: the one that runs the team, and waits for its end.
    """
    if sys.platform == "linux":
        _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _be_called(name: str) -> None:
    """Bear the robot's name (its first 15 letters) in lists of processes (Linux)."""
    if sys.platform == "linux":
        _libc.prctl(_PR_SET_NAME, name.encode())


def _take_place(name: str, order: Sequence[str]) -> None:
    """Let the scheduler favour robots that come earlier in the priority order: `nice` from 0 to `LOWEST_NICE`.

    What a robot decides on the basis of an old view is work for nothing, for all below it. On two cores 121 robots
    need a tenth of the messages this way (docs/explanation/design.md, "Processes").
    """
    os.nice(LOWEST_NICE * order.index(name) // len(order))


class _ControlPipe:
    """The robot's end of its control pipe: orders, with the queues' ends that come with them, and answers."""

    def __init__(self, control: socket.socket) -> None:
        self._socket = control
        self._writer = QueueWriter(control.fileno())
        self._buffer = bytearray()
        self._fds: deque[int] = deque()
        self._encode = msgspec.msgpack.Encoder().encode
        self._decoder = msgspec.msgpack.Decoder(FromParent)
        self.ended = False

    def fileno(self) -> int:
        return self._socket.fileno()

    def say(self, word: FromRobot) -> bool:
        """Send `word`; False when a part of it has to wait until the pipe is writable."""
        self._writer.put(self._encode(word))
        return self._writer.flush()

    def flush(self) -> bool:
        """Go on with what had to wait; False when something still has to."""
        return self._writer.flush()

    def orders(self) -> list[FromParent]:
        """All orders that have come. `ended` tells afterwards whether the parent is gone."""
        try:
            chunk, ancillary, flags, _ = self._socket.recvmsg(READ_BYTES, _ROOM_FOR_FDS)
        except BlockingIOError:
            return []
        except ConnectionResetError:
            chunk, ancillary, flags = b"", [], 0
        if flags & socket.MSG_CTRUNC:
            name = multiprocessing.current_process().name
            raise UnsupportedError(
                f"{name} needs more open files than the system allows (raise the limit, see 'ulimit -n')"
            )
        for _, _, data in ancillary:
            fds = array.array("i")
            fds.frombytes(data[: len(data) - len(data) % fds.itemsize])
            self._fds.extend(fds)
        self.ended = not chunk
        self._buffer += chunk
        return [self._decoder.decode(body) for body in unpack(self._buffer)]

    def take_fd(self) -> int:
        """The queue's end that came with the order in hand."""
        return self._fds.popleft()

    def finish(self) -> None:
        """Send what still waits, and close."""
        os.set_blocking(self.fileno(), True)
        self._writer.flush()
        self._socket.close()


class _RobotLoop:
    """The loop of one robot's process.

    Every message is stamped with its epoch. What comes from an epoch that is over is lost; what comes before this
    robot has been told to begin waits.
    """

    def __init__(self, host: Host, link: _ControlPipe, epoch: int, *, observed: bool) -> None:
        self._host = host
        self._link = link
        self._epoch = epoch
        self._began = 0.0
        self._events: list[AnyEvent] = []
        if observed:
            host.observe(self._events.append, self._now)
        self._readers: dict[str, QueueReader] = {}
        self._writers: dict[str, QueueWriter] = {}
        self._early: list[Envelope] = []
        self._sent = self._received = 0
        self._told: tuple[int, int] | None = None
        self._searching = self._concluded = self._paused = False
        self._running = True
        self._selector = selectors.DefaultSelector()
        self._selector.register(link, selectors.EVENT_READ, self._hear_parent)
        parent = multiprocessing.parent_process()
        if parent is not None:
            self._selector.register(parent.sentinel, selectors.EVENT_READ, self._parent_gone)

    def run(self) -> None:
        """Confirm, then wait and act until the parent hangs up or is gone."""
        self._say_ready()
        while self._running:
            ready = self._selector.select(self._patience())
            if not ready:
                self._report_idle()
                continue
            packet: list[Envelope] = []
            for key, _ in ready:
                key.data(packet)
            self._take_in(packet)
            if len(self._events) > EVENTS_AT_ONCE:
                self._report_events()

    def _patience(self) -> float | None:
        """Seconds to wait: for ever, once the parent knows the counters."""
        return IDLE_S if self._searching and self._told != (self._sent, self._received) else None

    def _now(self) -> float:
        return time.monotonic() - self._began

    # Messages

    def _take_in(self, packet: list[Envelope]) -> None:
        if not self._searching:
            self._early += packet
        elif packet:
            self._received += len(packet)
            self._send(self._host.handle(packet))

    def _send(self, envelopes: Sequence[Envelope]) -> None:
        touched = {}
        strangers = []
        for envelope in envelopes:
            writer = self._writers.get(envelope.receiver)
            if writer is None:
                writer = self._writers[envelope.receiver] = QueueWriter()
                strangers.append(envelope.receiver)
            writer.put(_STAMP.pack(self._epoch, envelope.clock) + envelope.content)
            touched[envelope.receiver] = writer
        self._sent += len(envelopes)
        for start in range(0, len(strangers), QUEUES_AT_ONCE):
            self._say(OpenQueues(strangers[start : start + QUEUES_AT_ONCE]))
        for writer in touched.values():
            self._flush(writer)
        self._conclude()

    def _conclude(self) -> None:
        verdict = self._host.protocol.verdict
        if verdict is not None and not self._concluded:
            self._concluded = True
            self._say(Conclusion(self._epoch, verdict))

    def _flush(self, writer: QueueWriter) -> None:
        if writer.flush() or writer.fd is None:
            return
        if writer.fd not in self._selector.get_map():
            self._selector.register(writer.fd, selectors.EVENT_WRITE, lambda _packet: self._flush_later(writer))

    def _flush_later(self, writer: QueueWriter) -> None:
        if writer.flush() and writer.fd is not None:
            self._selector.unregister(writer.fd)

    def _read(self, sender: str, reader: QueueReader, packet: list[Envelope]) -> None:
        if self._readers.get(sender) is not reader:
            return  # closed by an order that came in the same moment
        for body in reader.get():
            epoch, clock = _STAMP.unpack_from(body)
            if epoch == self._epoch and not self._paused:
                packet.append(Envelope(sender, self._host.name, body[_STAMP.size :], clock))
        if reader.ended:  # the sender is gone; what that means is for the parent to say
            self._forget(reader)

    # The parent

    def _say(self, word: FromRobot) -> None:
        if not self._link.say(word):
            self._selector.modify(self._link, selectors.EVENT_READ | selectors.EVENT_WRITE, self._hear_parent)

    def _hear_parent(self, _packet: list[Envelope]) -> None:
        if self._link.flush():
            self._selector.modify(self._link, selectors.EVENT_READ, self._hear_parent)
        for order in self._link.orders():
            self._obey(order)
        if self._link.ended:
            self._running = False

    def _parent_gone(self, _packet: list[Envelope]) -> None:
        self._running = False

    def _obey(self, order: FromParent) -> None:
        match order:
            case Begin():
                self._begin(order)
            case QueuesTo(robots):
                for robot in robots:
                    self._writers[robot].open(self._link.take_fd())
                    self._flush(self._writers[robot])
            case QueueFrom(robot):
                self._listen(robot, QueueReader(self._link.take_fd()))
            case Wave(number):
                self._say_counters(number)
            case Pause():
                self._pause()
            case Change():
                self._change(order)
            case never:
                assert_never(never)

    def _begin(self, order: Begin) -> None:
        self._began = order.began
        self._searching = True
        self._told = (-1, -1)
        self._send(self._host.start(lossless=order.lossless))
        early, self._early = self._early, []
        self._take_in(early)

    def _pause(self) -> None:
        """Be silent, and report: what still arrives is lost."""
        self._searching, self._paused = False, True
        self._early = []
        self._report_events()
        metrics = replace(self._host.metrics(), memory=own_memory())
        protocol = self._host.protocol
        self._say(Report(self._epoch, protocol.assignment, metrics, protocol.findings))

    def _change(self, order: Change) -> None:
        """Go over to the next epoch: with a changed problem, and nothing under way."""
        part, void = unsealed(order.change)
        for name in order.gone:
            if name in self._readers:
                self._forget(self._readers[name])
            if name in self._writers:
                self._drop(self._writers.pop(name))
        self._epoch = order.epoch
        self._sent = self._received = 0
        self._early = []
        self._searching = self._concluded = self._paused = False
        self._host.change(part, void)
        self._say_ready()

    def _listen(self, sender: str, reader: QueueReader) -> None:
        self._readers[sender] = reader
        self._selector.register(reader.fd, selectors.EVENT_READ, lambda packet: self._read(sender, reader, packet))

    def _forget(self, reader: QueueReader) -> None:
        """Close a queue's end that somebody wrote to."""
        self._readers = {name: other for name, other in self._readers.items() if other is not reader}
        self._selector.unregister(reader.fd)
        reader.close()

    def _drop(self, writer: QueueWriter) -> None:
        """Close a queue's end that somebody read from."""
        if writer.fd is not None and writer.fd in self._selector.get_map():
            self._selector.unregister(writer.fd)
        writer.close()

    def _say_ready(self) -> None:
        self._conclude()
        self._say(Ready(self._epoch))

    def _report_idle(self) -> None:
        self._report_events()
        self._say_counters(0)

    def _say_counters(self, wave: int) -> None:
        self._told = (self._sent, self._received)
        self._say(Counters(self._epoch, wave, *self._told))

    def _report_events(self) -> None:
        """Those that hold large messages go in bundles that the control pipe takes."""
        events, self._events[:] = list(self._events), []
        size = start = 0
        for place, event in enumerate(events, 1):
            size += event.bytes if isinstance(event, Sent) else 0
            if size >= BUNDLE_BYTES or place == len(events):
                self._say(Events(events[start:place]))
                size, start = 0, place
