"""The report of a closed loop: published decisions, unusable reports from robots, and the simulated flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import click

from robochoc.cli.reports.failures import LOST

if TYPE_CHECKING:
    from robochoc.flight.log import FlightLog
    from robochoc.flight.mission import Mission
    from robochoc.robots.closed_loop import ClosedLoop


def publication_lines(loop: ClosedLoop) -> list[str]:
    """Return a line for each sink, and notes on reports that could not be used."""
    return [*(f"{publisher.place}: {publisher.summary}" for publisher in loop.publishers), *loop.notes]


class FlownMission(NamedTuple):
    """The result of a simulated flight, if there was one."""

    status: int = 0
    mission: Mission | None = None
    flown: FlightLog | None = None


def report_flight(loop: ClosedLoop, failures: Sequence[tuple[str, float]], *, quiet: bool) -> FlownMission:
    """Print and return the result of the simulated flight.

    Args:
        loop: The closed loop with a simulated flight.
        failures: The drones given by --fail, with the times in seconds at which they fail.
        quiet: True to print nothing.
    """
    from robochoc.cli.reports.flight import as_planned, flight_summary, late_failures

    flight = _simulated_flight(loop)
    if flight is None:
        return FlownMission()
    mission, flown = flight
    if not quiet:
        click.echo(flight_summary(flown))
        for line in late_failures(failures, flown):
            click.echo(line, err=True)
    # A drone that fell has left the team, which alone is not a failure.
    return FlownMission(0 if as_planned(flown, may_fall=True) else LOST, mission, flown)


def _simulated_flight(loop: ClosedLoop) -> tuple[Mission, FlightLog] | None:
    """Return the mission and the log of the simulated flight, or None if nothing was flown."""
    from robochoc.robots.simulated_feedback import SimulatedFeedback

    flown = loop.feedback.log() if isinstance(loop.feedback, SimulatedFeedback) else None
    return (loop.mission, flown) if loop.mission and flown else None
