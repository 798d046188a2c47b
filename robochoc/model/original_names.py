"""Convert teams and results to the names that robots and variables had in another tool's files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from robochoc.model.absence import DroppedConstraint
from robochoc.model.change import team_after_events
from robochoc.model.outcome import Answer, EpochOutcome, Improvement, Outcome, PseudoTreeNode, Violations
from robochoc.model.policies import PolicyReport
from robochoc.model.problem import Team

_NAME = re.compile(r"[A-Za-z0-9_.]+")
"""A name in the description of the change that opened an epoch (`describe_change`)."""


def renamed_outcome(outcome: Outcome, names: Mapping[str, str]) -> Outcome:
    """Return `outcome` with the original names of robots and variables. `names` maps current to original names."""
    if not names:
        return outcome
    return replace(
        outcome,
        **_answer(outcome, names),
        lost=_all(outcome.lost, names),
        claimed_by=_one(outcome.claimed_by, names),
        epochs=tuple(_epoch(epoch, names) for epoch in outcome.epochs),
        symbolic=_all(outcome.symbolic, names),
        real_places={names.get(name, name): places for name, places in outcome.real_places.items()},
        uncertainty=_uncertainty(outcome.uncertainty, names),
    )


def _uncertainty(report: PolicyReport | None, names: Mapping[str, str]) -> PolicyReport | None:
    if report is None:
        return None
    policies = {
        names.get(variable, variable): tuple(replace(one, when=_by(one.when, names)) for one in choices)
        for variable, choices in report.policies.items()
    }
    return replace(report, worst_scenario=_by(report.worst_scenario, names), policies=policies)


def renamed_team(team: Team, names: Mapping[str, str], events: int = 0) -> Team:
    """Return `team` for reports, without links. Its robots and variables have their original `names`.

    Args:
        team: The team.
        names: Maps the names in the team to the original names. If empty, the team is returned unchanged.
        events: The number of events in its scenario that have happened.
    """
    if not names:
        return team
    team = team_after_events(team, events)
    robots = tuple(
        replace(
            robot,
            name=names.get(robot.name, robot.name),
            variables=tuple(replace(one, name=names.get(one.name, one.name)) for one in robot.variables),
            private=(),
            parents=(),
            children=(),
        )
        for robot in team.robots
    )
    return replace(team, robots=robots)


def robots_called(team: Team, names: Mapping[str, str]) -> dict[str, str]:
    """Return the current names of robots in `team`, by their current names and by their original `names`."""
    return {**{names.get(name, name): name for name in team.order}, **{name: name for name in team.order}}


def _epoch(epoch: EpochOutcome, names: Mapping[str, str]) -> EpochOutcome:
    return replace(
        epoch,
        opened_by=_NAME.sub(lambda found: names.get(found[0], found[0]), epoch.opened_by),
        robots=_all(epoch.robots, names),
        **_answer(epoch, names),
        lost=_all(epoch.lost, names),
    )


def _answer(answer: Answer, names: Mapping[str, str]) -> dict[str, Any]:
    """Return the fields of an answer that contain names."""
    optima = answer.optima
    return {
        "assignment": _by(answer.assignment, names),
        "withdrawn": _all(answer.withdrawn, names),
        "witness": _one(answer.witness, names),
        "tree": _tree(answer.tree, names),
        "optima": optima and optima._replace(assignments=tuple(_by(one, names) for one in optima.assignments)),
        "front": tuple(one._replace(assignment=_by(one.assignment, names)) for one in answer.front),
        "improvements": _improvements(answer.improvements, names),
        "dropped_constraints": _dropped(answer.dropped_constraints, names),
        "violations": answer.violations and _violations(answer.violations, names),
    }


def _dropped(found: Iterable[DroppedConstraint], names: Mapping[str, str]) -> tuple[DroppedConstraint, ...]:
    return tuple(replace(one, robots=_all(one.robots, names)) for one in found)


def _violations(found: Violations, names: Mapping[str, str]) -> Violations:
    first = (
        replace(one, robot=names.get(one.robot, one.robot), variables=_all(one.variables, names)) for one in found.first
    )
    return replace(found, first=tuple(first))


def _improvements(found: Iterable[Improvement], names: Mapping[str, str]) -> tuple[Improvement, ...]:
    return tuple(one._replace(withdrawn=_all(one.withdrawn, names)) for one in found)


def _tree(tree: Mapping[str, PseudoTreeNode], names: Mapping[str, str]) -> dict[str, PseudoTreeNode]:
    return {
        names.get(name, name): PseudoTreeNode(_one(node.parent, names), _all(node.pseudo_parents, names))
        for name, node in tree.items()
    }


def _by(assignment: Mapping[str, int], names: Mapping[str, str]) -> dict[str, int]:
    return {names.get(name, name): value for name, value in assignment.items()}


def _all(words: Iterable[str], names: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(names.get(word, word) for word in words)


def _one(word: str | None, names: Mapping[str, str]) -> str | None:
    return None if word is None else names.get(word, word)
