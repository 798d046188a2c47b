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
@click.option(
    "--tightness",
    type=float,
    help="Part of all pairs of values that is forbidden, 0 to 1  [default: 0 with --max-cost, else required]",
)
@click.option(
    "--max-cost",
    type=click.IntRange(0, 1_000_000),
    help="Make a DisWCSP: each pair of values that is not forbidden costs from 0 to this, all as likely.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="The same seed, the same problem.")
@click.option("--connected", is_flag=True, help="Draw graphs of constraints until one is connected.")
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    help="Folder to write  [default: instances/random-AGENTS-DOMAIN-DENSITY-TIGHTNESS[-costMAX]-SEED[-connected]]",
)
@click.option("--force", is_flag=True, help="Replace the folder if it is there.")
@invalid_input_fails
def random_problem(output: Path | None, *, force: bool, **problem: Any) -> None:  # noqa: ANN401 - `random_csp`'s own
    """Uniform random problems (Model B; Prosser 1996, Gent et al. 2001), the usual benchmark of protocols.

    Of all pairs of robots exactly the part DENSITY is constrained, and each constraint forbids exactly the part
    TIGHTNESS of all pairs of values. Robot3 has the variable V3. At --agents 20 --domain 10 --density 0.2, about half
    of the problems have a solution at --tightness 0.65; there they are hardest.

    With --max-cost, what is not forbidden costs something, and the sum of costs is to be minimised: --agents 10
    --domain 5 --density 0.4 --max-cost 100.
    """
    from robochoc.generators.random_csp import random_csp

    if problem["tightness"] is None and problem["max_cost"] is None:
        raise click.UsageError("Missing option '--tightness' (without --max-cost).")
    problem["tightness"] = problem["tightness"] or 0
    _write(lambda: random_csp(**problem), output, replace=force)


@generate.command(short_help="Graph colouring with too few colours: a cost for each conflict.")
@click.option("--agents", required=True, type=click.IntRange(1, 1000), help="Robots, of one variable each.")
@click.option("--colors", default=3, show_default=True, type=click.IntRange(1, 1000), help="Values of each variable.")
@click.option("--degree", required=True, type=float, help="Neighbours of a robot, on the average.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="The same seed, the same problem.")
@click.option("--connected", is_flag=True, help="Draw graphs until one is connected.")
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    help="Folder to write  [default: instances/coloring-AGENTS-COLORS-DEGREE-SEED[-connected]]",
)
@click.option("--force", is_flag=True, help="Replace the folder if it is there.")
@invalid_input_fails
def coloring(output: Path | None, *, force: bool, **problem: Any) -> None:  # noqa: ANN401 - `coloring`'s own
    """Random graphs to be coloured (a DisWCSP): two neighbours of one colour cost 1.

    The graph has exactly AGENTS x DEGREE / 2 edges, every such graph as likely as any other. Robot3 has the variable
    V3.
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
