"""`robochoc generate`: problems of known families, as folders of XML files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from robochoc.cli.failure import invalid_input_fails
from robochoc.cli.paths import InputPath


@click.group(short_help="Write a team of a known family.")
def generate() -> None:
    """Write a team of a known family as a folder of XML files."""


@generate.command(short_help="3D N^2 queens: one robot a cell, or a row, of the board.")
@click.option("--n", required=True, type=click.IntRange(1, 64), help="Side of the cube: n x n drones, n levels.")
@click.option(
    "--model",
    type=click.Choice(["planar", "full"]),
    default="planar",
    show_default=True,
    help="planar: the constraints of the paper's Figure 2; full: the space diagonals attack too.",
)
@click.option(
    "--robots",
    type=click.Choice(["cells", "rows"]),
    default="cells",
    show_default=True,
    help="cells: a robot flies one drone; rows: a robot flies all drones of a row (n variables).",
)
@click.option("-o", "--output", type=InputPath(), help="Folder to write  [default: instances/queens3d-N[-rows]]")
@click.option("--force", is_flag=True, help="Replace the folder if it is there.")
@invalid_input_fails
def queens3d(n: int, model: str, robots: str, output: Path | None, *, force: bool) -> None:
    """3D N^2 queens: n x n drones, one a cell of the board; each takes a level so that no two attack each other.

    A robot is named for its row and column, as in the paper: Robot3.1, with the variable V3.1. With --robots rows,
    Robot3 has the variables V3.1, V3.2, ...
    """
    from robochoc.formats import write_team
    from robochoc.generators.queens3d import queens3d as team_of_queens

    team = team_of_queens(n, model, robots)
    folder = output or Path("instances") / team.name
    write_team(team, folder, replace=force)
    click.echo(f"{folder}: {len(team.robots)} robots; next: robochoc solve {folder}")


@generate.command("random", short_help="Model B: random binary constraints, as many and as tight as asked.")
@click.option("--agents", required=True, type=click.IntRange(1, 1000), help="Robots, of one variable each.")
@click.option("--domain", required=True, type=click.IntRange(1, 1000), help="Values of each variable.")
@click.option("--density", required=True, type=float, help="Part of all pairs of robots that is constrained, 0 to 1.")
@click.option("--tightness", required=True, type=float, help="Part of all pairs of values that is forbidden, 0 to 1.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="The same seed, the same problem.")
@click.option("--connected", is_flag=True, help="Draw graphs of constraints until one is connected.")
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    help="Folder to write  [default: instances/random-AGENTS-DOMAIN-DENSITY-TIGHTNESS-SEED[-connected]]",
)
@click.option("--force", is_flag=True, help="Replace the folder if it is there.")
@invalid_input_fails
def random_problem(output: Path | None, *, force: bool, **problem: Any) -> None:  # noqa: ANN401 - `random_csp`'s own
    """Uniform random problems (Model B; Prosser 1996, Gent et al. 2001), the usual benchmark of protocols.

    Of all pairs of robots exactly the part DENSITY is constrained, and each constraint forbids exactly the part
    TIGHTNESS of all pairs of values. Robot3 has the variable V3. At --agents 20 --domain 10 --density 0.2, about half
    of the problems have a solution at --tightness 0.65; there they are hardest.
    """
    from robochoc.formats import write_team
    from robochoc.generators.random_csp import random_csp

    try:
        team = random_csp(**problem)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    folder = output or Path("instances") / team.name
    write_team(team, folder, replace=force)
    constraints = sum(len(robot.shared) for robot in team.robots)
    click.echo(f"{folder}: {len(team.robots)} robots, {constraints} constraints; next: robochoc solve {folder}")
