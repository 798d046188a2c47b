"""`robochoc master`: register robots, start the search, and collect the result (Figure 3)."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.network import (
    AddressType,
    authority_option,
    identity_option,
    masters_option,
    network_errors_as_failures,
    patience_option,
    token_options,
)
from robochoc.cli.options.paths import TeamFolder
from robochoc.cli.options.recording import flushing_progress, journal_option, recording
from robochoc.cli.options.ros import improve_option
from robochoc.cli.options.saved import saved_outcome
from robochoc.cli.options.sections import COMMON, Sections
from robochoc.cli.options.solve import (
    SolveCommand,
    deadline_option,
    filter_option,
    messages_option,
    protocol_option,
    protocol_settings,
    settings_option,
    start_option,
    withdraw_option,
)
from robochoc.cli.options.value_types import Number, Seed, WholeNumber
from robochoc.cli.reports.failures import LIMIT, LOST, Failure
from robochoc.cli.reports.improvements import ImprovementReporter
from robochoc.cli.reports.progress import print_above, progress_line
from robochoc.system.stopping import stop_handled

if TYPE_CHECKING:
    from robochoc.communication.network.journal_server import Publication
    from robochoc.journal.events import AnyEvent
    from robochoc.journal.journal import Header, JournalRecorder
    from robochoc.model.outcome import Outcome
    from robochoc.run.improvement import Audience
    from robochoc.run.networked.address import Address
    from robochoc.run.networked.master_run import MasterPlan, MasterResult
    from robochoc.run.networked.standby import StandbyPlan


_SECTIONS: Sections = {
    COMMON: (
        "--listen", "--robots", "--team", "--protocol", "--withdraw", "--timeout", "--deadline", "--improve",
        "--json", "--journal", "--sniffable", "--help",
    ),
    "Search": ("--set", "--seed", "--start", "--messages", "--message-loss"),
    "Robots and losses": ("--host", "--authority", "--gather", "--patience", "--on-loss"),
    "Standby masters": ("--standby", "--as", "--token-file", "--token", "--identity"),
    "Privacy and security": ("--private", "--filter"),
}  # fmt: skip


@click.command(cls=SolveCommand, sections=_SECTIONS)
@click.option(
    "--listen",
    "place",
    type=AddressType(),
    default="127.0.0.1:7447",
    show_default=True,
    metavar="HOST:PORT",
    help="Address at which robots reach this machine. Robots enrol on the next higher port.",
)
@click.option(
    "--host",
    "hosts",
    multiple=True,
    metavar="NAME",
    help="Another name or address of this machine; required with --listen 0.0.0.0. Repeatable.",
)
@click.option("--robots", "number", type=WholeNumber(1), metavar="N", help="Start when N robots have registered.")
@click.option(
    "--team",
    type=TeamFolder(),
    metavar="DIR",
    help="Start when the robots of this folder have registered. Only the names of its files are read.",
)
@protocol_option(central=False)
@settings_option
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Seed of randomised protocols.")
@start_option
@withdraw_option
@click.option("--private", is_flag=True, help="Robots report that they have values, but not the values.")
@filter_option
@click.option(
    "--gather",
    "gather_s",
    type=Number(0, min_open=True),
    metavar="SECONDS",
    help="Stop if the team is not complete after this time.",
)
@click.option(
    "--timeout",
    type=Number(0, min_open=True),
    metavar="SECONDS",
    help="Stop this long after the team is complete (status 3).",
)
@deadline_option
@improve_option
@messages_option
@click.option(
    "--message-loss",
    type=Number(0, 0.9),
    default=0.0,
    metavar="P",
    help="Robots drop received messages with this probability.",
)
@patience_option("Time without contact after which a robot counts as lost.", 10.0)
@click.option(
    "--on-loss",
    type=click.Choice(["fail", "withdraw"]),
    default="fail",
    show_default=True,
    metavar="fail|withdraw",
    help="If a robot is lost, end the run (status 4), or continue without the robot.",
)
@authority_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@journal_option
@click.option(
    "--sniffable",
    is_flag=True,
    help="Let observers with the right to sniff follow the run ('robochoc sniff --master').",
)
@masters_option(
    "--standby",
    "leaders",
    "Lead only if none of these masters leads. Requires --as, and the options of the first master.",
    required=False,
)
@click.option("--as", "own_name", metavar="NAME", help="Name of the standby master, enrolled with the role master.")
@token_options()
@identity_option
@click.pass_context
def master(
    context: click.Context,
    /,
    *,
    as_json: bool,
    journal: Path | None,
    sniffable: bool,
    folder: Path | None,
    team: Path | None,
    **given: Any,  # noqa: ANN401 - the fields of `MasterPlan` and `NetworkSettings`, by their names
) -> None:
    """Register robots of other machines, and lead the run in which they solve their problem together.

    The master never reads a robot's file. It accepts only robots that its Authority has enrolled. It prints
    registrations and rejections on standard error. Without --robots and --team, the team is complete when all
    neighbours of all robots have registered.

    \b
    robochoc master --listen 192.168.1.14:7447 --robots 16
    robochoc master --standby 192.168.1.14:7447 --as B --listen 192.168.1.15:7447 --robots 16
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    if given["number"] and team:
        raise click.UsageError("--robots and --team both define the team; remove one")
    if team and (team / "scenario.xml").exists():
        from robochoc.run.compatibility.team_rules import scenario_refusal

        raise click.UsageError(scenario_refusal(team, "robochoc master"))
    with network_errors_as_failures("master"), stop_handled():
        plan = _plan(folder, team, given)
        with (
            _publication(sniffable=sniffable) as publication,
            recording(journal, lambda: _header(plan), None, [publication.write] if publication else []) as recorder,
        ):
            audience = ImprovementReporter(None, quiet=as_json)
            result = _run(plan, recorder, publication, audience)
            if result is None:
                return
            _print_result(result, as_json=as_json)
    context.exit(LIMIT if result.outcome.verdict == "unknown" else 0)


def _plan(folder: Path | None, team: Path | None, given: dict[str, Any]) -> MasterPlan:
    from robochoc.authority.authority import default_authority_folder
    from robochoc.communication.filters import UnknownFilterError, filter_named
    from robochoc.communication.network.settings import NetworkSettings
    from robochoc.formats import robot_names
    from robochoc.run.networked.master_run import MasterPlan
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
    leaders = given.pop("leaders")
    if leaders:
        _refuse_for_standby(leaders, given["place"], folder)
    standby = _standby(leaders, given.pop("own_name"), given.pop("identity"), given.pop("token"))
    withdraw, start = given.pop("withdraw"), given.pop("start")
    return MasterPlan(
        authority=folder or default_authority_folder(),
        conditions=conditions,
        settings=protocol_settings(given.pop("settings_given")),
        withdraw=Withdrawal(withdraw) if withdraw else None,
        start=saved_outcome(start)[0] if start else None,
        standby=standby,
        names=tuple(robot_names(team)) if team else None,
        name=team.resolve().name if team else "team",
        **given,
    )


def _refuse_for_standby(leaders: tuple[Address, ...], place: Address, authority: Path | None) -> None:
    """Raise `UsageError` if a standby master would follow itself, or has an Authority."""
    if place in leaders:
        raise click.UsageError(f"--standby contains {place}, the address of this master (--listen): remove it there")
    if authority:
        raise click.UsageError("--authority is only for the first master: remove it, or --standby")


def _standby(
    leaders: tuple[Address, ...], name: str | None, identity: Path | None, token: str | None
) -> StandbyPlan | None:
    """Return the plan of a standby master, after it has enrolled or renewed its certificate; None for another one."""
    if not leaders:
        if name or identity or token:
            raise click.UsageError("--as, --identity and --token are only for standby masters: add --standby HOST:PORT")
        return None
    if name is None:
        raise click.UsageError(
            "--standby requires the name of this master, enrolled with the role master: add --as NAME"
        )
    from robochoc.run.networked.join import identity_of
    from robochoc.run.networked.standby import StandbyPlan

    return StandbyPlan(leaders, identity_of(name, leaders[0], identity, token))


@contextmanager
def _publication(*, sniffable: bool) -> Iterator[Publication | None]:
    """Yield the publication of the journal for sniffers, in an unnamed file, or None if the run is not `sniffable`."""
    if not sniffable:
        yield None
        return
    from robochoc.communication.network.journal_server import Publication
    from robochoc.system.temporary_files import unnamed_file

    with unnamed_file(buffered=False) as file, closing(Publication(file.fileno())) as publication:
        yield publication


def _run(
    plan: MasterPlan, recorder: JournalRecorder | None, publication: Publication | None, audience: Audience
) -> MasterResult | None:
    """Run the master with its observers. Return None if this is a standby master, and another one has ended the run."""
    from robochoc.run.networked.master_run import run_master
    from robochoc.run.networked.standby import RunOverElsewhereError

    if recorder and publication:
        publication.fresh = recorder.flush_if_due
    with progress_line(plan.name) as show:
        progress = flushing_progress(recorder, show)

        printer = _EventPrinter(plan.place)

        def observe(event: AnyEvent) -> None:
            printer.print_event(event)
            if recorder:
                recorder(event)

        plan = replace(plan, following=lambda: printer.print_following(plan))
        try:
            return run_master(
                plan,
                observer=observe,
                audience=audience,
                watched=recorder is not None,
                progress=progress,
                listening=printer.print_listening,
                publication=publication,
                concluded=partial(_close_journal, recorder, publication),
            )
        except RunOverElsewhereError as over:
            _close_journal(recorder, publication, None)
            if over.failed:
                raise Failure(LOST, str(over)) from None
            print_above(str(over))
            return None


def _close_journal(recorder: JournalRecorder | None, publication: Publication | None, outcome: Outcome | None) -> None:
    """Write the end of the run to the journal."""
    if recorder:
        recorder.outcome = outcome
        recorder.close()  # before anything else is written to the same destination
    if publication:
        publication.end()


def _print_result(result: MasterResult, *, as_json: bool) -> None:
    if as_json:
        from robochoc.formats.result import result_json

        click.echo(result_json(result.outcome))
    else:
        from robochoc.cli.reports.outcome import outcome_report

        click.echo(outcome_report(result.team, result.outcome))


def _header(plan: MasterPlan) -> Header:
    """Return the header for the run's journal."""
    from robochoc.journal.journal import Header
    from robochoc.run.defaults import AUTO, DEFAULT_PROTOCOL

    name = DEFAULT_PROTOCOL if plan.protocol in {None, AUTO} else plan.protocol
    return Header(team=plan.name, protocol=name, runtime="network", seed=plan.seed)


class _EventPrinter:
    """Prints that the master listens at `place`, and its events. Events that happen before are printed afterwards."""

    def __init__(self, place: Address) -> None:
        self._place = place
        self._early: list[AnyEvent] | None = []
        self._lock = threading.Lock()

    def print_listening(self) -> None:
        """Print that the master listens, and the events so far."""
        with self._lock:
            print_above(f"listening at {self._place}; start robots with --master {_address(self._place)}")
            for event in self._early or ():
                _print_event(event)
            self._early = None

    def print_following(self, plan: MasterPlan) -> None:
        """Print that this standby master follows the masters with a higher priority."""
        leaders = ", ".join(map(str, plan.standby.leaders)) if plan.standby else ""
        print_above(f"standing by for {leaders}")

    def print_event(self, event: AnyEvent) -> None:
        """Print an event now, or as soon as the master listens. Events arrive from several threads."""
        with self._lock:
            if self._early is None:
                _print_event(event)
            else:
                self._early.append(event)


def _print_event(event: AnyEvent) -> None:
    """Print one line for an event that the master's operator needs to know at once."""
    from robochoc.formats import on_one_line
    from robochoc.journal.events import DroppedOut, Granted, Leads, Lost, Refused, Registered

    match event:
        case Registered(robot=name):
            line = f"{name} has registered"
        case DroppedOut(robot=name, why=why):
            line = f"{name} has disconnected: {why}; waiting for its return"
        case Lost(robot=name, why=why):
            line = f"{name} is lost: {why}"
        case Leads(master=master, term=term, why=why):
            line = f"{master} leads in term {term}: {why}"
        case Granted(who=who, what=what):
            line = f"{who}: granted to {what}"
        case Refused(who=who, what=what, why=why):
            line = f"refused: {who}, {what}: {why}"
        case _:
            return
    print_above(on_one_line(line))


def _address(place: Address) -> str:
    return f"HOST:{place.port}" if place.anywhere else str(place)
