"""Commands robots, and tracks the outcomes of the commands. A sink and a source with the same place share it."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from enum import Enum, auto

from robochoc.flight.layout import Point
from robochoc.flight.mission import GoalStop
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, SinkError
from robochoc.system.lazy_dataclass import dataclass

GONE_S = 6.0
"""The time without its server after which a robot is out of order, in seconds. It is longer than the time for which a
broken link to a zenoh router is tolerated, in which no server is visible.
"""
POSE_S = 0.5
"""The shortest time between two reports of a robot's pose, in seconds."""
_SLICE_S = 0.1

Observer = Callable[[str, str, Fields], None]
"""Receives a robot's name, the last token of the topic of its report, and the fields of the report."""


class RobotPhase(Enum):
    """The state of a robot."""

    IDLE = auto()
    SENT = auto()
    """A command was sent, and has not been answered."""
    MOVING = auto()
    ARRIVED = auto()
    OUT = auto()
    """Out of order: the robot receives no more commands."""


@dataclass(frozen=True)
class Target:
    """The target of a robot, in metres; if it `lands`, the robot has withdrawn."""

    at: Point
    lands: bool
    frame: str
    stamp: int
    """The time of the decision, in nanoseconds."""
    stops: tuple[GoalStop, ...] = ()
    """All places of a robot that does tasks one after the other; the first one is `at`."""


@dataclass
class CommandedRobot:
    """The state of a robot. Times are those of `time.monotonic`."""

    name: str
    namespace: str
    phase: RobotPhase = RobotPhase.IDLE
    target: Target | None = None
    left: list[GoalStop] = field(default_factory=list)
    """The stops at which the robot has not been; it is on its way to the first one."""
    done: set[str] = field(default_factory=set)
    """The tasks at whose places the robot has been."""
    sent_s: float = 0.0
    """The time of the last command."""
    heard_s: float = 0.0
    """The time of the last message about this command."""
    posed_s: float = 0.0
    """The time of the last report of a pose."""
    gone_s: float | None = None
    """The time since which no server has been visible."""
    why: str = ""
    """The reason why the robot is out of order."""

    @property
    def is_busy(self) -> bool:
        """True if the robot is on its way."""
        return self.phase in {RobotPhase.SENT, RobotPhase.MOVING}

    def continues(self, target: Target) -> bool:
        """Return whether a robot with this new target continues on its way, or stays at its place."""
        if self.target is None or self.target.lands != target.lands:
            return False
        left = [stop for stop in target.stops if stop.task not in self.done]
        return left == self.left and (bool(target.stops) or self.target.at == target.at)


class Commander(ABC):
    """Commands robots; all methods are called in one thread, and raise `SinkError`.

    `poll` must be called regularly: it handles what has arrived, and the time limits.
    """

    where: str = ""
    """A description of the robots' place, for messages."""
    patience_s: float = 10.0
    """The longest time without an answer, or without a message of a moving robot, in seconds."""
    time_s: float = 300.0
    """The longest time for one target, in seconds."""

    def __init__(self) -> None:
        self.robots: dict[str, CommandedRobot] = {}
        self.observers: list[Observer] = []

    @property
    def is_busy(self) -> bool:
        """True if robots are on their way."""
        return any(robot.is_busy for robot in self.robots.values())

    @property
    def out_of_order(self) -> list[CommandedRobot]:
        """The robots that are out of order."""
        return [robot for robot in self.robots.values() if robot.phase is RobotPhase.OUT]

    def assign(self, namespaces: Mapping[str, str]) -> None:
        """Set the robots, by name, and their namespaces; wait until their servers are visible."""
        self.robots = {name: CommandedRobot(name, space) for name, space in self._spaces(namespaces).items()}
        self._prepare()
        self.wait_for(lambda: not self._missing(), self.patience_s)
        missing = self._missing()
        if missing:
            raise SinkError(on_one_line(missing))

    def command(self, targets: Mapping[str, Target]) -> None:
        """Send robots to their targets. A robot that already has the same target continues."""
        for name, target in targets.items():
            robot = self.robots[name]
            if robot.phase is RobotPhase.OUT or (robot.phase is not RobotPhase.IDLE and robot.continues(target)):
                continue
            robot.target = target
            robot.left = [stop for stop in target.stops if stop.task not in robot.done]
            if target.stops and not robot.left:
                self._stop(robot)
                robot.phase = RobotPhase.ARRIVED
            else:
                self._send(robot, target)

    def _send(self, robot: CommandedRobot, target: Target) -> None:
        """Send a robot to its target, or to the first of the stops that are left."""
        robot.sent_s = robot.heard_s = time.monotonic()
        robot.phase = RobotPhase.SENT
        self._start(robot, replace(target, at=robot.left[0].at) if robot.left else target)

    def _arrive(self, robot: CommandedRobot) -> None:
        """Handle the arrival of a robot: report that its task is done, and send it to its next stop."""
        if robot.left:
            task = robot.left.pop(0).task
            robot.done.add(task)
            self._report(robot, "done", {"data": task})
        if robot.left and robot.target is not None:
            self._send(robot, replace(robot.target, stamp=0))  # 0: the latest transforms, not those of the decision
        else:
            robot.phase = RobotPhase.ARRIVED

    def poll(self, wait_s: float) -> None:
        """Handle everything that has arrived, or the first event to arrive within `wait_s` seconds."""
        self._receive(wait_s)
        now = time.monotonic()
        for robot in self.robots.values():
            if robot.phase is not RobotPhase.OUT:
                self._check_times(robot, now)

    def wait_for(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Wait until `condition` is true, for at most `limit_s` seconds; return whether it is."""
        until = time.monotonic() + limit_s
        while not condition():
            left_s = until - time.monotonic()
            if left_s <= 0:
                return False
            self.poll(min(left_s, _SLICE_S))
        return True

    @abstractmethod
    def end(self) -> None:
        """Stop the robots that are on their way, or make them land."""

    @abstractmethod
    def close(self) -> None:
        """End the connection."""

    @abstractmethod
    def _spaces(self, namespaces: Mapping[str, str]) -> Mapping[str, str]:
        """Return the namespaces of the robots' servers; `namespaces` are those of the team's topics."""

    @abstractmethod
    def _prepare(self) -> None:
        """Connect to the servers of the robots."""

    @abstractmethod
    def _has_server(self, robot: CommandedRobot) -> bool | None:
        """Return whether the server of a robot is visible; None if the middleware cannot tell."""

    @abstractmethod
    def _missing(self) -> str:
        """Return the error text for a robot without a server; empty if there is none."""

    @abstractmethod
    def _start(self, robot: CommandedRobot, target: Target) -> None:
        """Send a command."""

    @abstractmethod
    def _stop(self, robot: CommandedRobot) -> None:
        """Stop a robot that is out of order, if it can still be reached."""

    @abstractmethod
    def _receive(self, wait_s: float) -> None:
        """Handle everything that has arrived."""

    def _check_times(self, robot: CommandedRobot, now: float) -> None:
        """Mark a robot as out of order if it exceeds a time limit."""
        if self._has_server(robot) is False:
            robot.gone_s = now if robot.gone_s is None else robot.gone_s
            if now - robot.gone_s > min(GONE_S, self.patience_s):
                self._fail(robot, "its server is gone")
                return
        else:
            robot.gone_s = None
        if robot.phase is RobotPhase.SENT and now - robot.sent_s > self.patience_s:
            self._fail(robot, f"its server has not answered within {self.patience_s:g} s")
        elif robot.phase is RobotPhase.MOVING and now - robot.sent_s > self.time_s:
            self._fail(robot, f"it has not arrived within {self.time_s:g} s")

    def _fail(self, robot: CommandedRobot, why: str) -> None:
        """Mark a robot as out of order, and report it once."""
        if robot.phase is RobotPhase.OUT:
            return
        robot.phase, robot.why = RobotPhase.OUT, on_one_line(why)
        self._stop(robot)
        self._report(robot, "out_of_order", {"data": robot.why})

    def _pose(self, robot: CommandedRobot, fields: Fields) -> None:
        """Report a pose, unless the last report of this robot is recent."""
        now = time.monotonic()
        if now - robot.posed_s >= POSE_S:
            robot.posed_s = now
            self._report(robot, "pose", fields)

    def _report(self, robot: CommandedRobot, token: str, fields: Fields) -> None:
        for observer in self.observers:
            observer(robot.name, token, fields)
