"""Random scenarios: sequences of events that add and remove constraints, values and robots of a team.

A dynamic problem is a sequence of problems, each of which results from the previous problem by such changes (Verfaillie
and Schiex, "Solution reuse in dynamic constraint satisfaction problems", AAAI 1994; for distributed optimisation: Yeoh,
Varakantham, Sun and Koenig, "Incremental DCOP search algorithms for solving dynamic DCOPs", AAMAS 2011). The rate is
the number of changes in an event, as a fraction of the number of the team's shared constraints.

Removed values, constraints and robots are added again under their old names. If nothing was removed, a variable gets a
value from the domain of another variable, two robots get a copy of a constraint between others, or a copy of a robot
joins, with copies of its variables and of its constraints with the same robots. A domain keeps at least one value, and
a team at least two robots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from itertools import count
from random import Random
from typing import TypeVar

from robochoc.generators.draws import MAX_CONSTRAINTS, check_bounds, seeded
from robochoc.model.change import apply_changes
from robochoc.model.copies import renamed_constraint
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    ConstraintModel,
    Parent,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.model.team_edits import ChangeError
from robochoc.system.suggestions import member

MAX_EVENTS = 1000
MAX_TRIES = 100
"""The maximum number of attempts, with random kinds and objects, for one change."""
MIN_ROBOTS = 2

_One = TypeVar("_One")


class ChangeKind(StrEnum):
    """The kinds of random changes."""

    REMOVE_VALUE = "remove-value"
    ADD_VALUE = "add-value"
    REMOVE_CONSTRAINT = "remove-constraint"
    ADD_CONSTRAINT = "add-constraint"
    REMOVE_AGENT = "remove-agent"
    ADD_AGENT = "add-agent"


def random_scenario(
    team: Team,
    events: int,
    rate: float,
    seed: int = 0,
    *,
    kinds: Iterable[ChangeKind | str] = tuple(ChangeKind),
    after: int | None = None,
) -> Team:
    """Return `team` with a random scenario of possible changes.

    Args:
        team: A team without a scenario.
        events: The number of events.
        rate: The changes in each event, as a share of the team's shared constraints, more than 0 and at most 1; it is
            at least one change.
        seed: The same seed gives the same scenario for the same team on every machine.
        kinds: The kinds of changes, each as likely as any other.
        after: The number of messages after which an event happens. None: when the problem before it is solved.

        rate: The number of changes in each event, as a fraction of the number of shared constraints, more than 0 and at
            most 1. Each event has at least one change.
        seed: The same seed gives the same scenario for the same team on every machine.
        kinds: The kinds of changes, which are equally likely.
        after: The number of messages after which an event happens. None: when the previous problem is solved.

    Raises:
        ValueError: The team has a scenario, a number is out of bounds, or no change of these kinds is possible.
    """
    check_bounds({"events": (events, 1, MAX_EVENTS), "rate": (rate, 0, 1)})
    if team.scenario:
        raise ValueError(f"{team.name} has a scenario already; use a team without one")
    named = {member(ChangeKind, "kinds", one) for one in kinds}
    wanted = [kind for kind in ChangeKind if kind in named] or list(ChangeKind)
    shared = sum(len(robot.shared) for robot in team.robots)
    changes = max(1, round(rate * shared))
    check_bounds({"changes of all events": (events * changes, 1, MAX_CONSTRAINTS)})
    builder = _ScenarioBuilder(seeded(seed), team, wanted)
    written = tuple(ScenarioEvent(tuple(builder.change() for _ in range(changes)), after) for _ in range(events))
    label = "" if set(wanted) == set(ChangeKind) else "-" + "-".join(wanted)
    name = f"{team.name}-events{events}-{float(rate)}{label}-{seed}"
    return replace(team, name=name, scenario=written)


class _ScenarioBuilder:
    """Draws changes one by one, and stores removed parts, so that these can be added again."""

    def __init__(self, chance: Random, team: Team, kinds: Sequence[ChangeKind]) -> None:
        self._chance = chance
        self._team = team
        self._kinds = kinds
        self._values: list[tuple[str, int]] = []
        self._constraints: list[Constraint] = []
        self._robots: list[tuple[Robot, list[Constraint]]] = []
        self._numbers = count(1)
        self._make: Mapping[ChangeKind, Callable[[], Change | None]] = {
            ChangeKind.REMOVE_VALUE: self._remove_value,
            ChangeKind.ADD_VALUE: self._add_value,
            ChangeKind.REMOVE_CONSTRAINT: self._remove_constraint,
            ChangeKind.ADD_CONSTRAINT: self._add_constraint,
            ChangeKind.REMOVE_AGENT: self._remove_agent,
            ChangeKind.ADD_AGENT: self._add_agent,
        }

    def change(self) -> Change:
        """Return a possible change to the team, after applying it."""
        for _ in range(MAX_TRIES):
            change = self._make[self._one(self._kinds)]()
            if change is None:
                continue
            try:
                after = apply_changes(self._team, [change])
            except ChangeError:
                continue
            self._note(change)
            self._team = after
            return change
        raise ValueError(f"no further change of the kinds {', '.join(self._kinds)} is possible; allow more kinds")

    def _one(self, things: Sequence[_One]) -> _One:
        return things[int(self._chance.random() * len(things))]

    def _note(self, change: Change) -> None:
        """Store the part removed by `change`, or delete the stored part that `change` adds again."""
        match change:
            case RemoveValue(variable, value):
                self._values.append((variable, value))
            case AddValue(variable, value):
                self._values = [one for one in self._values if one != (variable, value)]
            case RemoveConstraint(agent, parent, name):
                self._constraints += [one for one in _under(self._team, agent, parent) if one.name == name]
            case AddConstraint(constraint=constraint):
                self._constraints = [one for one in self._constraints if one != constraint]
            case RemoveAgent(name):
                self._robots.append((self._team[name], _constraints_of(self._team, name)))
            case AddAgent(robot):
                self._robots = [one for one in self._robots if one[0].name != robot.name]

    def _remove_value(self) -> Change | None:
        several = [one for one in self._team.variables.values() if len(one.domain) > 1]
        if not several:
            return None
        variable = self._one(several)
        return RemoveValue(variable.name, self._one(list(variable.domain)))

    def _add_value(self) -> Change | None:
        gone = [one for one in self._values if one[0] in self._team.variables]
        if gone:
            return AddValue(*self._one(gone))
        variable = self._one(list(self._team.variables.values()))
        known = {
            value
            for other in self._team.variables.values()
            if other.domain.symbols == variable.domain.symbols
            for value in other.domain
        }
        new = sorted(known.difference(variable.domain))
        return AddValue(variable.name, self._one(new)) if new else None

    def _remove_constraint(self) -> Change | None:
        shared = [
            (robot.name, parent.name, one.name)
            for robot in self._team.robots
            for parent in robot.parents
            for one in parent.constraints
        ]
        return RemoveConstraint(*self._one(shared)) if shared else None

    def _add_constraint(self) -> Change | None:
        there = self._team.owner
        gone = [one for one in self._constraints if _known(one) and all(name in there for name in one.variables)]
        if gone:
            return self._added(self._one(gone))
        like = [one for robot in self._team.robots for one in robot.shared if _known(one) and len(one.variables) == 2]  # noqa: PLR2004 - a pair
        names = list(self._team.variables)
        one, other = self._one(names), self._one(names)
        if not like or there[one] == there[other]:
            return None
        old = self._one(like)
        terms = dict(zip(old.variables, (one, other), strict=True))
        return self._added(replace(renamed_constraint(old, terms), name=f"Added{next(self._numbers)}", line=0))

    def _added(self, constraint: Constraint) -> AddConstraint:
        """Return the change that adds `constraint` to the lowest robot in its scope, under the second lowest."""
        rank = {name: place for place, name in enumerate(self._team.order)}
        owners = sorted({self._team.owner[name] for name in constraint.variables}, key=rank.__getitem__)
        return AddConstraint(owners[-1], owners[-2], constraint)

    def _remove_agent(self) -> Change | None:
        return RemoveAgent(self._one(self._team.order)) if len(self._team.robots) > MIN_ROBOTS else None

    def _add_agent(self) -> Change | None:
        gone = [one for one in self._robots if one[0].name not in self._team]
        if gone:
            return AddAgent(self._joining(*self._one(gone)))
        model = self._one(self._team.robots)
        number = next(self._numbers)
        terms = {own.name: f"Late{number}.{place}" for place, own in enumerate(model.variables, 1)}
        constraints = [renamed_constraint(one, terms) for one in _constraints_of(self._team, model.name)]
        variables = tuple(Variable(terms[own.name], own.domain) for own in model.variables)
        return AddAgent(
            self._joining(replace(model, name=f"Late{number}", variables=variables, topics=()), constraints)
        )

    def _joining(self, robot: Robot, constraints: Iterable[Constraint]) -> Robot:
        """Return `robot` with the lowest priority, and with the `constraints` whose other robots are in the team."""
        own = {variable.name for variable in robot.variables}
        rank = {name: place for place, name in enumerate(self._team.order)}
        private, under = list[Constraint](), dict[str, list[Constraint]]()
        for one in constraints:
            others = [name for name in one.variables if name not in own]
            if not others:
                private.append(one)
            elif _known(one) and all(name in self._team.owner for name in others):
                owners = sorted({self._team.owner[name] for name in others}, key=rank.__getitem__)
                for owner in owners:
                    under.setdefault(owner, [])
                under[owners[-1]].append(one)
        return replace(
            robot,
            private=tuple(private),
            parents=tuple(Parent(name, tuple(under[name])) for name in sorted(under, key=rank.__getitem__)),
            children=(),
            shown=(),
            file="",
            costs=replace(robot.costs, constant=0),
        )


def _known(constraint: Constraint) -> bool:
    """Return whether `constraint` is totally known; scenarios cannot add other constraints."""
    return constraint.model != ConstraintModel.PKC


def _under(team: Team, agent: str, parent: str) -> Iterator[Constraint]:
    for one in team[agent].parents:
        if one.name == parent:
            yield from one.constraints


def _constraints_of(team: Team, name: str) -> list[Constraint]:
    """Return the private constraints of a robot, and all constraints over its variables."""
    own = {variable.name for variable in team[name].variables}
    shared = (one for robot in team.robots for one in robot.shared)
    return [*team[name].private, *(one for one in shared if not own.isdisjoint(one.variables))]
