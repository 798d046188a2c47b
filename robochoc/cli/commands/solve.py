"""`robochoc solve`: solve teams and print their outcomes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from robochoc.cli.commands.solve_team import solve_team
from robochoc.cli.options.local_problems import local_options
from robochoc.cli.options.order import NAMES as ORDERS
from robochoc.cli.options.order import ORDER_NAME
from robochoc.cli.options.paths import refuse_same_places, teams_at
from robochoc.cli.options.problems import ProblemPath, format_option, reading_options
from robochoc.cli.options.recording import bounds_option, journal_option
from robochoc.cli.options.ros import (
    arm_option,
    flight_options,
    pop_ros_options,
    ros_options,
    situation_options,
)
from robochoc.cli.options.ros_setup import sink_places, source_places
from robochoc.cli.options.scene import html_option, serve_option
from robochoc.cli.options.sections import COMMON, Sections
from robochoc.cli.options.solve import (
    CHANNEL_NAMES,
    CHANNEL_TYPE,
    Outputs,
    SolveCommand,
    TeamRequest,
    answer_option,
    check_outputs,
    cluster_option,
    cold_option,
    deadline_option,
    filter_option,
    kill_option,
    messages_option,
    objectives_option,
    options_of,
    preprocess_option,
    protocol_option,
    repair_option,
    risk_option,
    samples_option,
    settings_option,
    standby_option,
    start_option,
    withdraw_option,
)
from robochoc.cli.options.value_types import Number, Seed, WholeNumber
from robochoc.cli.reports.failures import worst
from robochoc.cli.reports.live_sniffer import sniffer_request
from robochoc.system.stopping import stop_handled

_SECTIONS: Sections = {
    COMMON: (
        "--protocol", "--runtime", "--timeout", "--deadline", "--withdraw", "--verify", "--seed",
        "--json", "--html", "--journal", "--sniff", "--help",
    ),
    "Search": (
        "--order", "--set", "--objectives", "--risk", "--samples", "--start", "--cold", "--preprocess", "--answer",
        "--no-repair", "--messages", "--ncccs", "--cycles", "--count", "--with", "--cluster",
    ),
    "Losses of robots (processes and network)": ("--on-loss", "--spare", "--patience", "--kill", "--standby"),
    "Delivery of messages": ("--schedule", "--delay", "--channel", "--message-loss", "--filter"),
    "Robots with several variables": ("--local-solutions", "--local-timeout", "--ace", "--no-cache"),
    "Input (documentation, page Files of other tools)": ("--format", "--infinity", "--owner"),
    "Output": ("--explain", "--bounds", "--serve", "--open"),
    "ROS (documentation, page ROS)": (
        "--ros", "--frame", "--scale", "--ros-type", "--tf", "--diagnostics", "--arm",
        "--situation", "--report-timeout", "--battery", "--use-sim-time", "--improve",
    ),
    "Simulated flight (--situation flight)": (
        "--fail", "--distance", "--downwash", "--wind", "--gusts", "--obstacle",
    ),
}  # fmt: skip


@click.command(cls=SolveCommand, sections=_SECTIONS)
@click.argument("paths", nargs=-1, required=True, type=ProblemPath(), metavar="PATH ...")
@protocol_option(central=True)
@settings_option
@click.option(
    "--order",
    type=ORDER_NAME,
    metavar="NAME|FILE",
    help=(f"Order: {', '.join(ORDERS)}, or a file of names."),
)
@click.option(
    "--runtime",
    type=click.Choice(["processes", "simulator", "network", "arrays"], case_sensitive=False),
    default="processes",
    show_default=True,
    metavar="NAME",
    help="processes: one per robot; simulator: repeatable; network: TLS; arrays: numpy.",
)
@click.option(
    "--seed",
    type=Seed(),
    default=0,
    show_default=True,
    metavar="N",
    help="Random seed.",
)
@click.option(
    "--schedule",
    type=click.Choice(["concurrent", "cycles", "one-by-one", "random"]),
    default="concurrent",
    metavar="NAME",
    help="Simulator: concurrent, one-by-one, cycles or random.",
)
@click.option(
    "--delay",
    type=WholeNumber(0),
    default=0,
    show_default=True,
    metavar="CHECKS",
    help="Simulator: longest delay of a message.",
)
@click.option(
    "--channel",
    type=CHANNEL_TYPE,
    metavar="NAME|FILE",
    help=f"Simulator: times as on {', '.join(CHANNEL_NAMES)} or FILE.",
)
@click.option(
    "--message-loss",
    type=Number(0, 0.9),
    default=0.0,
    metavar="P",
    help="Lose each message for good with this probability.",
)
@click.option(
    "--timeout",
    type=Number(0, min_open=True),
    metavar="SECONDS",
    help="Stop after this time: verdict unknown, exit status 3.",
)
@deadline_option
@withdraw_option
@start_option
@cold_option
@preprocess_option
@answer_option
@risk_option
@samples_option
@repair_option
@objectives_option
@messages_option
@click.option(
    "--ncccs",
    type=WholeNumber(1),
    metavar="N",
    help="Simulator: stop after N non-concurrent constraint checks.",
)
@click.option(
    "--cycles",
    type=WholeNumber(1),
    metavar="N",
    help="Stop after N cycles of --schedule cycles.",
)
@click.option(
    "--on-loss",
    type=click.Choice(["fail", "withdraw"]),
    metavar="fail|withdraw",
    help="If a robot dies: end (default) or continue the run.",
)
@click.option(
    "--spare",
    "spares",
    type=WholeNumber(0),
    default=0,
    metavar="[=N]",
    help="Restart up to N lost robots; implies withdraw.",
)
@cluster_option
@kill_option
@standby_option
@filter_option
@click.option("--explain", is_flag=True, help="Print the reasons for the chosen protocol, and the pseudo-tree.")
@click.option("--count", is_flag=True, help="With --protocol central, count-dpop: count solutions.")
@click.option(
    "--with",
    "central_with",
    type=click.Choice(["auto", "ace", "ortools", "toulbar2", "cosoco"], case_sensitive=False),
    default="auto",
    metavar="NAME",
    help="central: auto (default), ace, ortools, toulbar2, cosoco.",
)
@click.option("--verify", is_flag=True, help="Confirm a no-solution or an optimum by a central solver.")
@local_options
@format_option
@reading_options
@ros_options
@arm_option
@situation_options
@flight_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per team, and nothing else.")
@html_option()
@journal_option
@bounds_option
@serve_option
@click.option(
    "--sniff",
    metavar="[=ROBOTS]",
    help="Show messages live on a page; ROBOTS (A,B.*) come first.",
)
@click.option("--open", "open_browser", is_flag=True, help="With --sniff: open the page in a browser before the run.")
@click.pass_context
def solve(
    context: click.Context,
    /,
    paths: tuple[Path, ...],
    *,
    as_json: bool,
    html: Path | None,
    journal: Path | None,
    serve: bool,
    explain: bool,
    **settings: Any,  # noqa: ANN401 - the other options
) -> None:
    """Solve all teams in the folders PATH and below, or files that 'robochoc import' reads, and check the solutions.

    \b
    robochoc solve instances/queens3d-4 --withdraw --html out/page.html
    robochoc solve instances/ --runtime simulator --protocol dpop --json
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    ros = pop_ros_options(settings)
    named = {"--order": settings["order"], "--channel": settings["channel"]}
    given = {option: value for option, value in named.items() if isinstance(value, Path)}
    if settings["start"]:
        given["--start"] = settings["start"]
    options = options_of(settings, environment=bool(ros.situation))
    request = TeamRequest(
        settings["order"], settings.pop("dialect"), settings.pop("infinity"), settings.pop("owner"),
        as_json=as_json, explain=explain, ros=ros, start=settings.pop("start"),
    )  # fmt: skip
    sniffer = sniffer_request(settings["sniff"], open_browser=settings["open_browser"])
    outputs = Outputs(html, journal, serve, sniffer)
    folders = teams_at(paths, foreign=True, dialect=request.dialect)
    refuse_same_places(
        {"--html": html, "--journal": journal},
        given,
        teams=folders,
        more_outputs=sink_places(ros.sinks),
        more_inputs=source_places(ros.situation),
    )
    check_outputs(outputs, request, options, teams=len(folders))
    with stop_handled():
        statuses = [solve_team(folder, options, outputs, request) for folder in folders]
    context.exit(worst(statuses))
