"""`robochoc generate queens3d`: the 3D N^2 queens problem."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.options.generate import next_step
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import invalid_input_fails
from robochoc.cli.reports.progress import elapsed_time

MAX_N = 49
"""The limit in `generators/queens3d.py`, repeated here because that module is not imported at the start."""


@click.command(short_help="3D N^2 queens: one robot per cell or row of the board.")
@click.option(
    "--n", required=True, type=WholeNumber(1, MAX_N), metavar="N", help="Side of the cube: N x N drones, N levels."
)
@click.option(
    "--model",
    type=click.Choice(["planar", "full"]),
    default="planar",
    show_default=True,
    help="planar: constraints of the paper's Figure 2; full: with space diagonals.",
)
@click.option(
    "--robots",
    type=click.Choice(["cells", "rows"]),
    default="cells",
    show_default=True,
    help="cells: one drone per robot; rows: all drones of a row per robot (N variables).",
)
@click.option(
    "-o", "--output", type=InputPath(), metavar="DIR", help="Folder to write.  [default: instances/queens3d-N[-rows]]"
)
@click.option("--force", is_flag=True, help="Replace the folder if it exists.")
@invalid_input_fails
def queens3d(n: int, model: str, robots: str, output: Path | None, *, force: bool) -> None:
    """3D N^2 queens: N x N drones, one per cell of the board; each chooses a level such that no two attack each other.

    Robots are named by row and column, as in the paper: Robot3.1 has the variable V3.1. With --robots rows, Robot3 has
    the variables V3.1, V3.2, ...
    """
    from robochoc.formats import write_team
    from robochoc.generators.queens3d import queens3d as team_of_queens

    with elapsed_time("generate", f"writing the robots of {n:,} x {n:,} cells"):
        team = team_of_queens(n, model, robots)
        folder = output or Path("instances") / team.name
        write_team(team, folder, replace=force)
    count = len(team.robots)
    click.echo(f"{folder}: {count} robots; {next_step(folder, count)}")
