"""`robochoc animate`: the 3D scene of a run that was saved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.failure import BadInput, invalid_input_fails
from robochoc.cli.output import OutputFile

if TYPE_CHECKING:
    from robochoc.outcome import Outcome

LARGEST_FILE = 1 << 30
"""1 GiB: a journal of millions of messages."""
NEXT_STEP = "give what 'robochoc solve --json' or '--journal' wrote"


@click.command(short_help="Make the 3D scene of a saved result or journal.")
@click.argument("saved", type=click.Path(path_type=Path), metavar="RESULT.json|JOURNAL")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="The page to write.")
@click.option(
    "--team",
    "folder",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="The team's folder, for the places that its topics name.  [default: instances/TEAM, if it is there]",
)
@click.option("--serve", is_flag=True, help="Show the scene live on this machine until Ctrl-C.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of --serve; 0 is any free one.")
@invalid_input_fails
def animate(saved: Path, output: Path | None, folder: Path | None, port: int, *, serve: bool) -> None:
    """Make the 3D scene of what `robochoc solve --json` printed, or of the journal that `--journal` wrote."""
    from robochoc.cli.scene import serve_scene, write_page
    from robochoc.formats import read_team
    from robochoc.view.scene import scene_of

    if not (output or serve):
        raise click.UsageError("say where the page goes (-o FILE), or show it live (--serve)")
    outcome = _outcome(saved)
    if folder is None:
        usual = Path("instances") / Path(outcome.team).name
        folder = usual if usual.is_dir() else None
    scene = scene_of(outcome, read_team(folder) if folder else None)
    if output:
        write_page(scene, output)
    if serve:
        serve_scene(scene, port)


def _outcome(saved: Path) -> Outcome:
    """What the file tells of the end of a run."""
    from robochoc.formats.result import BadResult, read_result
    from robochoc.observers.journal import BadJournal, is_journal, read_journal

    try:
        with saved.open("rb") as file:
            content = file.read(LARGEST_FILE)
    except OSError as error:
        raise BadInput(f"{saved}: {error.strerror} ({NEXT_STEP})") from error
    try:
        if not is_journal(content):
            return read_result(content)
        outcome = read_journal(content).outcome
    except (BadJournal, BadResult) as wrong:
        raise BadInput(f"{saved}: {wrong} ({NEXT_STEP})") from wrong
    if outcome is None:
        raise BadInput(f"{saved}: the run broke off before an outcome, so there is nothing to show")
    return outcome
