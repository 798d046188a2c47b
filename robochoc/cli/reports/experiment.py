"""Prints studies on the terminal: their plan, progress and results."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.reports.failures import USAGE, Failure
from robochoc.cli.reports.progress import progress_line
from robochoc.cli.reports.table import print_table
from robochoc.system.plain_text import on_one_line

if TYPE_CHECKING:
    from robochoc.experiments.results import Results
    from robochoc.experiments.runner import StudyProgress
    from robochoc.experiments.study import Study
    from robochoc.experiments.summary import Rows

_MINUTE_S, _HOUR_S = 60, 3600


@contextmanager
def progress_of(name: str) -> Iterator[Callable[[StudyProgress], None] | None]:
    """Provide a function that shows the progress of a study on the last line of a terminal, or None elsewhere."""
    from robochoc.communication.search_result import Progress

    with progress_line(name) as show:
        if show is None:
            yield None
            return

        def show_progress(now: StudyProgress) -> None:
            left = f", about {duration(now.left_s)} left" if now.left_s else ""
            show(Progress(0, now.elapsed_s, f"{now.done:,} of {now.planned:,} runs{left}"))

        yield show_progress


def duration(seconds: float) -> str:
    """Return a duration as text in seconds, minutes or hours."""
    if seconds < _MINUTE_S:
        return f"{seconds:.0f} s"
    if seconds < _HOUR_S:
        return f"{seconds / _MINUTE_S:.0f} min"
    return f"{seconds / _HOUR_S:.1f} h"


def plan_lines(study: Study, path: Path, again: Sequence[str] = ()) -> Iterator[str]:
    """Yield lines with the numbers of planned and existing runs, and the estimated time for the missing runs.

    Args:
        study: The study.
        path: The file with the results, which need not exist.
        again: The statuses of runs to repeat, in addition to those that are always repeated.
    """
    from robochoc.experiments.plan import TooManyRunsError, plan_of
    from robochoc.experiments.results import finished_keys, read

    try:
        plan = plan_of(study)
    except TooManyRunsError as refused:
        raise Failure(USAGE, str(refused)) from None
    there_is_a_file = path.exists()
    rows = {row["key"]: row for row in read(path)} if there_is_a_file else {}
    known = finished_keys(path, again) if there_is_a_file else set()
    missing = [task for key, task in plan.items() if key not in known]
    problems = len({task.problem.identity for task in plan.values()})
    labels = list(dict.fromkeys(task.setup.label for task in plan.values()))
    ways = on_one_line(", ".join(labels))
    yield f"{on_one_line(study.title)}: {len(plan):,} runs: {problems:,} problems, {len(labels)} ways to run ({ways})"
    there = len(plan) - len(missing)
    yield f"{on_one_line(str(path))}: {there:,} done, {len(missing):,} to be run{_estimate(missing, rows)}"


def _estimate(missing: Sequence[Any], rows: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the time for the missing runs, estimated from the existing ones; empty if there are none."""
    took: dict[str, list[float]] = {}
    for row in rows.values():
        took.setdefault(row["label"], []).append(row["total_s"])
    known = [time_s for times in took.values() for time_s in times]
    if not missing or not known:
        return ""
    mean = sum(known) / len(known)
    total = sum(sum(times) / len(times) if (times := took.get(task.setup.label)) else mean for task in missing)
    return f"; about {duration(total)} with one worker"


def ended_line(name: str, ended: Counter[str]) -> str:
    """Return the number of runs with each status in a study."""
    counts = ", ".join(f"{count:,} {status}" for status, count in ended.most_common())
    return f"{on_one_line(name)}: {sum(ended.values()):,} runs: {counts}"


def print_summary(results: Results, over: str | None, metrics: Sequence[str]) -> None:
    """Print the progress of a study, the medians of its metrics, and the statuses of its runs."""
    rows, count = results.rows, results.planned
    there = f"{len(rows):,} of {count:,} runs" if len(rows) < count else f"{len(rows):,} runs"
    click.echo(f"{on_one_line(results.title)}: {there}")
    if results.stopped:
        why, *commands = results.stopped.splitlines()
        click.echo("\n".join([f"stopped: {on_one_line(why)}", *map(on_one_line, commands)]))
    if rows:
        print_tables(results, over, metrics)


def print_tables(results: Results, over: str | None, metrics: Sequence[str]) -> None:
    """Print medians, the statuses of runs, and the ranking. The defaults are given by the study's `[report]`."""
    from robochoc.experiments import summary
    from robochoc.experiments.study import report_settings

    wishes = report_settings(results.text)
    try:
        over, rows, remarks = summary.prepare(results.rows, over or wishes.over, wishes.names)
        shown = summary.metrics_to_show(rows, metrics or wishes.metrics, over)
        parts = summary.parts(rows, wishes.each)
    except summary.NoSuchColumnError as wrong:
        raise click.UsageError(str(wrong)) from None
    for (part, own), metric in itertools.product(parts, shown):
        where = f", {on_one_line(part)}" if part else ""
        click.echo(f"\n{summary.METRICS[metric]}, median{where}")
        _print_table(*summary.medians(own, metric, over))
    _print_endings(rows)
    _print_answers(rows, shown)
    for remark in remarks:
        click.echo(on_one_line(remark))


def _print_table(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    """Print a table whose texts may come from a file."""
    heads = [on_one_line(head) for head in heads]
    print_table(heads, [[on_one_line(cell) for cell in line] for line in lines], right=heads[1:])


def _print_answers(rows: Rows, metrics: Sequence[str]) -> None:
    """Print the best way to run by each metric, and the ways to run with equal results."""
    from robochoc.experiments import ranking

    for line in ["", *ranking.answers(rows, metrics)]:
        click.echo(on_one_line(line))


def _print_endings(rows: Rows) -> None:
    """Print the statuses and verdicts of runs for each way to run."""
    from robochoc.experiments.summary import endings

    click.echo("\nhow runs ended")
    _print_table(*endings(rows))
    failed = next((row for row in rows if row["status"] not in {"done", "limit"}), None)
    if failed:
        click.echo(on_one_line(f"{failed['label']}: {failed['reason']}"))
