"""`robochoc leaderboard`: the benchmark set, and protocols compared on it."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import click

from robochoc.cli.options.paths import InputPath, OutputFile
from robochoc.cli.options.value_types import Number, Seed, WholeNumber
from robochoc.cli.reports.failures import LOST, USAGE, Failure, errors_as_failures, invalid_input_fails
from robochoc.system.plain_text import counted, on_one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from robochoc.communication.search_result import Progress
    from robochoc.leaderboard.instances import Instance
    from robochoc.leaderboard.peers.running import PeerEntrant
    from robochoc.leaderboard.results import Budget, LeaderboardResults
    from robochoc.leaderboard.saved_runs import SavedRuns

BUDGET = {"messages": "messages", "ncccs": "ncccs", "cycles": "cycles", "time": "time_s"}
MOST_FAULTS = 20
FORMATS = ("robochoc", "xcsp3", "frodo", "pydcop")

family_option = click.option(
    "--family", "families", multiple=True, metavar="NAME", help="Family. Repeatable.  [default: all]"
)
jobs_option = click.option(
    "--jobs", type=WholeNumber(1, 1024), metavar="N", help="Number of workers.  [default: one per processor]"
)
size_option = click.option(
    "--size", "sizes", multiple=True, metavar="NAME", help="Size: small or medium. Repeatable.  [default: all]"
)


def _repetition_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of `verify` and `submit`."""
    rerun = click.option(
        "--rerun", type=WholeNumber(0), default=10, show_default=True, metavar="N", help="Number of runs to repeat."
    )
    everything = click.option("--all", "everything", is_flag=True, help="Repeat all runs.")
    protocol = click.option(
        "--protocol", "protocols", multiple=True, metavar="MODULE:CLASS",
        help="Protocol that is not installed, to be imported and run. Repeatable.",
    )  # fmt: skip
    timeout = click.option(
        "--timeout", "limit_s", type=Number(0, min_open=True), default=60.0, show_default=True, metavar="SECONDS",
        help="Time limit of each repeated run; the limit of the file applies if it is lower.",
    )  # fmt: skip
    return rerun(everything(timeout(protocol(jobs_option(command)))))


@click.group()
def leaderboard() -> None:
    """Compare protocols on the benchmark set (documentation, page Leaderboard).

    \b
    robochoc leaderboard list --size small
    robochoc leaderboard export tracking-small-3 --format xcsp3 -o tracking.xml
    robochoc leaderboard run mgm dsa my_package.protocol:MyProtocol --family tracking
    robochoc leaderboard show results.json --html site/
    """  # noqa: D301 - \\b keeps click from wrapping the lines


@leaderboard.command("list", short_help="List the instances of the set, with their answers.")
@family_option
@size_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per instance.")
def list_(families: tuple[str, ...], sizes: tuple[str, ...], *, as_json: bool) -> None:
    """List the instances of the benchmark set: their answers, and the solvers that proved each answer.

    An answer that only one solver has proved is not called optimal, but best known.

    \b
    robochoc leaderboard list --family tracking
    robochoc leaderboard list --size small --json
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.leaderboard.certificates import published
    from robochoc.leaderboard.tables import answer_text

    listed = [published()[found.name] for found in _instances(families, sizes)]
    width = max(14, *(len(answer_text(one)) for one in listed))
    for one in listed:
        if as_json:
            import msgspec

            click.echo(msgspec.json.encode(one))
            continue
        provers = ", ".join(filter(None, [one.proved_by, one.agreed_by]))
        click.echo(f"{one.name:26} {one.robots:3} robots  {answer_text(one):{width}} {provers}")


@leaderboard.command(short_help="Write an instance as a team, or for another tool.")
@click.argument("instance")
@click.option(
    "--format", "kind", type=click.Choice(FORMATS), default="robochoc", show_default=True, help="Format to write."
)
@click.option(
    "-o", "--output", type=InputPath(), metavar="PATH",
    help="Folder (robochoc) or file to write.  [default: the name of the instance]",
)  # fmt: skip
@click.option("--force", is_flag=True, help="Replace the folder or file if it exists.")
@invalid_input_fails
def export(instance: str, kind: str, output: Path | None, *, force: bool) -> None:
    """Write the instance called INSTANCE, after a comparison with the digest in the published list.

    A team that the format cannot express is an error.

    \b
    robochoc leaderboard export random-small-0
    robochoc leaderboard export random-small-0 --format pydcop -o random.yaml
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    with errors_as_failures(instance):
        from robochoc.leaderboard.export import export_instance
        from robochoc.leaderboard.instances import UnknownInstanceError, instance_named

        try:
            found = instance_named(instance)
        except UnknownInstanceError as unknown:
            raise Failure(USAGE, str(unknown)) from None
        for line in export_instance(found, kind, output, replace=force):
            click.echo(line)


@leaderboard.command(short_help="Run protocols on the set under a budget.")
@click.argument("protocols", nargs=-1, required=True, metavar="PROTOCOL|MODULE:CLASS|PEER:NAME ...")
@click.option(
    "--peer", "peer_words", multiple=True, metavar="NAME=PATH",
    help="Program of a peer: pydcop or propflow and a Python, or frodo and its jar. Repeatable.",
)  # fmt: skip
@family_option
@size_option
@click.option(
    "--seeds",
    type=WholeNumber(1, 10),
    default=10,
    show_default=True,
    metavar="N",
    help="First N instances of each size.",
)
@click.option(
    "--budget", "budget_words", default="messages=20000,time=60", show_default=True, metavar="NAME=VALUE,...",
    help="Limits of each run: messages, ncccs, cycles, time (seconds).",
)  # fmt: skip
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Random seed of all runs.")
@click.option("--times", is_flag=True, help="Record processor times; the results then differ from run to run.")
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    default="results.json",
    show_default=True,
    metavar="FILE",
    help="File to write.",
)
@jobs_option
@invalid_input_fails
def run(  # noqa: PLR0913, PLR0917 - options
    protocols: tuple[str, ...],
    peer_words: tuple[str, ...],
    families: tuple[str, ...],
    sizes: tuple[str, ...],
    seeds: int,
    budget_words: str,
    seed: int,
    output: Path,
    jobs: int | None,
    *,
    times: bool,
) -> None:
    """Run protocols on instances of the set, and write the results as JSON.

    A protocol of an outside package is named as it is installed, or as MODULE:CLASS, also in the current folder. The
    same command writes the same bytes, unless --times is given or a run meets its time limit. An interrupted command
    continues when it is repeated: the file with the ending .part has its finished runs.

    Peers are other tools: FRODO, pyDCOP and PropFlow, which --peer names. Only the time limit binds them, and their
    results may differ from run to run.

    \b
    robochoc leaderboard run dpop mgm dsa maxsum --size small
    robochoc leaderboard run dpop pydcop:dpop --peer pydcop=pydcop-env/bin/python
    robochoc leaderboard run my_package.protocol:MyProtocol --budget messages=5000,cycles=200
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.progress import progress_line
    from robochoc.leaderboard.outside import named_protocols
    from robochoc.leaderboard.peers.claims import wrong_claims_of_peers
    from robochoc.leaderboard.results import is_peer_name, write_results
    from robochoc.leaderboard.running import entrants, failures, run_leaderboard
    from robochoc.leaderboard.saved_runs import SavedRuns, command_line
    from robochoc.system.posix import usable_processors

    chosen, budget = list(_instances(families, sizes, range(seeds))), _budget(budget_words)
    peers = [word for word in protocols if is_peer_name(word)]
    own = [word for word in protocols if not is_peer_name(word)]
    unfinished = output.with_name(f"{output.name}.part")
    with errors_as_failures("leaderboard"), named_protocols(own) as names:
        found, entered = entrants(names), _peers(peers, peer_words)
        command = command_line([*found, *(one.entrant for one in entered)], chosen, budget, seed=seed, times=times)
        is_file = output.is_file() or not output.exists()
        with SavedRuns(unfinished if is_file else None, command) as saved, progress_line("leaderboard") as show:
            if saved.found:
                click.echo(f"{unfinished}: {counted(len(saved.found), 'run')} found, not repeated", err=True)
            common = _Common(jobs=jobs or usable_processors(), times=times, progress=_run_counter(show), saved=saved)
            results = run_leaderboard(found, chosen, budget, seed=seed, **common)
            if entered:
                from robochoc.leaderboard.peers.running import with_peers

                results = with_peers(results, entered, chosen, **common)
            write_results(results, output)
            saved.delete()
    for line in (*failures(results), *wrong_claims_of_peers(results.runs)):
        click.echo(on_one_line(line), err=True)
    click.echo(f"{output}: {counted(len(results.runs), 'run')}; next: robochoc leaderboard show {output}")


@leaderboard.command(short_help="Check results: compute costs again, repeat runs.")
@click.argument("results", type=InputPath(), metavar="RESULTS.json")
@_repetition_options
@invalid_input_fails
def verify(
    results: Path, rerun: int, limit_s: float, protocols: tuple[str, ...], jobs: int | None, *, everything: bool
) -> None:
    """Check the results in a file: answers, claimed proofs, curves and counts of all runs; repeat some runs.

    Faults are printed, with exit status 4. Modules that the file names are not imported: to repeat runs of a protocol
    that is not installed, name it with --protocol. The guide (page Leaderboard) lists all that is checked.

    \b
    robochoc leaderboard verify results.json
    robochoc leaderboard verify results.json --all
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.leaderboard.results import read_results

    found = read_results(results)
    with _verified(found, results, None if everything else rerun, limit_s, protocols, jobs) as checked:
        click.echo(f"{results}: {checked}")


@leaderboard.command(short_help="Add results to a board.")
@click.argument("results", type=InputPath(), metavar="RESULTS.json")
@click.option("--board", type=InputPath(), required=True, metavar="FOLDER", help="Folder with the files of results.")
@_repetition_options
@invalid_input_fails
def submit(
    results: Path,
    board: Path,
    rerun: int,
    limit_s: float,
    protocols: tuple[str, ...],
    jobs: int | None,
    *,
    everything: bool,
) -> None:
    """Verify the results in a file as `verify` does, and add the file to a board, which is a folder.

    All results of a board have the same budget, seed and version. A file of the same name is replaced.

    \b
    robochoc leaderboard submit results.json --board board/
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.leaderboard.results import read_results

    found = read_results(results)
    with _verified(found, results, None if everything else rerun, limit_s, protocols, jobs) as checked:
        from robochoc.leaderboard.board import submit as submit_results

        path = submit_results(found, results.name, board)
        click.echo(f"{results}: {checked}", err=True)
    click.echo(f"{path}: {counted(len(found.runs), 'run')}; next: robochoc leaderboard show {board}")


@leaderboard.command(short_help="Show tables, or write a static site.")
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="RESULTS.json|BOARD ...")
@click.option("--html", "site", type=InputPath(), metavar="FOLDER", help="Write a static site into this folder.")
@click.option("--markdown", type=OutputFile(), metavar="FILE", help="Write the tables in Markdown.")
@invalid_input_fails
def show(paths: tuple[Path, ...], site: Path | None, markdown: Path | None) -> None:
    """Show the scores of protocols in files of results, or on a board: ranks, gaps, costs of communication.

    \b
    robochoc leaderboard show results.json
    robochoc leaderboard show board/ --html site/
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.commands.experiment import require_modules

    require_modules("ranks", "scipy")
    from robochoc.cli.reports.leaderboard import print_board, write_markdown
    from robochoc.leaderboard.board import read_board

    results = read_board(paths)
    with errors_as_failures(site or markdown or paths[0]):
        if site is not None:
            from robochoc.leaderboard.site import write_site

            click.echo(f"{site}: {write_site(results, site):,} pages", err=True)
        if markdown is not None:
            write_markdown(results, markdown)
            click.echo(f"{markdown}: written", err=True)
    if site is None and markdown is None:
        print_board(results)


@contextmanager
def _verified(
    found: LeaderboardResults,
    path: Path,
    number: int | None,
    limit_s: float,
    protocols: tuple[str, ...],
    jobs: int | None,
) -> Iterator[str]:
    """Verify results, with the named protocols available, and provide a summary.

    Raises:
        Failure: if there are faults.
    """
    from robochoc.cli.reports.progress import progress_line
    from robochoc.leaderboard.outside import named_protocols

    with errors_as_failures(path), named_protocols(protocols) as names:
        from robochoc.leaderboard.running import entrants
        from robochoc.leaderboard.verification import Repetition, has_answer, wrong_answers
        from robochoc.system.posix import usable_processors

        entrants(names)  # a protocol that cannot be used is an error
        repetition = Repetition(found, number, limit_s)
        with progress_line("leaderboard") as show:
            changed = repetition.changed_runs(jobs or usable_processors(), _run_counter(show))
            faults = [*wrong_answers(found), *changed]
        for remark in repetition.remarks:
            click.echo(f"{path}: {on_one_line(remark)}", err=True)
        _fail(path, faults)
        answers, many = sum(map(has_answer, found.runs)), len(repetition.runs) - repetition.unfinished
        summary = f"{counted(len(found.runs), 'run')}, {counted(answers, 'answer')}, no fault"
        repeated = f"; {counted(many, 'repeated run')} gave the same result{'' if many == 1 else 's'}"
        yield summary + (repeated if many else "")


def _run_counter(show: Callable[[Progress], None] | None) -> Callable[[int, int], None] | None:
    """Return a function that shows the number of finished runs, and the elapsed time."""
    import time

    from robochoc.communication.search_result import Progress

    began = time.monotonic()
    return show and (lambda done, planned: show(Progress(0, time.monotonic() - began, f"{done:,} of {planned:,} runs")))


def _fail(path: Path, faults: Sequence[str]) -> None:
    """Raise `Failure` with the first faults, if there are any."""
    if faults:
        more = [f"and {len(faults) - MOST_FAULTS:,} more"] if len(faults) > MOST_FAULTS else []
        raise Failure(LOST, "\n".join(f"{path}: {on_one_line(line)}" for line in [*faults[:MOST_FAULTS], *more]))


def _instances(families: tuple[str, ...], sizes: tuple[str, ...], seeds: Sequence[int] = ()) -> Iterator[Instance]:
    """Yield the chosen instances."""
    from robochoc.leaderboard.instances import UnknownInstanceError, instances

    try:
        yield from instances(families, sizes, seeds)
    except UnknownInstanceError as unknown:
        raise Failure(USAGE, str(unknown)) from None


class _Common(TypedDict):
    """The arguments shared by the runs of protocols and peers."""

    jobs: int
    times: bool
    progress: Callable[[int, int], None] | None
    saved: SavedRuns


def _peers(words: Sequence[str], places: Sequence[str]) -> list[PeerEntrant]:
    """Return the peers' algorithms named by words, with the programs given as NAME=PATH."""
    import shutil

    given: dict[str, Path] = {}
    for place in places:
        name, equals, path = place.partition("=")
        if not equals or not path or name in given:
            raise click.UsageError(f"--peer: {place!r} is not of the form NAME=PATH, with each name once.")
        given[name] = Path(shutil.which(path) or path).expanduser().absolute()
    if not words and not given:
        return []
    from robochoc.leaderboard.peers.running import peer_entrants

    return peer_entrants(words, given)


def _budget(words: str) -> Budget:
    """Parse NAME=VALUE,..."""
    import msgspec

    from robochoc.leaderboard.results import Budget

    given = {}
    for word in filter(None, words.split(",")):
        name, equals, value = word.partition("=")
        if not equals or name not in BUDGET or name in given:
            raise click.UsageError(f"--budget: {word!r} is not one of {', '.join(BUDGET)} with a value, each once.")
        given[name] = value
    try:
        return msgspec.convert({BUDGET[name]: value for name, value in given.items()}, Budget, strict=False)
    except msgspec.ValidationError:
        raise click.UsageError(f"--budget: {words!r} needs whole numbers of 1 or more; time has seconds.") from None
