"""`robochoc generate`: problems of known families, as folders of XML files."""

from __future__ import annotations

import click

from robochoc.cli.commands.generate.binary import agentsnet, coloring, ising, random_problem
from robochoc.cli.commands.generate.maps import coverage, formation, patrol, swarm_on_map
from robochoc.cli.commands.generate.missions import grid_sensors, meetings, sensors, tasks, tracking
from robochoc.cli.commands.generate.networks import (
    frequencies,
    heights,
    nary,
    smart_grid,
    smart_homes,
    stochastic,
    swarm,
)
from robochoc.cli.commands.generate.queens import queens3d
from robochoc.cli.commands.generate.scenario import scenario

__all__ = ["generate"]


@click.group()
def generate() -> None:
    """Write a team of a problem family as a folder of XML files.

    Each seed gives one team, the same on every machine. For the families, their sizes and papers, see the
    documentation, page Generated problems.
    """


for family in (
    agentsnet,
    coloring,
    coverage,
    formation,
    frequencies,
    grid_sensors,
    heights,
    ising,
    meetings,
    nary,
    patrol,
    queens3d,
    random_problem,
    scenario,
    sensors,
    smart_grid,
    smart_homes,
    stochastic,
    swarm,
    swarm_on_map,
    tasks,
    tracking,
):
    generate.add_command(family)
