"""Options for the commands that publish decisions, simulate flights, or receive reports from robots."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click

from robochoc.cli.options.value_types import Finite
from robochoc.system.lazy_dataclass import dataclass

Command = TypeVar("Command", bound=Callable[..., object])

FLIGHT = "flight"
"""The value of `--situation` that selects a simulated flight."""
FRAME = "map"
AXES = 3


class FrameType(click.ParamType[str]):
    """The name of a frame."""

    name = "frame"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name, which must not contain spaces."""
        if not value or not value.isprintable() or " " in value:
            self.fail(f"{value!r} is not the name of a frame, such as map", param, ctx)
        return value


class PointType(click.ParamType["tuple[float, ...]"]):
    """Three numbers separated by commas."""

    name = "point"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - click's signature
        """Return the numbers in a value such as `1,2,0.5`."""
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
    """The velocity of the wind; a single number is the speed along x."""

    name = "wind"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - click's signature
        """Return the numbers in a value such as `1,2,0.5`; `3` means `3,0,0`."""
        if not isinstance(value, str) or "," in value:
            return super().convert(value, param, ctx)
        try:
            return super().convert(f"{value},0,0", param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is neither a speed such as 3 nor three numbers such as 1,2,3", param, ctx)


class FailureType(click.ParamType["tuple[str, float]"]):
    """A robot or drone, and the time of its failure."""

    name = "failure"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:  # noqa: ANN401 - click's signature
        """Return the name and the seconds in a value such as `Robot3.1@5`."""
        from robochoc.robots.simulated_feedback import FAILS_S

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
            self.fail(f"{value!r} is not of the form ROBOT or ROBOT@SECONDS", param, ctx)
        return name, at_s


def _all_of(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def decorated(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorated


ros_options = _all_of(
    click.option(
        "--ros",
        "sinks",
        multiple=True,
        metavar="SINK",
        help=(
            "Publish waypoints, repeatable: echo, mcap:FILE, rosbag:FILE, dds, rmw_zenoh, rclpy, rospy, nav2,"
            " mavlink:FILE, crazyflie:FILE, rosbridge://HOST:PORT, ..."
        ),
    ),
    click.option("--frame", type=FrameType(), metavar="NAME", help=f"Frame of all positions.  [default: {FRAME}]"),
    click.option(
        "--scale",
        type=Finite(1e-6, 1e6),
        metavar="METRES",
        help="Metres per unit.  [default: 1; flights: 1 or less]",
    ),
    click.option("--ros-type", "ros_type", metavar="TYPE", help="ROS type of all waypoints, such as nav_msgs/Path."),
    click.option("--tf", is_flag=True, help="Publish goals on /tf_static and flights on /tf."),
    click.option("--diagnostics", is_flag=True, help="Publish verdict, epoch and cost on /diagnostics."),
)
"""The options `--ros`, `--frame`, `--scale`, `--ros-type`, `--tf` and `--diagnostics`."""

flight_options = _all_of(
    click.option(
        "--fail",
        "failures",
        multiple=True,
        type=FailureType(),
        metavar="ROBOT[@SECONDS]",
        help="Stop a motor of a drone (after 2 s). Repeatable.",
    ),
    click.option(
        "--distance",
        type=Finite(0, min_open=True),
        metavar="METRES",
        help="Minimum distance.  [default: 0.5 or less]",
    ),
    click.option(
        "--downwash",
        type=Finite(1),
        metavar="FACTOR",
        help="Factor of --distance for heights.  [default: 1]",
    ),
    click.option("--wind", type=WindType(), metavar="X[,Y,Z]", help="Wind, in m/s."),
    click.option("--gusts", type=Finite(0), metavar="M/S", help="Strength of gusts, in m/s."),
)
"""The options `--fail`, `--distance`, `--downwash`, `--wind` and `--gusts`."""

arm_option = click.option(
    "--arm",
    is_flag=True,
    help="Let vehicles and drones fly.",
)

improve_option = click.option(
    "--improve",
    type=Finite(0, min_open=True),
    metavar="SECONDS",
    help="After --deadline: publish better solutions.",
)
situation_options = _all_of(
    click.option(
        "--situation",
        metavar="SOURCE",
        help="Solve again when robots report changes: flight (simulated), rosbag2:FILE, or as for --ros.",
    ),
    click.option(
        "--patience",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        help="Silence after which a robot is lost.  [network: 10]",
    ),
    click.option(
        "--report-timeout",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        help="Longest wait for a report.  [default: 10]",
    ),
    click.option(
        "--battery",
        type=Finite(0, 1),
        metavar="LEVEL",
        help="Robots leave below this charge.  [default: 0.2]",
    ),
    improve_option,
    click.option("--use-sim-time", is_flag=True, help="Use the time on /clock of --situation for stamps."),
    click.option(
        "--obstacle",
        "obstacles",
        multiple=True,
        type=PointType(),
        metavar="X,Y,Z",
        help="An obstacle, in the problem's units. Repeatable.",
    ),
)
"""`--situation`, `--patience`, `--report-timeout`, `--battery`, `--improve`, `--use-sim-time` and `--obstacle`."""

CONDITIONS = {
    "failures": "--fail",
    "distance": "--distance",
    "downwash": "--downwash",
    "wind": "--wind",
    "gusts": "--gusts",
}
_SIMULATED = {**CONDITIONS, "obstacles": "--obstacle"}
_FROM_REPORTS = {"battery": "--battery", "report_timeout": "--report-timeout", "use_sim_time": "--use-sim-time"}
IN_FRAME = {"frame": "--frame", "scale": "--scale"}
PUBLISHED = {"ros_type": "--ros-type", "tf": "--tf", "diagnostics": "--diagnostics"}
NOT_PUBLISHED = "requires --ros SINK"


@dataclass(frozen=True)
class RosOptions:
    """The options in this module: sinks for decisions, and the source of the robots' situation.

    `flight` contains the given options of `FlightSettings`, and `published` the given options in `PUBLISHED`.
    """

    sinks: tuple[str, ...]
    situation: str | None
    frame: str
    scale: float | None
    report_timeout: float | None
    battery: float | None
    use_sim_time: bool
    published: Mapping[str, Any]
    flight: Mapping[str, Any]
    arm: bool = False

    def __bool__(self) -> bool:
        return bool(self.sinks or self.situation)

    @property
    def simulates_flight(self) -> bool:
        """True if the robots' situation is taken from a simulated flight."""
        return self.situation == FLIGHT


def pop_ros_options(settings: dict[str, Any]) -> RosOptions:
    """Remove this module's options from `settings`. Raises `click.UsageError` for an option that has no effect."""
    sinks, situation, arm = settings.pop("sinks"), settings.pop("situation"), settings.pop("arm")
    given = {name: settings.pop(name) for name in (*_SIMULATED, *_FROM_REPORTS, *IN_FRAME, *PUBLISHED)}
    asked = given_names(given)
    if situation != FLIGHT:
        refuse_given(_SIMULATED, asked, "applies to the simulated flight: add --situation flight")
    if situation in {None, FLIGHT}:
        refuse_given(_FROM_REPORTS, asked, "applies to reports of robots: add --situation mcap:FILE or another source")
    if not (sinks or situation):
        refuse_given(IN_FRAME, asked, NOT_PUBLISHED)
    if not sinks:
        refuse_given(PUBLISHED, asked, NOT_PUBLISHED)
    if arm and not sinks:
        raise click.UsageError("--arm requires --ros mavlink:FILE, crazyflie:FILE or crazyswarm2:FILE")
    flight = {name: given[name] for name in _SIMULATED if name in asked}
    frame = given["frame"] or FRAME
    return RosOptions(
        sinks,
        situation,
        frame,
        given["scale"],
        given["report_timeout"],
        given["battery"],
        bool(given["use_sim_time"]),
        {name: given[name] for name in PUBLISHED},
        flight,
        arm,
    )


def given_names(options: Mapping[str, Any]) -> set[str]:
    """Return the names of the options that were given."""
    return {name for name, value in options.items() if value not in (None, (), False)}


def refuse_given(options: Mapping[str, str], asked: set[str], why: str) -> None:
    """Raise `click.UsageError` with the reason `why` for the first of `options` that was given."""
    for name, option in options.items():
        if name in asked:
            raise click.UsageError(f"{option} {why}")
