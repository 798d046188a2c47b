"""`robochoc serve`: decides for others on request, as a service of ROS 2."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import InputPath, teams_at
from robochoc.cli.options.ros_setup import ros_errors_fail
from robochoc.cli.reports.failures import USAGE, Failure, failures_told, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.model.problem import Team
    from robochoc.ros.live.dds_service import DdsServices
    from robochoc.ros.live.rclpy_service import RclpyServices

_SERVICE = "/robochoc/decide"
_SLICE_S = 0.2
"""The interval at which signals are heard, in seconds."""


@click.command()
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="PATH ...")
@click.option(
    "--ros",
    "place",
    default="dds",
    metavar="PLACE",
    help="dds, dds:DOMAIN?partition=NAME, or rclpy.  [default: dds, in the domain of ROS_DOMAIN_ID]",
)
@click.option("--protocol", default="auto", show_default=True, metavar="NAME", help="As for robochoc solve.")
@click.option(
    "--runtime",
    type=click.Choice(["processes", "simulator"]),
    default="simulator",
    show_default=True,
    help="One process per robot, or one thread for all.",
)
@click.option(
    "--timeout",
    type=click.FloatRange(0, min_open=True),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="The longest time for one request; a request may ask for less.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Seed of all chance.")
@click.option("--requests", type=click.IntRange(1), metavar="N", help="End after N answers.  [default: at Ctrl-C]")
@invalid_input_fails
def serve(paths: tuple[Path, ...], place: str, requests: int | None, **given: Any) -> None:  # noqa: ANN401 - how teams decide
    """Decide for others: a service of ROS 2, for a behaviour tree or another node. With dds no ROS has to be here.

    /robochoc/decide (robochoc_msgs/srv/Decide) takes a team's name and changes of its problem. For each team there is
    also /robochoc/TEAM/decide (std_srvs/srv/Trigger). Requests are answered one after the other.

    \b
    robochoc serve docs/examples/hangar
    ros2 service call /robochoc/hangar/decide std_srvs/srv/Trigger
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    kind, _, where = place.partition(":")
    if kind not in {"dds", "rclpy"}:
        raise click.UsageError(f"--ros {place}: services are offered by dds, as in dds:5, and by rclpy")
    teams = _teams(paths)
    from robochoc.ros.decide_service import DECIDE, SERVICES, TRIGGER, DecideService, refusal
    from robochoc.ros.names import ros_name
    from robochoc.ros.sinks import lacking_for
    from robochoc.run.options import Options, Runtime
    from robochoc.run.orchestrator import solve

    lacking = lacking_for(kind)
    if lacking:
        raise Failure(USAGE, lacking)
    options = Options(given["protocol"], Runtime(given["runtime"]), given["seed"], given["timeout"])
    decider = DecideService(teams, solve, options)
    triggers = {f"/robochoc{ros_name(team.name)}/decide": team.name for team in teams}
    if len(triggers) < len(teams):
        raise Failure(USAGE, "two teams would have the same service in ROS: give one's folder another name")
    services = {_SERVICE: DECIDE, **dict.fromkeys(triggers, TRIGGER)}
    with ros_errors_fail(), _offered(kind, where, services, refusal) as offered:
        for name, what in services.items():
            is_here = name not in offered.lacking
            told = SERVICES[what] if is_here else f"not offered: {SERVICES[what]} is not built here"
            click.echo(f"{offered.where}: {name} ({told})", err=True)
        answered = 0
        while answered != requests:
            request: Any = offered.next(_SLICE_S)
            if request is None:
                continue
            named = triggers.get(request.name)
            answer = decider.decide(request.fields) if named is None else decider.trigger(named)
            offered.reply(request, answer)
            answered += 1
            click.echo(f"{request.name}: {answer['message']}", err=True)


def _offered(
    kind: str, place: str, services: Mapping[str, str], refuse: Callable[[str], Mapping[str, Any]]
) -> DdsServices | RclpyServices:
    """Return the services, by DDS or by rclpy. Raises `SinkError`."""
    if kind == "dds":
        from robochoc.ros.live.dds_service import DdsServices

        return DdsServices(place, services, refuse)
    from robochoc.ros.live.rclpy_service import RclpyServices

    return RclpyServices(place, services, refuse)


def _teams(paths: Sequence[Path]) -> list[Team]:
    """Return the teams in the folders `paths` and below. Raises `Failure`."""
    from robochoc.formats.problems import read_problem

    teams: dict[str, Team] = {}
    for folder in teams_at(paths, foreign=True):
        with failures_told(folder):
            team = read_problem(folder).team
        if team.name in teams:
            raise Failure(USAGE, f"two teams have the name {team.name!r}: give one's folder another name")
        teams[team.name] = team
    return [*teams.values()]
