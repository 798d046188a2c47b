"""The pool of the robots' processes: starts processes, reads their messages, and ends them."""

from __future__ import annotations

import os
import selectors
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Literal

from robochoc.communication.control import FromRobot, QueueFrom, QueuesTo
from robochoc.communication.main_guard import require_main_guard
from robochoc.communication.processes.forked_process import ChildProcess, ForkedProcess, ended_of, ranges_of
from robochoc.communication.processes.process_status import ProcessStatus
from robochoc.communication.processes.robot_link import RobotLink
from robochoc.communication.processes.robot_process import RobotStart, robot_process, served_robot_process
from robochoc.communication.resources import allow_descriptors
from robochoc.solver.errors import UnsupportedError
from robochoc.system.signals import signals_delayed

StartMethod = Literal["fork", "forkserver"]
STARTED_AT_ONCE = 16
GRACE_S = 0.5
"""The time for processes to end by themselves before they are killed, in seconds."""
_FDS_PER_ROBOT = 4
_FDS_SPARE = 128


class ProcessPool:
    """The processes of a team. `robots` contains the participating robots by name.

    `ended` finds the processes that have died. A dismissed process soon ends by itself.
    """

    def __init__(self, start_method: StartMethod) -> None:
        if start_method != "fork":
            require_main_guard()
        self._start_method = start_method
        self.robots: dict[str, RobotLink] = {}
        self._dismissed: list[RobotLink] = []
        self._inherited: list[range] = []
        self._selector = selectors.DefaultSelector()
        self._ends = selectors.DefaultSelector()
        self._selector.register(self._ends.fileno(), selectors.EVENT_READ)

    def make_room(self, robots: int) -> None:
        """Raise the limit on open files for this number of robots."""
        allow_descriptors(robots * _FDS_PER_ROBOT + _FDS_SPARE)

    def start(self, starts: Sequence[RobotStart]) -> None:
        """Start at most `STARTED_AT_ONCE` processes. Raises `OSError` if the system allows no more processes.

        Signals are delayed until the processes have set their handlers and are registered here, but not during the
        whole start of a large team.
        """
        prepared: list[RobotLink] = []
        with signals_delayed(), ExitStack() as theirs:
            try:
                prepared.extend(self._prepared(start, theirs) for start in starts)
            finally:
                self._start(prepared)

    def _prepared(self, start: RobotStart, theirs: ExitStack) -> RobotLink:
        """Return the robot with a process that is not yet started. `theirs` closes the process's ends of pipes."""
        name = start.part.robot.name
        ours, control = socket.socketpair()
        theirs.enter_context(control)
        try:
            return RobotLink(name, self._process(start, control), ours)
        except BaseException:
            ours.close()
            raise

    def _start(self, prepared: Sequence[RobotLink]) -> None:
        """Start the processes without other work between the forks, because memory written between forks is copied."""
        started = 0
        self._inherited[:] = ranges_of(self._own_descriptors(prepared))
        try:
            for robot in prepared:
                robot.process.start()
                started += 1
        finally:
            for robot in prepared[started:]:
                robot.control.close()
                robot.process.close()
            for robot in prepared[:started]:
                self.robots[robot.name] = robot
                self._selector.register(robot.control, selectors.EVENT_READ, robot)
                self._ends.register(robot.process.sentinel, selectors.EVENT_READ, robot)

    def _process(self, start: RobotStart, control: socket.socket) -> ChildProcess:
        """Return a process that runs the robot. The process gets its end of the control pipe."""
        if self._start_method == "fork":
            return ForkedProcess(partial(robot_process, start, control), [control.fileno()], self._inherited)
        from multiprocessing.context import ForkServerContext  # noqa: PLC0415 - seldom needed

        name = start.part.robot.name
        return ForkServerContext().Process(target=served_robot_process, name=name, args=(start, control), daemon=True)

    def _own_descriptors(self, prepared: Sequence[RobotLink]) -> Iterator[int]:
        """Yield all ends of pipes in this process. Inherited copies would hide that an end is closed."""
        for robot in [*self.robots.values(), *self._dismissed, *prepared]:
            if isinstance(robot.process, ForkedProcess):
                yield robot.process.sentinel
            if robot.control.fileno() >= 0:
                yield robot.control.fileno()
        for robot in prepared:
            if isinstance(robot.process, ForkedProcess):
                yield from robot.process.kept

    # Reading

    def readable(self, patience_s: float) -> list[RobotLink]:
        """Return the robots with messages to read; empty after `patience_s` seconds, or when a process has ended."""
        return [key.data for key, _ in self._selector.select(patience_s) if key.data is not None]

    def receive(self, robot: RobotLink) -> list[FromRobot]:
        """Return the messages from `robot`. A robot that has hung up will soon end, which its sentinel shows."""
        if self.robots.get(robot.name) is not robot or robot.control not in self._selector.get_map():
            return []  # the robot was dismissed or has ended since it was found readable
        messages = robot.receive()
        if robot.hung_up:
            self._selector.unregister(robot.control)
        return messages

    def ended(self) -> Iterator[tuple[RobotLink, list[FromRobot]]]:
        """Yield the robots whose processes have ended since the last call, with the last messages that they sent."""
        for key, _ in self._ends.select(0):
            robot: RobotLink = key.data
            self._ends.unregister(robot.process.sentinel)
            messages = robot.receive_rest()
            robot.ended = True
            self._unwatch(robot)
            yield robot, messages

    def with_status(self, *statuses: ProcessStatus) -> dict[ProcessStatus, list[RobotLink]]:
        """Return, for each of `statuses`, the robots whose processes have this status."""
        found: dict[ProcessStatus, list[RobotLink]] = {status: [] for status in statuses}
        for robot in self.robots.values():
            if (status := robot.status) in found:
                found[status].append(robot)
        return found

    # Queues

    def open_queues(self, sender: RobotLink, receivers: Sequence[str]) -> None:
        """Open queues: write ends are sent to `sender`, read ends to `receivers`. Raises `UnsupportedError`."""
        with ExitStack() as copies:
            writers = []
            for name in receivers:
                try:
                    reader, writer = os.pipe()
                except OSError as error:
                    raise UnsupportedError(
                        f"the system does not allow a queue from {sender.name} to {name}: {error.strerror}:"
                        " raise its limits, see 'ulimit -n', or use the simulator"
                    ) from error
                copies.callback(os.close, writer)
                writers.append(writer)
                try:
                    self.robots[name].send(QueueFrom(sender.name), [reader])
                finally:
                    os.close(reader)
            sender.send(QueuesTo(list(receivers)), writers)

    # Ending

    def dismiss(self, name: str, *, kill: bool = False) -> None:
        """Remove the robot and close its control pipe. The process then ends by itself, unless `kill` is set."""
        robot = self.robots.pop(name)
        self._unwatch(robot)
        if robot.process.sentinel in self._ends.get_map():
            self._ends.unregister(robot.process.sentinel)
        if kill:
            robot.process.kill()
        robot.control.close()
        self._dismissed.append(robot)

    def reap(self) -> None:
        """Release dismissed processes that have ended."""
        ended = [robot for robot in self._dismissed if robot.process.exitcode is not None]
        self._dismissed = [robot for robot in self._dismissed if robot not in ended]
        for robot in ended:
            robot.process.close()

    def end_all(self, reported: Callable[[str], bool]) -> None:
        """End all processes. Robots that have `reported` get `GRACE_S` to end by themselves; other robots are killed.

        Killing loses no result, and on a busy machine a process needs a long time to end by itself.
        """
        with signals_delayed():
            self._selector.close()
            self._ends.close()
            for robot in self.robots.values():
                if not reported(robot.name):
                    robot.process.kill()
                robot.control.close()
            all_robots = [*self.robots.values(), *self._dismissed]
            self.robots, self._dismissed = {}, []
            _await([robot.process.sentinel for robot in all_robots])
            for robot in all_robots:
                # Kill even processes that seem to have ended: a process can close its sentinel, a pipe, and live on.
                robot.process.kill()
                robot.process.join()
                robot.process.close()

    def _unwatch(self, robot: RobotLink) -> None:
        if robot.control in self._selector.get_map():
            self._selector.unregister(robot.control)


def _await(sentinels: Sequence[int]) -> None:
    deadline = time.monotonic() + GRACE_S
    alive = set(sentinels)
    while alive and time.monotonic() < deadline:
        alive.difference_update(ended_of(alive, max(0.0, deadline - time.monotonic())))
