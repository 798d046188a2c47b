"""`robochoc experiment`: runs studies, from a question to a figure."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.cluster import cluster_option, on_cluster
from robochoc.cli.options.paths import InputPath, OutputFile
from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import INVALID, LOST, USAGE, Failure, invalid_input_fails

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable, Sequence

    from robochoc.experiments.runner import Workers
    from robochoc.experiments.store import Store
    from robochoc.experiments.study import Study

FORMATS = ("csv", "json", "latex", "parquet")
SUMMARY = "summary"
JOURNALS = "journals"
AGAIN = ("refused", "limit", "memory", "refuted", "done")
PAGES = (".html", ".htm", ".md")


@click.group()
def experiment() -> None:
    """Run studies of protocols on problems, and report their results (documentation, page Experiments).

    \b
    robochoc experiment run study.toml
    robochoc experiment show study.sqlite
    robochoc experiment report study.sqlite -o report.html
    """  # noqa: D301 - \\b keeps click from wrapping the lines


@experiment.command(short_help="Run a study, or continue it.")
@click.argument("study", type=InputPath(), metavar="STUDY.toml")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="File of the results.  [default: STUDY.sqlite]")
@click.option("--jobs", type=WholeNumber(1, 1024), metavar="N", help="Number of workers.  [default: one per processor]")
@click.option(
    "--again",
    type=click.Choice(AGAIN),
    multiple=True,
    help="Also rerun the runs with this status. May be given more than once.",
)
@click.option("--dry-run", is_flag=True, help="Show the number of runs without running any.")
@cluster_option
@click.option("--scheduler", metavar="ADDRESS", hidden=True, help="Older spelling of --cluster ADDRESS.")
@click.option("--dask", type=InputPath(), metavar="FILE", hidden=True, help="Older spelling of --cluster FILE.")
@invalid_input_fails
def run(
    study: Path,
    output: Path | None,
    jobs: int | None,
    again: tuple[str, ...],
    cluster: str | None,
    scheduler: str | None,
    dask: Path | None,
    *,
    dry_run: bool,
) -> None:
    """Run the study in the file STUDY.toml, and write one row for each run to an SQLite file.

    Existing results are not computed again: after Ctrl-C, a crash or a change of the study, repeat the command. Answers
    are checked and compared; the study stops if two answers contradict each other, with exit status 4.

    \b
    robochoc experiment run study.toml --dry-run
    robochoc experiment run study.toml --jobs 8
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.experiment import ended_line
    from robochoc.experiments.study import read_study

    read = read_study(study)
    path = output or study.with_suffix(".sqlite")
    if dry_run:
        _show_plan(read, path, again)
        return
    place = _cluster_of(cluster, scheduler, dask)
    if place and any(setup.runtime not in {"simulator", "arrays"} for setup, *_ in read.setups):
        click.echo(
            f"{read.name}: runs with one process per robot are executed on this machine, not on the cluster", err=True
        )
    with on_cluster(place), open_store(path) as store:
        ended = carry_out(read, store, jobs, _workers(place), again)
    click.echo(ended_line(read.name, ended), err=True)
    click.echo(f"{path}: next: {shlex.join(['robochoc', 'experiment', 'show', str(path)])}", err=True)


@experiment.command(short_help="Show the results of a study.")
@click.argument("results", type=InputPath(), metavar="RESULTS.sqlite")
@click.option(
    "--over", metavar="PARAMETER", help="Parameter whose values are the rows.  [default: the first with several values]"
)
@click.option("--metric", "metrics", multiple=True, metavar="NAME", help="Metric to show. Repeatable.")
@invalid_input_fails
def show(results: Path, over: str | None, metrics: tuple[str, ...]) -> None:
    """Show medians of the results of a study, and the statuses of its runs. The study may still be running.

    \b
    robochoc experiment show study.sqlite
    robochoc experiment show study.sqlite --over tightness --metric ncccs
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.experiment import print_summary
    from robochoc.experiments.results import read_results

    print_summary(read_results(results), over, metrics)


@experiment.command(short_help="Write the results for other programs.")
@click.argument("results", type=InputPath(), metavar="RESULTS.sqlite")
@click.option(
    "-o", "--output", type=InputPath(), metavar="FILE", help="File, or folder, to write.  [default: standard output]"
)
@click.option(
    "--format", "form", type=click.Choice([*FORMATS, SUMMARY, JOURNALS]),
    help="csv, json (one line per run), latex (medians), parquet; summary: CSV of medians and means with 95 %"
    " confidence intervals (percentile bootstrap); journals: a folder with the recorded journals.  [default: by the"
    " file's ending, else csv]",
)  # fmt: skip
@click.option(
    "--over",
    metavar="PARAMETER",
    help="Parameter whose values are the rows of latex and summary.  [default: as in show]",
)
@invalid_input_fails
def export(results: Path, output: Path | None, form: str | None, over: str | None) -> None:
    """Write the results as CSV, JSON lines or Parquet with one row per run, or as a table of medians.

    \b
    robochoc experiment export study.sqlite -o study.csv
    robochoc experiment export study.sqlite --format latex > table.tex
    robochoc experiment export study.sqlite --format summary -o table.csv
    robochoc experiment export study.sqlite --format journals -o journals/
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.failures import errors_as_failures
    from robochoc.experiments.export import export_results
    from robochoc.experiments.results import read_results
    from robochoc.experiments.summary import NoSuchColumnError
    from robochoc.system.files import write_atomically

    endings = {".jsonl": "json", ".tex": "latex", ".pq": "parquet", **{f".{name}": name for name in FORMATS}}
    form = form or (endings.get(output.suffix) if output else None) or "csv"
    if form == "parquet" and output is None:
        raise click.UsageError("Parquet is a binary format: name a file with -o.")
    if over is not None and form not in {"latex", SUMMARY}:
        raise click.UsageError(f"--over is for --format latex and summary, not for {form}.")
    if form == JOURNALS:
        _write_journals(results, output)
        return
    with errors_as_failures(results):
        try:
            content = export_results(read_results(results), form, over)
        except NoSuchColumnError as error:
            raise click.UsageError(f"{error}.") from None
    if output is None:
        click.echo(content, nl=False)
    else:
        write_atomically(output, content)


def _write_journals(results: Path, folder: Path | None) -> None:
    """Write each journal to a file in the folder, named after the run's key."""
    from robochoc.experiments.results import journals
    from robochoc.system.files import write_atomically

    if folder is None:
        raise click.UsageError("Journals are written to a folder: name it with -o.")
    written = 0
    for key, content in journals(results):
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / f"{key}.journal", content)
        written += 1
    if not written:
        raise Failure(USAGE, f'{results} has no journals; write record = ["journal"] in the study')
    click.echo(f"{folder}: {written:,} journals", err=True)


@experiment.command(short_help="Report on the results: a page, or figures for a paper.")
@click.argument("results", type=InputPath(), metavar="RESULTS.sqlite")
@click.option(
    "-o",
    "--output",
    type=InputPath(),
    required=True,
    metavar="PAGE.html|PAGE.md|FOLDER",
    help="Page or folder to write.",
)
@click.option("--over", metavar="PARAMETER", help="Parameter on the x axis.  [default: the first with several values]")
@click.option("--force", is_flag=True, help="Replace figures that exist in the folder.")
@invalid_input_fails
def report(results: Path, output: Path, over: str | None, *, force: bool) -> None:
    """Report on a study: one self-contained page, or a folder with the figures in SVG and PDF.

    The report has medians with intervals over a parameter, profiles, cost over time, pairs of protocols, and tests.
    Markdown has the tables without the figures.

    \b
    robochoc experiment report study.sqlite -o report.html
    robochoc experiment report study.sqlite -o report.md
    robochoc experiment report study.sqlite -o figures/
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.experiments.results import read_results

    if output.suffix.lower() not in PAGES and output.suffix[1:].isalpha() and not output.is_dir():
        raise click.UsageError(
            f"-o {output}: name a page (.html or .md), or a folder (without an extension) for figures in SVG and PDF."
        )
    if output.suffix.lower() == ".md":
        require_modules("tests of pairs", "scipy")
        from robochoc.experiments.markdown import write_markdown

        write_markdown(read_results(results), output, over)
        click.echo(f"{output}: written", err=True)
        return
    require_figures()
    from robochoc.experiments.report import write_folder, write_page

    if output.suffix.lower() in {".html", ".htm"}:
        write_page(read_results(results), output, over)
    else:
        write_folder(read_results(results), output, over, replace=force)
    click.echo(f"{output}: written", err=True)


def require_figures() -> None:
    """Raise `Failure` unless the modules for drawing figures are installed."""
    require_modules("figures", "matplotlib", "scipy")


def require_modules(user: str, *modules: str) -> None:
    """Raise `Failure` unless the modules that `user` requires are installed. They belong to the extra `experiments`."""
    from importlib.util import find_spec

    for name in modules:
        if find_spec(name) is None:
            raise Failure(USAGE, f"{user} require {name}, which is not installed: pip install 'robochoc[experiments]'")


def _cluster_of(cluster: str | None, scheduler: str | None, dask: Path | None) -> str | None:
    """Return the place of the cluster. `scheduler` and `dask` are older spellings of `--cluster`."""
    address = f"tcp://{scheduler}" if scheduler and "://" not in scheduler else scheduler
    places = [place for place in (cluster, address, dask and str(dask)) if place]
    if len(places) > 1:
        raise click.UsageError("--cluster, --scheduler and --dask all name a cluster; use --cluster only.")
    return places[0] if places else None


def _workers(cluster: str | None) -> Callable[[int | None], Workers] | None:
    """Return a factory for a cluster's workers, or None for workers on this machine."""
    if cluster is None:
        return None
    from functools import partial

    from robochoc.experiments.cluster import ClusterWorkers

    return partial(ClusterWorkers, cluster, notice=partial(click.echo, err=True))


def _show_plan(study: Study, path: Path, again: Sequence[str]) -> None:
    from robochoc.cli.reports.experiment import plan_lines

    for line in plan_lines(study, path, again):
        click.echo(line)


@contextmanager
def open_store(path: Path | None) -> Iterator[Store]:
    """Open the file with a study's results. None: results are kept in memory."""
    from robochoc.experiments.store import Store, StudyInUseError

    try:
        store = Store(path)
    except StudyInUseError as refused:
        raise Failure(INVALID, str(refused)) from None
    with store:
        yield store


def carry_out(
    study: Study,
    store: Store,
    jobs: int | None,
    workers: Callable[[int | None], Workers] | None = None,
    again: Sequence[str] = (),
) -> Counter[str]:
    """Run a study, and show its progress on a terminal. Raises `Failure`, also if every run was refused."""
    from robochoc.cli.reports.experiment import progress_of
    from robochoc.experiments.agreement import DisagreementError
    from robochoc.experiments.plan import TooManyRunsError
    from robochoc.experiments.runner import run_study
    from robochoc.experiments.task import Status

    try:
        with progress_of(study.name) as progress:
            once_more = [Status(one) for one in again]
            ended = run_study(study, store, jobs, progress=progress, workers=workers, again=once_more)
    except KeyboardInterrupt:
        saved = len(store.results().rows)
        click.echo(f"\n{study.name}: {saved:,} runs are saved; the same command continues with the others", err=True)
        raise
    except DisagreementError as error:
        raise Failure(LOST, f"{study.name}: stopped: {error}") from None
    except TooManyRunsError as refused:
        raise Failure(INVALID, f"{study.name}: {refused}") from None
    if {*ended} == {Status.REFUSED}:
        raise Failure(USAGE, f"{study.name}: every run was refused: {store.results().rows[0]['reason']}")
    return ended
