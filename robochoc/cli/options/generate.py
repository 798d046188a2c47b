"""Options shared by families of `robochoc generate`, and the command that writes the generated team."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.value_types import Finite, Number, Seed, WholeNumber
from robochoc.cli.reports.failures import invalid_input_fails
from robochoc.cli.reports.progress import elapsed_time

if TYPE_CHECKING:
    from robochoc.generators.graphs import Graph
    from robochoc.maps.ground_map import GroundMap
    from robochoc.model.problem import Team

MAX = 1000
MAX_NODES = 1_000_000
"""The limit in `generators/draws.py`, repeated here because that module is not imported at the start."""
MAX_PROCESSES = 1000
"""The most robots that run as processes; for larger teams, the simulator is suggested (docs/guides/large-teams.md)."""
Options = dict[str, Any]
Command = Callable[..., None]
TeamOnMap: TypeAlias = "tuple[Team, GroundMap]"


def number_option(
    name: str, text: str, *, least: int = 1, most: int = MAX, default: int | None = None
) -> Callable[..., Any]:
    """Return an option with an integer value, which is required unless it has a default."""
    return click.option(
        name,
        required=default is None,
        default=default,
        show_default=default is not None,
        type=WholeNumber(least, most),
        metavar="N",
        help=text,
    )


def share_option(name: str, text: str, default: float) -> Callable[..., Any]:
    """Return an option whose value is a share or a probability."""
    return click.option(
        name, default=default, show_default=True, type=Number(0, 1), metavar="P", help=f"{text}, 0 to 1."
    )


seed_option = click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Random seed.")


def writes_team(folder: str) -> Callable[[Callable[..., Team | TeamOnMap]], Command]:
    """Return a decorator for a function that makes a team: the resulting command writes the team to the folder of -o.

    The default folder has the team's name; `folder` describes the default in the help text. If the function raises
    `ValueError` for inconsistent numbers, this is a usage error.
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
    """Write the team made by `make`, and its map of the ground, if there is one, in the form that `robochoc fly` reads.

    If `make` raises `ValueError` for inconsistent numbers, this is a usage error.
    """
    from robochoc.formats import InvalidInputError, write_team
    from robochoc.formats.team_reader import GROUND_FILE

    try:
        with elapsed_time("generate", "drawing the problem"):
            made = make()
    except InvalidInputError:
        raise
    except ValueError as error:
        raise click.UsageError(_with_dashes(str(error))) from None
    team, ground = made if isinstance(made, tuple) else (made, None)
    folder = output or Path("instances") / team.name
    other_files = {}
    if ground:
        from robochoc.maps.ground_map import ground_map_json

        other_files[GROUND_FILE] = ground_map_json(ground)
    with elapsed_time("generate", f"writing {len(team.robots):,} robots"):
        write_team(team, folder, replace=replace, extra_files=other_files)
    constraints = sum(len(robot.shared) for robot in team.robots)
    count = len(team.robots)
    size = f"{count} robot{'s' * (count != 1)}, {constraints} constraint{'s' * (constraints != 1)}"
    click.echo(f"{folder}: {size}; {next_step(folder, count)}")
    if ground:
        click.echo(f"{folder / GROUND_FILE}: cells of {ground.scale:g} m, and walls that drones fly around")


def _with_dashes(message: str) -> str:
    """Return `message` with the option of this command for a parameter at its start: `--degree is 9; it must ...`."""
    name, _, rest = message.partition(" ")
    context = click.get_current_context(silent=True)
    for option in context.command.params if context else ():
        if option.name == name and isinstance(option, click.Option) and rest.startswith(("is ", "has ")):
            return f"{option.opts[0]} {rest}"
    return message


def next_step(folder: Path | str, robots: int) -> str:
    """Return a hint with the command that solves the team in `folder`, in the simulator if there are many robots."""
    return f"next: robochoc solve {folder}{' --runtime simulator' if robots > MAX_PROCESSES else ''}"


OUTPUT = ("--seed", "-o", "--force", "--help")
"""The options in the last section of a family's help."""
GRAPH = ("--connected", "--links", "--neighbours", "--rewiring", "--rows", "--torus")
"""The options in the section on graphs."""

KINDS = ("random", "scale-free", "small-world", "grid", "tree", "delaunay")


_GRAPH_PARAMETERS = ("links", "neighbours", "rewiring", "rows", "torus", "connected")
"""Parameters that only apply to some kinds of graphs."""


def graph_options(command: Command) -> Command:
    """Add the options for constraint graphs, which `pop_graph` evaluates."""
    for option in reversed(
        (
            click.option("--agents", type=WholeNumber(1, MAX_NODES), metavar="N", help="Number of robots."),
            click.option(
                "--graph",
                default="random",
                show_default=True,
                metavar="KIND",
                help=f"Constraint graph: {', '.join(KINDS)}, or a file (GraphML, GEXF, GML, edge list).",
            ),
            click.option("--connected", is_flag=True, help="random, small-world: repeat until the graph is connected."),
            click.option(
                "--links", type=WholeNumber(1), metavar="N", help="scale-free: links of a new node.  [default: 2]"
            ),
            click.option(
                "--neighbours", type=WholeNumber(2), metavar="N", help="small-world: nearest nodes.  [default: 4]"
            ),
            click.option(
                "--rewiring", type=Finite(), metavar="P", help="small-world: share of edges moved.  [default: 0.1]"
            ),
            click.option(
                "--rows", type=WholeNumber(1), metavar="N", help="grid: rows.  [default: nearest to a square]"
            ),
            click.option("--torus", is_flag=True, help="grid: join opposite borders."),
        )
    ):
        command = option(command)
    return command


def pop_graph(options: Options, density: str) -> Graph | None:
    """Remove the options for graphs from `options`, and return the graph; None: a random graph of a given `density`.

    For the random graph, `options` keeps the number of robots, the density, and whether the graph must be connected.

    Raises:
        ValueError: if an option is missing or does not apply to this graph, or if numbers are inconsistent.
    """
    from robochoc.generators.graph_choice import GraphChoice

    given = {key: options.pop(key) for key in _GRAPH_PARAMETERS}
    choice = GraphChoice(kind=options.pop("graph"), agents=options["agents"], **given)
    graph = choice.graph(density, options[density], dashes="--")
    if graph is None:
        options["connected"] = choice.connected
    else:
        del options["agents"], options[density]
    return graph
