"""Random changes of random teams: constraints, values and robots come and go."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from random import Random

from robochoc.model.change import apply_changes
from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Domain,
    Parent,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.run import Options, solve
from tests.support.brute_force import solutions
from tests.support.problems import random_constraint, random_team

MOST_ROBOTS, MOST_VALUES = 7, 4
VALUES = range(-3, 6)


class ScenarioAuthor:
    """Writes scenarios; what robots have left may come again under their old names."""

    values = VALUES

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._left: list[str] = []
        self._number = 0

    def scenario(self, team: Team, events: int) -> Iterator[ScenarioEvent]:
        """So many events for `team`, of one to three changes each; one in four in mid-run."""
        for _ in range(events):
            changes = []
            for _ in range(self._chance.choice((1, 1, 2, 3))):
                changes.append(self._change(team))
                team = apply_changes(team, changes[-1:])
            yield ScenarioEvent(tuple(changes), self._chance.choice((None, None, None, self._chance.randint(0, 30))))

    def _change(self, team: Team) -> Change:
        while True:
            self._number += 1
            change = self._chance.choice(self._kinds())(team)
            if change is not None:
                return change

    def _kinds(self) -> list[Callable[[Team], Change | None]]:
        """The kinds of changes, as often as they are wanted."""
        return [
            self._remove_constraint,
            self._add_constraint,
            self._remove_value,
            self._add_value,
            self._remove_agent,
            self._add_agent,
        ]

    def _remove_constraint(self, team: Team) -> Change | None:
        held = [(robot.name, p.name, c.name) for robot in team.robots for p in robot.parents for c in p.constraints]
        return RemoveConstraint(*self._chance.choice(held)) if held else None

    def _add_constraint(self, team: Team) -> Change | None:
        if len(team.robots) < 2:
            return None
        parent, agent = sorted(self._chance.sample(range(len(team.robots)), 2))
        above, below = team.robots[parent], team.robots[agent]
        scope = (above.variables[0].name, below.variables[0].name)
        constraint = random_constraint(self._chance, domains(team), scope)
        return AddConstraint(below.name, above.name, replace(constraint, name=f"N{self._number}"))

    def _remove_value(self, team: Team) -> Change | None:
        variable, values = self._chance.choice(list(domains(team).items()))
        return RemoveValue(variable, self._chance.choice(values)) if values else None

    def _add_value(self, team: Team) -> Change | None:
        variable, values = self._chance.choice(list(domains(team).items()))
        new = [value for value in self.values if value not in values]
        return AddValue(variable, self._chance.choice(new)) if len(values) < MOST_VALUES else None

    def _remove_agent(self, team: Team) -> Change | None:
        if len(team.robots) <= 2:
            return None
        self._left.append(self._chance.choice(team.order))
        return RemoveAgent(self._left[-1])

    def _add_agent(self, team: Team) -> Change | None:
        if len(team.robots) >= MOST_ROBOTS:
            return None
        name = self._left.pop() if self._left and self._chance.random() < 0.5 else f"RY{self._number}"
        if name in team:
            return None
        own = name[1:]
        values = sorted(self._chance.sample(VALUES, 3))
        known = {**domains(team), own: values}
        parents = tuple(
            Parent(robot.name, (random_constraint(self._chance, known, (robot.variables[0].name, own)),))
            for robot in self._chance.sample(team.robots, min(2, len(team.robots)))
        )
        domain = Domain("D", tuple(range(value, value + 1) for value in values))
        return AddAgent(Robot(name, (Variable(own, domain),), parents=parents))


def domains(team: Team) -> dict[str, list[int]]:
    """The values of each variable."""
    return {name: list(variable.domain) for name, variable in team.variables.items()}


def random_changing_team(chance: Random, events: int = 10, change: Callable[[Team], Team] = lambda team: team) -> Team:
    """A random team with a scenario of so many events; `change` is made to it before."""
    team = change(random_team(chance))
    return replace(team, scenario=tuple(ScenarioAuthor(chance).scenario(team, events)))


def stages(team: Team) -> Iterator[Team]:
    """The team of each epoch."""
    now = replace(team, scenario=())
    yield now
    for event in team.scenario:
        now = apply_changes(now, event.changes)
        yield now


def check_epochs(team: Team, options: Options) -> int:
    """Solve `team`, compare the verdict of each finished epoch with brute force, and return how many there were."""
    outcome = solve(team, options)
    every = list(stages(team))
    assert len(outcome.epochs) == len(every)
    ended = 0
    for now, epoch, event in zip(every, outcome.epochs, [*team.scenario, None], strict=True):
        assert set(epoch.robots) == set(now.order)
        if epoch.verdict is Verdict.UNKNOWN:
            assert event is not None
            assert event.after is not None, "only an event may end an epoch without a verdict"
            continue
        truth = Verdict.NO_SOLUTION if next(solutions(now), None) is None else Verdict.SOLUTION
        assert epoch.verdict is truth, (team, options)
        assert epoch.verified is (truth is Verdict.SOLUTION)
        ended += 1
    return ended
