"""`robochoc generate` of problems that teams have: meetings, sensors, targets, tasks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.generated import OUTPUT, Command, number, seed_option, share, team_written
from robochoc.cli.options.sections import COMMON, SectionedCommand

if TYPE_CHECKING:
    from robochoc.model.problem import Team


def model_option(name: str, choices: list[str], text: str) -> Callable[..., Any]:
    """Return an option that takes one of `choices`, by default the first."""
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
@number("--agents", "Number of persons.")
@number("--meetings", "Number of meetings.")
@number("--participants", "Persons in each meeting.", default=2)
@number("--slots", "Number of time slots.")
@number("--max-length", "Meetings take 1 to N slots.", default=1)
@number("--max-value", "Meetings are worth 1 to N a slot and person, free slots 0 to N.", most=1_000_000, default=10)
@model_option(
    "--model",
    ["peav", "eav", "tsav"],
    "peav: a robot is a person, with a variable for each of its meetings; eav: a robot is a meeting; tsav: a robot is a"
    " person, with a variable for each slot.",
)
@click.option("--required", is_flag=True, help="All meetings must take place, and preferences do not count: a DisCSP.")
@seed_option
@team_written("meetings-MODEL-AGENTS-MEETINGS-PARTICIPANTS-SLOTS-LENGTH-VALUE-SEED")
def meetings(**problem: Any) -> Team:  # noqa: ANN401 - `meetings`'s own
    """Distributed multi-event scheduling (DiMES; Maheswaran et al. 2004): what meetings are worth is maximised.

    A variable is the slot in which a meeting starts, or 0: it does not take place. Both models of a seed have the same
    maximum.

    \b
    robochoc generate meetings --agents 5 --meetings 4 --slots 5
    robochoc generate meetings --agents 5 --meetings 4 --slots 5 --max-length 2 --model eav
    robochoc generate meetings --agents 8 --meetings 6 --participants 3 --slots 6 --required
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
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
        number("--needed", "Sensors that a target needs.", most=10, default=3),
        number("--targets", "Number of targets."),
    ):
        command = option(command)
    return command


@click.command(short_help="SensorDCSP: three compatible sensors for each target.")
@number("--sensors", "Number of sensors.")
@_sensor_options
@share("--visibility", "Probability that a sensor sees a target", 0.5)
@share("--compatibility", "Probability that two sensors are compatible", 0.5)
@team_written("sensors-MODEL-SENSORS-TARGETS-NEEDED-VISIBILITY-COMPATIBILITY-SEED")
def sensors(**problem: Any) -> Team:  # noqa: ANN401 - `sensors`'s own
    """SensorDCSP (Bejar et al. 2005): each target is tracked by three sensors that see it and are compatible.

    A sensor tracks one target at most. Target2 has the variables S2.1, S2.2, S2.3; in the other model Sensor5 has T5.

    \b
    robochoc generate sensors --sensors 15 --targets 4
    robochoc generate sensors --sensors 15 --targets 4 --visibility 0.7 --model sensors
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
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
@number("--rows", "Rows of sensors.", least=2)
@number("--columns", "Columns of sensors.", least=2)
@_sensor_options
@number("--sight", "Sensors see the cells up to N away: 1, the four around them.", default=1)
@number("--hearing", "Sensors hear those up to N steps away, also diagonally.", default=1)
@share("--visibility", "Probability that a sensor that is near enough sees a target", 1)
@share("--compatibility", "Probability that two sensors that are near enough are compatible", 1)
@team_written("grid-sensors-MODEL-ROWSxCOLUMNS-TARGETS-NEEDED-SIGHT-HEARING-VISIBILITY-COMPATIBILITY-SEED")
def grid_sensors(**problem: Any) -> Team:  # noqa: ANN401 - `grid_sensors`'s own
    """GSensorDCSP (Bejar et al. 2005): sensors stand on the nodes of a grid, and targets in cells, one a cell at most.

    \b
    robochoc generate grid-sensors --rows 4 --columns 4 --targets 3
    robochoc generate grid-sensors --rows 5 --columns 5 --targets 5 --sight 2 --hearing 2 --visibility 0.8
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
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
@number("--agents", "Number of robots.")
@number("--targets", "Number of targets.", most=10_000)
@number("--side", "Rows and columns of the field.", most=100)
@number("--mobility", "Cells that a robot can go.", least=0, most=100, default=1)
@number("--sensing", "Cells that a robot can see.", least=0, most=100, default=2)
@number("--requirement", "How much of a target is to be covered.", default=100)
@number("--credibility", "Robots cover 1 to N of a target.", default=30)
@seed_option
@team_written("tracking-AGENTS-TARGETS-SIDExSIDE-MOBILITY-SENSING-REQUIREMENT-CREDIBILITY-SEED")
def tracking(**problem: Any) -> Team:  # noqa: ANN401 - `tracking`'s own
    """Target tracking (one step of DCOP_MST; Zivan et al. 2015): robots choose cells, and cover what they see.

    The cost is what is left of the targets' requirements. Each target is one function over all robots near it.

    \b
    robochoc generate tracking --agents 6 --targets 4 --side 8
    robochoc generate tracking --agents 12 --targets 10 --side 20 --mobility 2
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.generators.tracking import tracking as covering

    return covering(**problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--tasks", "--model", "--capacity"),
        "Worth": ("--worth", "--skills", "--skilled", "--side", "--distance", "--places"),
        "Output": OUTPUT,
    },
    short_help="Task allocation: skills, ways, one task a robot or several.",
)
@number("--agents", "Number of robots.")
@number("--tasks", "Number of tasks.")
@number("--side", "All lie in a square at whole coordinates from 0 to N.", most=10_000, default=100)
@number("--worth", "Tasks are worth 1 to N.", most=1_000_000, default=200)
@number("--skills", "Number of skills; a task asks for one.", most=100, default=1)
@number("--skilled", "Skills of a robot.", most=100, default=1)
@model_option("--distance", ["streets", "straight"], "Ways are along streets (Manhattan), or straight.")
@number("--places", "Decimal places of straight ways.", least=0, most=9, default=0)
@model_option(
    "--model", ["assignment", "several"], "A robot does one task at most, or several. A task is done by one at most."
)
@number("--capacity", "several: room of a robot; tasks take 1 to 3.", default=3)
@seed_option
@team_written("tasks-MODEL-AGENTS-TASKS-SIDE-WORTH-SKILLS-DISTANCE-SEED")
def tasks(**problem: Any) -> Team:  # noqa: ANN401 - `tasks`'s own
    """Task allocation (Gerkey and Mataric 2004; Scerri et al. 2005): the tasks' worth less the ways is maximised.

    \b
    robochoc generate tasks --agents 6 --tasks 5
    robochoc generate tasks --agents 6 --tasks 8 --skills 3 --skilled 2 --distance straight --places 2
    robochoc generate tasks --agents 4 --tasks 8 --model several --capacity 5
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.generators.families import tasks as allocation

    return allocation(**problem)
