"""Random changes of teams of complex robots: values, constraints over any of their variables, and robots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from random import Random

from changes import domains
from complex_problems import complex_team, random_complex_team, random_constraint

from robochoc.change import changed
from robochoc.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    Event,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Team,
)

MOST_VARIABLES, MOST_VALUES = 8, 4
VALUES = range(-4, 7)


class ComplexAuthor:
    """Writes scenarios for complex robots. Constraints come and go with what neighbours see of each other."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._number = 0

    def scenario(self, team: Team, events: int) -> Iterator[Event]:
        """So many events for `team`, of one to three changes each; one in four in mid-run."""
        for _ in range(events):
            changes = []
            for _ in range(self._chance.choice((1, 1, 2, 3))):
                changes.append(self._change(team))
                team = changed(team, changes[-1:])
            yield Event(tuple(changes), self._chance.choice((None, None, None, self._chance.randint(0, 20))))

    def _change(self, team: Team) -> Change:
        kinds: list[Callable[[Team], Change | None]] = [
            self._remove_constraint,
            self._add_constraint,
            self._add_constraint,
            self._remove_value,
            self._add_value,
            self._remove_agent,
            self._add_agent,
        ]
        while True:
            self._number += 1
            change = self._chance.choice(kinds)(team)
            if change is not None:
                return change

    def _remove_constraint(self, team: Team) -> Change | None:
        held = [(robot.name, p.name, c.name) for robot in team.robots for p in robot.parents for c in p.constraints]
        return RemoveConstraint(*self._chance.choice(held)) if held else None

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

    def _remove_value(self, team: Team) -> Change | None:
        variable, values = self._chance.choice(list(domains(team).items()))
        return RemoveValue(variable, self._chance.choice(values)) if values else None

    def _add_value(self, team: Team) -> Change | None:
        variable, values = self._chance.choice(list(domains(team).items()))
        new = [value for value in VALUES if value not in values]
        return AddValue(variable, self._chance.choice(new)) if len(values) < MOST_VALUES else None

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


def random_complex_journey(chance: Random, events: int = 8) -> Team:
    """A random team of complex robots with a scenario of so many events."""
    team = random_complex_team(chance)
    return replace(team, scenario=tuple(ComplexAuthor(chance).scenario(team, events)))
