"""Solves one team for `robochoc solve`: reads it, runs it with its observers, and prints the outcome."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from robochoc.cli.options.order import order_for
from robochoc.cli.options.recording import flushing_progress, recording
from robochoc.cli.options.ros_setup import closed_loop
from robochoc.cli.options.scene import problem_map, readable_map
from robochoc.cli.options.solve import Outputs, TeamRequest
from robochoc.cli.reports.closed_loop import FlownMission, publication_lines, report_flight
from robochoc.cli.reports.failures import INVALID, LIMIT, Failure, errors_as_failures
from robochoc.cli.reports.live_sniffer import LiveSniffer, check_patterns
from robochoc.cli.reports.notes import bound_warning, difference_lines

if TYPE_CHECKING:
    from robochoc.communication.kill_schedule import Kill
    from robochoc.formats.problems import ReadProblem
    from robochoc.journal.journal import JournalRecorder
    from robochoc.maps.ground_map import GroundMap
    from robochoc.model.outcome import Outcome
    from robochoc.model.problem import Team
    from robochoc.robots.closed_loop import ClosedLoop
    from robochoc.run.choice import ProtocolChoice
    from robochoc.run.improvement import Audience
    from robochoc.run.options import Options
    from robochoc.run.orchestrator import PreparedRun
    from robochoc.solver.agent_problem import StartValues


def solve_team(folder: Path, options: Options, outputs: Outputs, request: TeamRequest) -> int:
    """Solve the team in `folder`, print the outcome, and return the exit status once all pages are closed."""
    with LiveSniffer(outputs.sniffer) as sniffer:
        status = _solve_and_show(folder, options, outputs, request, sniffer)
        sniffer.wait()
    return status


def _solve_and_show(
    folder: Path, options: Options, outputs: Outputs, request: TeamRequest, sniffer: LiveSniffer
) -> int:
    """Solve the team in `folder`, show the outcome, and return the exit status."""
    from robochoc.formats import on_one_line

    try:
        with errors_as_failures(folder):
            team, outcome, loop, flight, problem = _solve(folder, options, outputs, request, sniffer)
    except Failure as failure:
        failure.show()
        return failure.exit_code
    for line in publication_lines(loop) if loop and not request.as_json else ():
        click.echo(line, err=True)
    if outputs.html and outcome.front:
        from robochoc.cli.reports.scene import write_front

        write_front(outcome, team, outputs.html, quiet=request.as_json)
    elif outputs.html or outputs.serve:
        from robochoc.cli.reports.scene import scene_for, show_scene

        ground = problem_map(problem, folder)
        scene = scene_for(outcome, team, mission=flight.mission, flown=flight.flown, ground=ground)
        show_scene(scene, outputs.html, serve=outputs.serve, quiet=request.as_json)
    if outcome.verdict != "unknown":
        return flight.status
    if outcome.reason and request.as_json:
        click.echo(on_one_line(f"{folder}: {outcome.reason}"), err=True)
    return LIMIT


def _with_team_names(kills: Sequence[Kill], problem: ReadProblem) -> tuple[Kill, ...]:
    """Return `kills` with the robots' names in the team. Unknown names are kept, so that the run rejects them."""
    from robochoc.model.original_names import robots_called

    known = robots_called(problem.team, problem.names)
    return tuple(kill._replace(robot=known.get(kill.robot, kill.robot)) for kill in kills)


def _start_in(file: Path, problem: ReadProblem) -> StartValues:
    """Return the start values in a JSON result or a journal. Raises `Failure`."""
    from robochoc.cli.options.saved import saved_outcome
    from robochoc.model.change import team_after_events
    from robochoc.run.starts import start_of_outcome
    from robochoc.system.errors import OptionError

    outcome, _ = saved_outcome(file)
    if not outcome.assignment:
        click.echo(f"{file}: the verdict is {outcome.verdict}, so there is no assignment to begin from", err=True)
    try:
        return start_of_outcome(outcome, team_after_events(problem.team, events=0), problem.names)
    except OptionError as unfit:
        raise Failure(INVALID, f"{file}: {str(unfit).removeprefix('start: ')}") from None


class _FinishedRun(NamedTuple):
    """A finished run whose journal has been written."""

    team: Team
    outcome: Outcome
    loop: ClosedLoop | None
    flight: FlownMission
    problem: ReadProblem


def _solve(
    folder: Path, options: Options, outputs: Outputs, request: TeamRequest, sniffer: LiveSniffer
) -> _FinishedRun:
    """Solve the team in `folder`, with a journal and a closed loop if requested, and print the outcome."""
    from robochoc.formats import on_one_line
    from robochoc.formats.problems import read_problem

    problem = read_problem(folder, dialect=request.dialect, infinity=request.infinity, owner=request.owner)
    for line in difference_lines(problem.notes):
        click.echo(f"{on_one_line(str(folder))}: {line.strip()}", err=True)
    team = problem.team
    check_patterns(outputs.sniffer, team)
    order = order_for(team, request.order, problem.names)
    options = replace(options, order=order, kill=_with_team_names(options.kill, problem))
    if request.start is not None:
        options = replace(options, start=_start_in(request.start, problem))
    from robochoc.cli.reports.improvements import ImprovementReporter
    from robochoc.run.orchestrator import prepare
    from robochoc.run.recording import journal_header, objective_to_record

    run = prepare(team, options, environment=bool(request.ros.situation), ordered=not problem.foreign)
    options, team = run.choice.options, run.team
    header = partial(journal_header, team, options)

    objective = None if request.ros.situation else objective_to_record(team, options)
    with (
        closed_loop(request.ros, team, options.seed, partial(problem_map, problem, folder)) as loop,
        recording(outputs.journal, header, objective, sniffer.start()) as recorder,
    ):
        audience = ImprovementReporter(loop, quiet=request.as_json) if options.improve else None
        outcome = _observed(run, recorder, loop, audience)
        team = loop.team if loop else team
        _print_outcome(problem._replace(team=team), outcome, request, run.choice, readable_map(problem, folder))
        if loop and loop.mission is None:  # the run did not use the loop
            loop.publish(outcome)
        flight = FlownMission()
        if loop and request.ros.simulates_flight:
            flight = report_flight(loop, request.ros.flight.get("failures", ()), quiet=request.as_json)
        if audience and (outputs.html or outputs.serve) and flight.mission is None:
            flight = flight._replace(mission=audience.mission(outcome, team))
    return _FinishedRun(team, outcome, loop, flight, problem)


def _observed(
    run: PreparedRun, recorder: JournalRecorder | None, loop: ClosedLoop | None, audience: Audience | None
) -> Outcome:
    """Run the team with the requested observers: the page, a journal, the progress line, and the ROS sinks."""
    from robochoc.cli.reports.choice import OrderNote
    from robochoc.cli.reports.progress import progress_line, waiting_for_reports
    from robochoc.run.defaults import CENTRAL

    team, options = run.team, run.choice.options
    is_dynamic = loop and (loop.feedback or (team.dynamic and options.protocol != CENTRAL))
    note = OrderNote(team, options)
    with progress_line(team.name) as progress:
        show = flushing_progress(recorder, note.observing(progress))
        if loop and loop.feedback and show:
            loop.feedback.idle = waiting_for_reports(show)
        environment = loop if is_dynamic else None
        outcome = run.solve(observer=recorder, progress=show, environment=environment, audience=audience)
    note.print_if_slow(outcome.metrics.wall_s)
    if recorder:
        recorder.outcome = outcome
        recorder.close()  # before anything else is written to the same destination
    return outcome


def _print_outcome(
    problem: ReadProblem, outcome: Outcome, request: TeamRequest, choice: ProtocolChoice, ground: GroundMap | None
) -> None:
    """Print the outcome, with the original names if the problem was imported.

    The JSON result for a team's folder contains the team's names, and the original names in addition.
    """
    from robochoc.model.original_names import renamed_outcome, renamed_team

    names = problem.names
    if warning := bound_warning(problem, outcome.cost):
        click.echo(f"{problem.team.name}: {warning}", err=True)
    if request.as_json:
        from robochoc.formats.result import result_json
        from robochoc.maps.places import MapPlaces
        from robochoc.model.change import team_after_events

        places = MapPlaces(team_after_events(problem.team, outcome.events), ground).places_of(outcome.assignment)
        shown = result_json(renamed_outcome(outcome, names)) if problem.foreign else result_json(outcome, names, places)
        click.echo(shown)
    else:
        from robochoc.cli.reports.outcome import outcome_report

        outcome = renamed_outcome(outcome, names)
        click.echo(outcome_report(renamed_team(problem.team, names, outcome.events), outcome, ground))
        if request.explain:
            from robochoc.cli.reports.choice import choice_lines
            from robochoc.cli.reports.pseudo_tree import tree_text

            for line in choice_lines(choice):
                click.echo(line)
            click.echo(tree_text(outcome))
