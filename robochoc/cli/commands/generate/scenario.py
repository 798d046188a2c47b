"""`robochoc generate scenario`: adds a random scenario to a team."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.options.generate import seed_option
from robochoc.cli.options.paths import InputPath, TeamFolder
from robochoc.cli.options.value_types import Number, WholeNumber
from robochoc.cli.reports.failures import invalid_input_fails

KINDS = ("remove-value", "add-value", "remove-constraint", "add-constraint", "remove-agent", "add-agent")


@click.command(short_help="A random scenario for a team: changes over time.")
@click.argument("team", type=TeamFolder())
@click.option("--events", required=True, type=WholeNumber(1, 1000), metavar="N", help="Number of events.")
@click.option(
    "--rate",
    default=0.1,
    show_default=True,
    type=Number(0, 1),
    metavar="R",
    help="Changes per event, as a share of the team's shared constraints; at least one.",
)
@click.option("--kinds", multiple=True, type=click.Choice(KINDS), help="Kind of changes. Repeatable.  [default: all]")
@click.option(
    "--after",
    type=WholeNumber(1, 1_000_000),
    metavar="N",
    help="Events occur after N messages.  [default: when the previous problem is solved]",
)
@seed_option
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    metavar="DIR",
    help="Folder to write.  [default: instances/TEAM-eventsN-RATE[-KINDS]-SEED]",
)
@click.option("--force", is_flag=True, help="Replace the folder if it exists; it may be that of the team.")
@invalid_input_fails
def scenario(
    team: Path,
    events: int,
    rate: float,
    kinds: tuple[str, ...],
    after: int | None,
    seed: int,
    output: Path | None,
    *,
    force: bool,
) -> None:
    """Write a copy of a team with a random scenario: constraints, values and robots are added and removed.

    Each event is valid for the team at that time. Removed parts may be added again.

    \b
    robochoc generate scenario instances/queens3d-4 --events 5
    robochoc generate scenario out/random --events 10 --rate 0.05 --kinds add-constraint --kinds remove-constraint
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.formats import read_team, write_team
    from robochoc.formats.team_reader import GROUND_FILE
    from robochoc.generators.scenario import random_scenario

    try:
        changing = random_scenario(read_team(team), events, rate, seed, kinds=kinds, after=after)
    except ValueError as error:
        from robochoc.formats import InvalidInputError

        if isinstance(error, InvalidInputError):
            raise
        raise click.UsageError(str(error)) from None
    folder = output or Path("instances") / changing.name
    ground = team / GROUND_FILE
    beside = {GROUND_FILE: ground.read_bytes()} if ground.is_file() else {}
    write_team(changing, folder, replace=force, extra_files=beside)
    changes = sum(len(event.changes) for event in changing.scenario)
    click.echo(f"{folder}: {events} events, {changes} changes; next: robochoc solve {folder}")
