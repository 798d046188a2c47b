"""Random teams with costs that change, and their least costs by brute force, epoch by epoch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random

from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import (
    INFINITE,
    AddAgent,
    AddConstraint,
    Change,
    Constraint,
    Parent,
    Relation,
    Semantics,
    Team,
)
from robochoc.run import Options, solve
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team
from tests.support.random_changes import ScenarioAuthor, stages


def _soft(constraint: Constraint, chance: Random) -> Constraint:
    """Return the constraint, or in most cases one over the same variables that only costs something."""
    definition = constraint.definition
    if chance.random() < 0.3 or not isinstance(definition, Relation):
        return constraint
    costs = tuple(chance.choice((0, chance.randint(0, 9), INFINITE)) for _ in definition.tuples)
    soft = replace(definition, semantics=Semantics.SOFT, costs=costs, default_cost=chance.randint(0, 9))
    return replace(constraint, definition=soft)


class CostScenarioAuthor(ScenarioAuthor):
    """Writes scenarios in which what comes mostly costs something."""

    def _add_constraint(self, team: Team) -> Change | None:
        change = super()._add_constraint(team)
        if not isinstance(change, AddConstraint):
            return change
        return replace(change, constraint=_soft(change.constraint, self._chance))

    def _add_agent(self, team: Team) -> Change | None:
        change = super()._add_agent(team)
        if not isinstance(change, AddAgent):
            return change
        parents = tuple(
            Parent(one.name, tuple(_soft(constraint, self._chance) for constraint in one.constraints))
            for one in change.robot.parents
        )
        return AddAgent(replace(change.robot, kind=team.kind, parents=parents))


def changing_cost_team(
    chance: Random, events: int = 10, change: Callable[[Team], Team] = lambda team: team, *, binary: bool = False
) -> Team:
    """A random team with costs and a scenario of so many events; `change` is made to it before."""
    while len((team := random_cost_team(chance, n_ary=not binary)).robots) > 7:
        pass
    team = change(team)
    return replace(team, scenario=tuple(CostScenarioAuthor(chance).scenario(team, events)))


def agrees_on_costs(team: Team, options: Options) -> tuple[int, Outcome]:
    """Every epoch that came to its end ends with brute force's cost; return how many did, and the outcome."""
    outcome = solve(team, options)
    every: Sequence[Team] = list(stages(team))
    assert len(outcome.epochs) == len(every)
    ended = 0
    for now, epoch, event in zip(every, outcome.epochs, [*team.scenario, None], strict=True):
        assert {*epoch.robots} == {*now.order}
        if epoch.verdict is Verdict.UNKNOWN:
            assert event is not None
            assert event.after is not None, "only an event may end an epoch without a verdict"
            continue
        least = least_cost(now)
        assert epoch.verdict is (Verdict.NO_SOLUTION if least == INFINITE else Verdict.OPTIMAL), (team, options)
        assert epoch.cost == (None if least == INFINITE else least), (team, options)
        assert epoch.verified is (least < INFINITE)
        ended += 1
    return ended, outcome
