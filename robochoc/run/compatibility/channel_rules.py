"""Refuses channel models that do not fit the team: they name unknown robots, or need unknown positions."""

from __future__ import annotations

from robochoc.communication.simulator.channel import ChannelModel
from robochoc.communication.simulator.loss_models import has_place
from robochoc.formats.diagnostics import shortened, suggestion
from robochoc.model.change import team_after_events
from robochoc.model.problem import Robot, Team
from robochoc.run.options import Options
from robochoc.solver.errors import UnsupportedError


def refuse_channel(team: Team, options: Options) -> None:
    """Refuse a channel model that does not fit the team, including the robots that join in its scenario.

    Raises:
        UnsupportedError: if the model names a robot that is never in the team, or if losses depend on distance and the
            position of a robot is unknown.
    """
    channel = options.channel
    if channel is None or options.message_loss:
        return
    epochs = [team_after_events(team, events) for events in range(len(team.scenario) + 1)]
    robots = {robot.name: robot for epoch in epochs for robot in epoch.robots}
    _refuse_unknown(channel, robots)
    if channel.by_distance:
        _refuse_unplaced(channel, robots)


def _refuse_unknown(channel: ChannelModel, robots: dict[str, Robot]) -> None:
    named = {"positions": channel.positions, "links": [name for link in channel.links for name in link.between]}
    for field, names in named.items():
        for name in names:
            if name not in robots:
                why = f"--channel {channel.name}: {field}: there is no robot {shortened(name)}"
                raise UnsupportedError(f"{why} ({suggestion(name, robots, 'robots')})")


def _refuse_unplaced(channel: ChannelModel, robots: dict[str, Robot]) -> None:
    unplaced = [name for name, robot in robots.items() if name not in channel.positions and not has_place(robot)]
    if unplaced:
        many = f"{', '.join(unplaced[:3])}{', ...' * (len(unplaced) > 3)}"  # noqa: PLR2004 - fits a line
        why = f"--channel {channel.name} loses messages by distance, but the position of {many} is unknown"
        raise UnsupportedError(f"{why}; give positions in its file, or topics with x and y in robots' files")
