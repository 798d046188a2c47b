"""Options that families of `robochoc generate` share, and the writing of what they make."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from robochoc.cli.options.numbers import Number, WholeNumber
from robochoc.cli.options.paths import InputPath
from robochoc.cli.reports.failures import invalid_input_fails
from robochoc.cli.reports.progress import elapsed_time

if TYPE_CHECKING:
    from robochoc.formats.ground_map import GroundMap
    from robochoc.generators.graphs import Graph
    from robochoc.model.problem import Team

MAX = 1000
MAX_NODES = 1_000_000
"""As `generators/draws.py` has it, which is not imported at the start."""
MAX_PROCESSES = 1000
"""With more robots, the simulator is proposed: docs/guides/large-teams.md."""
Options = dict[str, Any]
Command = Callable[..., None]
TeamOnMap: TypeAlias = "tuple[Team, GroundMap]"


def number(name: str, text: str, *, least: int = 1, most: int = MAX, default: int | None = None) -> Callable[..., Any]:
    """Return an option that takes an integer; required unless it has a default."""
    return click.option(
        name,
        required=default is None,
        default=default,
        show_default=default is not None,
        type=WholeNumber(least, most),
        metavar="N",
        help=text,
    )


def share(name: str, text: str, default: float) -> Callable[..., Any]:
    """Return an option that takes a share or a probability."""
    return click.option(
        name, default=default, show_default=True, type=Number(0, 1), metavar="P", help=f"{text}, 0 to 1."
    )


seed_option = click.option(
    "--seed", type=WholeNumber(0), default=0, show_default=True, metavar="N", help="Random seed."
)


def team_written(folder: str) -> Callable[[Callable[..., Team | TeamOnMap]], Command]:
    """Return a decorator: the command makes a team, which is written to a folder of -o, or called after the team.

    `folder` is how the help calls that. Numbers that do not fit together (`ValueError`) are wrong usage.
    """

    def decorate(make: Callable[..., Team | TeamOnMap]) -> Command:
        @click.option(
            "-o", "--output", type=InputPath(), metavar="DIR", help=f"Folder to write.  [default: instances/{folder}]"
        )
        @click.option("--force", is_flag=True, help="Replace the folder if it exists.")
        @invalid_input_fails
        @wraps(make)
        def command(output: Path | None, *, force: bool, **problem: Any) -> None:  # noqa: ANN401 - `make`'s own
            write(lambda: make(**problem), output, replace=force)

        return command

    return decorate


def write(make: Callable[[], Team | TeamOnMap], output: Path | None, *, replace: bool) -> None:
    """Write what `make` makes; numbers that do not fit together are wrong usage.

    With a map of the ground, that is written beside the team, as `robochoc fly --map` reads it.
    """
    from robochoc.formats import InvalidInputError, write_team
    from robochoc.formats.folder import GROUND_FILE

    try:
        with elapsed_time("generate", "drawing the problem"):
            made = make()
    except InvalidInputError:
        raise
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    team, ground = made if isinstance(made, tuple) else (made, None)
    folder = output or Path("instances") / team.name
    beside = {}
    if ground:
        from robochoc.formats.ground_map import ground_map_json

        beside[GROUND_FILE] = ground_map_json(ground)
    with elapsed_time("generate", f"writing {len(team.robots):,} robots"):
        write_team(team, folder, replace=replace, beside=beside)
    constraints = sum(len(robot.shared) for robot in team.robots)
    count = len(team.robots)
    click.echo(f"{folder}: {count} robots, {constraints} constraints; {next_step(folder, count)}")
    if ground:
        click.echo(f"{folder / GROUND_FILE}: cells of {ground.scale:g} m, and walls that drones fly around")


def next_step(folder: Path | str, robots: int) -> str:
    """Return how to solve the team in `folder`: not in processes where that would be very many."""
    return f"next: robochoc solve {folder}{' --runtime simulator' if robots > MAX_PROCESSES else ''}"


OUTPUT = ("--seed", "-o", "--force", "--help")
"""The last section of a family's help."""
GRAPH = ("--connected", "--links", "--neighbours", "--rewiring", "--rows", "--torus")
"""The section on graphs."""

KINDS = ("random", "scale-free", "small-world", "grid", "tree")


_OWN = ("links", "neighbours", "rewiring", "rows", "torus", "connected")
"""Parameters of some kinds of graphs alone."""


def graph_options(command: Command) -> Command:
    """Add the options of constraint graphs, which `graph_of` takes out again."""
    for option in reversed(
        (
            click.option("--agents", type=WholeNumber(1, MAX_NODES), metavar="N", help="Number of robots."),
            click.option(
                "--graph",
                default="random",
                show_default=True,
                metavar="KIND",
                help=f"Constraint graph: {', '.join(KINDS)}, or a file that networkx reads (GraphML, GEXF, GML,"
                " edge list).",
            ),
            click.option("--connected", is_flag=True, help="random, small-world: draw graphs until one is connected."),
            click.option(
                "--links", type=WholeNumber(1), metavar="N", help="scale-free: links of a new node.  [default: 2]"
            ),
            click.option(
                "--neighbours", type=WholeNumber(2), metavar="N", help="small-world: nearest nodes.  [default: 4]"
            ),
            click.option(
                "--rewiring", type=float, metavar="P", help="small-world: share of edges moved.  [default: 0.1]"
            ),
            click.option(
                "--rows", type=WholeNumber(1), metavar="N", help="grid: rows.  [default: nearest to a square]"
            ),
            click.option("--torus", is_flag=True, help="grid: the borders meet."),
        )
    ):
        command = option(command)
    return command


def graph_of(options: Options, density: str) -> Graph | None:
    """Take the options of graphs out of `options`, and return the graph; None: a random one, of a given `density`.

    For that one `options` keep the number of robots, the density and whether it is connected.

    Raises:
        ValueError: if an option is missing, or has nothing to say about this graph, or numbers do not fit together.
    """
    from robochoc.generators.graph_choice import GraphChoice

    given = {key: options.pop(key) for key in _OWN}
    choice = GraphChoice(kind=options.pop("graph"), agents=options["agents"], **given)
    graph = choice.graph(density, options[density], dashes="--")
    if graph is None:
        options["connected"] = choice.connected
    else:
        del options["agents"], options[density]
    return graph
