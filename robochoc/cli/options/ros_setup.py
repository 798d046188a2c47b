"""The setup for the options of ROS and flights: sinks, feedback, the closed loop. Errors become one line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.ground import ground_map
from robochoc.cli.options.paths import Place, refuse_same_places
from robochoc.cli.options.ros import (
    CONDITIONS,
    FLIGHT,
    FRAME,
    IN_FRAME,
    NOT_PUBLISHED,
    PUBLISHED,
    RosOptions,
    given_names,
    refuse,
)
from robochoc.cli.reports.failures import INVALID, USAGE, Failure

if TYPE_CHECKING:
    from robochoc.flight.mission import Drone, Leg, Mission
    from robochoc.flight.quadrotor.conditions import FlightConditions
    from robochoc.model.problem import Assignment, Robot, Team
    from robochoc.ros.closed_loop import ClosedLoop, Feedback
    from robochoc.ros.simulated_feedback import FlightSettings
    from robochoc.ros.sink import Sink
    from robochoc.ros.team_topics import PublishOptions


@contextmanager
def ros_errors_fail() -> Iterator[None]:
    """Turn errors of sinks, sources and names into `Failure`, with one line."""
    from robochoc.ros.mappings import NoMappingError
    from robochoc.ros.names import NameClashError
    from robochoc.ros.publisher import NothingToPublishError
    from robochoc.ros.sink import SinkError
    from robochoc.ros.sinks import UnknownSinkError, UnknownSourceError
    from robochoc.ros.source import SourceError

    try:
        yield
    except (UnknownSinkError, UnknownSourceError) as wrong:
        raise Failure(USAGE, str(wrong)) from wrong
    except (NameClashError, NoMappingError, NothingToPublishError, SinkError, SourceError) as wrong:
        raise Failure(INVALID, str(wrong)) from wrong


@contextmanager
def flight_errors_fail() -> Iterator[None]:
    """Turn a decision that cannot be flown into `Failure`, with one line."""
    from robochoc.ros.simulated_feedback import CannotFlyError

    try:
        yield
    except CannotFlyError as wrong:
        raise Failure(INVALID, str(wrong)) from wrong


def open_sinks(texts: Sequence[str], stack: ExitStack) -> list[Sink]:
    """Return the sinks, which `stack` closes. Raises `SinkError`."""
    from robochoc.ros.sinks import open_sink

    return [stack.enter_context(open_sink(text)) for text in texts]


def publish_options(given: Mapping[str, Any]) -> PublishOptions:
    """Return what `--ros-type`, `--tf` and `--diagnostics` ask for."""
    from robochoc.ros.team_topics import PublishOptions

    return PublishOptions(kind=given["ros_type"] or "", frames=given["tf"], diagnostics=given["diagnostics"])


def _allow_arming(texts: Sequence[str], sinks: Sequence[Sink]) -> None:
    """Let those of `sinks` arm that can. Raises `click.UsageError` if none can, and `SinkError`."""
    able = [sink for sink in sinks if sink.arms]
    if not able:
        raise click.UsageError(f"--arm is for --ros mavlink:FILE or crazyflie:FILE; {', '.join(texts)} arms nothing")
    for sink in able:
        sink.allow_arming()


def flight_settings(given: Mapping[str, Any], seed: int) -> FlightSettings:
    """Return the settings of a simulated flight, of options that were `given`."""
    from robochoc.ros.simulated_feedback import FlightSettings

    return FlightSettings(seed=seed, **given)


@contextmanager
def _flight_usage() -> Iterator[None]:
    """Turn an unknown drone, or impossible weather, into `click.UsageError`."""
    from robochoc.ros.simulated_feedback import UnknownDroneError

    try:
        yield
    except UnknownDroneError as wrong:
        raise click.UsageError(f"--fail: {wrong}") from wrong
    except ValueError as wrong:
        raise click.UsageError(str(wrong)) from wrong


def conditions_of(given: Mapping[str, Any], mission: Mission) -> FlightConditions:
    """Return the conditions that the options of `robochoc fly` ask for. Raises `click.UsageError`."""
    asked = {name: given[name] for name in CONDITIONS if given[name] not in (None, ())}
    with _flight_usage():
        return flight_settings(asked, given["seed"]).conditions(mission.drones, mission.scale)


@contextmanager
def scale_usage() -> Iterator[None]:
    """Turn a scale that is not that of the map into `click.UsageError`."""
    try:
        yield
    except ValueError as wrong:
        raise click.UsageError(f"--scale: {wrong}") from wrong


@contextmanager
def closed_loop(ros: RosOptions, team: Team, seed: int, folder: Path | None = None) -> Iterator[ClosedLoop | None]:
    """Give the closed loop of `team`, or None if no option asks for one. At the end, what was published is complete.

    A map in the `folder` of the team says where robots stand, how long a unit is, and what is in the way.

    Raises:
        Failure: A sink or a source fails, or a decision cannot be flown.
        click.UsageError: An option does not go with the team, or with the source.
    """
    if not ros:
        yield None
        return
    from robochoc.ros.closed_loop import ClosedLoop, drones_of
    from robochoc.ros.situation import BATTERY

    with flight_errors_fail() if ros.situation == FLIGHT else nullcontext(), ros_errors_fail(), ExitStack() as stack:
        feedback = _feedback(ros, drones_of(team), seed, stack) if ros.situation else None
        battery = BATTERY if ros.battery is None else ros.battery
        sinks = open_sinks(ros.sinks, stack)
        if ros.arm:
            _allow_arming(ros.sinks, sinks)
        with scale_usage():
            loop = ClosedLoop(
                team,
                sinks,
                feedback,
                frame=ros.frame,
                scale=ros.scale,
                battery=battery,
                publish=publish_options(ros.published),
                ground=ground_map(None, folder),
            )
        yield loop


def _feedback(ros: RosOptions, drones: Sequence[Drone], seed: int, stack: ExitStack) -> Feedback:
    """Return the feedback that `--situation` asks for."""
    if ros.situation == FLIGHT:
        from robochoc.ros.simulated_feedback import SimulatedFeedback

        settings = flight_settings(ros.flight, seed)
        with _flight_usage():
            settings.check(drones)
        return SimulatedFeedback(settings)
    from robochoc.ros.report_decoder import ReportDecoder
    from robochoc.ros.sinks import open_source
    from robochoc.ros.source_feedback import PATIENCE_S, SourceFeedback

    source = stack.enter_context(open_source(ros.situation or ""))
    if ros.report_timeout is not None and not source.live:
        raise click.UsageError(f"--report-timeout is for a live source; {ros.situation} is a recording")
    return SourceFeedback(
        source, ReportDecoder(drones, ros.frame), ros.report_timeout or PATIENCE_S, sim_time=ros.use_sim_time
    )


@contextmanager
def robot_publisher(robot: Robot, given: dict[str, Any]) -> Iterator[Callable[[str, Assignment], list[str]]]:
    """Give a function that publishes the decision of `robot` alone, and returns what was published where.

    The function takes the master's word for how the run ended, or for what it has come to, and the robot's own
    decision. What was published last is not published again. All options of `ros_options` are taken out of `given`.
    Raises `Failure`.
    """
    texts = given.pop("sinks")
    asked = {name: given.pop(name) for name in (*IN_FRAME, *PUBLISHED)}
    frame, scale, options = asked["frame"] or FRAME, asked["scale"], publish_options(asked)
    if not texts:
        refuse({**IN_FRAME, **PUBLISHED}, given_names(asked), NOT_PUBLISHED)
        yield lambda _why, _assignment: []
        return
    import time

    from robochoc.ros.single_robot import drones_of_robot, leg_of_robot
    from robochoc.ros.sink_publisher import SinkPublisher

    refuse_same_places({}, more_outputs=sink_places(texts))
    with ros_errors_fail(), ExitStack() as stack:
        opened = open_sinks(texts, stack)
        found = [SinkPublisher(robot.name, drones_of_robot(robot), sink, frame, options) for sink in opened]
        last: Leg | None = None

        def publish(why: str, assignment: Assignment) -> list[str]:
            nonlocal last
            leg = leg_of_robot(robot, why, assignment, scale)
            for publisher in found if leg != last else ():
                publisher.decide(leg, time.time_ns())
            last = leg
            return [f"{publisher.place}: {publisher.summary}" for publisher in found]

        yield publish


def sink_places(sinks: Sequence[str]) -> list[Place]:
    """Return where `--ros` publishes. Raises `click.UsageError`."""
    return [_place_of("--ros", text) for text in sinks]


def source_places(situation: str | None) -> list[Place]:
    """Return the file that `--situation` reads; what is live may be published to as well. Raises `click.UsageError`."""
    places = [_place_of("--situation", situation)] if situation else []
    return [(place, named) for place, named in places if isinstance(place, Path)]


def _place_of(option: str, text: str) -> Place:
    from robochoc.ros.sinks import place_of

    try:
        return place_of(text), f"{option} {text}"
    except OSError as error:
        raise click.UsageError(f"{option} {text}: {error.strerror}; name another file") from error
