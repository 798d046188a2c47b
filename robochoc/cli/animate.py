"""`robochoc animate`: the 3D scene of a run that was saved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.failure import INVALID, Failure, invalid_input_fails
from robochoc.cli.paths import InputPath, OutputFile
from robochoc.cli.saved import saved_content

if TYPE_CHECKING:
    from robochoc.outcome import Outcome
    from robochoc.problem import Team

NEXT_STEP = "give what 'robochoc solve --json' or '--journal' wrote"


@click.command(short_help="Make the 3D scene of a saved result or journal.")
@click.argument("saved", type=InputPath(), metavar="RESULT.json|JOURNAL")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="The page to write; needed unless --serve.")
@click.option(
    "--team",
    "folder",
    type=InputPath(),
    metavar="DIR",
    help="The team's folder: it has the robots' names and topics.  [default: instances/TEAM, if it is there]",
)
@click.option("--serve", is_flag=True, help="Show the scene live on this machine until Ctrl-C.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port for --serve; 0 is any free one.")
@invalid_input_fails
def animate(saved: Path, output: Path | None, folder: Path | None, port: int, *, serve: bool) -> None:
    """Make the 3D scene of what `robochoc solve --json` printed, or of the journal that `--journal` wrote."""
    from robochoc.cli.scene import serve_scene, write_page
    from robochoc.formats import read_team
    from robochoc.view.scene import scene_of

    if not (output or serve):
        raise click.UsageError("say where the page goes (-o FILE), or show it live (--serve)")
    if port and not serve:
        raise click.UsageError("--port is for --serve")
    outcome = _outcome(saved)
    folder = folder or _usual_folder(outcome)
    team = read_team(folder) if folder else None
    if team and not _is_team_of(outcome, team):
        raise Failure(
            INVALID, f"{folder}: this is not the team of {saved}, {outcome.team} (give its folder with --team)"
        )
    scene = scene_of(outcome, team)
    if output:
        write_page(scene, output)
    if serve:
        serve_scene(scene, port)


def _is_team_of(outcome: Outcome, team: Team) -> bool:
    """Whether all who took part, and all that they decided, are known to `team` or come with its scenario."""
    from robochoc.ros.mission import everybody

    robots = everybody(team)
    names = {robot.name for robot in robots}
    variables = {variable.name for robot in robots for variable in robot.variables}
    epochs = outcome.epochs
    there = {*outcome.withdrawn, *(name for epoch in epochs for name in epoch.robots)}
    decided = {*outcome.assignment, *(name for epoch in epochs for name in epoch.assignment)}
    return there <= names and decided <= variables


def _usual_folder(outcome: Outcome) -> Path | None:
    """Where `generate` puts teams of that name, if it is there."""
    name = Path(outcome.team).name
    folder = Path("instances") / name
    if name not in {"", ".."} and folder.is_dir():
        return folder
    click.echo(f"{folder} is not there: drones are named for variables, without topics (give --team DIR)", err=True)
    return None


def _outcome(saved: Path) -> Outcome:
    """What the file tells of the end of a run."""
    from robochoc.formats.result import BadResult, read_result
    from robochoc.observers.journal import BadJournal, is_journal, read_journal

    content = saved_content(saved, NEXT_STEP)
    try:
        if not is_journal(content):
            return read_result(content)
        journal = read_journal(content)
    except (BadJournal, BadResult) as wrong:
        raise Failure(INVALID, f"{saved}: {wrong} ({NEXT_STEP})") from wrong
    if journal.outcome is None:
        why = journal.damage or "the run broke off"
        raise Failure(INVALID, f"{saved}: {why}, so there is no outcome to show ({NEXT_STEP})")
    return journal.outcome
