"""`robochoc generate`: problems of known families, as folders of XML files."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.failure import invalid_input_fails
from robochoc.cli.paths import InputPath


@click.group(short_help="Write a team of a known family.")
def generate() -> None:
    """Write a team of a known family as a folder of XML files."""


@generate.command(short_help="3D N^2 queens: one robot a cell of the board.")
@click.option("--n", required=True, type=click.IntRange(1, 64), help="Side of the cube: n x n robots, n levels.")
@click.option(
    "--model",
    type=click.Choice(["planar", "full"]),
    default="planar",
    show_default=True,
    help="planar: the constraints of the paper's Figure 2; full: the space diagonals attack too.",
)
@click.option("-o", "--output", type=InputPath(), help="Folder to write  [default: instances/queens3d-N]")
@click.option("--force", is_flag=True, help="Replace the folder if it is there.")
@invalid_input_fails
def queens3d(n: int, model: str, output: Path | None, *, force: bool) -> None:
    """3D N^2 queens: n x n robots, one a cell of the board; each chooses its level so that no two attack each other.

    A robot is named for its row and column, as in the paper: Robot3.1, with the variable V3.1.
    """
    from robochoc.formats import write_team
    from robochoc.generators.queens3d import queens3d as team_of_queens

    folder = output or Path("instances") / f"queens3d-{n}"
    write_team(team_of_queens(n, model), folder, replace=force)
    click.echo(f"{folder}: {n * n} robots; next: robochoc solve {folder}")
