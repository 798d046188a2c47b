"""`robochoc check`: explores every order in which messages can arrive, on small teams."""

from __future__ import annotations

import itertools
import json
import sys
import time
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.cluster import cluster_option, on_cluster
from robochoc.cli.options.paths import InputPath, OutputFile, refuse_same_places
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.options.solve import protocol_settings, settings_option
from robochoc.cli.options.value_types import Number, ProtocolName, Seed, WholeNumber
from robochoc.cli.reports.failures import LIMIT, LOST, USAGE, Failure, errors_as_failures, invalid_input_fails
from robochoc.system.termination import Terminated

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from robochoc.exploration.check import CheckedTeam, CheckOptions
    from robochoc.model.problem import Team

MOST_TEAMS, MOST_ROBOTS, MOST_VALUES = 1_000_000, 6, 6

_SECTIONS: Sections = {
    COMMON: ("--set", "--timeout", "--states", "--jobs", "--cluster", "--journal", "--html", "--json", "--help"),
    "Random teams": ("--teams", "--robots", "--values", "--seed"),
    "Arrival and loss of messages": ("--packets", "--loss"),
    "Changes of the problem": ("--crash", "--rejoin", "--event"),
}


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("protocol", type=ProtocolName())
@click.argument("folders", nargs=-1, type=InputPath(), metavar="[TEAM...]")
@click.option(
    "--teams",
    type=WholeNumber(1, MOST_TEAMS),
    default=20,
    show_default=True,
    metavar="N",
    help="Number of random teams.",
)
@click.option(
    "--robots", type=WholeNumber(1, MOST_ROBOTS), default=3, show_default=True, metavar="N",
    help="Maximum number of robots in a random team.",
)  # fmt: skip
@click.option(
    "--values", type=WholeNumber(1, MOST_VALUES), default=2, show_default=True, metavar="N",
    help="Maximum number of values of a robot in a random team.",
)  # fmt: skip
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Seed of the random teams.")
@click.option(
    "--states", type=WholeNumber(1), default=100_000, show_default=True, metavar="N",
    help="Maximum number of states per team.",
)  # fmt: skip
@click.option("--packets", is_flag=True, help="Deliver also several waiting messages at once, as runtimes do.")
@click.option("--loss", type=WholeNumber(0), default=0, metavar="N", help="Lose up to N messages, any of them.")
@click.option("--crash", type=WholeNumber(0), default=0, metavar="N", help="Up to N robots crash, at any time.")
@click.option(
    "--rejoin", type=WholeNumber(0), default=0, metavar="N", help="Up to N robots crash at any time, and are restarted."
)
@click.option(
    "--event", type=WholeNumber(0), default=0, metavar="N",
    help="Up to N events change the problem at any time: random ones, or those of a team's scenario.",
)  # fmt: skip
@settings_option
@click.option(
    "--jobs", type=WholeNumber(1, 1024), metavar="N",
    help="Number of teams explored at the same time.  [default: one per processor]",
)  # fmt: skip
@cluster_option
@click.option("--timeout", type=Number(0, min_open=True), metavar="SECONDS", help="Time limit of the command.")
@click.option("--journal", type=OutputFile(), metavar="FILE", help="Write the run that leads to the first fault.")
@click.option(
    "--html", type=OutputFile(), metavar="FILE",
    help="Write a page on which you choose the next message: of the first faulty team, or of the first team.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per team.")
@invalid_input_fails
def check(  # noqa: PLR0913 - options, by name
    protocol: str,
    folders: tuple[Path, ...],
    *,
    teams: int,
    robots: int,
    values: int,
    seed: int,
    states: int,
    packets: bool,
    loss: int,
    crash: int,
    rejoin: int,
    event: int,
    settings_given: tuple[str, ...],
    jobs: int | None,
    cluster: str | None,
    timeout: float | None,
    journal: Path | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """Explore every order in which messages can arrive, with the code of PROTOCOL that robots run.

    Each state of a team is explored once, up to --states; a team with more states is also played in random orders. In
    each state, verdicts and bounds must be right, no robot may refuse a message, and a complete protocol must end with
    an answer. The teams are small and random, or those in TEAM.

    The table has the number of states, of steps between them, of states in which the search is over, and whether all
    states were explored. Exit status: 0 without a fault if all were, 3 if not; 4 with a fault.

    \b
    robochoc check abt                          every order, on 20 random teams of at most 3 robots
    robochoc check adopt --robots 4 --values 3  larger teams
    robochoc check dsa --set cycles=3 --loss 1  any message may be lost
    robochoc check dynabt --crash 1 --event 1   any robot may crash, and the problem may change
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.exploration.changes import FaultPlan
    from robochoc.exploration.check import CheckedTeam, CheckOptions, checked
    from robochoc.exploration.shrinking import reduced
    from robochoc.run.defaults import AUTO, CENTRAL
    from robochoc.run.options import Options, Runtime
    from robochoc.run.registry import protocol_named
    from robochoc.system.posix import usable_processors
    from robochoc.system.stopping import stop_handled, stop_requested

    with errors_as_failures(protocol):
        run = Options(
            protocol=protocol, runtime=Runtime.SIMULATOR, settings=protocol_settings(settings_given), seed=seed
        )
    refuse_same_places({"--journal": journal, "--html": html}, teams=folders)
    deadline = None if timeout is None else time.monotonic() + timeout
    if protocol in {AUTO, CENTRAL}:
        raise Failure(USAGE, f"{protocol} is not a protocol of robots; name one ('robochoc protocols')")
    with stop_handled():
        found = list[CheckedTeam]()
        count = len(folders) or teams
        with (
            _reported_if_interrupted(lambda: _print_found(found, count, as_json=as_json)),
            on_cluster(cluster),
            errors_as_failures(protocol),
            _progress_of(protocol, count, as_json=as_json) as show,
        ):
            plan = FaultPlan(crash, rejoin, event)
            options = CheckOptions(protocol_named(protocol), run, states, packets=packets, losses=loss, plan=plan)
            problems = _teams(folders, (teams, robots, values, seed), options)
            jobs, notice = jobs or usable_processors(), partial(click.echo, err=True)
            results = checked(problems, options, deadline, jobs=jobs, cluster=cluster, show=show, notice=notice)
            with closing(results):
                _collect(results, found, as_json=as_json)
        if not as_json:
            _print_table(found)
        fault = next((one for one in found if one.exploration.fault), None)
        if fault is not None and not folders:
            with _reported_if_interrupted(partial(_print_faults, found)):
                fault = reduced(fault, options, lambda: stop_requested() or _is_past(deadline))
        if html is not None and found:
            _write_page(html, fault or found[0], options)
        if journal is not None and fault is not None:
            _write_journal(journal, fault, options)
        _end(found, fault, is_late=_is_past(deadline), packets=packets)


def _is_past(deadline: float | None) -> bool:
    return deadline is not None and time.monotonic() > deadline


@contextmanager
def _progress_of(protocol: str, count: int, *, as_json: bool) -> Iterator[Callable[[int, int], None] | None]:
    """Provide a function that shows the progress on a terminal, or None elsewhere."""
    from robochoc.cli.reports.progress import stages

    if as_json and sys.stdout.isatty():  # both would be written to the same line
        yield None
        return
    with stages(protocol) as show:
        yield show and (lambda teams, states: show(f"{teams:,} of {count:,} teams, {states:,} states"))


def _teams(folders: tuple[Path, ...], sizes: tuple[int, int, int, int], options: CheckOptions) -> Iterator[Team]:
    """Return the teams to check."""
    from robochoc.exploration.problems import small_teams
    from robochoc.formats import read_team

    traits = options.protocol.traits
    if folders:
        return map(read_team, folders)
    count, robots, values, seed = sizes
    return itertools.islice(small_teams(traits, robots, values, seed), count)


def _collect(results: Iterable[CheckedTeam], found: list[CheckedTeam], *, as_json: bool) -> None:
    """Append the results to `found`, and print each of them as JSON."""
    for one in results:
        found.append(one)
        if as_json:
            click.echo(json.dumps(one.as_dict()))


@contextmanager
def _reported_if_interrupted(report: Callable[[], None]) -> Iterator[None]:
    """Call `report` if Ctrl-C or SIGTERM ends the context."""
    try:
        yield
    except (KeyboardInterrupt, Terminated):
        report()
        raise


def _print_found(found: list[CheckedTeam], count: int, *, as_json: bool) -> None:
    """Print the teams that were explored before an interruption. `count`: the number of all teams."""
    if not as_json and found:
        _print_table(found)
    _print_faults(found)
    click.echo(f"{len(found):,} of {count:,} teams explored", err=True)


def _print_faults(found: list[CheckedTeam]) -> None:
    for one in found:
        if one.exploration.fault:
            click.echo(f"{one.team.name}: {one.report}", err=True)


def _print_table(found: list[CheckedTeam]) -> None:
    from robochoc.cli.reports.table import print_table

    headings = ("team", "robots", "states", "steps", "ends", "explored")
    rows = []
    for one in found:
        explored = one.exploration
        numbers = [len(one.team.robots), explored.states, explored.steps, explored.ends]
        whole = "fault" if explored.fault else "all" if explored.is_complete else "in part"
        rows.append([one.team.name, *(f"{number:,}" for number in numbers), whole])
    print_table(headings, rows, right=headings[1:-1])


def _write_page(page: Path, team: CheckedTeam, options: CheckOptions) -> None:
    from robochoc.sniffer.orders_page import orders_page
    from robochoc.system.files import write_atomically

    if team.exploration.fault and not team.exploration.explanation.text:
        click.echo(f"{page}: not written: the robots cannot be created", err=True)
        return
    with errors_as_failures(page):
        write_atomically(page, orders_page(team, options))
    click.echo(f"{page}: written; open it in a browser", err=True)


def _write_journal(journal: Path, team: CheckedTeam, options: CheckOptions) -> None:
    """Write the run that leads to the fault of `team`, unless its robots cannot be created."""
    from robochoc.exploration.counterexample import write_counterexample

    if not team.exploration.explanation.text:
        click.echo(f"{journal}: not written: the robots cannot be created", err=True)
        return
    with errors_as_failures(journal):
        write_counterexample(journal, team.case, team.exploration.run, options.run)
    click.echo(f"{journal}: written; next: robochoc sniff {journal}", err=True)


def _end(found: list[CheckedTeam], fault: CheckedTeam | None, *, is_late: bool, packets: bool) -> None:
    """Report what was found. Raises `Failure` if there is a `fault`, or if not everything was explored."""
    from robochoc.system.plain_text import counted
    from robochoc.system.stopping import stop_requested

    states = counted(sum(one.exploration.states for one in found), "state")
    if fault is not None:
        others = [one for one in found if one.exploration.fault and one.team.name != fault.team.name]
        lines = [f"{fault.team.name}: {fault.report}", *(f"{one.team.name}: {one.in_words}" for one in others)]
        raise Failure(LOST, "\n".join(lines))
    partly = sum(not one.exploration.is_complete for one in found)
    if partly or stop_requested():
        more = "--timeout" if is_late else "--states, or omit --packets" if packets else "--states"
        hint = "stopped" if stop_requested() else f"increase {more}"
        rest = f"{counted(partly, 'team')} explored in part or not at all"
        raise Failure(LIMIT, f"{states}, no fault so far; {rest}: {hint}")
    click.echo(f"{states}, no fault in any order of deliveries", err=True)
