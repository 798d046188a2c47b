"""Sets up sinks, feedback and the closed loop from the options for ROS and flights. Errors become `Failure`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import NamedPlace, refuse_same_places
from robochoc.cli.options.ros import (
    CONDITIONS,
    FLIGHT,
    FRAME,
    IN_FRAME,
    NOT_PUBLISHED,
    PUBLISHED,
    RosOptions,
    given_names,
    refuse_given,
)
from robochoc.cli.reports.failures import INVALID, USAGE, Failure

if TYPE_CHECKING:
    from robochoc.flight.mission import Drone, Leg, Mission
    from robochoc.flight.quadrotor.conditions import FlightConditions
    from robochoc.maps.ground_map import GroundMap
    from robochoc.model.problem import Assignment, Robot, Team
    from robochoc.robots.closed_loop import ClosedLoop, Feedback
    from robochoc.robots.simulated_feedback import FlightSettings
    from robochoc.robots.sink import Sink
    from robochoc.ros.team_topics import PublishOptions


@contextmanager
def ros_errors_as_failures() -> Iterator[None]:
    """Convert errors in sinks, sources and names to a `Failure` with one line."""
    from robochoc.robots.connections import UnknownSinkError, UnknownSourceError
    from robochoc.robots.sink import SinkError
    from robochoc.robots.source import SourceError
    from robochoc.ros.names import NameClashError
    from robochoc.ros.publisher import NothingToPublishError
    from robochoc.ros.waypoint_types import NoMappingError

    try:
        yield
    except (UnknownSinkError, UnknownSourceError) as wrong:
        raise Failure(USAGE, str(wrong)) from wrong
    except (NameClashError, NoMappingError, NothingToPublishError, SinkError, SourceError) as wrong:
        raise Failure(INVALID, str(wrong)) from wrong


@contextmanager
def flight_errors_as_failures() -> Iterator[None]:
    """Convert the error for a decision that cannot be flown to a `Failure` with one line."""
    from robochoc.robots.simulated_feedback import CannotFlyError

    try:
        yield
    except CannotFlyError as wrong:
        raise Failure(INVALID, str(wrong)) from wrong


def open_sinks(texts: Sequence[str], stack: ExitStack) -> list[Sink]:
    """Return the opened sinks, which `stack` will close. Raises `SinkError`."""
    from robochoc.robots.connections import open_sink

    return [stack.enter_context(open_sink(text)) for text in texts]


def publish_options(given: Mapping[str, Any]) -> PublishOptions:
    """Return the options set by `--ros-type`, `--tf` and `--diagnostics`."""
    from robochoc.ros.team_topics import PublishOptions

    return PublishOptions(kind=given["ros_type"] or "", frames=given["tf"], diagnostics=given["diagnostics"])


def _allow_arming(texts: Sequence[str], sinks: Sequence[Sink]) -> None:
    """Allow arming in all `sinks` that support it. Raises `click.UsageError` if no sink does, and `SinkError`."""
    able = [sink for sink in sinks if sink.arms]
    if not able:
        raise click.UsageError(
            "--arm requires --ros mavlink:FILE, crazyflie:FILE or crazyswarm2:FILE; "
            f"{', '.join(texts)} cannot arm vehicles"
        )
    for sink in able:
        sink.allow_arming()


def flight_settings(given: Mapping[str, Any], seed: int) -> FlightSettings:
    """Return the settings for a simulated flight from the `given` options."""
    from robochoc.robots.simulated_feedback import FlightSettings

    return FlightSettings(seed=seed, **given)


@contextmanager
def _flight_usage() -> Iterator[None]:
    """Convert the errors for an unknown drone or invalid weather to `click.UsageError`."""
    from robochoc.robots.simulated_feedback import UnknownDroneError

    try:
        yield
    except UnknownDroneError as wrong:
        raise click.UsageError(f"--fail: {wrong}") from wrong
    except ValueError as wrong:
        raise click.UsageError(str(wrong)) from wrong


def conditions_of(given: Mapping[str, Any], mission: Mission) -> FlightConditions:
    """Return the flight conditions from the options of `robochoc fly`. Raises `click.UsageError`."""
    asked = {name: given[name] for name in CONDITIONS if given[name] not in (None, ())}
    with _flight_usage():
        return flight_settings(asked, given["seed"]).conditions(mission.drones, mission.scale)


@contextmanager
def scale_usage() -> Iterator[None]:
    """Convert the error for a scale that differs from the map's scale to `click.UsageError`."""
    try:
        yield
    except ValueError as wrong:
        raise click.UsageError(f"--scale: {wrong}") from wrong


@contextmanager
def closed_loop(
    ros: RosOptions, team: Team, seed: int, ground_map: Callable[[], GroundMap | None] = lambda: None
) -> Iterator[ClosedLoop | None]:
    """Provide the closed loop for `team`, or None if no option requires it. Publications are complete on exit.

    The map returned by `ground_map` has the positions of robots, the length of a unit, and the obstacles.

    Raises:
        Failure: if a sink or a source fails, or a decision cannot be flown.
        click.UsageError: if an option does not apply to the team or to the source.
    """
    if not ros:
        yield None
        return
    from robochoc.flight.mission import UNIT_M, check_scale
    from robochoc.robots.closed_loop import ClosedLoop, drones_of
    from robochoc.robots.situation import BATTERY
    from robochoc.ros.publisher import SinkPublisher

    with (
        flight_errors_as_failures() if ros.situation == FLIGHT else nullcontext(),
        ros_errors_as_failures(),
        ExitStack() as stack,
    ):
        drones = drones_of(team)
        feedback = _feedback(ros, drones, seed, stack) if ros.situation else None
        battery = BATTERY if ros.battery is None else ros.battery
        sinks = open_sinks(ros.sinks, stack)
        if ros.arm:
            _allow_arming(ros.sinks, sinks)
        ground = ground_map()
        with scale_usage():
            check_scale(ros.scale, ground)
        options = publish_options(ros.published)
        publishers = [SinkPublisher(team.name, drones, sink, ros.frame, options) for sink in sinks]
        scale = ros.scale
        if scale is None and ros.situation != FLIGHT and (ground is None or ground.scale is None):
            scale = UNIT_M
        loop = ClosedLoop(team, publishers, feedback, scale=scale, battery=battery, ground=ground)
        yield loop


def _feedback(ros: RosOptions, drones: Sequence[Drone], seed: int, stack: ExitStack) -> Feedback:
    """Return the feedback from the source given by `--situation`."""
    if ros.situation == FLIGHT:
        from robochoc.robots.simulated_feedback import SimulatedFeedback

        settings = flight_settings(ros.flight, seed)
        with _flight_usage():
            settings.check(drones)
        return SimulatedFeedback(settings)
    from robochoc.robots.connections import open_source
    from robochoc.ros.report_decoder import ReportDecoder
    from robochoc.ros.source_feedback import PATIENCE_S, SourceFeedback

    source = stack.enter_context(open_source(ros.situation or ""))
    if ros.report_timeout is not None and not source.live:
        raise click.UsageError(f"--report-timeout requires a live source; {ros.situation} is a recording")
    return SourceFeedback(
        source, ReportDecoder(drones, ros.frame), ros.report_timeout or PATIENCE_S, sim_time=ros.use_sim_time
    )


@contextmanager
def robot_publisher(robot: Robot, given: dict[str, Any]) -> Iterator[Callable[[str, Assignment], list[str]]]:
    """Provide a function that publishes the decision of `robot` alone, and returns a line for each sink.

    The function's arguments are the master's description of the end or the state of the run, and the robot's decision.
    A decision that equals the last published decision is not published again. All options in `ros_options` are removed
    from `given`. Raises `Failure`.
    """
    texts = given.pop("sinks")
    asked = {name: given.pop(name) for name in (*IN_FRAME, *PUBLISHED)}
    frame, scale, options = asked["frame"] or FRAME, asked["scale"], publish_options(asked)
    if not texts:
        refuse_given({**IN_FRAME, **PUBLISHED}, given_names(asked), NOT_PUBLISHED)
        yield lambda _why, _assignment: []
        return
    import time

    from robochoc.flight.mission import UNIT_M
    from robochoc.robots.closed_loop import drones_of_robot, leg_of_robot
    from robochoc.ros.publisher import SinkPublisher

    refuse_same_places({}, more_outputs=sink_places(texts))
    with ros_errors_as_failures(), ExitStack() as stack:
        opened = open_sinks(texts, stack)
        publishers = [SinkPublisher(robot.name, drones_of_robot(robot), sink, frame, options) for sink in opened]
        last: Leg | None = None

        def publish(why: str, assignment: Assignment) -> list[str]:
            nonlocal last
            leg = leg_of_robot(robot, why, assignment, UNIT_M if scale is None else scale)
            for publisher in publishers if leg != last else ():
                publisher.decide(leg, time.time_ns())
            last = leg
            return [f"{publisher.place}: {publisher.summary}" for publisher in publishers]

        yield publish


def sink_places(sinks: Sequence[str]) -> list[NamedPlace]:
    """Return the targets given by `--ros`. Raises `click.UsageError`."""
    return [_place_of("--ros", text) for text in sinks]


def source_places(situation: str | None) -> list[NamedPlace]:
    """Return the file that `--situation` reads. (A live source may also be a sink.) Raises `click.UsageError`."""
    places = [_place_of("--situation", situation)] if situation else []
    return [(place, named) for place, named in places if isinstance(place, Path)]


def _place_of(option: str, text: str) -> NamedPlace:
    from robochoc.robots.connections import place_of

    try:
        return place_of(text), f"{option} {text}"
    except OSError as error:
        raise click.UsageError(f"{option} {text}: {error.strerror}; name another file") from error
