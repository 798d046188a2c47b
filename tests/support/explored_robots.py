"""The robots of the runtime of processes, step by step.

The code that runs is that of `QueueRobot`; pipes, queues and descriptors are replaced. A step is one turn of its loop.
Each step is computed once for each state, on a copy of the robot.
"""

# ruff: noqa: SLF001 - the state of the code under test is private
from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from typing import Any, ClassVar, NamedTuple, cast
from unittest import mock

import msgspec

from robochoc.communication.control import EpochReport, FromParent, FromRobot
from robochoc.communication.host import Host
from robochoc.communication.processes import processes, robot_process
from robochoc.communication.processes.queues import Stamped
from robochoc.communication.processes.robot_process import QueueRobot
from robochoc.exploration.state_key import content_key, state_key
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.message import Envelope
from tests.support.explored_master import Output, Pool, Run, Step, start_of

_PARENT = msgspec.msgpack.Decoder(FromParent)


class RobotView(NamedTuple):
    """A state of a robot, as far as properties and other steps depend on it. `held`: messages in its memory."""

    epoch: int
    sent: int
    received: int
    held: int
    is_searching: bool
    is_paused: bool
    is_restless: bool
    is_running: bool
    readers: frozenset[str]
    writers: tuple[str, ...]
    verdict: Verdict | None
    assignment: dict[str, int]


class _Queue:
    """Replaces `QueueReader` and `QueueWriter`: one end of a queue."""

    def __init__(self, fd: str | None = None) -> None:
        self.fd = fd
        self.ended = False
        self.stamped: list[Stamped] = []
        """Messages that wait until the queue is open, or those that arrive."""

    def open(self, fd: str) -> None:
        self.fd = fd

    def put_stamped(self, epoch: int, _clock: int, content: bytes) -> None:
        self.stamped.append(Stamped(epoch, 0, content))

    def flush(self) -> bool:
        if self.fd is not None:
            _Pipe.outputs += [Output("put", self.fd, msgspec.msgpack.encode(one)) for one in self.stamped]
            self.stamped.clear()
        return True

    def get_stamped(self) -> list[Stamped]:
        arrived, self.stamped = self.stamped, []
        return arrived

    def close(self) -> None:
        if self.fd is not None:
            _Pipe.outputs.append(Output("shut", self.fd))


class _Pipe:
    """Replaces `ControlPipe`."""

    outputs: ClassVar[list[Output]] = []
    """The effects of the present step, of all robots."""

    def __init__(self) -> None:
        self.ended = False
        self.arrived: tuple[Output, ...] = ()
        self._fds: list[str] = []

    def fileno(self) -> int:
        return -1

    def send(self, message: FromRobot) -> bool:
        if type(message) is EpochReport:  # the time and memory would differ in each run
            lost = message.metrics.lost_messages
            message = msgspec.structs.replace(message, metrics=Metrics(lost_messages=lost))
        self.outputs.append(Output("report", "", msgspec.msgpack.encode(message)))
        return True

    def orders(self) -> list[FromParent]:
        arrived, self.arrived = self.arrived, ()
        self._fds += [fd for order in arrived for fd in order.ends]
        return [_PARENT.decode(order.content) for order in arrived]

    def take_fd(self) -> str:
        return self._fds.pop(0)


class _Watch:
    """Replaces `DescriptorWatch`: the exploration decides what the robot reads."""

    def __contains__(self, _fd: object) -> bool:
        return False

    def add(self, *_args: object, **_options: object) -> None:
        pass

    remove = watch_writing = add


class Action(NamedTuple):
    """The input of a robot that wakes up: orders, messages of a queue, or (without any) the end of the pipe or queue.

    `queue`: the queue; empty for the control pipe.
    """

    queue: str = ""
    arrived: tuple[Output, ...] = ()


Wake = tuple[Action, ...]
"""The actions of a robot that wakes up. Without actions it has waited in vain."""


class Robots:
    """The states of all robots' processes by number, and their steps. `kind`: the class of the robots.

    Attributes:
        views: What is seen of each state.
    """

    def __init__(self, kind: type[QueueRobot] = QueueRobot) -> None:
        self._kind = kind
        self._robots: list[QueueRobot] = []
        self._numbers: dict[bytes, int] = {}
        self._steps: dict[tuple[int | bytes, Wake], Step] = {}
        self.views: list[RobotView] = []

    def spawn(self, start: bytes) -> Step:
        """Return the first step of a process."""
        return self._known((start, ()), lambda: _spawned(self._kind, start))

    def step(self, state: int, wake: Wake) -> Step:
        """Return the step from `state`."""
        return self._known((state, wake), lambda: _woken(deepcopy(self._robots[state]), wake))

    def _known(self, key: tuple[int | bytes, Wake], compute: Callable[[], QueueRobot]) -> Step:
        known = self._steps.get(key)
        if known is None:
            _Pipe.outputs.clear()
            try:
                robot = compute()
            except Exception as error:  # noqa: BLE001 - a fault that is reported
                known = Step(-1, fault=f"a robot has failed: {type(error).__name__}: {error}")
            else:
                known = Step(self._number(robot), tuple(_Pipe.outputs))
            self._steps[key] = known
        return known

    def _number(self, robot: QueueRobot) -> int:
        key = _robot_key(robot)
        number = self._numbers.setdefault(key, len(self._robots))
        if number == len(self._robots):
            self._robots.append(robot)
            self.views.append(_robot_view(robot))
        return number


def _spawned(kind: type[QueueRobot], content: bytes) -> QueueRobot:
    start = start_of(content)
    host = Host.create(start.protocol, start.part)
    return kind(host, cast("Any", _Pipe()), start.epoch, observed=False, measured=False)


def _woken(robot: QueueRobot, wake: Wake) -> QueueRobot:
    """Run one turn of `QueueRobot.run`."""
    if not wake:
        robot.report_idle()
    packet: list[Envelope] = []
    pipe = cast("_Pipe", robot._link)
    readers = {one.fd: (sender, one) for sender, one in cast("dict[str, Any]", robot._readers).items()}
    for queue, arrived in wake:
        if not queue:
            pipe.arrived, pipe.ended = arrived, not arrived
            robot._read_orders(packet)
            continue
        sender, reader = readers[queue]  # an order in the same turn may have closed it
        reader.ended = not arrived
        reader.stamped += [msgspec.msgpack.decode(one.content, type=Stamped) for one in arrived]
        robot._read(sender, reader, packet)
    robot.receive(packet)
    return robot


_NOT_STATE = frozenset({"_host", "_watch", "_memory_before", "_began", "_patience_s", "_measured"})


def _robot_key(robot: QueueRobot) -> bytes:
    host = robot._host
    assert host is not None
    state = {name: part for name, part in vars(robot).items() if name not in _NOT_STATE}
    return content_key((state_key(host.protocol), host._begun, state))


def _robot_view(robot: QueueRobot) -> RobotView:
    writers = cast("dict[str, _Queue]", robot._writers)
    host = robot._host
    assert host is not None
    return RobotView(
        robot.epoch,
        robot._sent,
        robot._received,
        len(robot._early) + sum(one.epoch == robot.epoch for writer in writers.values() for one in writer.stamped),
        robot._searching,
        robot._paused,
        robot.is_restless,
        robot._running,
        frozenset(cast("_Queue", one).fd or "" for one in robot._readers.values()),
        tuple(writer.fd for writer in writers.values() if writer.fd is not None),
        host.protocol.verdict,
        host.protocol.assignment,
    )


@contextmanager
def without_system() -> Iterator[None]:
    """Replace processes, pipes, descriptors and the clock. Programs of a `Master` must run inside."""
    with ExitStack() as stack:
        for module, name, stand_in in (
            (processes, "ProcessPool", lambda _method: Pool(Run.script)),
            (processes, "ProcessesRun", Run),
            (time, "monotonic", lambda: Run.script.now),
            (robot_process, "QueueReader", _Queue),
            (robot_process, "QueueWriter", _Queue),
            (robot_process, "DescriptorWatch", _Watch),
            (robot_process, "resident_memory", lambda: 0),
        ):
            stack.enter_context(mock.patch.object(module, name, stand_in))
        yield
