"""Convert costs as in files, before they are normalised, to a finer unit."""

from __future__ import annotations

from dataclasses import replace

from robochoc.model.constraint import INFINITE, Constraint, Function, Predicate, Relation
from robochoc.model.problem import AddAgent, AddConstraint, Change, Robot, Team


def in_finer_units(constraint: Constraint, factor: int) -> Constraint:
    """Return `constraint` with its costs in a unit that is smaller by `factor`."""
    if factor == 1:
        return constraint
    match constraint.definition:
        case Relation() as relation:
            costs = tuple(_times(cost, factor) for cost in relation.costs)
            finer = replace(relation, costs=costs, default_cost=_times(relation.default_cost, factor))
            return replace(constraint, definition=finer)
        case Predicate():
            return replace(constraint, cost=_times(constraint.cost, factor))
        case Function():
            return constraint


def robot_in_places(robot: Robot, places: int) -> Robot:
    """Return `robot` with costs in units of `places` decimal places, at least as many as now."""
    factor = 10 ** (places - robot.costs.places)
    if factor == 1:
        return robot

    costs = replace(robot.costs, places=places, constant=robot.costs.constant * factor)
    declared = robot.declared and robot_in_places(robot.declared, places)
    return replace(robot.with_constraints(lambda one: in_finer_units(one, factor)), costs=costs, declared=declared)


def team_in_places(team: Team, places: int) -> Team:
    """Return `team` and its scenario with costs in units of `places` decimal places, at least as many as now."""
    factor = 10 ** (places - max((robot.costs.places for robot in team.robots), default=places))

    def finer(change: Change) -> Change:
        match change:
            case AddAgent(robot):
                return AddAgent(robot_in_places(robot, places))
            case AddConstraint(constraint=constraint):
                return replace(change, constraint=in_finer_units(constraint, factor))
            case _:
                return change

    robots = tuple(robot_in_places(robot, places) for robot in team.robots)
    scenario = tuple(replace(event, changes=tuple(map(finer, event.changes))) for event in team.scenario)
    return replace(team, robots=robots, scenario=scenario)


def _times(cost: float, factor: int) -> float:
    return cost if cost == INFINITE else int(cost) * factor
