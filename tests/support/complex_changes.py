"""Random changes of teams of complex robots: values, constraints over any of their variables, and robots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random

from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    Change,
    Constraint,
    RemoveAgent,
    Team,
)
from tests.support.complex_problems import complex_team, random_complex_team, random_constraint
from tests.support.random_changes import ScenarioAuthor, domains

MOST_VARIABLES, MOST_VALUES = 8, 4
VALUES = range(-4, 7)


class ComplexScenarioAuthor(ScenarioAuthor):
    """Writes scenarios for complex robots. Constraints come and go with what neighbours see of each other."""

    values = VALUES

    def _kinds(self) -> list[Callable[[Team], Change | None]]:
        return [*super()._kinds(), self._add_constraint]

    def _add_constraint(self, team: Team) -> Change | None:
        """Over two or three variables of two or three robots."""
        if len(team.robots) < 2:
            return None
        names = self._chance.sample(sorted(team.variables), min(self._chance.choice((2, 2, 3)), len(team.variables)))
        owners = [name for name in team.order if name in {team.owner[one] for one in names}]
        if len(owners) < 2:
            return None
        return AddConstraint(owners[-1], owners[-2], self._constraint(team, names))

    def _constraint(self, team: Team, names: list[str]) -> Constraint:
        return replace(random_constraint(self._chance, domains(team), names), name=f"N{self._number}")

    def _remove_agent(self, team: Team) -> Change | None:
        return RemoveAgent(self._chance.choice(team.order)) if len(team.robots) > 2 else None

    def _add_agent(self, team: Team) -> Change | None:
        """A robot of two variables, with a private constraint, below one or two others."""
        if len(team.variables) + 2 > MOST_VARIABLES:
            return None
        own = [f"W{self._number}.{place}" for place in range(2)]
        values = domains(team) | {name: sorted(self._chance.sample(VALUES, 3)) for name in own}
        above = self._chance.sample(team.order, min(2, len(team.order)))
        constraints = [random_constraint(self._chance, values, own)]
        for parent in above:
            theirs = self._chance.choice(team[parent].variables).name
            constraints.append(random_constraint(self._chance, values, (theirs, self._chance.choice(own))))
        owned = {robot.name: [one.name for one in robot.variables] for robot in team.robots} | {
            f"R{self._number}x": own
        }
        return AddAgent(complex_team(owned, values, constraints)[f"R{self._number}x"])


def random_complex_changing_team(chance: Random, events: int = 8) -> Team:
    """A random team of complex robots with a scenario of so many events."""
    team = random_complex_team(chance)
    return replace(team, scenario=tuple(ComplexScenarioAuthor(chance).scenario(team, events)))
