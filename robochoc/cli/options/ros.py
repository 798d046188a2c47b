"""Options of the commands that publish decisions, fly them, and receive what robots report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from robochoc.cli.options.ros_types import FailureType, Finite, FrameType, PointType, WindType

Command = TypeVar("Command", bound=Callable[..., object])

FLIGHT = "flight"
"""The value of `--situation` for the simulation."""
FRAME = "map"


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
            "Publish waypoints: mcap:FILE, rosbag:FILE, dds, rmw_zenoh, rclpy, rospy, rosbridge://HOST:PORT"
            ", mavlink:FILE, crazyflie:FILE, others. Repeatable."
        ),
    ),
    click.option("--frame", type=FrameType(), metavar="NAME", help=f"Frame of all positions.  [default: {FRAME}]"),
    click.option(
        "--scale",
        type=Finite(1e-6, 1e6),
        metavar="METRES",
        help="Metres a unit.  [default: 1 or less]",
    ),
    click.option("--ros-type", "ros_type", metavar="TYPE", help="ROS type of all waypoints, such as nav_msgs/Path."),
    click.option("--tf", is_flag=True, help="Goals become frames on /tf_static, flights on /tf."),
    click.option("--diagnostics", is_flag=True, help="Publish verdict, epoch and cost on /diagnostics."),
)
"""`--ros`, `--frame`, `--scale`, `--ros-type`, `--tf`, `--diagnostics`."""

flight_options = _optional(
    click.option(
        "--fail",
        "failures",
        multiple=True,
        type=FailureType(),
        metavar="ROBOT[@SECONDS]",
        help="Stop a motor of its drone (after 2 s). Repeatable.",
    ),
    click.option(
        "--distance",
        type=Finite(0, min_open=True),
        metavar="METRES",
        help="Distance that drones keep.  [default: 0.5 or less]",
    ),
    click.option(
        "--downwash",
        type=Finite(1),
        metavar="FACTOR",
        help="Distances kept right above each other.  [default: 1]",
    ),
    click.option("--wind", type=WindType(), metavar="X[,Y,Z]", help="Wind, in m/s."),
    click.option("--gusts", type=Finite(0), metavar="M/S", help="Strength of gusts, in m/s."),
)
"""`--fail`, `--distance`, `--downwash`, `--wind`, `--gusts`."""

arm_option = click.option(
    "--arm",
    is_flag=True,
    help="Let vehicles of mavlink: and crazyflie: fly.",
)

improve_option = click.option(
    "--improve",
    type=Finite(0, min_open=True),
    metavar="SECONDS",
    help="After --deadline: search on, publish better.",
)
situation_options = _optional(
    click.option(
        "--situation",
        metavar="SOURCE",
        help=("Solve again when robots report a change: flight (a simulated one), or as for --ros, or rosbag2:FILE."),
    ),
    click.option(
        "--patience",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        help=("A robot out of reach, or stopped, for so long is lost.  [default: no limit; on a network 10]"),
    ),
    click.option(
        "--report-timeout",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        help="With --situation: wait so long.  [default: 10]",
    ),
    click.option(
        "--battery",
        type=Finite(0, 1),
        metavar="LEVEL",
        help="A robot leaves below this charge.  [default: 0.2]",
    ),
    improve_option,
    click.option("--use-sim-time", is_flag=True, help="Stamps are the time on /clock of --situation."),
    click.option(
        "--obstacle",
        "obstacles",
        multiple=True,
        type=PointType(),
        metavar="X,Y,Z",
        help="An obstacle, in the problem's units. Repeatable.",
    ),
)
"""`--situation`, `--patience`, `--report-timeout`, `--battery`, `--improve`, `--use-sim-time`, `--obstacle`."""

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
NOT_PUBLISHED = "is for what is published: add --ros SINK"


@dataclass(frozen=True)
class RosOptions:
    """The options of this file: where decisions go, and where the robots' situation comes from.

    `flight` holds those of `FlightSettings` that were given, and `published` those of `PUBLISHED`.
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


def take_ros_options(settings: dict[str, Any]) -> RosOptions:
    """Take the options of this file out of `settings`. Raises `click.UsageError` for one that would be ignored."""
    sinks, situation, arm = settings.pop("sinks"), settings.pop("situation"), settings.pop("arm")
    given = {name: settings.pop(name) for name in (*_SIMULATED, *_FROM_REPORTS, *IN_FRAME, *PUBLISHED)}
    asked = given_names(given)
    if situation != FLIGHT:
        refuse(_SIMULATED, asked, "is for the simulated flight: add --situation flight")
    if situation in {None, FLIGHT}:
        refuse(_FROM_REPORTS, asked, "is for robots that report: add --situation mcap:FILE, or another source")
    if not (sinks or situation):
        refuse(IN_FRAME, asked, NOT_PUBLISHED)
    if not sinks:
        refuse(PUBLISHED, asked, NOT_PUBLISHED)
    if arm and not sinks:
        raise click.UsageError("--arm is for robots that are commanded: add --ros mavlink:FILE, or crazyflie:FILE")
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


def refuse(options: Mapping[str, str], asked: set[str], why: str) -> None:
    """Raise `click.UsageError` for the first of `options` that was `asked` for."""
    for name, option in options.items():
        if name in asked:
            raise click.UsageError(f"{option} {why}")
