"""`robochoc serve`: solves teams on request, as a ROS 2 service."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import InputPath, teams_at
from robochoc.cli.options.ros_setup import ros_errors_as_failures
from robochoc.cli.options.value_types import Number, Seed, WholeNumber
from robochoc.cli.reports.failures import USAGE, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.model.problem import Team
    from robochoc.ros.live.action_goals import ActionGoals
    from robochoc.ros.live.services import ImmediateServices, Refuse, ServiceRequest, Services

_SERVICE, _CANCEL, _FEEDBACK = "/robochoc/decide", "/robochoc/cancel", "/robochoc/feedback"
_TEXT = "std_msgs/String"
_GOAL = f"{_SERVICE} (goal)"
"""The name of the requests that goals of the action become."""
_MIDDLEWARES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "dds": ("dds_service", "DdsServices"),
        "rclpy": ("rclpy_service", "RclpyServices"),
        "rmw_zenoh": ("rmw_zenoh_service", "RmwZenohServices"),
        "rosbridge": ("rosbridge_service", "RosbridgeServices"),
    }
)
"""For each kind of middleware: its module in `robochoc.ros.live`, and its class in that module."""
_WITH_SERVICE_GOALS = frozenset({"dds", "rmw_zenoh"})
"""The kinds of middleware over which an action consists of services and topics."""
_SLICE_S = 0.2
"""The interval at which signals are handled, in seconds."""


@click.command()
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="PATH ...")
@click.option(
    "--ros",
    "place",
    default="dds",
    metavar="PLACE",
    help="dds, dds:DOMAIN?partition=NAME, rclpy, rmw_zenoh://HOST:PORT or rosbridge://HOST:PORT.  "
    "[default: dds, in the domain of ROS_DOMAIN_ID]",
)
@click.option("--protocol", default="auto", show_default=True, metavar="NAME", help="As for 'robochoc solve'.")
@click.option(
    "--runtime",
    type=click.Choice(["processes", "simulator"]),
    default="simulator",
    show_default=True,
    help="One process per robot, or one thread for all.",
)
@click.option(
    "--timeout",
    type=Number(0, min_open=True),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Time limit of a request; a request may set a lower one.",
)
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Random seed.")
@click.option("--feedback", is_flag=True, help="Publish the progress of each decision on /robochoc/feedback.")
@click.option("--requests", type=WholeNumber(1), metavar="N", help="End after N answers.  [default: at Ctrl-C]")
@invalid_input_fails
def serve(
    paths: tuple[Path, ...],
    place: str,
    requests: int | None,
    *,
    feedback: bool,
    **given: Any,  # noqa: ANN401 - options of the run
) -> None:
    """Solve teams on request: a ROS 2 service and action, for behaviour trees and other nodes. Only rclpy requires ROS.

    A request to /robochoc/decide (robochoc_msgs/srv/Decide) contains a team's name and changes to its problem. The
    action /robochoc/decide (robochoc_msgs/action/Decide; not with rclpy) also has feedback, and can be cancelled. Each
    team also has /robochoc/TEAM/decide (std_srvs/srv/Trigger). Requests are answered one after the other;
    /robochoc/cancel (std_srvs/srv/Trigger) ends the current decision.

    \b
    robochoc serve hangar
    ros2 service call /robochoc/hangar/decide std_srvs/srv/Trigger
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    kind, _, where = place.partition(":")
    if kind not in _MIDDLEWARES:
        raise click.UsageError(f"--ros {place}: unknown middleware; use {', '.join(_MIDDLEWARES)}, such as dds:5")
    teams = _teams(paths)
    from robochoc.robots.connections import missing_packages_of
    from robochoc.robots.decision import CancellableDecision
    from robochoc.ros.decide_action import DecideAction
    from robochoc.ros.decide_service import DECIDE, TRIGGER, DecideService, refusal
    from robochoc.ros.live.action_goals import ActionGoals
    from robochoc.ros.names import ros_name
    from robochoc.run.options import Options

    missing = missing_packages_of(kind)
    if missing:
        raise Failure(USAGE, missing)
    options = Options(given["protocol"], given["runtime"], given["seed"], given["timeout"])
    triggers = {f"/robochoc{ros_name(team.name)}/decide": team.name for team in teams}
    if len(triggers) < len(teams):
        raise Failure(USAGE, "two teams would have the same ROS service: rename the folder of one of them")
    services = {_SERVICE: DECIDE, **dict.fromkeys((*triggers, _CANCEL), TRIGGER)}

    def publish_feedback(text: str) -> None:
        with suppress(Exception):  # an error in the feedback must not end the decision
            offered.publish(_FEEDBACK, _TEXT, {"data": text})

    also = publish_feedback if feedback else None
    decision = CancellableDecision(also)
    decider = DecideService(teams, decision, options)
    goals = ActionGoals(_GOAL, decision.cancel, refusal)
    action = DecideAction(decider, decision, goals, also)
    with ros_errors_as_failures(), _opened(kind, where, services, {_CANCEL: decision.cancel}, goals) as offered:
        if feedback:
            offered.announce(_FEEDBACK, _TEXT)
        _list_offered(offered, services, feedback=feedback, action=goals.clients is not None)
        for request in _requests(offered, requests):
            if request.name == _GOAL:
                click.echo(f"{_GOAL}: {action.run(request)}", err=True)
                continue
            team = triggers.get(request.name)
            answer = decider.decide(request.fields) if team is None else decider.trigger(team)
            offered.reply(request, answer)
            click.echo(f"{request.name}: {answer['message']}", err=True)


def _list_offered(offered: Services, services: Mapping[str, str], *, feedback: bool, action: bool) -> None:
    """Print the names and types of the services, of the action and of the topic."""
    from robochoc.ros.decide_service import SERVICES

    for name, service in services.items():
        is_offered = name not in offered.lacking
        text = SERVICES[service] if is_offered else f"not offered: {SERVICES[service]} is not installed here"
        click.echo(f"{offered.where}: {name} ({text})", err=True)
    if action:
        click.echo(f"{offered.where}: {_SERVICE} (an action, robochoc_msgs/action/Decide)", err=True)
    if feedback:
        click.echo(f"{offered.where}: {_FEEDBACK} (a topic, {_TEXT})", err=True)


def _requests(offered: Services, most: int | None) -> Iterator[ServiceRequest]:
    """Yield up to `most` requests as they arrive."""
    yielded = 0
    while yielded != most:
        request = offered.next(_SLICE_S)
        if request is not None:
            yield request
            yielded += 1


@contextmanager
def _opened(
    kind: str, place: str, services: Mapping[str, str], immediate: ImmediateServices, goals: ActionGoals
) -> Iterator[Services]:
    """Provide the services and the action offered through the middleware `kind`. Raises `SinkError`."""
    from robochoc.ros.decide_service import DECIDE, refusal
    from robochoc.ros.live.service_goals import ServiceGoals

    module, name = _MIDDLEWARES[kind]
    factory: Callable[[str, Mapping[str, str], Refuse, ImmediateServices], Services] = getattr(
        import_module(f"robochoc.ros.live.{module}"), name
    )
    clients = ServiceGoals(_SERVICE, DECIDE, goals) if kind in _WITH_SERVICE_GOALS else None
    if clients is not None:
        services, immediate = {**services, **clients.services}, {**immediate, **clients.handlers}
    with factory(place, services, refusal, immediate) as offered:
        if clients is not None:
            clients.attach(offered)
            goals.clients = clients
        else:
            offered.offer_action(_SERVICE, DECIDE, goals)
        goals.set_queue(offered.put)
        try:
            yield offered
        finally:
            goals.close()
            if clients is not None:
                clients.wait_for_requests()


def _teams(paths: Sequence[Path]) -> list[Team]:
    """Return the teams in or below the folders `paths`. Raises `Failure`."""
    from robochoc.formats.problems import read_problem
    from robochoc.model.costs import refuse_several_objectives

    teams: dict[str, Team] = {}
    for folder in teams_at(paths, foreign=True):
        with errors_as_failures(folder):
            team = read_problem(folder).team
            refuse_several_objectives(team)
        if team.name in teams:
            raise Failure(USAGE, f"two teams have the name {team.name!r}: rename the folder of one of them")
        teams[team.name] = team
    return [*teams.values()]
