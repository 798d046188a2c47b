"""`robochoc fly`: a result that was saved, flown by simulated quadrotors."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import InputPath, OutputFile, refuse_same_places
from robochoc.cli.options.ros import (
    FRAME,
    conditions_of,
    flight_options,
    open_sinks,
    ros_failures_told,
    ros_options,
)
from robochoc.cli.options.saved import saved_outcome, team_of, team_option
from robochoc.cli.reports.failures import INVALID, LOST, Failure, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.flight.flight import FlightLog
    from robochoc.flight.mission import Mission


@click.command()
@click.argument("saved", type=InputPath(), metavar="RESULT.json|JOURNAL")
@team_option
@ros_options
@flight_options
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of --gusts.")
@click.option("--html", type=OutputFile(), metavar="FILE", help="Write the 3D scene: one page that needs no server.")
@click.option("--serve", is_flag=True, help="Show the 3D scene live on this machine until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Print how it went as one JSON object.")
@invalid_input_fails
def fly(saved: Path, folder: Path | None, html: Path | None, *, serve: bool, as_json: bool, **given: Any) -> None:  # noqa: ANN401 - how it is flown and published
    """Fly what `robochoc solve --json` printed, or the journal that `--journal` wrote.

    Epoch by epoch the drones fly to their places, or land at the edge if they have withdrawn, and keep their distance.
    With --ros, each epoch's waypoints are published, and where all drones are 20 times a second, by the flight's
    own time, which begins at 0. The exit status is 4 if a drone did not arrive, fell, or came nearer than it may.
    """
    from robochoc.cli.reports.flight import as_planned, flight_json, report, too_late

    refuse_same_places({"--html": html}, {"the result": saved}, teams=[folder] if folder else [], sinks=given["sinks"])
    outcome = saved_outcome(saved)
    team = team_of(outcome, saved, folder)
    if given["sinks"] and team is None:
        raise click.UsageError("--ros publishes on the topics that robots' files name: give their folder with --team")
    from robochoc.flight.mission import mission_of

    mission = mission_of(outcome, team, given["scale"])
    flown, published = _flown(saved, mission, given)
    click.echo(flight_json(mission, flown) if as_json else report(mission, flown))
    if not as_json:
        for line in (*published, *too_late(given["failures"], flown)):
            click.echo(line, err=True)
    if html or serve:
        from robochoc.cli.reports.scene import scene_for, serve_scene, write_page

        scene = scene_for(outcome, team, mission=mission, flown=flown)
        if html:
            write_page(scene, html, quiet=as_json)
        if serve:
            serve_scene(scene)
    click.get_current_context().exit(0 if as_planned(flown) else LOST)


def _flown(saved: Path, mission: Mission, given: dict[str, Any]) -> tuple[FlightLog, list[str]]:
    """What was flown, and what of it was published where."""
    from robochoc.cli.reports.progress import stages
    from robochoc.flight.flight import fly as flight
    from robochoc.formats import on_one_line
    from robochoc.ros.sink_publisher import SinkPublisher, publish_flight

    conditions = conditions_of(given, mission)
    with ros_failures_told(), ExitStack() as stack:
        sinks = open_sinks(given["sinks"], stack)
        frame = given["frame"] or FRAME
        publishers = [SinkPublisher(mission.team, mission.drones, sink, frame) for sink in sinks]
        try:
            with stages(mission.team) as progress:
                flown = flight(mission, conditions, progress)
        except ValueError as refused:
            raise Failure(INVALID, on_one_line(f"{saved}: it cannot be flown: {refused}")) from refused
        publish_flight(mission, flown, publishers)
    return flown, [f"{publisher.place}: {publisher.summary}" for publisher in publishers]
