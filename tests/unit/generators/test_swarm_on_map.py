"""Swarms on maps: exact positions outside of walls, and routes that keep all distances."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from pathlib import Path
from random import Random

import numpy as np
import pytest

from robochoc.flight.coordination.timetable import plan_routes
from robochoc.flight.mission import mission_of
from robochoc.formats import check_team, read_team, write_team
from robochoc.formats.team_reader import GROUND_FILE
from robochoc.generators.maps.swarm_on_map import swarm_on_map
from robochoc.generators.swarm import swarm
from robochoc.maps.ground_map import ground_map_json, read_ground_map
from robochoc.maps.routes.distances import norms
from robochoc.maps.routes.wall_plan import wall_plan_of
from robochoc.maps.walls import walls_of
from robochoc.model.expression import evaluate, text
from robochoc.model.problem import Function, Predicate, Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.examples import count, drawn
from tests.support.outcomes import outcome_of
from tests.support.program import ROOT

BUILDING = str(ROOT / "docs/examples/building/building.yaml")


def random_positions(team: Team, chance: Random) -> dict[str, int]:
    """Return random positions, 0.5 m from each other, that satisfy all hard constraints."""
    values: dict[str, int] = {}
    others: list[list[int]] = []
    hard = [one for one in team.constraints() if isinstance(one.definition, Predicate)]
    for robot in team.order:
        own = list(team[robot].variables)
        while True:
            for variable in own:
                assert variable.domain.real is not None
                values[variable.name] = chance.randint(variable.domain.real.low, variable.domain.real.high)
            known = [one for one in hard if set(one.scope) <= set(values)]
            here = [values[variable.name] for variable in own]
            is_apart = all(math.dist(here, other) >= 50 for other in others)
            if is_apart and all(_holds(one.definition, [values[str(name)] for name in one.scope]) for one in known):
                others.append(here)
                break
    return values


def _holds(definition: object, row: list[int]) -> bool:
    assert isinstance(definition, Predicate)
    return bool(evaluate(definition.body, dict(zip(definition.parameters, row, strict=True))))


def test_goals_are_the_numbers_of_the_answer(tmp_path: Path) -> None:
    team, ground = swarm_on_map(BUILDING, agents=3, points=5)
    check_team(team)
    write_team(team, tmp_path / team.name, extra_files={GROUND_FILE: ground_map_json(ground)})
    assert read_team(tmp_path / team.name) == team
    assert read_ground_map((tmp_path / team.name / GROUND_FILE).read_bytes()) == ground
    cells = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, refine=1))
    found = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert cells.cost is not None
    assert found.cost is not None
    assert Fraction(found.cost) < Fraction(cells.cost)
    numbers = found.labelled(found.assignment)
    goals = mission_of(found, team, ground=ground).legs[0].goals
    assert [goal.at for goal in goals.values()] == [(numbers[f"x{n}"], numbers[f"y{n}"], 1) for n in (1, 2, 3)]


def test_sensors_are_placed_near_targets() -> None:
    team, _ = swarm_on_map(BUILDING, agents=2, points=5, targets=3)
    check_team(team)
    values = random_positions(team, drawn("sensors"))
    costs = [one.definition for one in team.constraints() if one.name.startswith("target")]
    places = [(values["x1"], values["y1"]), (values["x2"], values["y2"])]
    for cost in costs:
        assert isinstance(cost, Function)
        body = text(cost.real.source) if cost.real and cost.real.source else ""
        x, y = (100 * float(part) for part in re.findall(r"sub\([XY]1,([\d.]+)\)", body))
        nearest = min(math.dist((x, y), place) for place in places)
        row = [part for place in places for part in place]
        assert evaluate(cost.body, dict(zip(cost.parameters, row, strict=True))) == pytest.approx(100 * nearest**2)


def test_goals_without_a_map_are_exact_and_in_metres() -> None:
    team = swarm(agents=2, side=100)
    values = {"x1": 137, "y1": 9_999, "x2": 9_960, "y2": 51}
    mission = mission_of(outcome_of(values), team)
    assert [goal.at for goal in mission.legs[0].goals.values()] == [(1.37, 99.99, 1), (99.6, 0.51, 1)]


@count("teams", 20, 200)
def test_routes_keep_all_distances(teams: int) -> None:
    for number in range(teams):
        _check_routes(drawn(f"routes {number}"))


def _check_routes(chance: Random) -> None:
    team, ground = swarm_on_map(BUILDING, agents=chance.randint(2, 3), seed=chance.randrange(10**6))
    values = random_positions(team, chance)
    mission = mission_of(outcome_of(values), team, ground=ground)
    starts = np.array([drone.home for drone in mission.drones])
    goals = np.array([mission.legs[0].goals[number].at for number in range(len(starts))])
    walls = walls_of(ground)
    assert walls is not None
    plan = wall_plan_of(walls)
    routes = plan_routes(starts, goals, distance=0.4, floor_plan=plan, rises=True)
    places = np.array([routes.at(s).position for s in np.arange(0, routes.duration_s + 0.1, 0.1)])
    assert plan.clearances(places.reshape(-1, 3), 1.0).min() >= walls.radius - 1e-6
    for number in range(1, len(starts)):
        assert norms(places[:, number:] - places[:, :-number]).min() >= 0.4 - 1e-6


def test_unusable_maps_and_starts_are_refused() -> None:
    house = str(ROOT / "docs/examples/house/house.bt")
    with pytest.raises(ValueError, match=r"^map has three dimensions; real positions require a map of the ground"):
        swarm_on_map(house, agents=2)
    with pytest.raises(ValueError, match=r"^at has 1 places, but agents is 2: make them equal"):
        swarm_on_map(BUILDING, agents=2, at="1,1")
    with pytest.raises(ValueError, match="robot 1 at 0,0 does not fit there"):
        swarm_on_map(BUILDING, agents=1, at="0,0")
    with pytest.raises(ValueError, match="sensor placement requires at least 2 robots"):
        swarm_on_map(BUILDING, agents=1, targets=3)
    with pytest.raises(ValueError, match="no pixel is free"):
        swarm_on_map(BUILDING, agents=1, radius=5)
