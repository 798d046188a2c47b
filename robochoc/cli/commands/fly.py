"""`robochoc fly`: simulated quadrotors fly a saved result."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import InputPath, refuse_same_places
from robochoc.cli.options.ros import FRAME, flight_options, ros_options
from robochoc.cli.options.ros_setup import (
    conditions_of,
    open_sinks,
    publish_options,
    ros_errors_as_failures,
    scale_usage,
    sink_places,
)
from robochoc.cli.options.saved import saved_outcome, saved_team, team_option
from robochoc.cli.options.scene import ground_map, html_option, map_option, serve_option
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.options.value_types import Seed
from robochoc.cli.reports.failures import INVALID, LOST, Failure, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.flight.log import FlightLog
    from robochoc.flight.mission import Mission


_SECTIONS: Sections = {
    COMMON: ("--html", "--serve", "--json", "--team", "--map", "--help"),
    "Simulated flight": ("--fail", "--distance", "--downwash", "--wind", "--gusts", "--seed"),
    "ROS (documentation, page ROS)": ("--ros", "--frame", "--scale", "--ros-type", "--tf", "--diagnostics"),
}


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("saved", type=InputPath(), metavar="RESULT.json|JOURNAL")
@team_option
@map_option
@ros_options
@flight_options
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Seed of --gusts.")
@html_option()
@serve_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@invalid_input_fails
def fly(saved: Path, folder: Path | None, html: Path | None, *, serve: bool, as_json: bool, **given: Any) -> None:  # noqa: ANN401 - options of the flight and of ROS
    """Simulate the flight of a result that 'robochoc solve' saved with --json or --journal.

    In each epoch the drones fly to their positions at a safe distance from each other; drones of withdrawn robots land
    at the edge. Teams that were generated on a map fly around its walls. --ros publishes the waypoints of each epoch,
    and all poses 20 times a second of simulated time. The exit status is 4 if a drone did not arrive, fell, or came too
    close to another drone or a wall.

    \b
    robochoc solve instances/queens3d-4 --withdraw --json > out/result.json
    robochoc fly out/result.json --html out/flight.html --wind 3
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.flight import as_planned, flight_json, flight_report, late_failures

    refuse_same_places(
        {"--html": html},
        {"the result": saved, "--map": given["ground"]},
        teams=[folder] if folder else [],
        more_outputs=sink_places(given["sinks"]),
    )
    outcome, team = saved_outcome(saved)
    team, folder = saved_team(outcome, team, saved, folder)
    if given["sinks"] and team is None:
        raise click.UsageError("--ros requires the robots' files, which name the topics: give their folder with --team")
    from robochoc.flight.mission import mission_of

    ground = ground_map(given["ground"], folder)
    with scale_usage():
        mission = mission_of(outcome, team, given["scale"], ground)
    flown, published = _flown(saved, mission, given)
    click.echo(flight_json(mission, flown) if as_json else flight_report(mission, flown))
    if not as_json:
        for line in (*published, *late_failures(given["failures"], flown)):
            click.echo(line, err=True)
    if html or serve:
        from robochoc.cli.reports.scene import scene_for, show_scene

        show_scene(scene_for(outcome, team, mission=mission, flown=flown), html, serve=serve, quiet=as_json)
    click.get_current_context().exit(0 if as_planned(flown) else LOST)


def _flown(saved: Path, mission: Mission, given: dict[str, Any]) -> tuple[FlightLog, list[str]]:
    """Fly the mission, and return the log and a line for each sink."""
    from robochoc.cli.reports.progress import stages
    from robochoc.flight.flight import fly as flight
    from robochoc.formats import on_one_line
    from robochoc.robots.mission_publisher import publish_flight
    from robochoc.ros.publisher import SinkPublisher

    conditions = conditions_of(given, mission)
    with ros_errors_as_failures(), ExitStack() as stack:
        sinks = open_sinks(given["sinks"], stack)
        frame = given["frame"] or FRAME
        options = publish_options(given)
        publishers = [SinkPublisher(mission.team, mission.drones, sink, frame, options) for sink in sinks]
        try:
            with stages(mission.team) as progress:
                flown = flight(mission, conditions, progress)
        except ValueError as error:
            raise Failure(INVALID, on_one_line(f"{saved}: the result cannot be flown: {error}")) from error
        publish_flight(mission, flown, publishers)
    return flown, [f"{publisher.place}: {publisher.summary}" for publisher in publishers]
