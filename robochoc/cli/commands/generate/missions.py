"""`robochoc generate meetings`, `sensors`, `grid-sensors`, `tracking` and `tasks`: problems from applications."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.generate import OUTPUT, Command, number_option, seed_option, share_option, writes_team
from robochoc.cli.options.sections import COMMON, SectionedCommand

if TYPE_CHECKING:
    from robochoc.model.problem import Team


def model_option(name: str, choices: list[str], text: str) -> Callable[..., Any]:
    """Return an option whose value is one of `choices`. The first is the default."""
    return click.option(name, type=click.Choice(choices), default=choices[0], show_default=True, help=text)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--meetings", "--participants", "--slots", "--model"),
        "Preferences": ("--max-length", "--max-value", "--required"),
        "Output": OUTPUT,
    },
    short_help="Meetings with preferences (DiMES): PEAV, EAV and TSAV.",
)
@number_option("--agents", "Number of persons.")
@number_option("--meetings", "Number of meetings.")
@number_option("--participants", "Persons in each meeting.", default=2)
@number_option("--slots", "Number of time slots.")
@number_option("--max-length", "Meetings take 1 to N slots.", default=1)
@number_option(
    "--max-value", "Meetings are worth 1 to N per slot and person; free slots 0 to N.", most=1_000_000, default=10
)
@model_option(
    "--model",
    ["peav", "eav", "tsav", "words"],
    "peav: a robot is a person, with a variable for each of its meetings; eav: a robot is a meeting; tsav: a robot is a"
    " person, with a variable for each slot; words: peav with names of persons, meetings and times.",
)
@click.option("--required", is_flag=True, help="All meetings must take place, without preferences: a DisCSP.")
@seed_option
@writes_team("meetings-MODEL-AGENTS-MEETINGS-PARTICIPANTS-SLOTS-LENGTH-VALUE-SEED")
def meetings(**problem: Any) -> Team:  # noqa: ANN401 - `meetings`'s own
    """Distributed multi-event scheduling (DiMES; Maheswaran et al. 2004): maximise the worth of meetings.

    The value of a variable is the slot in which a meeting starts, or 0 if it does not take place. All models of a seed
    have the same maximum.

    \b
    robochoc generate meetings --agents 5 --meetings 4 --slots 5
    robochoc generate meetings --agents 5 --meetings 4 --slots 5 --max-length 2 --model eav
    robochoc generate meetings --agents 8 --meetings 6 --participants 3 --slots 6 --required
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.families import meetings as scheduling

    return scheduling(**problem)


def _sensor_options(command: Command) -> Command:
    for option in (
        seed_option,
        model_option(
            "--model",
            ["targets", "sensors"],
            "A robot is a target, which chooses its sensors, or a sensor, which chooses its target.",
        ),
        number_option("--needed", "Number of sensors per target.", most=10, default=3),
        number_option("--targets", "Number of targets."),
    ):
        command = option(command)
    return command


@click.command(short_help="SensorDCSP: three compatible sensors for each target.")
@number_option("--sensors", "Number of sensors.")
@_sensor_options
@share_option("--visibility", "Probability that a sensor sees a target", 0.5)
@share_option("--compatibility", "Probability that two sensors are compatible", 0.5)
@writes_team("sensors-MODEL-SENSORS-TARGETS-NEEDED-VISIBILITY-COMPATIBILITY-SEED")
def sensors(**problem: Any) -> Team:  # noqa: ANN401 - `sensors`'s own
    """SensorDCSP (Bejar et al. 2005): each target is tracked by three sensors that see it and are compatible.

    A sensor tracks at most one target. Target2 has the variables S2.1, S2.2, S2.3; in the other model Sensor5 has T5.

    \b
    robochoc generate sensors --sensors 15 --targets 4
    robochoc generate sensors --sensors 15 --targets 4 --visibility 0.7 --model sensors
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.sensors import sensors as tracked

    return tracked(**problem)


@click.command(
    "grid-sensors",
    cls=SectionedCommand,
    sections={
        COMMON: ("--rows", "--columns", "--targets", "--needed", "--model"),
        "Reach": ("--sight", "--hearing", "--visibility", "--compatibility"),
        "Output": OUTPUT,
    },
    short_help="GSensorDCSP: sensors on a grid, targets in its cells.",
)
@number_option("--rows", "Rows of sensors.", least=2)
@number_option("--columns", "Columns of sensors.", least=2)
@_sensor_options
@number_option("--sight", "Range of sight, in cells; 1: the four cells around a sensor.", default=1)
@number_option("--hearing", "Range of communication between sensors, in steps, also diagonal ones.", default=1)
@share_option("--visibility", "Probability that a sensor within range sees a target", 1)
@share_option("--compatibility", "Probability that two sensors within range are compatible", 1)
@writes_team("grid-sensors-MODEL-ROWSxCOLUMNS-TARGETS-NEEDED-SIGHT-HEARING-VISIBILITY-COMPATIBILITY-SEED")
def grid_sensors(**problem: Any) -> Team:  # noqa: ANN401 - `grid_sensors`'s own
    """GSensorDCSP (Bejar et al. 2005): sensors on the nodes of a grid, and at most one target in each cell.

    \b
    robochoc generate grid-sensors --rows 4 --columns 4 --targets 3
    robochoc generate grid-sensors --rows 5 --columns 5 --targets 5 --sight 2 --hearing 2 --visibility 0.8
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.families import grid_sensors as tracked

    return tracked(**problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--targets", "--side"),
        "Reach": ("--mobility", "--sensing", "--requirement", "--credibility"),
        "Output": OUTPUT,
    },
    short_help="Target tracking by mobile sensors (DCOP_MST).",
)
@number_option("--agents", "Number of robots.")
@number_option("--targets", "Number of targets.", most=10_000)
@number_option("--side", "Rows and columns of the field.", most=100)
@number_option("--mobility", "Number of cells that a robot can move.", least=0, most=100, default=1)
@number_option("--sensing", "Range of sight, in cells.", least=0, most=100, default=2)
@number_option("--requirement", "Required coverage of a target.", default=100)
@number_option("--credibility", "Coverage by one robot: 1 to N.", default=30)
@seed_option
@writes_team("tracking-AGENTS-TARGETS-SIDExSIDE-MOBILITY-SENSING-REQUIREMENT-CREDIBILITY-SEED")
def tracking(**problem: Any) -> Team:  # noqa: ANN401 - `tracking`'s own
    """Target tracking (one step of DCOP_MST; Zivan et al. 2015): robots choose cells, and cover the targets they see.

    The cost is the part of the targets' requirements that is not covered. Each target is a function over all robots
    near it.

    \b
    robochoc generate tracking --agents 6 --targets 4 --side 8
    robochoc generate tracking --agents 12 --targets 10 --side 20 --mobility 2
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.tracking import tracking as covering

    return covering(**problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--tasks", "--model", "--capacity"),
        "Worth": ("--worth", "--skills", "--skilled", "--side", "--distance", "--places"),
        "Output": OUTPUT,
    },
    short_help="Task allocation: skills, distances, one task per robot or several.",
)
@number_option("--agents", "Number of robots.")
@number_option("--tasks", "Number of tasks.")
@number_option("--side", "Robots and tasks are in a square, at integer coordinates 0 to N.", most=10_000, default=100)
@number_option("--worth", "Tasks are worth 1 to N.", most=1_000_000, default=200)
@number_option("--skills", "Number of skills; a task requires one.", most=100, default=1)
@number_option("--skilled", "Number of skills per robot.", most=100, default=1)
@model_option("--distance", ["streets", "straight"], "Distances along streets (Manhattan), or straight.")
@number_option("--places", "Decimal places of straight distances.", least=0, most=9, default=0)
@model_option(
    "--model", ["assignment", "several"], "A robot does at most one task, or several. At most one robot does a task."
)
@number_option("--capacity", "several: capacity of a robot; tasks use 1 to 3 of it.", default=3)
@seed_option
@writes_team("tasks-MODEL-AGENTS-TASKS-SIDE-WORTH-SKILLS-DISTANCE-SEED")
def tasks(**problem: Any) -> Team:  # noqa: ANN401 - `tasks`'s own
    """Task allocation (Gerkey and Mataric 2004; Scerri et al. 2005): maximise the worth of tasks minus distances.

    \b
    robochoc generate tasks --agents 6 --tasks 5
    robochoc generate tasks --agents 6 --tasks 8 --skills 3 --skilled 2 --distance straight --places 2
    robochoc generate tasks --agents 4 --tasks 8 --model several --capacity 5
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.families import tasks as allocation

    return allocation(**problem)
