"""Options of the commands that publish decisions, fly them, and listen to what the robots report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import click

from robochoc.cli.options.paths import refuse_same_places
from robochoc.cli.reports.failures import INVALID, USAGE, Failure

if TYPE_CHECKING:
    from robochoc.flight.flight import FlightConditions
    from robochoc.flight.mission import Drone, Mission
    from robochoc.model.problem import Assignment, Robot, Team
    from robochoc.ros.closed_loop import ClosedLoop, Feedback
    from robochoc.ros.simulated_feedback import FlightSettings
    from robochoc.ros.sink import Sink

Command = TypeVar("Command", bound=Callable[..., object])

FLIGHT = "flight"
"""What `--situation` says for the simulation."""
FRAME = "map"
AXES = 3


class FrameType(click.ParamType[str]):
    """The name of a frame."""

    name = "frame"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """A name without blanks."""
        if not value or not value.isprintable() or " " in value:
            self.fail(f"{value!r} is no name of a frame, such as {FRAME}", param, ctx)
        return value


class PointType(click.ParamType["tuple[float, ...]"]):
    """Three numbers with commas between them."""

    name = "point"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - click's signature
        """`1,2,0.5` as numbers."""
        if isinstance(value, tuple):
            return value
        try:
            point = tuple(map(float, value.split(",")))
        except ValueError:
            point = ()
        if len(point) != AXES or not all(map(math.isfinite, point)):
            self.fail(f"{value!r} is not three numbers such as 1,2,3", param, ctx)
        return point


class WindType(PointType):
    """A wind's velocity; one number is its speed along x."""

    name = "wind"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - click's signature
        """`3` as `3,0,0`."""
        alone = isinstance(value, str) and "," not in value
        return super().convert(f"{value},0,0" if alone else value, param, ctx)


class FailureType(click.ParamType["tuple[str, float]"]):
    """A robot or a drone, and when it fails."""

    name = "failure"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:  # noqa: ANN401 - click's signature
        """`Robot3.1@5` as a name and seconds."""
        from robochoc.ros.simulated_feedback import FAILS_S

        if isinstance(value, tuple):
            return value
        name, at, seconds = value.rpartition("@")
        if not at:
            return value, FAILS_S
        try:
            at_s = float(seconds)
        except ValueError:
            at_s = math.nan
        if not name or not 0 <= at_s < math.inf:
            self.fail(f"{value!r} is not ROBOT or ROBOT@SECONDS", param, ctx)
        return name, at_s


class Finite(click.FloatRange):
    """A number in a range, and one that can be reckoned with."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """The number."""
        number = super().convert(value, param, ctx)
        return number if math.isfinite(number) else self.fail(f"{value} is no such number", param, ctx)


def _optional(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def decorated(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorated


ros_options = _optional(
    click.option(
        "--ros",
        "sinks",
        multiple=True,
        metavar="SINK",
        help=(
            "Publish decisions as waypoints: mcap:FILE (for Foxglove), rosbag:FILE, rosbridge://HOST:PORT, rospy, or"
            " an installed sink. Repeatable."
        ),
    ),
    click.option("--frame", type=FrameType(), metavar="NAME", help=f"Frame of all positions.  [default: {FRAME}]"),
    click.option(
        "--scale",
        type=Finite(1e-6, 1e6),
        metavar="METRES",
        help="Length of one unit of the problem's x, y and z.  [default: 1, less for a vast field]",
    ),
)
"""`--ros`, `--frame`, `--scale`."""

flight_options = _optional(
    click.option(
        "--fail",
        "failures",
        multiple=True,
        type=FailureType(),
        metavar="ROBOT[@SECONDS]",
        help="Stop a motor of this robot's drone (after 2 s). Repeatable.",
    ),
    click.option(
        "--distance",
        type=Finite(0, min_open=True),
        metavar="METRES",
        help="Minimum distance between drones.  [default: 0.5, or less where places are nearer]",
    ),
    click.option("--wind", type=WindType(), metavar="X[,Y,Z]", help="Wind, in m/s."),
    click.option("--gusts", type=Finite(0), metavar="M/S", help="Strength of gusts, in m/s."),
)
"""`--fail`, `--distance`, `--wind`, `--gusts`."""

situation_options = _optional(
    click.option(
        "--situation",
        metavar="SOURCE",
        help=(
            "Solve again when robots report a change. SOURCE: flight (decisions are flown in a simulation), mcap:FILE,"
            " rosbag:FILE, rosbridge://HOST:PORT, rospy or an installed source."
        ),
    ),
    click.option(
        "--patience",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        help=(
            "A robot is lost after its process was stopped (on a network: out of reach) for this long.  [default: no"
            " limit; on a network 10]"
        ),
    ),
    click.option(
        "--report-timeout",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        help="With --situation: how long to wait for a report after each decision.  [default: 10]",
    ),
    click.option(
        "--battery",
        type=Finite(0, 1),
        metavar="LEVEL",
        help="A robot leaves when a battery of its drones falls below this (1: full).  [default: 0.2]",
    ),
    click.option(
        "--obstacle",
        "obstacles",
        multiple=True,
        type=PointType(),
        metavar="X,Y,Z",
        help="An obstacle, in the problem's units. Repeatable.",
    ),
)
"""`--situation`, `--patience`, `--report-timeout`, `--battery`, `--obstacle`."""

_FLOWN = {"failures": "--fail", "distance": "--distance", "wind": "--wind", "gusts": "--gusts"}
_FLOWN_HERE = {**_FLOWN, "obstacles": "--obstacle"}
_HEARD = {"battery": "--battery", "report_timeout": "--report-timeout"}
_PLACED = {"frame": "--frame", "scale": "--scale"}
_NOT_PUBLISHED = "is for what is published: add --ros SINK"


@dataclass(frozen=True)
class Ros:
    """What the options ask for: where decisions go, and where the robots' situation comes from."""

    sinks: tuple[str, ...]
    situation: str | None
    frame: str
    scale: float | None
    report_timeout: float | None
    battery: float | None
    surroundings: Mapping[str, Any]

    def __bool__(self) -> bool:
        return bool(self.sinks or self.situation)


def ros_asked(settings: dict[str, Any]) -> Ros:
    """Take the options of this file out of `settings`. What would be ignored is wrong usage."""
    sinks, situation = settings.pop("sinks"), settings.pop("situation")
    given = {name: settings.pop(name) for name in (*_FLOWN_HERE, *_HEARD, *_PLACED)}
    asked = {name for name, value in given.items() if value not in (None, ())}
    if situation != FLIGHT:
        _refuse(_FLOWN_HERE, asked, "is for the simulated flight: add --situation flight")
    if situation in {None, FLIGHT}:
        _refuse(_HEARD, asked, "is for robots that are listened to: add --situation mcap:FILE, or another source")
    if not (sinks or situation):
        _refuse(_PLACED, asked, _NOT_PUBLISHED)
    surroundings = {name: given[name] for name in _FLOWN_HERE if name in asked}
    frame = given["frame"] or FRAME
    return Ros(sinks, situation, frame, given["scale"], given["report_timeout"], given["battery"], surroundings)


def _refuse(options: Mapping[str, str], asked: set[str], why: str) -> None:
    for name, option in options.items():
        if name in asked:
            raise click.UsageError(f"{option} {why}")


@contextmanager
def ros_failures_told() -> Iterator[None]:
    """What goes wrong with sinks, sources and names becomes one line, and `Failure`."""
    from robochoc.ros.mappings import NoMappingError
    from robochoc.ros.names import NameClashError
    from robochoc.ros.publisher import NothingToPublishError
    from robochoc.ros.sink import SinkError
    from robochoc.ros.sinks import UnknownSinkError, UnknownSourceError
    from robochoc.ros.source import SourceError

    try:
        yield
    except (UnknownSinkError, UnknownSourceError) as wrong:
        raise Failure(USAGE, str(wrong)) from wrong
    except (NameClashError, NoMappingError, NothingToPublishError, SinkError, SourceError) as wrong:
        raise Failure(INVALID, str(wrong)) from wrong


@contextmanager
def flights_told() -> Iterator[None]:
    """A decision that cannot be flown becomes one line, and `Failure`."""
    from robochoc.ros.simulated_feedback import CannotFlyError

    try:
        yield
    except CannotFlyError as wrong:
        raise Failure(INVALID, str(wrong)) from wrong


def open_sinks(texts: Sequence[str], stack: ExitStack) -> list[Sink]:
    """The sinks, which `stack` closes. Raises `SinkError`."""
    from robochoc.ros.sinks import open_sink

    return [stack.enter_context(open_sink(text)) for text in texts]


def surroundings_of(given: Mapping[str, Any], seed: int) -> FlightSettings:
    """What the options of a simulated flight ask for; those that are not given are left out."""
    from robochoc.ros.simulated_feedback import FlightSettings

    return FlightSettings(seed=seed, **given)


@contextmanager
def _surroundings_told() -> Iterator[None]:
    """A drone that is not there, or weather in which nothing flies, is wrong usage."""
    from robochoc.ros.simulated_feedback import UnknownDroneError

    try:
        yield
    except UnknownDroneError as wrong:
        raise click.UsageError(f"--fail: {wrong}") from wrong
    except ValueError as wrong:
        raise click.UsageError(str(wrong)) from wrong


def conditions_of(given: Mapping[str, Any], mission: Mission) -> FlightConditions:
    """What the options of `robochoc fly` ask for. Raises `click.UsageError` for a drone that is not there."""
    asked = {name: given[name] for name in _FLOWN if given[name] not in (None, ())}
    with _surroundings_told():
        return surroundings_of(asked, given["seed"]).conditions(mission.drones, mission.scale)


@contextmanager
def looped(ros: Ros, team: Team, seed: int) -> Iterator[ClosedLoop | None]:
    """The loop of `team`, if there is to be one; what it publishes is complete once the `with` is left without error.

    Raises `Failure`, and `click.UsageError` for what does not go with the team, or the source.
    """
    if not ros:
        yield None
        return
    from robochoc.ros.closed_loop import ClosedLoop, drones_of
    from robochoc.ros.situation import BATTERY

    with flights_told() if ros.situation == FLIGHT else nullcontext(), ros_failures_told(), ExitStack() as stack:
        feedback = _feedback(ros, drones_of(team), seed, stack) if ros.situation else None
        battery = BATTERY if ros.battery is None else ros.battery
        sinks = open_sinks(ros.sinks, stack)
        yield ClosedLoop(team, sinks, feedback, frame=ros.frame, scale=ros.scale, battery=battery)


def _feedback(ros: Ros, drones: Sequence[Drone], seed: int, stack: ExitStack) -> Feedback:
    """What `--situation` asks for."""
    if ros.situation == FLIGHT:
        from robochoc.ros.simulated_feedback import SimulatedFeedback

        surroundings = surroundings_of(ros.surroundings, seed)
        with _surroundings_told():
            surroundings.check(drones)
        return SimulatedFeedback(surroundings)
    from robochoc.ros.report_decoder import ReportDecoder
    from robochoc.ros.sinks import open_source
    from robochoc.ros.source_feedback import PATIENCE_S, SourceFeedback

    source = stack.enter_context(open_source(ros.situation or ""))
    if ros.report_timeout is not None and not source.live:
        raise click.UsageError(f"--report-timeout is for robots that report now; {ros.situation} is a recording")
    return SourceFeedback(source, ReportDecoder(drones, ros.frame), ros.report_timeout or PATIENCE_S)


@contextmanager
def robot_publisher(robot: Robot, given: dict[str, Any]) -> Iterator[Callable[[str, Assignment], list[str]]]:
    """Takes --ros, --frame and --scale out of `given`: what `robot` alone is to publish, and where.

    Gives a function for the run's end, by the master's words, and the robot's own decision: it publishes that, and says
    what went where. Raises `Failure`.
    """
    texts, frame, scale = (given.pop(name) for name in ("sinks", *_PLACED))
    if not texts:
        _refuse(_PLACED, {name for name, value in zip(_PLACED, (frame, scale), strict=True) if value}, _NOT_PUBLISHED)
        yield lambda _why, _assignment: []
        return
    import time

    from robochoc.ros.single_robot import drones_of_robot, leg_of_robot
    from robochoc.ros.sink_publisher import SinkPublisher

    refuse_same_places({}, sinks=texts)
    with ros_failures_told(), ExitStack() as stack:
        opened = open_sinks(texts, stack)
        found = [SinkPublisher(robot.name, drones_of_robot(robot), sink, frame or FRAME) for sink in opened]

        def publish(why: str, assignment: Assignment) -> list[str]:
            leg = leg_of_robot(robot, why, assignment, scale)
            for publisher in found:
                publisher.decide(leg, time.time_ns())
            return [f"{publisher.place}: {publisher.summary}" for publisher in found]

        yield publish
