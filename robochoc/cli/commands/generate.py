"""`robochoc generate`: problems of known families, as folders of XML files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import InputPath
from robochoc.cli.reports.failures import invalid_input_fails

if TYPE_CHECKING:
    from robochoc.model.problem import Team


@click.group()
def generate() -> None:
    """Write a team of a problem family as a folder of XML files."""


@generate.command(short_help="3D N^2 queens: one robot per cell or row of the board.")
@click.option(
    "--n", required=True, type=click.IntRange(1, 64), metavar="N", help="Side of the cube: N x N drones, N levels."
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
    """3D N^2 queens: N x N drones, one per cell of the board; each takes a level, and no two may attack each other.

    Robots are named by row and column, as in the paper: Robot3.1 has the variable V3.1. With --robots rows, Robot3 has
    the variables V3.1, V3.2, ...
    """
    from robochoc.formats import write_team
    from robochoc.generators.queens3d import queens3d as team_of_queens

    team = team_of_queens(n, model, robots)
    folder = output or Path("instances") / team.name
    write_team(team, folder, replace=force)
    click.echo(f"{folder}: {len(team.robots)} robots; next: robochoc solve {folder}")


@generate.command("random", short_help="Model B: random binary constraints.")
@click.option(
    "--agents",
    required=True,
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Number of robots, with one variable each.",
)
@click.option(
    "--domain", required=True, type=click.IntRange(1, 1000), metavar="N", help="Number of values of each variable."
)
@click.option(
    "--density", required=True, type=float, metavar="P", help="Fraction of pairs of robots with a constraint, 0 to 1."
)
@click.option(
    "--tightness",
    type=float,
    metavar="P",
    help="Fraction of pairs of values that a constraint forbids, 0 to 1.  [default: 0 with --max-cost, else required]",
)
@click.option(
    "--max-cost",
    type=click.IntRange(0, 1_000_000),
    metavar="COST",
    help="Make a DisWCSP: each allowed pair of values has a cost, uniform from 0 to COST.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Random seed.")
@click.option("--connected", is_flag=True, help="Draw constraint graphs until one is connected.")
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    metavar="DIR",
    help="Folder to write.  [default: instances/random-AGENTS-DOMAIN-DENSITY-TIGHTNESS[-costMAX]-SEED[-connected]]",
)
@click.option("--force", is_flag=True, help="Replace the folder if it exists.")
@invalid_input_fails
def random_problem(output: Path | None, *, force: bool, **problem: Any) -> None:  # noqa: ANN401 - `random_csp`'s own
    """Uniform random problems (Model B; Prosser 1996, Gent et al. 2001), the usual benchmark of protocols.

    Exactly the given fractions of pairs are drawn. Robot3 has the variable V3. At --agents 20 --domain 10 --density
    0.2, the problems are hardest at --tightness 0.65, where about half of them have a solution.

    With --max-cost, allowed pairs have costs, whose sum is to be minimised: --agents 10 --domain 5 --density 0.4
    --max-cost 100.
    """
    from robochoc.generators.random_csp import random_csp

    if problem["tightness"] is None and problem["max_cost"] is None:
        raise click.UsageError("Missing option '--tightness' (without --max-cost).")
    problem["tightness"] = problem["tightness"] or 0
    _write(lambda: random_csp(**problem), output, replace=force)


@generate.command(short_help="Graph colouring with a cost for each conflict.")
@click.option(
    "--agents",
    required=True,
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Number of robots, with one variable each.",
)
@click.option(
    "--colors",
    default=3,
    show_default=True,
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Number of values of each variable.",
)
@click.option("--degree", required=True, type=float, metavar="D", help="Average number of neighbours.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Random seed.")
@click.option("--connected", is_flag=True, help="Draw graphs until one is connected.")
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    metavar="DIR",
    help="Folder to write.  [default: instances/coloring-AGENTS-COLORS-DEGREE-SEED[-connected]]",
)
@click.option("--force", is_flag=True, help="Replace the folder if it exists.")
@invalid_input_fails
def coloring(output: Path | None, *, force: bool, **problem: Any) -> None:  # noqa: ANN401 - `coloring`'s own
    """Graph colouring on a random graph (a DisWCSP): two neighbours of the same colour cost 1.

    The graph is uniform among those with exactly AGENTS x DEGREE / 2 edges. Robot3 has the variable V3.
    """
    from robochoc.generators.coloring import coloring as graph_to_color

    _write(lambda: graph_to_color(**problem), output, replace=force)


def _write(make: Callable[[], Team], output: Path | None, *, replace: bool) -> None:
    """Write what `make` makes; numbers that do not fit together are wrong usage."""
    from robochoc.formats import write_team

    try:
        team = make()
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    folder = output or Path("instances") / team.name
    write_team(team, folder, replace=replace)
    constraints = sum(len(robot.shared) for robot in team.robots)
    click.echo(f"{folder}: {len(team.robots)} robots, {constraints} constraints; next: robochoc solve {folder}")
