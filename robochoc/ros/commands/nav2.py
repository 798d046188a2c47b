"""The sink and the source `nav2`: each robot receives its waypoints as goals of Nav2's action `NavigateToPose`.

A goal that is rejected, aborted, or cancelled by another client makes its robot out of order, and so does a server that
is gone or silent. A new decision replaces the goals that it changes; Nav2 itself ends a replaced goal.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.settings_file import check_mapping, number_at, read_settings
from robochoc.formats.yaml_tree import Node, scalar_text
from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.commands.command_sink import CommandSink, CommandSource
from robochoc.ros.commands.commander import CommandedRobot, Commander, RobotPhase, Target
from robochoc.ros.commands.place import CommandPlace
from robochoc.ros.interfaces import distribution
from robochoc.ros.live.actions import GoalEvent, GoalPhase, open_actions
from robochoc.ros.names import ros_name
from robochoc.ros.waypoint_types import UPRIGHT, point
from robochoc.system.lazy_dataclass import dataclass

ACTION = "navigate_to_pose"
"""The default name of the action in a robot's namespace."""
KIND = "nav2_msgs/NavigateToPose"
END_S = 2.0
"""The longest wait for the end of cancelled goals, in seconds."""
ROBOTS_MAX = 1_000
_EVENTS_MAX = 1_000
"""The maximum number of events handled at a time."""
_EXPECTED = "see the page Nav2 of the documentation for the entries"


@dataclass(frozen=True)
class Nav2Settings:
    """The content of a file of Nav2 robots."""

    robots: Mapping[str, str]
    """The namespaces of robots by name; other robots have the namespace of their topic."""
    action: str = ACTION
    behavior_tree: str = ""
    """The path of a behavior tree on the robots; empty for their default."""
    patience_s: float = Commander.patience_s
    time_s: float = Commander.time_s


class Nav2Commander(Commander):
    """Sends goals to the action servers of Nav2 robots.

    Args:
        place: The text after `nav2:`.
    """

    def __init__(self, place: str) -> None:
        super().__init__()
        found = CommandPlace.parse(place)
        if found.options:
            raise SinkError("nav2 has no options: write them into its file")
        self._settings = read_nav2(found.file) if found.file else Nav2Settings({})
        self.patience_s, self.time_s = self._settings.patience_s, self._settings.time_s
        self._actions = open_actions(found.middleware)
        self.where = f"Nav2, {self._actions.where}"
        self._goals: dict[str, str] = {}
        """The current goal of each robot, by name."""
        self._owners: dict[str, str] = {}
        """The robot of each goal that has not ended."""

    def end(self) -> None:
        """Cancel all goals, and wait for their end."""
        for goal in [*self._owners]:
            self._actions.cancel(goal)
        self._goals.clear()
        self.wait_for(lambda: not self._owners, END_S)
        for robot in self.robots.values():
            robot.phase = RobotPhase.IDLE if robot.is_busy else robot.phase

    def close(self) -> None:
        """End the connection."""
        self._actions.close()

    def _spaces(self, namespaces: Mapping[str, str]) -> Mapping[str, str]:
        unknown = [name for name in self._settings.robots if name not in namespaces]
        if unknown:
            known = shortened(", ".join(namespaces))
            raise SinkError(f"{self.where}: no robot is called {shortened(unknown[0])}; the robots are {known}")
        return {name: self._settings.robots.get(name, space) for name, space in namespaces.items()}

    def _prepare(self) -> None:
        self._actions.prepare({self._action(robot): KIND for robot in self.robots.values()})

    def _has_server(self, robot: CommandedRobot) -> bool | None:
        return self._actions.has_server(self._action(robot))

    def _missing(self) -> str:
        for robot in self.robots.values():
            if self._has_server(robot) is False:
                problem = f"{self.where}: no action server {self._action(robot)} for {robot.name}"
                others = f"; or set ROS_DISTRO, if its ROS is not {distribution()}"
                return f"{problem}: start Nav2 there, or name its namespace in a file (nav2:robots.yaml@...){others}"
        return ""

    def _start(self, robot: CommandedRobot, target: Target) -> None:
        if target.lands:
            self._stop(robot)
            self._goals.pop(robot.name, None)
            robot.phase = RobotPhase.IDLE
            return
        pose = {"position": point(target.at), "orientation": UPRIGHT}
        header = {"stamp": target.stamp, "frame_id": target.frame}
        fields: Fields = {"pose": {"header": header, "pose": pose}, "behavior_tree": self._settings.behavior_tree}
        goal = self._actions.send(self._action(robot), fields, self.patience_s)
        self._goals[robot.name] = goal
        self._owners[goal] = robot.name

    def _stop(self, robot: CommandedRobot) -> None:
        for goal, name in self._owners.items():
            if name == robot.name:
                self._actions.cancel(goal)

    def _receive(self, wait_s: float) -> None:
        for _ in range(_EVENTS_MAX):
            event = self._actions.next(wait_s)
            if event is None:
                return
            wait_s = 0.0
            self._handle(event)

    def _handle(self, event: GoalEvent) -> None:
        """Handle an event. Events of replaced goals, and of robots out of order, change nothing."""
        robot = self.robots[self._owners[event.goal]]
        if event.phase not in {GoalPhase.ACCEPTED, GoalPhase.FEEDBACK}:
            del self._owners[event.goal]
        if self._goals.get(robot.name) != event.goal or not robot.is_busy:
            return
        robot.heard_s = time.monotonic()
        match event.phase:
            case GoalPhase.ACCEPTED:
                robot.phase = RobotPhase.MOVING
            case GoalPhase.FEEDBACK:
                robot.phase = RobotPhase.MOVING
                if isinstance(pose := event.fields.get("current_pose"), Mapping):
                    self._pose(robot, pose)
            case GoalPhase.SUCCEEDED:
                self._arrive(robot)
            case _:
                self._fail(robot, _failure(event))

    def _check_times(self, robot: CommandedRobot, now: float) -> None:
        super()._check_times(robot, now)
        if robot.phase is RobotPhase.MOVING and now - robot.heard_s > self.patience_s:
            self._fail(robot, f"its server has sent no feedback for {self.patience_s:g} s")

    def _action(self, robot: CommandedRobot) -> str:
        return f"{robot.namespace}/{self._settings.action}"


class Nav2Sink(CommandSink):
    """`--ros nav2`, `nav2:dds:DOMAIN`, `nav2:rmw_zenoh://HOST:PORT`, `nav2:rosbridge://HOST:PORT`, `nav2:FILE@...`."""

    commander = Nav2Commander


class Nav2Source(CommandSource):
    """`--situation nav2...`, with the same text as the sink."""

    commander = Nav2Commander


def read_nav2(path: Path) -> Nav2Settings:
    """Return the settings in the file at `path`. Raises `SinkError`."""
    hint = "name a file, as in nav2:robots.yaml@dds:5"
    return read_settings(path, _settings, "a file of Nav2 robots", _EXPECTED, hint, SinkError)


def _settings(root: Node) -> Nav2Settings:
    check_mapping(root, "a file of Nav2 robots")
    robots, action, tree = root.get("robots"), root.get("action"), root.get("behavior_tree")
    return Nav2Settings(
        _robots(robots) if robots else {},
        _name(action, "action").removeprefix("/") if action else ACTION,
        _text(tree, "behavior_tree") if tree else "",
        number_at(root, "patience", Nav2Settings.patience_s, 1, 600),
        number_at(root, "time", Nav2Settings.time_s, 1, 86_400),
    )


def _robots(node: Node) -> dict[str, str]:
    check_mapping(node, "'robots'")
    found: dict[str, str] = {}
    for key, entry in node.named():
        name, space = scalar_text(key), _name(entry, scalar_text(key))
        other = next((one for one, its in found.items() if its == space), None)
        if other is not None:
            problem = f"{shortened(name)} and {shortened(other)} have the same namespace"
            raise MistakeError(problem, "each robot needs its own", entry.line)
        found[name] = space
    if len(found) > ROBOTS_MAX:
        raise MistakeError(f"{len(found):,} robots", f"at most {ROBOTS_MAX:,} are allowed", node.line)
    return found


def _name(node: Node, what: str) -> str:
    """Return a legal ROS name, which begins with `/`."""
    text = _text(node, what)
    if not text.strip("/") or ros_name(text) != f"/{text.strip('/')}":
        problem = f"{shortened(what)} is {shortened(text)!r}, which is not a ROS name"
        raise MistakeError(problem, "expected letters, digits and _, as in /robot1", node.line)
    return ros_name(text)


def _text(node: Node, what: str) -> str:
    value = node.scalar
    if not isinstance(value, str):
        raise MistakeError(f"{shortened(what)} is not text", "write it in quotes", node.line)
    return value


def _failure(event: GoalEvent) -> str:
    """Return the reason of the event that ends a goal before the robot has arrived."""
    if event.phase is GoalPhase.CANCELED:
        return "its goal was cancelled by another client"
    words = {GoalPhase.REJECTED: "was rejected", GoalPhase.ABORTED: "was aborted", GoalPhase.LOST: "is lost"}
    why = event.why or _error_of(event.fields)
    return f"its goal {words[event.phase]}{f': {why}' if why else ''}"


def _error_of(fields: Mapping[str, Any]) -> str:
    """Return the error in a result as text. Distributions of ROS 2 before Iron have none."""
    code, text = fields.get("error_code"), fields.get("error_msg")
    parts = [f"error code {code}"] if isinstance(code, int) and code else []
    return ", ".join([*parts, shortened(text)] if isinstance(text, str) and text else parts)
