"""`robochoc compile`: what the robots' local problems come to."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.failure import Failure, failures_told, worst
from robochoc.cli.local import limits, local_options
from robochoc.cli.paths import InputPath

if TYPE_CHECKING:
    from rich.table import Table

    from robochoc.problem import Team
    from robochoc.solver.cache import SolutionCache
    from robochoc.solver.compile import Compilation, Limits

WIDTH_IN_A_PIPE = 120
SOURCES = {
    "direct": "no solver needed",
    "equal": "equal to an earlier one",
    "cache": "cached",
    "ace": "solved by ACE",
}


@click.command("compile", short_help="Compile robots' local problems, and show what they come to.")
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="TEAM ...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a team.")
@local_options
@click.pass_context
def compile_team(
    context: click.Context,
    paths: tuple[Path, ...],
    *,
    as_json: bool,
    local_solutions: int,
    local_timeout: float,
    no_cache: bool,
) -> None:
    """Compile the local problem of every robot of the teams at TEAM or below, and show what it comes to.

    A robot's local solutions are all values of its variables that its private constraints allow. Those that look
    alike to its neighbours make one group; the groups are the values that a protocol sees.
    """
    from robochoc.formats import find_teams
    from robochoc.solver.cache import SolutionCache

    bounds = limits(local_solutions, local_timeout)
    cache = None if no_cache else SolutionCache()
    statuses = []
    for path in paths:
        try:
            with failures_told(path):
                folders = find_teams(path)
        except Failure as failure:
            failure.show()
            statuses.append(failure.exit_code)
            continue
        statuses += [_status(folder, bounds, cache, as_json=as_json) for folder in folders]
    context.exit(worst(statuses))


def _status(folder: Path, bounds: Limits, cache: SolutionCache | None, *, as_json: bool) -> int:
    try:
        with failures_told(folder):
            _compile(folder, bounds, cache, as_json=as_json)
    except Failure as failure:
        failure.show()
        return failure.exit_code
    return 0


def _compile(folder: Path, bounds: Limits, cache: SolutionCache | None, *, as_json: bool) -> None:
    from robochoc.cli.progress import progress_line
    from robochoc.communication.run_result import Progress
    from robochoc.formats import read_team
    from robochoc.solver.compile import Compiler

    began = time.monotonic()
    team = read_team(folder)
    compiled = []
    with progress_line(team.name) as progress, Compiler(bounds, cache) as compiler:
        for number, robot in enumerate(team.robots, 1):
            if progress:
                stage = f"compiling {robot.name} ({number} of {len(team.robots)})"
                progress(Progress(0, time.monotonic() - began, stage))
            compiled.append(compiler.compile(robot))
    if as_json:
        _print_json(team, compiled, time.monotonic() - began)
    else:
        _print(team, compiled, time.monotonic() - began)


def _rows(team: Team, compiled: list[Compilation]) -> list[dict[str, Any]]:
    """A row a robot; `seconds` includes the start of the solver's process where the robot was the first to need it."""
    return [
        {
            "robot": one.robot,
            "variables": len(team[one.robot].variables),
            "interface": len(team[one.robot].interface),
            "private_constraints": len(team[one.robot].private),
            "local_solutions": one.domain.total,
            "groups": len(one.domain.values),
            "seconds": round(one.seconds, 6),
            "source": str(one.source),
        }
        for one in compiled
    ]


def _print_json(team: Team, compiled: list[Compilation], seconds: float) -> None:
    import msgspec

    from robochoc.formats import encodable

    report = {"team": encodable(team.name), "seconds": round(seconds, 6), "robots": _rows(team, compiled)}
    click.echo(msgspec.json.encode(report))


def _print(team: Team, compiled: list[Compilation], seconds: float) -> None:
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else WIDTH_IN_A_PIPE, highlight=False)
    console.print(_table(team, compiled), soft_wrap=False)
    empty = [one.robot for one in compiled if not one.domain.values]
    if empty:
        console.print(f"{empty[0]} has no local solution, so the team has none.", markup=False)
    console.print(f"{len(compiled)} robots, {seconds:.2f} s; next: robochoc solve", markup=False)


def _table(team: Team, compiled: list[Compilation]) -> Table:
    from rich.markup import escape
    from rich.table import Table

    from robochoc.formats import on_one_line

    table = Table(title=escape(on_one_line(team.name)), title_justify="left", box=None, header_style="bold")
    table.add_column("robot")
    for heading in ("variables", "seen", "private constraints", "local solutions", "groups", "time"):
        table.add_column(heading, justify="right")
    table.add_column("how")
    for row in _rows(team, compiled):
        counts = [row[name] for name in ("variables", "interface", "private_constraints", "local_solutions", "groups")]
        table.add_row(
            escape(row["robot"]),
            *(f"{count:,}" for count in counts),
            f"{1000 * row['seconds']:,.1f} ms",
            SOURCES[row["source"]],
        )
    return table
