"""`robochoc compile`: compiles the robots' local problems into domains."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.paths import TeamFolder, teams_at
from robochoc.cli.reports.failures import LIMIT, Failure, errors_as_failures, worst

if TYPE_CHECKING:
    from robochoc.solver.cache import SolutionCache
    from robochoc.solver.compile import CompileLimits, CompileTimeoutError
    from robochoc.solver.compiled_domain import TooManySolutionsError


@click.command("compile")
@click.argument("paths", nargs=-1, required=True, type=TeamFolder(), metavar="TEAM ...")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per team.")
@local_options
@click.pass_context
def compile_team(
    context: click.Context,
    paths: tuple[Path, ...],
    *,
    as_json: bool,
    local_solutions: int,
    local_timeout: float,
    always_ace: bool,
    no_cache: bool,
) -> None:
    """Compile the local problems of all robots of the teams in TEAM and below, and show their sizes.

    A robot's local solutions are the values of its variables that its private constraints allow. Local solutions that
    neighbours cannot distinguish form one group. Protocols work on the groups.

    \b
    variables  number of the robot's variables
    seen       number of its variables in shared constraints
    private    number of constraints on its own variables only
    local      number of local solutions
    groups     number of groups
    cost       minimum and maximum cost of a group (DCOP)
    how        direct: without search; enumerated: without ACE; ACE: by ACE;
               cached: solved earlier; equal: same problem as a robot above
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.solver.cache import SolutionCache

    bounds = limits(local_solutions, local_timeout, always_ace=always_ace)
    cache = None if no_cache else SolutionCache()
    context.exit(worst([_status(folder, bounds, cache, as_json=as_json) for folder in teams_at(paths)]))


def _status(folder: Path, bounds: CompileLimits, cache: SolutionCache | None, *, as_json: bool) -> int:
    try:
        with errors_as_failures(folder):
            return _compile(folder, bounds, cache, as_json=as_json)
    except Failure as failure:
        failure.show()
        return failure.exit_code


def _compile(folder: Path, bounds: CompileLimits, cache: SolutionCache | None, *, as_json: bool) -> int:
    """Compile all robots in the team in `folder`, even if some reach a limit, and return the exit status."""
    from robochoc.cli.reports.compile import print_sizes, sizes_json
    from robochoc.cli.reports.progress import progress_line
    from robochoc.communication.search_result import Progress
    from robochoc.formats import read_team
    from robochoc.model.costs import normalized
    from robochoc.solver.compile import Compilation, Compiler, CompileTimeoutError
    from robochoc.solver.compiled_domain import TooManySolutionsError

    began = time.monotonic()
    team = normalized(read_team(folder))
    found: list[Compilation | TooManySolutionsError | CompileTimeoutError] = []
    with progress_line(team.name) as progress, Compiler(bounds, cache) as compiler:
        for number, robot in enumerate(team.robots, 1):
            if progress:
                stage = f"compiling {robot.name} ({number} of {len(team.robots)})"
                progress(Progress(0, time.monotonic() - began, stage))
            try:
                found.append(compiler.compile(robot))
            except (TooManySolutionsError, CompileTimeoutError) as limit:
                found.append(limit)
    if as_json:
        click.echo(sizes_json(team, found, time.monotonic() - began))
    else:
        print_sizes(team, found, time.monotonic() - began, folder)
    limited = [one for one in found if not isinstance(one, Compilation)]
    if limited:
        _print_limits(folder, limited)
    return LIMIT if limited else 0


def _print_limits(folder: Path, limited: Sequence[TooManySolutionsError | CompileTimeoutError]) -> None:
    """Print the first limit that was reached, and the names of the other robots, on one line."""
    from robochoc.formats import on_one_line

    first, *others = limited
    more = f" (and {len(others)} more: {', '.join(one.robot for one in others)})" if others else ""
    click.echo(on_one_line(f"{folder}: {first}{more}"), err=True)
