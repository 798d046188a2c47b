"""The report of a closed loop: what was published, what could not be used, and the simulated flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import click

from robochoc.cli.options.ros import FLIGHT, RosOptions
from robochoc.cli.reports.failures import LOST

if TYPE_CHECKING:
    from robochoc.flight.log import FlightLog
    from robochoc.flight.mission import Mission
    from robochoc.ros.closed_loop import ClosedLoop


def told_of(loop: ClosedLoop) -> list[str]:
    """Return the lines on what was published where, and on reports that could not be used."""
    return [*(f"{publisher.place}: {publisher.summary}" for publisher in loop.publishers), *loop.notes]


class FlownMission(NamedTuple):
    """The result of a simulated flight, if there was one."""

    status: int = 0
    mission: Mission | None = None
    flown: FlightLog | None = None


def flight_told(loop: ClosedLoop | None, ros: RosOptions, *, quiet: bool) -> FlownMission:
    """Report the simulated flight and return it. A drone that fell has left the team: that alone is no failure."""
    if loop is None or ros.situation != FLIGHT:
        return FlownMission()
    from robochoc.cli.reports.flight import as_planned, how_it_went, too_late

    flight = _flown_by(loop)
    if flight is None:
        return FlownMission()
    mission, flown = flight
    if not quiet:
        click.echo(how_it_went(flown))
        for line in too_late(ros.flight.get("failures", ()), flown):
            click.echo(line, err=True)
    return FlownMission(0 if as_planned(flown, may_fall=True) else LOST, mission, flown)


def _flown_by(loop: ClosedLoop) -> tuple[Mission, FlightLog] | None:
    """Return the mission and the log of the simulated flight. None if nothing was flown."""
    from robochoc.ros.simulated_feedback import SimulatedFeedback

    flown = loop.feedback.flown() if isinstance(loop.feedback, SimulatedFeedback) else None
    return (loop.mission, flown) if loop.mission and flown else None
