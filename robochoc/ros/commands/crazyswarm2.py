"""The sink and the source `crazyswarm2`: the server of Crazyswarm2 flies the drones in its `crazyflies.yaml`.

Commands are calls of the services `takeoff`, `go_to` and `land` (crazyflie_interfaces) in each drone's namespace. The
server answers a call at once, and reports no arrival: a flight ends after its duration. Flights are steps, one after
the other; a new decision replaces the steps that have not begun.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from robochoc.flight.layout import Point
from robochoc.formats.diagnostics import MistakeError, on_one_line, shortened
from robochoc.formats.settings_file import check_mapping, decimal, read_settings
from robochoc.formats.yaml_tree import Node, scalar_text
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import Source, SourceError
from robochoc.ros.commands.command_sink import CommandSink, CommandSource
from robochoc.ros.commands.commander import CommandedRobot, Commander, RobotPhase, Target
from robochoc.ros.commands.place import CommandPlace
from robochoc.ros.commands.swarm_flights import TooCloseError, flights, longest_m
from robochoc.ros.live.service_calls import Answer, open_calls
from robochoc.ros.waypoint_types import point
from robochoc.system.lazy_dataclass import dataclass

SERVICES: Mapping[str, str] = MappingProxyType(
    {
        "takeoff": "crazyflie_interfaces/Takeoff",
        "go_to": "crazyflie_interfaces/GoTo",
        "land": "crazyflie_interfaces/Land",
    }
)
"""The services in a drone's namespace, and their types."""
POSE = "geometry_msgs/PoseStamped"
LANDED_M = 0.04
"""The height at which the motors stop, as in the examples of Crazyswarm2."""
LOW_M = 0.1
"""The least height of a waypoint."""
LEAST_S = 2.0
"""The shortest duration of a take-off, a flight or a landing, in seconds."""
END_S = 60.0
"""The longest time for landing all drones at the end, in seconds."""
DRONES_MAX = 1_000
_AXES = 3
_OPTIONS = ("height", "speed", "distance", "patience")
_EXPECTED = "expected the form of Crazyswarm2"


@dataclass
class _Step:
    """Calls that are sent at the same time, by drone: a service, its fields, and the place afterwards."""

    service: str
    targets: Mapping[str, Point]
    duration_s: float


class Crazyswarm2Commander(Commander):
    """Calls the services of the drones in a `crazyflies.yaml`.

    Args:
        place: The text after `crazyswarm2:`.
    """

    def __init__(self, place: str) -> None:
        super().__init__()
        found = CommandPlace.parse(place)
        if found.file is None:
            raise SinkError("the file of drones is missing, as in crazyswarm2:crazyflies.yaml@dds:5")
        unknown = [name for name in found.options if name not in _OPTIONS]
        if unknown:
            raise SinkError(on_one_line(f"unknown option {shortened(unknown[0])!r}; known: {', '.join(_OPTIONS)}"))
        self._file = found.file
        self._homes = read_crazyflies(found.file)
        self._height_m = found.number("height", 0.5, 0.1, 100)
        self._speed_ms = found.number("speed", 0.5, 0.05, 5)
        self._distance_m = found.number("distance", 0.5, 0.05, 100)
        self.patience_s = found.number("patience", self.patience_s, 1, 600)
        self._calls = open_calls(found.middleware)
        self.where = f"Crazyswarm2, {self._calls.where}"
        self._source: Source | None = None
        self.may_fly = False
        self._places: dict[str, Point] = {}
        """The places of the drones in the air after the current step, by name."""
        self._plan: deque[_Step] = deque()
        self._until_s = 0.0
        """The end of the current step."""
        self._open: dict[int, tuple[str, str, float]] = {}
        """The drone, the service and the time of each call without an answer."""

    @property
    def is_busy(self) -> bool:
        """True if a step is not finished."""
        return bool(self._plan or self._open) or time.monotonic() < self._until_s

    def command(self, targets: Mapping[str, Target]) -> None:
        """Plan the steps to new targets, after the current step. Raises `SinkError` if drones would come too close."""
        if not self.may_fly:
            return
        known = {name: one for name, one in targets.items() if self.robots[name].phase is not RobotPhase.OUT}
        self._plan.clear()
        landing = [name for name, one in known.items() if one.lands and name in self._places]
        self._plan_landing(landing)
        flown = {name: one.at for name, one in known.items() if not one.lands}
        self._check_heights(flown)
        places = {name: at for name, at in self._places.items() if name not in landing}
        rising = {name: self._above(name) for name in flown if name not in places}
        try:
            groups = flights({**places, **rising}, flown, self._distance_m)
        except TooCloseError as error:
            raise SinkError(on_one_line(f"{self.where}: {error}; the decision is not flown")) from error
        if rising:
            self._plan.append(_Step("takeoff", rising, self._duration_s(self._height_m)))
        here = {**places, **rising}
        for group in groups:
            self._plan.append(_Step("go_to", group, self._duration_s(longest_m(here, group))))
            here |= group
        for name, one in known.items():
            self.robots[name].target, self.robots[name].phase = one, RobotPhase.MOVING
            self.robots[name].sent_s = time.monotonic()

    def _check_heights(self, places: Mapping[str, Point]) -> None:
        """Raise `SinkError` for a place on the ground, such as those of lists with two coordinates."""
        for name, (_, _, z) in places.items():
            if z < LOW_M:
                problem = f"{self.where}: the waypoint of {name} has the height {z:g} m, less than {LOW_M:g} m"
                raise SinkError(on_one_line(f"{problem}; use places with a height; the decision is not flown"))

    def end(self) -> None:
        """Land all drones in the air, after the current step."""
        self._plan.clear()
        self._plan_landing([*self._places])
        self.wait_for(lambda: not self.is_busy, END_S)

    def close(self) -> None:
        """End the connection."""
        if self._source is not None:
            self._source.close()
        self._calls.close()

    def _spaces(self, namespaces: Mapping[str, str]) -> Mapping[str, str]:
        found = {
            name: next((one for one in (space, f"/{name}") if one[1:] in self._homes), "")
            for name, space in namespaces.items()
        }
        missing = [name for name, space in found.items() if not space]
        if missing:
            names = " or ".join(dict.fromkeys((namespaces[missing[0]][1:], missing[0])))
            problem = f"{self._file}: no enabled robot is called {names}"
            raise SinkError(on_one_line(f"{problem}; each drone of the team needs one"))
        return found

    def _prepare(self) -> None:
        services = {f"{one.namespace}/{name}": kind for one in self.robots.values() for name, kind in SERVICES.items()}
        self._calls.prepare(services)
        try:
            self._source = self._calls.source()
            self._source.listen({f"{robot.namespace}/pose": POSE for robot in self.robots.values()})
        except SourceError as error:
            raise SinkError(str(error)) from error

    def _has_server(self, robot: CommandedRobot) -> bool | None:
        found = [self._calls.has_server(f"{robot.namespace}/{name}") for name in SERVICES]
        return None if None in found else all(found)

    def _missing(self) -> str:
        for robot in self.robots.values():
            if self._has_server(robot) is False:
                problem = f"{self.where}: no services {robot.namespace}/{{{','.join(SERVICES)}}} for {robot.name}"
                return f"{problem}: start the server of Crazyswarm2; nothing flies"
        return ""

    def _start(self, robot: CommandedRobot, target: Target) -> None:
        """Do nothing: `command` plans the steps of all drones together."""

    def _stop(self, robot: CommandedRobot) -> None:
        """Land a drone that is out of order, without waiting for it."""
        self._open = {number: one for number, one in self._open.items() if one[0] != robot.name}
        for step in self._plan:
            step.targets = {name: at for name, at in step.targets.items() if name != robot.name}
        if self._places.pop(robot.name, None) is not None:
            self._call(robot, "land", self._fields("land", (0.0, 0.0, LANDED_M), LEAST_S))

    def _receive(self, wait_s: float) -> None:
        answer = self._calls.answer(wait_s)
        while answer is not None:
            self._answered(answer)
            answer = self._calls.answer(0)
        self._read_poses()
        self._advance()

    def _answered(self, answer: Answer) -> None:
        name, service, _ = self._open.pop(answer.number, ("", "", 0.0))
        if name and answer.fields is None:
            self._fail(self.robots[name], f"its call of {service} failed: {answer.why}")

    def _read_poses(self) -> None:
        robots = {f"{robot.namespace}/pose": robot for robot in self.robots.values()}
        while self._source is not None:
            try:
                received = self._source.next(0)
            except SourceError as error:
                raise SinkError(str(error)) from error
            if received is None:
                return
            if (robot := robots.get(received.topic)) is not None:
                self._pose(robot, received.fields)

    def _advance(self) -> None:
        """Begin the next step when the current one has ended; after the last one, all drones have arrived."""
        if self._open or time.monotonic() < self._until_s:
            return
        if self._plan:
            self._begin(self._plan.popleft())
            return
        for robot in self.robots.values():
            if robot.phase is RobotPhase.MOVING:
                is_flying = robot.target is not None and not robot.target.lands
                robot.phase = RobotPhase.ARRIVED if is_flying else RobotPhase.IDLE

    def _begin(self, step: _Step) -> None:
        for name, at in step.targets.items():
            robot = self.robots[name]
            robot.sent_s = time.monotonic()
            number = self._call(robot, step.service, self._fields(step.service, at, step.duration_s))
            self._open[number] = name, step.service, time.monotonic()
            if step.service == "land":
                self._places.pop(name, None)
            else:
                self._places[name] = at
        self._until_s = time.monotonic() + (step.duration_s if step.targets else 0.0)

    def _check_times(self, robot: CommandedRobot, now: float) -> None:
        super()._check_times(robot, now)
        ours = [(service, sent_s) for name, service, sent_s in self._open.values() if name == robot.name]
        late = [service for service, sent_s in ours if now - sent_s > self.patience_s]
        if late and robot.phase is not RobotPhase.OUT:
            self._fail(robot, f"its server has not answered {late[0]} within {self.patience_s:g} s")

    def _call(self, robot: CommandedRobot, service: str, fields: Fields) -> int:
        return self._calls.call(f"{robot.namespace}/{service}", fields, self.patience_s)

    def _fields(self, service: str, at: Point, duration_s: float) -> Fields:
        duration = {"duration": round(duration_s * 1e9)}
        return {"goal": point(at), **duration} if service == "go_to" else {"height": at[2], **duration}

    def _plan_landing(self, names: Sequence[str]) -> None:
        if names:
            x, y = 0.0, 0.0  # a landing keeps the horizontal place
            heights = [self._places[name][2] for name in names]
            step = _Step("land", dict.fromkeys(names, (x, y, LANDED_M)), self._duration_s(max(heights)))
            self._plan.append(step)

    def _above(self, name: str) -> Point:
        x, y, z = self._homes[self.robots[name].namespace[1:]]
        return x, y, z + self._height_m

    def _duration_s(self, length_m: float) -> float:
        return max(length_m / self._speed_ms, LEAST_S)


class Crazyswarm2Sink(CommandSink):
    """`--ros crazyswarm2:crazyflies.yaml@dds:DOMAIN`, or with another middleware."""

    commander = Crazyswarm2Commander
    arms = True

    def allow_arming(self) -> None:
        """Permit flights."""
        self._swarm.may_fly = True

    def _result_text(self) -> str:
        if self._swarm.may_fly:
            return super()._result_text()
        return f"{len(self._swarm.robots)} drones seen, none armed (--arm lets them fly)"

    @property
    def _swarm(self) -> Crazyswarm2Commander:
        assert isinstance(self._commander, Crazyswarm2Commander)  # noqa: S101 - its class is set above
        return self._commander


class Crazyswarm2Source(CommandSource):
    """`--situation crazyswarm2...`, with the same text as the sink."""

    commander = Crazyswarm2Commander


def read_crazyflies(path: Path) -> dict[str, Point]:
    """Return the initial positions of the enabled robots in the file at `path`, by name. Raises `SinkError`."""
    hint = "name a file, as in crazyswarm2:crazyflies.yaml@dds:5"
    return read_settings(path, _drones, "a file of Crazyswarm2", _EXPECTED, hint, SinkError)


def _drones(root: Node) -> dict[str, Point]:
    check_mapping(root, "crazyflies.yaml")
    found: dict[str, Point] = {}
    robots = root.needed("robots", "crazyflies.yaml", _EXPECTED)
    check_mapping(robots, "'robots'")
    for key, entry in robots.named():
        name = scalar_text(key)
        check_mapping(entry, shortened(name))
        enabled = entry.get("enabled")
        if enabled is None or enabled.scalar is not False:
            found[name] = _position(entry.needed("initial_position", f"robot {shortened(name)}", _EXPECTED), name)
        entry.skip()
    root.skip()
    if not 0 < len(found) <= DRONES_MAX:
        raise MistakeError(f"{len(found):,} enabled robots", f"expected 1 to {DRONES_MAX:,}", robots.line)
    return found


def _position(node: Node, name: str) -> Point:
    values = [decimal(one) for one in node.items or ()]
    x, y, z = values if len(values) == _AXES else (None, None, None)
    if x is None or y is None or z is None:
        problem = f"'initial_position' of {shortened(name)} is not a place"
        raise MistakeError(problem, "expected [x, y, z] in metres", node.line)
    return x, y, z
