"""The crew: the robots' processes, as the parent has them. They are begun here, listened to, and ended."""

from __future__ import annotations

import multiprocessing.connection
import selectors
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from multiprocessing.context import ForkContext, ForkServerContext
from typing import Literal, cast

from robochoc.communication.control import FromParent, FromRobot, QueueFrom, QueuesTo
from robochoc.communication.processes.robot_link import Condition, RobotLink
from robochoc.communication.processes.robot_process import Beginning, robot_process
from robochoc.communication.resources import allow_descriptors, signals_held
from robochoc.solver.encoding import UnsupportedError

StartMethod = Literal["fork", "forkserver"]
_CONTEXTS: dict[StartMethod, type[ForkContext | ForkServerContext]] = {
    "fork": ForkContext,
    "forkserver": ForkServerContext,
}
FAREWELL_S = 0.5
"""How long processes may take to end by themselves before they are killed."""
_FDS_PER_ROBOT = 4
_FDS_SPARE = 128


class ProcessPool:
    """The processes of a team. `robots` are those that are there, by name.

    Whoever died is told of by `ended`; whoever is dismissed ends by itself, soon.
    """

    def __init__(self, start_method: StartMethod) -> None:
        self._context = _CONTEXTS[start_method]()
        self.robots: dict[str, RobotLink] = {}
        self._dismissed: list[RobotLink] = []
        self._selector = selectors.DefaultSelector()
        self._ends = selectors.DefaultSelector()
        self._selector.register(self._ends.fileno(), selectors.EVENT_READ)

    def make_room(self, robots: int) -> None:
        """Get ready for so many robots."""
        allow_descriptors(robots * _FDS_PER_ROBOT + _FDS_SPARE)

    def start(self, begin: Beginning) -> None:
        """Start one process. Raises `OSError` when the system does not allow it.

        Signals wait until it has set its own handlers, and until it is known here: one by one, so that they wait for
        the start of one robot, and not of a large team.
        """
        with signals_held():
            self._start(begin)

    def _start(self, begin: Beginning) -> None:
        name = begin.part.robot.name
        ours, theirs = socket.socketpair()
        forked = self._context.get_start_method() == "fork"
        inherited = [other.control for other in self.robots.values()] + [ours] if forked else []
        process = self._context.Process(target=robot_process, name=name, args=(begin, theirs, inherited), daemon=True)
        with theirs:
            try:
                process.start()
            except BaseException:
                ours.close()
                raise
        link = self.robots[name] = RobotLink(name, process, ours)
        self._selector.register(link.control, selectors.EVENT_READ, link)
        self._ends.register(process.sentinel, selectors.EVENT_READ, link)

    # Listening

    def speakers(self, patience_s: float) -> list[RobotLink]:
        """Robots that have something to say, waited for at most `patience_s`; none as well when one has ended."""
        return [key.data for key, _ in self._selector.select(patience_s) if key.data is not None]

    def words(self, robot: RobotLink) -> list[FromRobot]:
        """What `robot` says. One that has hung up is about to end, which its sentinel tells soon, if not before."""
        if self.robots.get(robot.name) is not robot or robot.control not in self._selector.get_map():
            return []  # dismissed, or ended, since it began to speak
        words = robot.words()
        if robot.hung_up:
            self._selector.unregister(robot.control)
        return words

    def ended(self) -> Iterator[tuple[RobotLink, list[FromRobot]]]:
        """Robots whose processes have ended since the last look, with their last words."""
        for key, _ in self._ends.select(0):
            robot: RobotLink = key.data
            self._ends.unregister(robot.process.sentinel)
            words = robot.last_words()
            robot.ended = True
            self._unwatch(robot)
            yield robot, words

    def in_condition(self, *conditions: Condition) -> dict[Condition, list[RobotLink]]:
        """The robots whose processes are in one of `conditions`, for each of these."""
        found: dict[Condition, list[RobotLink]] = {condition: [] for condition in conditions}
        for robot in self.robots.values():
            if (now := robot.condition()) in found:
                found[now].append(robot)
        return found

    # Queues

    def open_queues(self, sender: RobotLink, receivers: Sequence[str]) -> None:
        """Make the queues from `sender` to `receivers`: it gets the write ends, each of them its read end."""
        with ExitStack() as copies:
            writers = []
            for name in receivers:
                try:
                    reader, writer = self._context.Pipe(duplex=False)
                except OSError as error:
                    raise UnsupportedError(
                        f"the system does not let {sender.name} have a queue to {name}: {error.strerror}"
                        " (raise its limits, see 'ulimit -n', or use the simulator)"
                    ) from error
                writers.append(copies.enter_context(writer))
                with reader:
                    self.robots[name].tell(QueueFrom(sender.name), [reader.fileno()])
            sender.tell(QueuesTo(list(receivers)), [writer.fileno() for writer in writers])

    def tell_all(self, order: FromParent) -> None:
        """Say `order` to every robot."""
        for robot in list(self.robots.values()):
            robot.tell(order)

    # Ending

    def dismiss(self, name: str, *, kill: bool = False) -> None:
        """The robot leaves: it is hung up on, and ends by itself unless it is to be killed."""
        robot = self.robots.pop(name)
        self._unwatch(robot)
        if robot.process.sentinel in self._ends.get_map():
            self._ends.unregister(robot.process.sentinel)
        if kill:
            robot.process.kill()
        robot.control.close()
        self._dismissed.append(robot)

    def reap(self) -> None:
        """Let go of what is left of those who have been dismissed, as far as they have ended."""
        ended = [robot for robot in self._dismissed if robot.process.exitcode is not None]
        self._dismissed = [robot for robot in self._dismissed if robot not in ended]
        for robot in ended:
            robot.process.close()

    def end_all(self) -> None:
        """Hang up; robots that have reported get a moment to end by themselves, others are killed at once.

        They lose nothing by it, and on a busy machine the turns that they would need to end by themselves take time.
        """
        with signals_held():
            self._selector.close()
            self._ends.close()
            for robot in self.robots.values():
                if robot.report is None:
                    robot.process.kill()
                robot.control.close()
            everybody = [*self.robots.values(), *self._dismissed]
            self.robots, self._dismissed = {}, []
            _await([robot.process.sentinel for robot in everybody])
            for robot in everybody:
                # Also one that seems to have ended: a sentinel is a pipe, and a process can close it and live on.
                robot.process.kill()
                robot.process.join()
                robot.process.close()

    def _unwatch(self, robot: RobotLink) -> None:
        if robot.control in self._selector.get_map():
            self._selector.unregister(robot.control)


def _await(sentinels: Sequence[int]) -> None:
    deadline = time.monotonic() + FAREWELL_S
    alive = set(sentinels)
    while alive and time.monotonic() < deadline:
        ended = multiprocessing.connection.wait(list(alive), max(0.0, deadline - time.monotonic()))
        alive.difference_update(cast("list[int]", ended))
