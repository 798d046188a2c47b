"""Studies on the terminal: the plan, the progress, and what came of them."""

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
    """Give a function that shows how far a study is, on the last line of a terminal; None elsewhere."""
    from robochoc.communication.run_result import Progress

    with progress_line(name) as show:
        if show is None:
            yield None
            return

        def told(now: StudyProgress) -> None:
            left = f", about {duration(now.left_s)} left" if now.left_s else ""
            show(Progress(0, now.elapsed_s, f"{now.done:,} of {now.planned:,} runs{left}"))

        yield told


def duration(seconds: float) -> str:
    """Return a time as people say it."""
    if seconds < _MINUTE_S:
        return f"{seconds:.0f} s"
    if seconds < _HOUR_S:
        return f"{seconds / _MINUTE_S:.0f} min"
    return f"{seconds / _HOUR_S:.1f} h"


def plan_lines(study: Study, path: Path, again: Sequence[str] = ()) -> Iterator[str]:
    """Yield what a study is going to run, how much of it is there, and about how long the rest takes.

    Args:
        study: The study.
        path: The file of its results, which need not exist.
        again: Runs that have ended so are run again, besides those that always are.
    """
    from robochoc.experiments.plan import TooManyRunsError, plan_of
    from robochoc.experiments.results import keys_there, read

    try:
        plan = plan_of(study)
    except TooManyRunsError as refused:
        raise Failure(USAGE, str(refused)) from None
    there_is_a_file = path.exists()
    rows = {row["key"]: row for row in read(path)} if there_is_a_file else {}
    known = keys_there(path, again) if there_is_a_file else set()
    missing = [task for key, task in plan.items() if key not in known]
    problems = len({task.problem.identity for task in plan.values()})
    labels = list(dict.fromkeys(task.setup.label for task in plan.values()))
    ways = on_one_line(", ".join(labels))
    yield f"{on_one_line(study.title)}: {len(plan):,} runs: {problems:,} problems, {len(labels)} ways to run ({ways})"
    there = len(plan) - len(missing)
    yield f"{on_one_line(str(path))}: {there:,} are there, {len(missing):,} are to be run{_about(missing, rows)}"


def _about(missing: Sequence[Any], rows: Mapping[str, Mapping[str, Any]]) -> str:
    """Return how long the missing runs take, by what those that are there took; nothing where none is."""
    took: dict[str, list[float]] = {}
    for row in rows.values():
        took.setdefault(row["label"], []).append(row["total_s"])
    known = [time_s for times in took.values() for time_s in times]
    if not missing or not known:
        return ""
    mean = sum(known) / len(known)
    total = sum(sum(times) / len(times) if (times := took.get(task.setup.label)) else mean for task in missing)
    return f"; about {duration(total)} of one worker"


def ended_line(name: str, ended: Counter[str]) -> str:
    """Return how the runs of a study have ended."""
    told = ", ".join(f"{count:,} {status}" for status, count in ended.most_common())
    return f"{on_one_line(name)}: {sum(ended.values()):,} runs: {told}"


def print_summary(results: Results, over: str | None, metrics: Sequence[str]) -> None:
    """Print how far a study is, medians of its metrics, and how its runs have ended."""
    rows, count = results.rows, results.planned
    there = f"{len(rows):,} of {count:,} runs" if len(rows) < count else f"{len(rows):,} runs"
    click.echo(f"{on_one_line(results.title)}: {there}")
    if results.stopped:
        why, *commands = results.stopped.splitlines()
        click.echo("\n".join([f"stopped: {on_one_line(why)}", *map(on_one_line, commands)]))
    if rows:
        print_tables(results, over, metrics)


def print_tables(results: Results, over: str | None, metrics: Sequence[str]) -> None:
    """Print medians, how runs have ended, and who needs least, as the study wishes where nothing else is asked for."""
    from robochoc.experiments import summary
    from robochoc.experiments.study import study_wishes

    wishes = study_wishes(results.text)
    try:
        over, rows, remarks = summary.prepared(results.rows, over or wishes.over, wishes.names)
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
    """Print a table whose words may come from a file."""
    heads = [on_one_line(head) for head in heads]
    print_table(heads, [[on_one_line(cell) for cell in line] for line in lines], right=heads[1:])


def _print_answers(rows: Rows, metrics: Sequence[str]) -> None:
    """Print who needs least of each metric, and who does the same as who."""
    from robochoc.experiments import ranking

    for line in ["", *ranking.answers(rows, metrics)]:
        click.echo(on_one_line(line))


def _print_endings(rows: Rows) -> None:
    """Print how runs have ended, and with which verdicts, for each way to run."""
    from robochoc.experiments.summary import endings

    click.echo("\nhow runs ended")
    _print_table(*endings(rows))
    told = next(((row["reason"], row["label"]) for row in rows if row["status"] not in {"done", "limit"}), None)
    if told:
        click.echo(on_one_line(f"{told[1]}: {told[0]}"))
