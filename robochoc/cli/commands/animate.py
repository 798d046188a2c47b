"""`robochoc animate`: the 3D scene of a saved result."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.options.paths import InputPath, refuse_same_places
from robochoc.cli.options.saved import saved_outcome, saved_team, team_option
from robochoc.cli.options.scene import ground_map, html_option, map_option, serve_option
from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import invalid_input_fails


@click.command()
@click.argument("saved", type=InputPath(), metavar="RESULT.json|JOURNAL")
@html_option("-o", "--output")
@serve_option
@team_option
@map_option
@click.option("--port", type=WholeNumber(0, 65535), default=0, metavar="N", help="Port of --serve; 0 is a free port.")
@invalid_input_fails
def animate(
    saved: Path, html: Path | None, folder: Path | None, ground: Path | None, port: int, *, serve: bool
) -> None:
    """Write or show the 3D scene of a result that 'robochoc solve' saved with --json or --journal.

    The page is the same as that of 'robochoc solve --html'. 'robochoc fly' also simulates the flight.

    \b
    robochoc solve instances/queens3d-4 --withdraw --json > out/result.json
    robochoc animate out/result.json --html out/page.html
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.scene import scene_for, show_scene

    if not (html or serve):
        raise click.UsageError("no output: write the page with --html FILE, or show it with --serve")
    if port and not serve:
        raise click.UsageError("--port requires --serve")
    refuse_same_places({"--html": html}, {"the result": saved, "--map": ground}, teams=[folder] if folder else [])
    outcome, team = saved_outcome(saved)
    team, folder = saved_team(outcome, team, saved, folder)
    from robochoc.flight.mission import mission_of

    mission = mission_of(outcome, team, ground=ground_map(ground, folder))
    show_scene(scene_for(outcome, team, mission=mission), html, serve=serve, port=port)
