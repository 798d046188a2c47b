"""`robochoc master`: the one who registers robots, orders the start, and collects the result (Figure 3)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.network import PlaceType, network_failures_told
from robochoc.cli.options.paths import InputPath, OutputFile
from robochoc.cli.options.recording import recording, shown_and_flushed
from robochoc.cli.options.solve import WITHDRAWALS, SolveCommand, protocol_settings
from robochoc.cli.reports.failures import LIMIT
from robochoc.cli.reports.progress import progress_line

if TYPE_CHECKING:
    from robochoc.communication.network.journal_server import Publication
    from robochoc.journal.events import AnyEvent
    from robochoc.journal.journal import Header, Recorder
    from robochoc.model.outcome import Outcome
    from robochoc.run.networked.address import Address
    from robochoc.run.networked.lead import Led, Plan


@click.command(cls=SolveCommand)
@click.option(
    "--listen",
    "place",
    type=PlaceType(),
    default="127.0.0.1:7447",
    show_default=True,
    metavar="HOST:PORT",
    help="The address of this machine at which robots reach it. Tokens are redeemed one port higher.",
)
@click.option(
    "--host",
    "hosts",
    multiple=True,
    metavar="NAME",
    help="Another name or address by which robots may call this machine; needed with --listen 0.0.0.0.",
)
@click.option("--robots", "number", type=click.IntRange(1), metavar="N", help="Begin when N robots have come.")
@click.option(
    "--team",
    type=InputPath(),
    metavar="DIR",
    help="Begin when the robots of this folder have come. Only its file names are looked at.",
)
@click.option(
    "--protocol", metavar="NAME", help="By default abt, and sfb where there are costs; all: robochoc protocols."
)
@click.option("--set", "settings_given", multiple=True, metavar="NAME=VALUE", help="A setting of the protocol.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="For protocols that draw lots.")
@click.option(
    "--withdraw",
    type=click.Choice(WITHDRAWALS),
    metavar="[=fewest|maximal]",
    help="When the whole team has no solution, robots step aside: as few as possible, or whoever finds no place.",
)
@click.option("--private", is_flag=True, help="Robots do not tell their values, only that they have one.")
@click.option(
    "--filter",
    "filters",
    multiple=True,
    metavar="NAME",
    help="signed or sealed, or an installed filter: messages go through all of them, in this order.",
)
@click.option("--gather", "gather_s", type=float, metavar="SECONDS", help="Give up if the team is not complete then.")
@click.option("--timeout", type=float, metavar="SECONDS", help="Give up so long after the team is complete: status 3.")
@click.option("--messages", type=click.IntRange(1), metavar="N", help="Give up after (about) so many messages.")
@click.option(
    "--patience",
    "patience_s",
    type=click.FloatRange(0, min_open=True),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="How long a robot may be out of reach before it is lost.",
)
@click.option(
    "--on-loss",
    type=click.Choice(["fail", "withdraw"]),
    default="fail",
    show_default=True,
    help="When a robot is lost. fail: the run ends, exit status 4; withdraw: it leaves with its constraints.",
)
@click.option(
    "--authority",
    type=InputPath(),
    metavar="DIR",
    help="The Authority's folder  [default: robochoc/authority in your data folder]",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output.")
@click.option(
    "--journal",
    type=OutputFile(),
    metavar="FILE",
    help="Write down every event while the run goes on, in a compact file (docs/guides/journal.md).",
)
@click.option(
    "--sniffable",
    is_flag=True,
    help="Let those follow the run who may (authority enrol --may sniff): they say robochoc sniff --master.",
)
@click.pass_context
def master(
    context: click.Context,
    /,
    *,
    as_json: bool,
    journal: Path | None,
    sniffable: bool,
    authority: Path | None,
    team: Path | None,
    **given: Any,  # noqa: ANN401 - the fields of `Plan` and `NetworkSettings`, by their names
) -> None:
    """Listen for robots, and have them solve their problem together once all are there.

    The master never sees a robot's file. It takes robots that its Authority has enrolled, and tells on standard error
    who comes, and every refusal. Without --robots and --team the team is complete when every neighbour that a robot
    names has come.
    """
    if given["number"] and team:
        raise click.UsageError("--robots and --team both say who is expected; drop one")
    if team and (team / "scenario.xml").exists():
        raise click.UsageError(f"{team} has a scenario.xml; across machines problems do not change")
    for option in ("gather_s", "timeout"):
        if given[option] is not None and not given[option] > 0:
            raise click.UsageError(f"--{option.removesuffix('_s')} takes a number of seconds, more than 0")
    with network_failures_told("master"):
        plan = _plan(authority, team, given)
        with (
            _publication(sniffable=sniffable) as publication,
            recording(journal, lambda: _header(plan), None, [publication.write] if publication else []) as recorder,
        ):
            led = _led(plan, recorder, publication)
            _tell(led, as_json=as_json)
    context.exit(LIMIT if led.outcome.verdict == "unknown" else 0)


def _plan(authority: Path | None, team: Path | None, given: dict[str, Any]) -> Plan:
    from robochoc.authority.authority import default_folder
    from robochoc.communication.filters import UnknownFilterError, filter_named
    from robochoc.communication.network.settings import NetworkSettings
    from robochoc.formats import robot_names
    from robochoc.run.networked.lead import Plan
    from robochoc.run.options import Withdrawal

    try:
        for name in given["filters"]:
            filter_named(name)
    except UnknownFilterError as unknown:
        raise click.UsageError(f"--filter: {unknown}") from None
    conditions = NetworkSettings(
        filters=given.pop("filters"),
        private=given.pop("private"),
        patience_s=given.pop("patience_s"),
        survive=given.pop("on_loss") == "withdraw",
    )
    withdraw = given.pop("withdraw")
    return Plan(
        authority=authority or default_folder(),
        conditions=conditions,
        settings=protocol_settings(given.pop("settings_given")),
        withdraw=Withdrawal(withdraw) if withdraw else None,
        names=tuple(robot_names(team)) if team else None,
        name=team.resolve().name if team else "team",
        **given,
    )


@contextmanager
def _publication(*, sniffable: bool) -> Iterator[Publication | None]:
    """What those get who may sniff, in a file without a name, if they are to get anything."""
    if not sniffable:
        yield None
        return
    import tempfile

    from robochoc.communication.network.journal_server import Publication

    with tempfile.TemporaryFile(buffering=0) as file, closing(Publication(file.fileno())) as publication:
        yield publication


def _led(plan: Plan, recorder: Recorder | None, publication: Publication | None) -> Led:
    """The run, with whatever watches it."""
    from robochoc.run.networked.lead import lead

    if recorder and publication:
        publication.fresh = recorder.flush_if_due
    with progress_line(plan.name) as show:
        progress = shown_and_flushed(recorder, show)

        def observe(event: AnyEvent) -> None:
            _tell_event(event)
            if recorder:
                recorder(event)

        def listening() -> None:
            click.echo(f"listening at {plan.place}; robots say: --master {_address(plan.place)}", err=True)

        def concluded(outcome: Outcome | None) -> None:
            if recorder:
                recorder.outcome = outcome
                recorder.close()  # before anything else goes to where it may be written
            if publication:
                publication.end()

        watched = recorder is not None
        return lead(
            plan,
            observer=observe,
            watched=watched,
            progress=progress,
            listening=listening,
            publication=publication,
            concluded=concluded,
        )


def _tell(led: Led, *, as_json: bool) -> None:
    if as_json:
        from robochoc.formats.result import result_json

        click.echo(result_json(led.outcome))
    else:
        from robochoc.cli.reports.outcome import report

        click.echo(report(led.team, led.outcome))


def _header(plan: Plan) -> Header:
    """What the journal says of the run."""
    from robochoc.journal.journal import Header
    from robochoc.run.defaults import SATISFIES

    return Header(team=plan.name, protocol=plan.protocol or SATISFIES, runtime="network", seed=plan.seed)


def _tell_event(event: AnyEvent) -> None:
    """One line for what whoever runs a master wants to know at once."""
    from robochoc.formats import on_one_line
    from robochoc.journal.events import Granted, Lost, Refused, Registered

    match event:
        case Registered(robot=name):
            line = f"{name} is there"
        case Lost(robot=name, why=why):
            line = f"{name} is lost: {why}"
        case Granted(who=who, what=what):
            line = f"{who}: granted to {what}"
        case Refused(who=who, what=what, why=why):
            line = f"refused: {who}, {what}: {why}"
        case _:
            return
    click.echo(on_one_line(line), err=True)


def _address(place: Address) -> str:
    return f"HOST:{place.port}" if place.anywhere else str(place)
