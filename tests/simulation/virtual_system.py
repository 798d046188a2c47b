"""An operating system in virtual time: pipes whose content arrives late, and processes that crash, stop and are slow.

The robots' side of the runtime with processes (`QueueRobot`, its queues and orders) runs unchanged on it.
"""

from __future__ import annotations

import heapq
import itertools
import signal
from collections import deque
from collections.abc import Callable, Sequence
from random import Random
from typing import cast

import msgspec

from robochoc.communication.control import FromParent, FromRobot, RobotFailed
from robochoc.communication.host import Host
from robochoc.communication.processes import robot_process
from robochoc.communication.processes.control_pipe import ControlPipe
from robochoc.communication.processes.robot_process import DescriptorWatch, QueueRobot, RobotStart
from robochoc.protocols.message import Envelope
from robochoc.solver.errors import TooLargeError, UnsupportedError
from tests.simulation.clock import VirtualClock

_FROM_PARENT = msgspec.msgpack.Decoder(FromParent)
_ENCODER = msgspec.msgpack.Encoder()
CHECK_S = 1e-6
"""The virtual seconds of a constraint check."""
LARGEST_CONTROL_S = 0.1
"""The longest time that a message between the master and a robot needs: their pipe is on one machine."""


class Pipe:
    """A pipe. What is written arrives in order, after a delay; then `wake` is called.

    `is_held_until` is the time before which nothing arrives, because of a partition.
    """

    def __init__(self, system: VirtualSystem, longest_s: float) -> None:
        self._system = system
        self._longest_s = longest_s
        self._chunks: deque[tuple[float, bytes]] = deque()
        self._last_s = 0.0
        self.wake: Callable[[], None] = lambda: None
        self.held_until = 0.0
        self.has_reader = self.has_writer = True

    def write(self, data: bytes) -> int:
        """Send bytes. Raises `BrokenPipeError` if nobody reads them."""
        if not self.has_reader:
            raise BrokenPipeError
        system = self._system
        arrival = system.clock.now + system.chance.random() * self._longest_s
        self._last_s = max(self._last_s, arrival, self.held_until)
        self._chunks.append((self._last_s, bytes(data)))
        system.at(self._last_s, self._arrive)
        return len(data)

    def _arrive(self) -> None:
        self.wake()  # which is set later

    def end(self) -> None:
        """Close the end for writing. The reader sees this after everything that was written."""
        self.has_writer = False
        self._system.at(max(self._last_s, self._system.clock.now), self._arrive)

    @property
    def is_readable(self) -> bool:
        """True if bytes have arrived, or no more will arrive."""
        if not self._chunks:
            return not self.has_writer
        return self._chunks[0][0] <= self._system.clock.now

    @property
    def is_at_its_end(self) -> bool:
        """True if everything was read, and no more will arrive."""
        return not (self._chunks or self.has_writer)

    def read(self, most: int, *, late: bool = False) -> bytes:
        """Return the bytes that have arrived, with `late` also the others; empty if no more will arrive."""
        found = b""
        while self._chunks and (late or self._chunks[0][0] <= self._system.clock.now) and len(found) < most:
            found += self._chunks.popleft()[1]
        if len(found) > most:
            self._chunks.appendleft((0.0, found[most:]))
            found = found[:most]
        if not found and self.has_writer and not late:
            raise BlockingIOError
        return found


class VirtualSystem:
    """Pipes, processes and the time. Its functions stand in for those of the module `os`.

    Attributes:
        clock: The virtual time.
        chance: The source of all delays.
        running: The process that runs now; None for the master.
    """

    def __init__(self, clock: VirtualClock, seed: int) -> None:
        self.clock = clock
        self.chance = Random(f"system {seed}")
        self.running: VirtualProcess | None = None
        self._events: list[tuple[float, float, int, Callable[[], None]]] = []
        self._count = itertools.count()
        self._pipes: dict[int, Pipe] = {}

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Let something happen at a time; ties are broken at random."""
        heapq.heappush(self._events, (time_s, self.chance.random(), next(self._count), action))

    def run_until(self, time_s: float, done: Callable[[], bool]) -> None:
        """Let the time pass until `time_s`, or until something makes `done` true."""
        while not done() and self._events and self._events[0][0] <= time_s:
            due, _, _, action = heapq.heappop(self._events)
            self.clock.advance_to(due)
            action()
        if not done():
            self.clock.advance_to(time_s)

    # In place of the module `os`

    def open_pipe(self, longest_s: float) -> tuple[int, int]:
        """Return the descriptors of a new pipe, to read and to write."""
        pipe, number = Pipe(self, longest_s), 2 * next(self._count) + 10**6
        self._pipes[number] = self._pipes[number + 1] = pipe
        return number, number + 1

    def pipe_of(self, fd: int) -> Pipe:
        """Return the pipe of a descriptor."""
        return self._pipes[fd]

    def set_blocking(self, fd: int, blocking: bool) -> None:  # noqa: FBT001 - as in `os`
        """Do nothing: no pipe blocks."""

    def read(self, fd: int, most: int) -> bytes:
        """See `os.read`."""
        return self._pipes[fd].read(most)

    def write(self, fd: int, data: bytes) -> int:
        """See `os.write`."""
        return self._pipes[fd].write(data)

    def close(self, fd: int) -> None:
        """See `os.close`."""
        pipe = self._pipes.pop(fd, None)
        if pipe is not None and fd % 2:
            pipe.end()
        elif pipe is not None:
            pipe.has_reader = False


class VirtualWatch(DescriptorWatch):
    """Watches virtual pipes, for the process that is running."""

    def __init__(self, system: VirtualSystem) -> None:
        self._actions = {}
        self._system = system
        self._process = system.running

    def add(self, fd: int, action: robot_process.Action, *, write: bool = False) -> None:  # noqa: ARG002 - all is written at once
        """See `DescriptorWatch.add`."""
        self._actions[fd] = action
        if self._process is not None:
            pipe = self._system.pipe_of(fd)
            pipe.wake = self._process.notify
            if pipe.is_readable:
                self._process.notify()

    def watch_writing(self, fd: int, wanted: bool) -> None:  # noqa: FBT001 - as in the base class
        """See `DescriptorWatch.watch_writing`."""

    def remove(self, fd: int) -> None:
        """See `DescriptorWatch.remove`."""
        del self._actions[fd]

    def wait(self, patience_s: float | None) -> list[robot_process.Action]:  # noqa: ARG002 - it does not wait
        """Return the actions of the pipes with something to read."""
        ready = [fd for fd in self._actions if self._system.pipe_of(fd).is_readable]
        self._system.chance.shuffle(ready)
        return [self._actions[fd] for fd in ready]


class VirtualControlPipe:
    """A robot's end of its control pipe; see `ControlPipe`. Queue ends arrive together with the orders."""

    def __init__(self, system: VirtualSystem) -> None:
        self._system = system
        self._fds: deque[int] = deque()
        self._buffer: deque[tuple[bytes, Sequence[int]]] = deque()
        self.down = system.open_pipe(LARGEST_CONTROL_S)
        self.up = system.open_pipe(LARGEST_CONTROL_S)
        self.ended = False

    def order(self, order: FromParent, fds: Sequence[int]) -> None:
        """Send an order to the robot."""
        self._buffer.append((_ENCODER.encode(order), tuple(fds)))
        self._system.write(self.down[1], b".")

    def fileno(self) -> int:
        """See `ControlPipe.fileno`."""
        return self.down[0]

    def send(self, message: FromRobot) -> bool:
        """See `ControlPipe.send`."""
        body = _ENCODER.encode(message)
        try:
            self._system.write(self.up[1], len(body).to_bytes(4, "big") + body)
        except (BrokenPipeError, KeyError):
            return True
        return True

    def flush(self) -> bool:
        """See `ControlPipe.flush`."""
        return True

    def orders(self) -> list[FromParent]:
        """See `ControlPipe.orders`."""
        marks = self._system.read(self.down[0], 1 << 16)
        self.ended = not marks
        found = [self._buffer.popleft() for _ in marks]
        for _, fds in found:
            self._fds.extend(fds)
        return [_FROM_PARENT.decode(body) for body, _ in found]

    def take_fd(self) -> int:
        """See `ControlPipe.take_fd`."""
        return self._fds.popleft()


class VirtualRobot(QueueRobot):
    """A robot in a virtual process, whose message number `garbled` cannot be decoded."""

    garbled = 0

    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        for place, envelope in enumerate(envelopes):
            self.garbled -= 1
            if self.garbled == 0:
                wrong = msgspec.structs.replace(envelope, content=b"\xc1")
                envelopes = [*envelopes[:place], wrong, *envelopes[place + 1 :]]
        super()._transmit(envelopes)


class VirtualProcess:
    """A process of one robot.

    Attributes:
        exitcode: The exit code as the parent sees it; None while the process has not ended.
        stopped_until: The time until which the process stands still.
        step_s: The seconds that each step lasts besides its checks.
        garbled: The number of the message that cannot be decoded; 0 for none.
    """

    def __init__(self, system: VirtualSystem, start: RobotStart, control: VirtualControlPipe) -> None:
        self.name = start.part.robot.name
        self.exitcode: int | None = None
        self.stopped_until = 0.0
        self.step_s = 0.0
        self.garbled = 0
        self.queues: list[int] = []
        """The ends of queues that are closed at its end."""
        self._system = system
        self._start = start
        self._control = control
        self._robot: VirtualRobot | None = None
        self._is_alive = True
        self._busy_until = 0.0
        self._due: float | None = None
        system.at(system.clock.now + system.chance.random() * LARGEST_CONTROL_S, self._boot)

    @property
    def is_stopped(self) -> bool:
        """True while the process stands still."""
        return self._system.clock.now < self.stopped_until

    @property
    def is_computing(self) -> bool:
        """True while a step lasts."""
        return self._system.clock.now < self._busy_until

    @property
    def is_dying(self) -> bool:
        """True if it was killed, and the parent does not see yet that it has ended."""
        return not self._is_alive and self.exitcode is None

    def kill(self) -> None:
        """End the process at once. The parent sees this a moment later."""
        self._end(-signal.SIGKILL)

    def notify(self) -> None:
        """Let the process run once it can."""
        self._wake_at(self._system.clock.now)

    def _end(self, code: int) -> None:
        if not self._is_alive:
            return
        self._is_alive = False
        for fd in (self._control.down[0], self._control.up[1], *self.queues):
            self._system.close(fd)

        def show() -> None:
            self.exitcode = code

        self._system.at(self._system.clock.now + self._system.chance.random() * LARGEST_CONTROL_S, show)

    def _wake_at(self, time_s: float) -> None:
        time_s = max(time_s, self._busy_until, self.stopped_until)
        if self._is_alive and (self._due is None or time_s < self._due):
            self._due = time_s
            self._system.at(time_s, lambda: self._run(time_s))

    def _run(self, due: float) -> None:
        """Do one step, unless the process has ended, or is to run at another time."""
        if not self._is_alive or self._due != due:
            return
        self._due = None
        now = self._system.clock.now
        if now < max(self._busy_until, self.stopped_until):
            self._wake_at(now)
        elif self._robot is not None:
            self._do(self._turn)

    def _boot(self) -> None:
        if self._is_alive and self.is_stopped:
            self._system.at(self.stopped_until, self._boot)
        elif self._is_alive:
            self._do(self._begin)

    def _begin(self) -> None:
        start = self._start
        host = Host.create(start.protocol, start.part)
        link = cast("ControlPipe", self._control)
        self._robot = VirtualRobot(host, link, start.epoch, observed=start.observed, bounds=start.bounds)
        self._robot.garbled = self.garbled

    def _turn(self) -> None:
        robot = self._robot
        if robot is None:
            return
        actions = robot._watch.wait(None)  # noqa: SLF001 - as in `run`
        if actions or robot.is_restless:
            robot.turn(actions)
        if not robot._running:  # noqa: SLF001 - as in `run`
            self._end(0)

    def _do(self, step: Callable[[], None]) -> None:
        """Do a step as the main function of a robot's process would, and note how long it lasts."""
        system, before = self._system, self._checks
        system.running = self
        try:
            step()
        except UnsupportedError as refusal:
            elsewhere = isinstance(refusal, TooLargeError)
            self._control.send(RobotFailed(str(refusal), unsupported=True, elsewhere=elsewhere))
            self._end(0)
        except Exception as error:  # noqa: BLE001 - as in `robot_process`
            self._control.send(RobotFailed(f"{type(error).__name__}: {error}"))
            self._end(0)
        finally:
            system.running = None
        now = system.clock.now
        self._busy_until = now + self.step_s + CHECK_S * max(0, self._checks - before)
        robot = self._robot
        if self._is_alive and robot is not None:
            self._due = None
            if robot._watch.wait(None):  # noqa: SLF001 - as in `run`
                self._wake_at(now)
            elif robot.is_restless:
                self._wake_at(now + robot._patience_s)  # noqa: SLF001 - as in `run`

    @property
    def _checks(self) -> int:
        host = None if self._robot is None else self._robot._host  # noqa: SLF001 - its counts
        return 0 if host is None else host.checks
