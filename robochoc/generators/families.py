"""The families of problems by name, for `robochoc generate`, studies and `robochoc compare`.

Parameters have the names of the options of `robochoc generate`, with underscores.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType, UnionType
from typing import Any, get_args, get_type_hints

from robochoc.generators import agentsnet as agent_tasks
from robochoc.generators import coloring as colorings
from robochoc.generators import frequencies as frequency_assignments
from robochoc.generators import heights as flight_heights
from robochoc.generators import ising as isings
from robochoc.generators import meetings as schedules
from robochoc.generators import nary as nary_problems
from robochoc.generators import queens3d as queens
from robochoc.generators import random_csp as random_problems
from robochoc.generators import sensors as sensor_networks
from robochoc.generators import smart_grid as grids
from robochoc.generators import smart_homes as lightings
from robochoc.generators import stochastic as stochastic_problems
from robochoc.generators import swarm as swarms
from robochoc.generators import tasks as allocations
from robochoc.generators import tracking as trackings
from robochoc.generators.graph_choice import GraphChoice
from robochoc.generators.maps import coverage as coverages
from robochoc.generators.maps import formation as formations
from robochoc.generators.maps import patrol as patrols
from robochoc.generators.maps import swarm_on_map as map_swarms
from robochoc.generators.maps.map_team import MapChoice
from robochoc.model.allocation import Distance
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Team

Parameter = str | int | float | bool


def random(  # noqa: PLR0913 - parameters of a family, by their names
    *,
    domain: int,
    agents: int | None = None,
    density: float | None = None,
    tightness: float | None = None,
    max_cost: int | None = None,
    places: int = 0,
    maximize: bool = False,
    asymmetric: bool = False,
    seed: int = 0,
    graph: str = "random",
    **of_graph: Any,  # noqa: ANN401 - `GraphChoice`'s own
) -> Team:
    """Return a random Model B problem: see `generators/random_csp.py`."""
    if tightness is None and max_cost is None:
        raise ValueError("tightness is missing (without max_cost)")
    drawn = GraphChoice(kind=graph, agents=agents, **of_graph)
    costs = CostUnits(maximize, places)
    on = drawn.graph("density", density)
    if on is not None:
        return random_problems.random_on(
            on, domain, tightness or 0, seed, max_cost=max_cost, costs=costs, asymmetric=asymmetric
        )
    return random_problems.random_csp(
        agents or 0,
        domain,
        density or 0,
        tightness or 0,
        seed,
        connected=drawn.connected,
        max_cost=max_cost,
        costs=costs,
        asymmetric=asymmetric,
    )


def coloring(
    *,
    agents: int | None = None,
    colors: int = 3,
    degree: float | None = None,
    conflicts: str = "soft",
    max_cost: int = 10,
    places: int = 0,
    seed: int = 0,
    graph: str = "random",
    **of_graph: Any,  # noqa: ANN401 - `GraphChoice`'s own
) -> Team:
    """Return a graph colouring problem: see `generators/coloring.py`."""
    drawn = GraphChoice(kind=graph, agents=agents, **of_graph)
    on = drawn.graph("degree", degree)
    if on is not None:
        return colorings.coloring_of(on, colors, seed, conflicts=conflicts, max_cost=max_cost, places=places)
    return colorings.coloring(
        agents or 0,
        colors,
        degree or 0,
        seed,
        connected=drawn.connected,
        conflicts=conflicts,
        max_cost=max_cost,
        places=places,
    )


def agentsnet(
    *,
    task: str,
    agents: int | None = None,
    graph: str = "random",
    degree: float | None = None,
    seed: int = 0,
    **of_graph: Any,  # noqa: ANN401 - `GraphChoice`'s own
) -> Team:
    """Return a task of AgentsNet: see `generators/agentsnet.py`."""
    drawn = GraphChoice(kind=graph, agents=agents, **of_graph)
    on = drawn.graph("degree", degree)
    if on is None:
        on = colorings.random_graph_of(agents or 0, degree or 0, connected=drawn.connected)
    return agent_tasks.agentsnet_on(on, task, seed)


def meetings(  # noqa: PLR0913 - parameters of a family, by their names
    *,
    agents: int,
    meetings: int,
    slots: int,
    participants: int = 2,
    model: str = "peav",
    max_length: int = 1,
    max_value: int = 10,
    required: bool = False,
    seed: int = 0,
) -> Team:
    """Return a meeting scheduling problem: see `generators/meetings.py`."""
    worth = None if required else max_value
    return schedules.meetings(
        agents, meetings, participants, slots, seed, max_length=max_length, max_value=worth, model=model
    )


def grid_sensors(  # noqa: PLR0913 - parameters of a family, by their names
    *,
    rows: int,
    columns: int,
    targets: int,
    needed: int = 3,
    model: str = "targets",
    sight: int = 1,
    hearing: int = 1,
    visibility: float = 1,
    compatibility: float = 1,
    seed: int = 0,
) -> Team:
    """Return a problem with sensors on a grid: see `generators/sensors.py`."""
    reach = sensor_networks.Reach(sight, hearing, visibility, compatibility)
    return sensor_networks.grid_sensors(rows, columns, targets, seed, reach=reach, needed=needed, model=model)


def tasks(  # noqa: PLR0913 - parameters of a family, by their names
    *,
    agents: int,
    tasks: int,
    side: int = 100,
    worth: int = 200,
    skills: int = 1,
    skilled: int = 1,
    distance: str = "streets",
    places: int = 0,
    model: str = "assignment",
    capacity: int = 3,
    seed: int = 0,
) -> Team:
    """Return a task allocation problem: see `generators/tasks.py`."""
    travel = allocations.Travel(side, Distance(distance), places)
    robot_skills = allocations.Skills(skills, skilled)
    return allocations.tasks(
        agents, tasks, seed, worth=worth, travel=travel, skills=robot_skills, model=model, capacity=capacity
    )


def coverage(
    *,
    sensing: float = 3.0,
    worth: float = 10.0,
    seed: int = 0,
    **of_map: Any,  # noqa: ANN401 - `MapChoice`'s own
) -> Team:
    """Return a problem of covering a map: see `generators/maps/coverage.py`."""
    team, _ = coverages.coverage(MapChoice(**of_map), seed, sensing=sensing, worth=worth)
    return team


def formation(
    *,
    shape: str = "line",
    spacing: float = 1.0,
    heading: float = 0.0,
    anchor: str = "",
    seed: int = 0,
    **of_map: Any,  # noqa: ANN401 - `MapChoice`'s own
) -> Team:
    """Return a problem of forming a formation on a map: see `generators/maps/formation.py`."""
    team, _ = formations.formation(
        MapChoice(**of_map), seed, shape=shape, spacing=spacing, heading=heading, anchor=anchor
    )
    return team


def patrol(
    *,
    points: int = 6,
    visit: str = "",
    idle: int = 120,
    rounds: int = 1,
    apart: float = 2.0,
    seed: int = 0,
    **of_map: Any,  # noqa: ANN401 - `MapChoice`'s own
) -> Team:
    """Return the problem of planning a patrol's next visits: see `generators/maps/patrol.py`."""
    team, _ = patrols.patrol(
        MapChoice(**of_map), seed, points=points, visit=visit, idle=idle, rounds=rounds, apart=apart
    )
    return team


def swarm_on_map(
    *,
    map: str,  # noqa: A002 - the name of the option
    agents: int,
    at: str = "",
    radius: float = 0.2,
    speed: float = 0.5,
    points: int = swarms.POINTS,
    targets: int = 0,
    seed: int = 0,
) -> Team:
    """Return a swarm of drones with real positions on a map: see `generators/maps/swarm_on_map.py`."""
    team, _ = map_swarms.swarm_on_map(
        map, agents=agents, at=at, radius=radius, speed=speed, points=points, targets=targets, seed=seed
    )
    return team


FAMILIES: Mapping[str, Callable[..., Team]] = MappingProxyType(
    {
        "agentsnet": agentsnet,
        "coloring": coloring,
        "coverage": coverage,
        "formation": formation,
        "frequencies": frequency_assignments.frequencies,
        "grid-sensors": grid_sensors,
        "heights": flight_heights.heights,
        "ising": isings.ising,
        "meetings": meetings,
        "nary": nary_problems.nary,
        "stochastic": stochastic_problems.stochastic,
        "patrol": patrol,
        "queens3d": queens.queens3d,
        "random": random,
        "sensors": sensor_networks.sensors,
        "smart-grid": grids.smart_grid,
        "smart-homes": lightings.smart_homes,
        "swarm": swarms.swarm,
        "swarm-on-map": swarm_on_map,
        "tasks": tasks,
        "tracking": trackings.tracking,
    }
)
"""The function that generates problems of each family, with keyword parameters."""
_CHOICES: Mapping[str, tuple[type, frozenset[str]]] = MappingProxyType(
    {"of_graph": (GraphChoice, frozenset({"kind", "agents"})), "of_map": (MapChoice, frozenset())}
)
"""Groups of parameters shared by families: the class of a group, and the fields that families declare themselves.

The keys are the names of the `**` parameters.
"""


@cache
def parameters_of(family: str) -> Mapping[str, tuple[type, ...]]:
    """Return the parameters of a family, and the possible types of each parameter."""
    make = FAMILIES[family]
    hints = get_type_hints(make)
    given = inspect.signature(make).parameters
    found = {name: _types(hints[name]) for name in given if name not in _CHOICES}
    for choice, (of_choice, own) in _CHOICES.items():
        if choice in given:
            types = {name: _types(hint) for name, hint in get_type_hints(of_choice).items()}
            found |= {name: type_ for name, type_ in types.items() if name not in own}
    return MappingProxyType(found)


def required_of(family: str) -> tuple[str, ...]:
    """Return the parameters of a family without a default."""
    signature = inspect.signature(FAMILIES[family])
    found = [
        name
        for name, one in signature.parameters.items()
        if one.default is one.empty and one.kind is not one.VAR_KEYWORD
    ]
    return ("map", *found) if "of_map" in signature.parameters else tuple(found)


def _types(hint: Any) -> tuple[type, ...]:  # noqa: ANN401 - whatever a parameter is declared as
    """Return the plain types that a parameter may have; floats may also be integers."""
    alternatives = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    plain = [one for one in alternatives if one in {int, float, bool, str}]
    return tuple(dict.fromkeys([*plain, *([int] if float in plain else [])]))
