"""Converts a sketch to a `robochoc.Model` and a team, and a solution to the values in the sketch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from robochoc.app.sketch.palette import Applied
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Decision, DecisionKind, Sketch, SketchRule
from robochoc.model.problem import Team
from robochoc.modelling.model import Model
from robochoc.modelling.robots import ModelRobot
from robochoc.modelling.team_builder import build_team, saved_order
from robochoc.modelling.terms import ModelVariable, Term

WAYPOINT = "waypoint"
"""The name of the topic for a robot's target, which follows the robot's name."""


def model_of(sketch: Sketch) -> Model:
    """Return the model for a sketch, which must not have errors (`checks.errors_of`).

    Constraints are named after the rule and its robots, such as `R1.North.South`.

    Raises:
        ModelError: if the sketch has an error.
    """
    model = Model(sketch.name)
    for drawn in sketch.robots:
        model.robot(drawn.name, priority=drawn.rank, weight=drawn.weight)
    for decision in sketch.decisions:
        for name in sketch.deciders(decision):
            model.robots[name].variable(decision.name, [*sketch.values(decision)])
    for drawn in sketch.robots:
        add_topic(sketch, model.robots[drawn.name])
    for rule in sketch.rules:
        if rule.on:
            _add(model, sketch, rule)
    return model


def decided(
    sketch: Sketch, assignment: Mapping[str, int | str], model: Model | None = None
) -> dict[tuple[str, str], int | str]:
    """Return the robots' decisions as values in the sketch.

    Args:
        sketch: The sketch.
        assignment: Values by variable, in the form of `solve --json`, in which names have no spaces.
        model: The solved model, if it is not the model of the sketch.

    Returns:
        The values in the sketch, by robot and decision. Unknown values are left out.
    """
    model = model_of(sketch) if model is None else model
    found: dict[tuple[str, str], int | str] = {}
    for decision in sketch.decisions:
        for name in sketch.deciders(decision):
            variable = model.robots[name].variables[decision.name]
            label = assignment.get(variable.name)
            words = {model.symbols.all[code] if variable.codes.symbolic else code: code for code in variable.codes.ever}
            if label in words:
                value = variable.codes.value(words[label])
                found[name, decision.name] = value if isinstance(value, (int, str)) else str(value)
    return found


def saved_team(sketch: Sketch) -> Team:
    """Return the team that the files of a sketch contain. Raises `ModelError` if the sketch has an error."""
    model = model_of(sketch)
    order = saved_order(model.team)
    return model.team if order == model.team.order else build_team(model, order)


def applied(sketch: Sketch, rule: SketchRule) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the name and the robots of each constraint for a rule."""
    for robots in PALETTE[rule.kind].groups(sketch, rule):
        yield name_of(rule, robots), robots


def name_of(rule: SketchRule, robots: Sequence[str]) -> str:
    """Return the name of the constraint for `rule` and the robots in one link."""
    few = 3
    return ".".join([rule.id, *robots]) if len(robots) < few else rule.id


def _add(model: Model, sketch: Sketch, rule: SketchRule) -> None:
    for name, robots in applied(sketch, rule):
        add_constraint(model, rule, name, term_of(model, sketch, rule, robots), robots)


def term_of(model: Model, sketch: Sketch, rule: SketchRule, robots: Sequence[str]) -> Term:
    """Return the condition for a rule and the robots in one link, over the variables of a model."""
    term = PALETTE[rule.kind].condition(Applied(sketch, rule), [model.robots[robot][rule.decision] for robot in robots])
    assert isinstance(term, Term), "variables of a model make terms"  # noqa: S101
    return term


def add_constraint(model: Model, rule: SketchRule, name: str, term: Term, robots: Sequence[str]) -> None:
    """Add the constraint for a rule and the robots in one link."""
    if PALETTE[rule.kind].graded:
        model.minimize(term)
    elif rule.private and len(robots) > 1:  # partially known: the other robot has no part, and never learns this one
        model.robots[robots[0]].knows(term, cost=rule.cost, name=name)
    else:
        model.add(term, cost=rule.cost, name=name)


def add_topic(sketch: Sketch, robot: ModelRobot) -> None:
    """Add the topic for a robot's target, if the robot decides a place or a level."""
    variables: dict[DecisionKind, ModelVariable] = {}
    for decision in _decided_by(sketch, robot.name):
        variables.setdefault(decision.kind, robot.variables[decision.name])
    place, level = variables.get(DecisionKind.PLACE), variables.get(DecisionKind.LEVEL)
    if place is None and level is None:
        return
    drawn = sketch.robot(robot.name)
    assert drawn is not None, "the robot is one of the sketch"  # noqa: S101
    columns = sketch.area.columns
    robot.topic(
        f"{robot.name}/{WAYPOINT}",
        x=drawn.at.x + 1 if place is None else place % columns + 1,
        y=drawn.at.y + 1 if place is None else place // columns + 1,
        z=1 if level is None else level,
    )


def _decided_by(sketch: Sketch, name: str) -> Iterator[Decision]:
    for decision in sketch.decisions:
        if name in sketch.deciders(decision):
            yield decision
