"""`robochoc capacity`: measures the largest team that this machine solves in time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.value_types import Number, ProtocolName, Seed
from robochoc.cli.reports.failures import LIMIT, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.experiments.capacity.measurement import Step
    from robochoc.experiments.capacity.search import Capacity

DEADLINE_MIN_S = 0.01
"""The limit in `experiments/capacity/measurement.py`, repeated here because it is not imported at the start."""
_HEADINGS = ("robots", "variables", "decisions/s", "messages/s", "messages", "MiB/robot", "CPU")


@click.command()
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="PATH ...")
@click.option("--protocol", type=ProtocolName(), default="auto", show_default=True, help="As for 'robochoc solve'.")
@click.option(
    "--runtime",
    type=click.Choice(["processes", "network", "simulator"]),
    default="processes",
    show_default=True,
    help="One process per robot, also over the network of this machine, or one thread for all.",
)
@click.option(
    "--deadline",
    type=Number(DEADLINE_MIN_S),
    default=5.0,
    show_default=True,
    metavar="SECONDS",
    help=f"The longest time for a decision, with its check; at least {DEADLINE_MIN_S:g} s.",
)
@click.option(
    "--timeout",
    type=Number(0, min_open=True),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="The longest time for all measurements.",
)
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Random seed.")
@click.option("--json", "as_json", is_flag=True, help="Print the measurements as JSON.")
@invalid_input_fails
def capacity(
    paths: tuple[Path, ...],
    protocol: str,
    runtime: str,
    deadline: float,
    timeout: float,
    seed: int,
    *,
    as_json: bool,
) -> None:
    """Measure how many robots, messages and decisions per second this machine holds for a problem of your kind.

    PATH is a team's folder, a list of tasks, or another tool's file. The problem is grown (copies of the team; a list
    with copies of its robots and tasks) until a decision takes too long or the system refuses. Several PATHs, such as
    teams of 'robochoc generate' with more and more robots, are measured as they are.

    \b
    robochoc capacity tasks.yaml
    robochoc capacity instances/queens3d-4 --runtime simulator --deadline 1
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.progress import progress_line
    from robochoc.experiments.capacity.growth import growth_of
    from robochoc.experiments.capacity.measurement import Limit
    from robochoc.experiments.capacity.search import find_capacity
    from robochoc.run.options import Options

    name = paths[0].name or str(paths[0])
    with errors_as_failures(paths[0]), progress_line(name) as progress:
        found = find_capacity(
            growth_of(paths),
            Options(protocol, runtime, seed),  # type: ignore[arg-type]  # converted and checked
            deadline_s=deadline,
            timeout_s=timeout,
            progress=progress,
            report=_report,
        )
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode(found), indent=2).decode())
    else:
        _print(found)
    if not found.robots:
        if found.limit == Limit.TIME:
            why = f"could not be measured within --timeout {timeout:g} s; use a longer --timeout"
            raise Failure(LIMIT, f"{paths[0]}: {why}")
        raise Failure(LIMIT, f"{paths[0]}: the given problem is too large: {found.limit}: {found.why}")


def _report(step: Step) -> None:
    from robochoc.cli.reports.progress import print_above

    what = f"{step.limit}: {step.why}" if step.limit else f"{step.decision_s:.2g} s a decision"
    print_above(f"{step.robots:,} robots: {what}")


def _print(found: Capacity) -> None:
    """Print what was grown, a table of the sizes that were solved, and the limit."""
    from robochoc.cli.reports.table import print_table

    click.echo(f"grown: {found.grown}")
    rows = [_row(step) for step in found.steps if step.limit is None]
    if rows:
        print_table(_HEADINGS, rows, right=_HEADINGS)
    if found.robots:
        limit = f"the limit is {found.limit} ({found.why})" if found.limit else "no limit was met"
        within = f"each decision within {found.deadline_s:g} s, {found.processors} processors"
        click.echo(f"{found.robots:,} robots ({within}); {limit}")


def _row(step: Step) -> tuple[str, ...]:
    memory = f"{step.robot_bytes / (1 << 20):.1f}" if step.robot_bytes else "-"
    return (
        f"{step.robots:,}",
        f"{step.variables:,}",
        f"{step.decisions_per_s:.3g}",
        f"{step.messages_per_s:,.0f}",
        f"{step.messages:,.0f}",
        memory,
        f"{step.cpu:.0%}",
    )
