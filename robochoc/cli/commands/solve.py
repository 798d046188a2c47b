"""`robochoc solve`: teams in, verdicts out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from robochoc.cli.options.channel import CHANNEL_NAME
from robochoc.cli.options.channel import NAMES as CHANNELS
from robochoc.cli.options.ground import ground_map
from robochoc.cli.options.local_problems import local_options
from robochoc.cli.options.order import NAMES as ORDERS
from robochoc.cli.options.order import ORDER_NAME, order_for
from robochoc.cli.options.pages import html_option, serve_option
from robochoc.cli.options.paths import refuse_same_places, teams_at
from robochoc.cli.options.problems import Problem, reading_options
from robochoc.cli.options.recording import bounds_option, journal_option, recording, shown_and_flushed
from robochoc.cli.options.ros import (
    arm_option,
    flight_options,
    ros_options,
    situation_options,
    take_ros_options,
)
from robochoc.cli.options.ros_setup import closed_loop, sink_places, source_places
from robochoc.cli.options.sections import COMMON, Sections
from robochoc.cli.options.solve import (
    Products,
    SolveCommand,
    Wanted,
    check_products,
    filter_option,
    kill_option,
    messages_option,
    options_of,
    preprocess_option,
    protocol_option,
    settings_option,
    withdraw_option,
)
from robochoc.cli.reports.closed_loop import flight_told, told_of
from robochoc.cli.reports.failures import LIMIT, Failure, failures_told, worst
from robochoc.cli.reports.live_sniffer import Watch, check_chosen, watching
from robochoc.cli.reports.notes import bound_told, differences_told
from robochoc.system.stopping import stop_heard

if TYPE_CHECKING:
    from robochoc.cli.reports.closed_loop import FlownMission
    from robochoc.communication.kill_schedule import Kill
    from robochoc.formats.problems import ReadProblem
    from robochoc.journal.journal import JournalRecorder
    from robochoc.model.outcome import Outcome
    from robochoc.model.problem import Team
    from robochoc.ros.closed_loop import ClosedLoop
    from robochoc.run.choice import Choice
    from robochoc.run.improvement import Audience
    from robochoc.run.options import Options


_SECTIONS: Sections = {
    COMMON: (
        "--protocol", "--runtime", "--timeout", "--deadline", "--withdraw", "--verify", "--seed",
        "--json", "--html", "--journal", "--sniff", "--help",
    ),
    "Search": ("--order", "--set", "--preprocess", "--messages", "--ncccs", "--cycles", "--count", "--with"),
    "Losses of robots (processes and network)": ("--on-loss", "--spare", "--patience", "--kill"),
    "Messages on their way": ("--schedule", "--delay", "--channel", "--message-loss", "--filter"),
    "Robots with several variables": ("--local-solutions", "--local-timeout", "--ace", "--no-cache"),
    "Files of other tools (docs/guides/import.md)": ("--infinity", "--owner"),
    "Output": ("--explain", "--bounds", "--serve", "--open"),
    "ROS (docs/guides/ros.md)": (
        "--ros", "--frame", "--scale", "--ros-type", "--tf", "--diagnostics", "--arm",
        "--situation", "--report-timeout", "--battery", "--use-sim-time", "--improve",
    ),
    "Simulated flight (--situation flight)": (
        "--fail", "--distance", "--downwash", "--wind", "--gusts", "--obstacle",
    ),
}  # fmt: skip


@click.command(cls=SolveCommand, sections=_SECTIONS)
@click.argument("paths", nargs=-1, required=True, type=Problem(), metavar="PATH ...")
@protocol_option(central=True)
@settings_option
@click.option(
    "--order",
    type=ORDER_NAME,
    metavar="NAME|FILE",
    help=(
        f"Priority order of the robots: {', '.join(ORDERS)}, or a file with a name a line."
        "  [default: given; auto chooses]"
    ),
)
@click.option(
    "--runtime",
    type=click.Choice(["processes", "simulator", "network", "arrays"], case_sensitive=False),
    default="processes",
    show_default=True,
    metavar="NAME",
    help="processes: one per robot; simulator: one thread, repeatable; network: with TLS; arrays: numpy, no messages.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    metavar="N",
    help="Seed of everything that is random.",
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
    type=click.IntRange(0),
    default=0,
    show_default=True,
    metavar="CHECKS",
    help="Simulator: largest delay of a message.",
)
@click.option(
    "--channel",
    type=CHANNEL_NAME,
    metavar="NAME|FILE",
    help=f"Simulator: seconds of computing and radio, by a channel model: {', '.join(CHANNELS)} or a TOML file.",
)
@click.option(
    "--message-loss",
    type=click.FloatRange(0, 0.9),
    default=0.0,
    metavar="P",
    help="Lose each message with this probability, for good.",
)
@click.option(
    "--timeout",
    type=click.FloatRange(0, min_open=True),
    metavar="SECONDS",
    help="Stop after this time: verdict unknown, exit status 3.",
)
@click.option(
    "--deadline",
    type=click.FloatRange(0, min_open=True),
    metavar="SECONDS",
    help="Stop by then with the best solution so far.",
)
@withdraw_option
@preprocess_option
@messages_option
@click.option(
    "--ncccs",
    type=click.IntRange(1),
    metavar="N",
    help="Simulator: stop after N non-concurrent constraint checks.",
)
@click.option(
    "--cycles",
    type=click.IntRange(1),
    metavar="N",
    help="Stop after N cycles of --schedule cycles.",
)
@click.option(
    "--on-loss",
    type=click.Choice(["fail", "withdraw"]),
    metavar="fail|withdraw",
    help="If a robot's process dies, end the run (status 4), or let the robot leave.  [default: fail]",
)
@click.option(
    "--spare",
    "spares",
    type=click.IntRange(0),
    default=0,
    metavar="[=N]",
    help="Restart up to N lost robots (1 without a number). Implies --on-loss withdraw.",
)
@kill_option
@filter_option
@click.option("--explain", is_flag=True, help="Print why the protocol was chosen, and the pseudo-tree.")
@click.option("--count", is_flag=True, help="With --protocol central, count-dpop: count solutions.")
@click.option(
    "--with",
    "central_with",
    type=click.Choice(["ace", "ortools"], case_sensitive=False),
    default="ace",
    metavar="NAME",
    help="--protocol central: ace (default) or ortools.",
)
@click.option("--verify", is_flag=True, help="Confirm a no-solution or an optimum centrally.")
@local_options
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
    help="Show all messages live on a page of this machine; ROBOTS: those shown first, such as Robot3.1,Robot2.*.",
)
@click.option("--open", "open_browser", is_flag=True, help="With --sniff: open the page in a browser, then start.")
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
    """Solve all teams in the folders PATH and below, or files that 'robochoc import' reads; solutions are checked.

    \b
    robochoc solve instances/queens3d-4 --withdraw --html out/page.html
    robochoc solve instances/ --runtime simulator --protocol dpop --json
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    ros = take_ros_options(settings)
    named = {"--order": settings["order"], "--channel": settings["channel"]}
    given = {option: value for option, value in named.items() if isinstance(value, Path)}
    options = options_of(settings, environment=bool(ros.situation))
    wanted = Wanted(
        settings["order"], settings.pop("infinity"), settings.pop("owner"),
        as_json=as_json, explain=explain, ros=ros,
    )  # fmt: skip
    products = Products(html, journal, serve, watching(settings["sniff"], open_browser=settings["open_browser"]))
    folders = teams_at(paths, foreign=True)
    refuse_same_places(
        {"--html": html, "--journal": journal},
        given,
        teams=folders,
        more_outputs=sink_places(ros.sinks),
        more_inputs=source_places(ros.situation),
    )
    check_products(products, wanted, options, teams=len(folders))
    with stop_heard():
        statuses = [_solve_one(folder, options, products, wanted) for folder in folders]
    context.exit(worst(statuses))


def _solve_one(folder: Path, options: Options, products: Products, wanted: Wanted) -> int:
    """Solve the team in `folder`, print the outcome, and return the exit status after all pages are closed."""
    with Watch(products.watching) as watch:
        status = _solved(folder, options, products, wanted, watch)
        watch.stay()
    return status


def _solved(folder: Path, options: Options, products: Products, wanted: Wanted, watch: Watch) -> int:
    """Solve the team in `folder`, show the outcome, and return the exit status."""
    from robochoc.formats import on_one_line

    try:
        with failures_told(folder):
            team, outcome, loop, flight = _recorded(folder, options, products, wanted, watch)
    except Failure as failure:
        failure.show()
        return failure.exit_code
    for line in told_of(loop) if loop and not wanted.as_json else ():
        click.echo(line, err=True)
    if products.html or products.serve:
        from robochoc.cli.reports.scene import scene_for, show_scene

        ground = ground_map(None, folder)
        scene = scene_for(outcome, team, mission=flight.mission, flown=flight.flown, ground=ground)
        show_scene(scene, products.html, serve=products.serve, quiet=wanted.as_json)
    if outcome.verdict != "unknown":
        return flight.status
    if outcome.reason and wanted.as_json:
        click.echo(on_one_line(f"{folder}: {outcome.reason}"), err=True)
    return LIMIT


def _called(kills: Sequence[Kill], problem: ReadProblem) -> tuple[Kill, ...]:
    """Return `kills` with the robots' names in the team. One that no robot has stays: the run refuses it."""
    from robochoc.model.original_names import robots_called

    known = robots_called(problem.team, problem.names)
    return tuple(one._replace(robot=known.get(one.robot, one.robot)) for one in kills)


class _RecordedRun(NamedTuple):
    """A run that is over, and whose journal is written."""

    team: Team
    outcome: Outcome
    loop: ClosedLoop | None
    flight: FlownMission


def _recorded(folder: Path, options: Options, products: Products, wanted: Wanted, watch: Watch) -> _RecordedRun:
    """Solve the team in `folder`, with a journal and a closed loop where they are asked for, and print the outcome."""
    from robochoc.formats import on_one_line
    from robochoc.formats.problems import read_problem

    problem = read_problem(folder, infinity=wanted.infinity, owner=wanted.owner)
    for line in differences_told(problem.notes):
        click.echo(f"{on_one_line(str(folder))}: {line.strip()}", err=True)
    team = problem.team
    check_chosen(products.watching, team)
    order = order_for(team, wanted.order, problem.names)
    options = replace(options, order=order, kill=_called(options.kill, problem))
    from robochoc.cli.reports.improvements import ImprovementsTold
    from robochoc.run.choice import decided
    from robochoc.run.recording import journal_header, objective_to_record

    choice = decided(team, options, environment=bool(wanted.ros.situation), ordered=not problem.foreign)
    options = choice.options
    header = partial(journal_header, team, options)

    objective = None if wanted.ros.situation else objective_to_record(team, options)
    with (
        closed_loop(wanted.ros, team, options.seed, folder) as loop,
        recording(products.journal, header, objective, watch.begun()) as recorder,
    ):
        audience = ImprovementsTold(team, loop, quiet=wanted.as_json) if options.improve else None
        outcome = _run(team, options, recorder, loop, audience)
        team = loop.team if loop else team
        _tell(problem._replace(team=team), outcome, wanted, choice)
        if loop and loop.mission is None:  # the run knew nothing of it
            loop.publish(outcome)
        flight = flight_told(loop, wanted.ros, quiet=wanted.as_json)
        if audience and (products.html or products.serve) and flight.mission is None:
            flight = flight._replace(mission=audience.mission(outcome, team))
    return _RecordedRun(team, outcome, loop, flight)


def _run(
    team: Team,
    options: Options,
    recorder: JournalRecorder | None,
    loop: ClosedLoop | None,
    audience: Audience | None,
) -> Outcome:
    """Run with the requested observers: the page, a journal, the progress line, and the ROS sinks."""
    from robochoc.cli.reports.choice import OrderNote
    from robochoc.cli.reports.progress import progress_line, waiting
    from robochoc.run.options import CENTRAL
    from robochoc.run.orchestrator import solve as run

    told = loop and (loop.feedback or (team.dynamic and options.protocol != CENTRAL))
    note = OrderNote(team, options)
    with progress_line(team.name) as progress:
        show = shown_and_flushed(recorder, note.watching(progress))
        if loop and loop.feedback and show:
            loop.feedback.idle = waiting(show)
        environment = loop if told else None
        outcome = run(team, options, observer=recorder, progress=show, environment=environment, audience=audience)
    note.tell_if_late(outcome.metrics.wall_s)
    if recorder:
        recorder.outcome = outcome
        recorder.close()  # before anything else goes to where it may be written
    return outcome


def _tell(problem: ReadProblem, outcome: Outcome, wanted: Wanted, choice: Choice) -> None:
    """Print the outcome, in the original names if the problem was imported.

    In JSON a team's folder keeps its own names, with the others beside.
    """
    from robochoc.model.original_names import renamed_outcome, renamed_team

    names = problem.names
    if reached := bound_told(problem, outcome.cost):
        click.echo(f"{problem.team.name}: {reached}", err=True)
    if wanted.as_json:
        from robochoc.formats.result import result_json

        shown = result_json(renamed_outcome(outcome, names)) if problem.foreign else result_json(outcome, names)
        click.echo(shown)
    else:
        from robochoc.cli.reports.outcome import outcome_report

        outcome = renamed_outcome(outcome, names)
        click.echo(outcome_report(renamed_team(problem.team, names, outcome.events), outcome))
        if wanted.explain:
            from robochoc.cli.reports.choice import choice_lines
            from robochoc.cli.reports.pseudo_tree import tree_text

            for line in choice_lines(choice):
                click.echo(line)
            click.echo(tree_text(outcome))
