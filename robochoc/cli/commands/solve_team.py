"""One team of `robochoc solve`: it is read, run with all that watches, and its outcome is printed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from robochoc.cli.options.ground import ground_map, map_beside
from robochoc.cli.options.order import order_for
from robochoc.cli.options.recording import recording, shown_and_flushed
from robochoc.cli.options.ros_setup import closed_loop
from robochoc.cli.options.solve import Products, Wanted
from robochoc.cli.reports.closed_loop import flight_told, told_of
from robochoc.cli.reports.failures import LIMIT, Failure, failures_told
from robochoc.cli.reports.live_sniffer import Watch, check_chosen
from robochoc.cli.reports.notes import bound_told, differences_told

if TYPE_CHECKING:
    from robochoc.cli.reports.closed_loop import FlownMission
    from robochoc.communication.kill_schedule import Kill
    from robochoc.formats.ground_map import GroundMap
    from robochoc.formats.problems import ReadProblem
    from robochoc.journal.journal import JournalRecorder
    from robochoc.model.outcome import Outcome
    from robochoc.model.problem import Team
    from robochoc.ros.closed_loop import ClosedLoop
    from robochoc.run.choice import Choice
    from robochoc.run.improvement import Audience
    from robochoc.run.options import Options


def solve_team(folder: Path, options: Options, products: Products, wanted: Wanted) -> int:
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

    problem = read_problem(folder, dialect=wanted.dialect, infinity=wanted.infinity, owner=wanted.owner)
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
        audience = ImprovementsTold(loop, quiet=wanted.as_json) if options.improve else None
        outcome = _run(team, options, recorder, loop, audience)
        team = loop.team if loop else team
        _tell(problem._replace(team=team), outcome, wanted, choice, map_beside(folder))
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


def _tell(problem: ReadProblem, outcome: Outcome, wanted: Wanted, choice: Choice, ground: GroundMap | None) -> None:
    """Print the outcome, in the original names if the problem was imported.

    In JSON a team's folder keeps its own names, with the others beside.
    """
    from robochoc.model.original_names import renamed_outcome, renamed_team

    names = problem.names
    if reached := bound_told(problem, outcome.cost):
        click.echo(f"{problem.team.name}: {reached}", err=True)
    if wanted.as_json:
        from robochoc.formats.places import MapPlaces
        from robochoc.formats.result import result_json
        from robochoc.model.change import team_after_events

        places = MapPlaces(team_after_events(problem.team, outcome.events), ground).of(outcome.assignment)
        shown = result_json(renamed_outcome(outcome, names)) if problem.foreign else result_json(outcome, names, places)
        click.echo(shown)
    else:
        from robochoc.cli.reports.outcome import outcome_report

        outcome = renamed_outcome(outcome, names)
        click.echo(outcome_report(renamed_team(problem.team, names, outcome.events), outcome, ground))
        if wanted.explain:
            from robochoc.cli.reports.choice import choice_lines
            from robochoc.cli.reports.pseudo_tree import tree_text

            for line in choice_lines(choice):
                click.echo(line)
            click.echo(tree_text(outcome))
