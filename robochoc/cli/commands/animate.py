"""`robochoc animate`: the 3D scene of a run that was saved."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.options.paths import InputPath, OutputFile, refuse_same_places
from robochoc.cli.options.saved import saved_outcome, team_of, team_option
from robochoc.cli.reports.failures import invalid_input_fails


@click.command()
@click.argument("saved", type=InputPath(), metavar="RESULT.json|JOURNAL")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="The page to write; needed unless --serve.")
@team_option
@click.option("--serve", is_flag=True, help="Show the scene live on this machine until Ctrl-C.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port for --serve; 0 is any free one.")
@invalid_input_fails
def animate(saved: Path, output: Path | None, folder: Path | None, port: int, *, serve: bool) -> None:
    """Make the 3D scene of what `robochoc solve --json` printed, or of the journal that `--journal` wrote."""
    from robochoc.cli.reports.scene import scene_for, serve_scene, write_page

    if not (output or serve):
        raise click.UsageError("say where the page goes (-o FILE), or show it live (--serve)")
    if port and not serve:
        raise click.UsageError("--port is for --serve")
    refuse_same_places({"-o": output}, {"the result": saved}, teams=[folder] if folder else [])
    outcome = saved_outcome(saved)
    team = team_of(outcome, saved, folder)
    scene = scene_for(outcome, team)
    if output:
        write_page(scene, output)
    if serve:
        serve_scene(scene, port)
