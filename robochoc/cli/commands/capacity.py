"""`robochoc capacity`: measures the largest team that this machine solves in time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.cluster import cluster_option, on_cluster
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.value_types import Number, ProtocolName, Seed
from robochoc.cli.reports.failures import LIMIT, LOST, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.experiments.capacity.machines import Machine
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
@cluster_option
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Random seed.")
@click.option("--json", "as_json", is_flag=True, help="Print the measurements as JSON.")
@invalid_input_fails
def capacity(
    paths: tuple[Path, ...],
    protocol: str,
    runtime: str,
    deadline: float,
    timeout: float,
    cluster: str | None,
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
    robochoc capacity tasks.yaml --cluster cluster.json  # each of its machines
    robochoc capacity instances/queens3d-4 --runtime simulator --deadline 1
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.progress import progress_line
    from robochoc.experiments.capacity.growth import growth_of
    from robochoc.experiments.capacity.measurement import Limit
    from robochoc.experiments.capacity.search import find_capacity
    from robochoc.run.options import Options

    names = ", ".join(map(str, paths))
    if cluster is not None:
        words = ["--protocol", protocol, "--runtime", runtime, "--deadline", str(deadline), "--seed", str(seed)]
        with errors_as_failures(names), on_cluster(cluster):
            _measure_machines(cluster, paths, words, timeout, as_json=as_json)
        return
    with errors_as_failures(names), progress_line(paths[0].name or str(paths[0])) as progress:
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
            raise Failure(LIMIT, f"{names}: {why}")
        problem = "the given problem" if len(paths) == 1 else "the smallest of the given problems"
        raise Failure(LIMIT, f"{names}: {problem} is too large: {found.limit}: {found.why}")


def _measure_machines(
    cluster: str, paths: tuple[Path, ...], words: list[str], timeout: float, *, as_json: bool
) -> None:
    """Print the capacity of each machine of a cluster. Raises `Failure` if a machine has no result."""
    from robochoc.experiments.capacity.growth import check_is_complete, growth_of

    growth = growth_of(paths)
    check_is_complete(paths)
    from robochoc.cli.reports.progress import elapsed_time
    from robochoc.experiments.capacity.machines import measure_machines

    with elapsed_time(cluster, "measuring each machine"):
        machines = measure_machines(cluster, paths, words, timeout)
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode({"machines": machines}), indent=2).decode())
    else:
        from robochoc.cli.reports.table import print_table

        click.echo(f"grown: {growth.text}")
        print_table(("machine", *_HEADINGS, "limit"), [_machine_row(one) for one in machines], right=_HEADINGS)
    for one in machines:
        if one.capacity is None:
            raise Failure(LOST, f"{one.host}: {one.error}")
        if not one.capacity.robots:
            raise Failure(LIMIT, f"{one.host}: the given problem is too large: {one.capacity.why}")


def _machine_row(one: Machine) -> tuple[str, ...]:
    """Return the row of the largest size that a machine holds."""
    if one.capacity is None:
        return (one.host, *("-" for _ in _HEADINGS), one.error)
    found = one.capacity
    solved = [step for step in found.steps if step.limit is None]
    row = _row(max(solved, key=lambda step: step.robots)) if solved else ("0", *("-" for _ in _HEADINGS[1:]))
    return (one.host, *row, f"{found.limit} ({found.why})" if found.limit else "none was met")


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
