"""Assemble teams from variables, constraints and a priority order.

The lowest robot in a constraint's scope holds the constraint, and all other robots in the scope are its parents
(docs/reference/format.md, "One robot"). Importers, generators and `robochoc.Model` create their teams in this module.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace

from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Function,
    Predicate,
    Relation,
    Semantics,
    Variable,
)
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.expression import Apply, Name
from robochoc.model.finer_units import robot_in_places
from robochoc.model.priorities import priority_order
from robochoc.model.problem import Child, Parent, ProblemKind, RandomVariable, Robot, Team, Topic
from robochoc.model.real import RealParameters
from robochoc.model.symbols import with_marked_symbols, with_table_everywhere
from robochoc.model.uncertainty import Outcomes, expected_robot
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True, kw_only=True)
class Extras:
    """Additional parts of the robots in a team.

    Attributes:
        links: Pairs of robots that are neighbours without a shared constraint. The higher robot is the parent.
        topics: The topics of robots.
        weights: The weights of robots; the default is 1.
        random: Random variables, which constraints may contain.
        parts: The parts of partially known constraints (PKC), by the robot that knows them. Each part is over variables
            of that robot and of one other robot. If the other robot has no part, it gets a part that allows everything.
        objectives: The first objectives of the team, followed by those that only constraints name.
    """

    links: Sequence[tuple[str, str]] = ()
    topics: Mapping[str, Sequence[Topic]] = field(default_factory=dict)
    weights: Mapping[str, int] = field(default_factory=dict)
    random: Sequence[RandomVariable] = ()
    parts: Mapping[str, Sequence[Constraint]] = field(default_factory=dict)
    objectives: Sequence[str] = ()


def assemble(
    name: str,
    variables: Mapping[str, Sequence[Variable]],
    constraints: Iterable[Constraint],
    *,
    kind: ProblemKind = ProblemKind.DISCSP,
    costs: CostUnits = PLAIN_COSTS,
    extras: Extras = Extras(),
) -> Team:
    """Return the team whose robots own `variables` and share `constraints`.

    The domains determine which parameters of definitions are symbols. The cost of a constraint without variables is
    added to the constant; if such a constraint is hard and violated, the first robot gets a private constraint that no
    value satisfies.

    Args:
        name: The team's name.
        variables: The variables of each robot, by its name; the robots are in priority order, the highest first.
        constraints: Totally known constraints over these variables, with costs in the unit `costs`. Constraints over
            variables of a single robot are private.
        kind: The kind of problem.
        costs: The unit of costs. Only the first robot gets its constant.
        extras: Further parts of the robots.

    Raises:
        ValueError: if a constraint contains a variable that no robot owns.
    """
    symbolic = {one.name: one.domain.symbols for own in variables.values() for one in own if one.domain.symbols}
    outcomes = Outcomes(extras.random)
    links = _LinkBuilder(variables, outcomes)
    with_variables, costs = _without_constants(constraints, variables, costs)
    for constraint in with_marked_symbols(with_variables, symbolic):
        links.add(constraint)
    for robot, parts in extras.parts.items():
        for part in with_marked_symbols(parts, symbolic):
            links.add_part(robot, part)
    for robot, part in links.missing_parts():
        links.add_part(robot, *with_marked_symbols([part], symbolic))
    for one, other in extras.links:
        links.link(one, other)
    links.place()
    priced = [*with_variables, *(part for parts in extras.parts.values() for part in parts)]
    objectives = dict.fromkeys([*extras.objectives, *(one.objective for one in priced if one.objective)])
    robots = tuple(
        Robot(
            name=robot,
            variables=tuple(own),
            kind=kind,
            private=tuple(links.private[robot]),
            parents=links.parents_of(robot),
            children=links.children_of(robot),
            topics=tuple(extras.topics.get(robot, ())),
            weight=extras.weights.get(robot, 1),
            costs=costs if number == 0 else replace(costs, constant=0),
            objectives=tuple(objectives),
        )
        for number, (robot, own) in enumerate(variables.items())
    )
    if extras.random:
        robots = tuple(expected_robot(replace(one, random=_affecting(one, outcomes))) for one in robots)
        places = max(one.costs.places for one in robots)
        robots = tuple(robot_in_places(one, places) for one in robots)
    return with_table_everywhere(Team(name, robots), next(iter(symbolic.values()), ()))


def _affecting(robot: Robot, outcomes: Outcomes) -> tuple[RandomVariable, ...]:
    """Return the random variables on which the variables and constraints of `robot` depend."""
    terms = itertools.chain(
        (one.name for one in robot.variables), *(constraint.scope for constraint in robot.constraints())
    )
    return outcomes.on_which(terms)


def _without_constants(
    constraints: Iterable[Constraint], variables: Mapping[str, Sequence[Variable]], costs: CostUnits
) -> tuple[list[Constraint], CostUnits]:
    """Return the `constraints` over variables, and `costs` with the costs of all other constraints in the constant."""
    found = []
    for constraint in constraints:
        if constraint.variables:
            found.append(constraint)
            continue
        price = constraint.price({})
        if price == INFINITE:
            first = next(own[0] for own in variables.values() if own)
            real = first.domain.real
            never = replace(_NEVER, real=RealParameters(_NEVER.parameters, real.places)) if real else _NEVER
            found.append(Constraint(constraint.name, never, (first.name,), (first.name,)))
        elif price:
            places = constraint.definition.places if isinstance(constraint.definition, Function) else costs.places
            unit = 10 ** (costs.places - places)
            costs = replace(costs, constant=costs.constant + int(price) * unit)
    return found, costs


_NEVER = Predicate("never", ("X",), Apply("ne", (Name("X"), Name("X"))))


class _LinkBuilder:
    """Collects the constraints that robots hold, and the resulting links."""

    def __init__(self, variables: Mapping[str, Sequence[Variable]], outcomes: Outcomes) -> None:
        self._outcomes = outcomes
        self._variables = variables
        self._owner = {variable.name: robot for robot, own in variables.items() for variable in own}
        self._rank = {robot: place for place, robot in enumerate(variables)}
        self._held: list[tuple[str, set[str], Constraint]] = []
        self._parents: dict[str, set[str]] = {robot: set() for robot in variables}
        self._children: dict[str, set[str]] = {robot: set() for robot in variables}
        self._shown: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._with: dict[tuple[str, str], list[Constraint]] = defaultdict(list)
        self._parts: dict[tuple[str, frozenset[str]], Constraint] = {}
        self.private: dict[str, list[Constraint]] = defaultdict(list)

    def add(self, constraint: Constraint) -> None:
        """Assign a totally known constraint to the lowest robot in its scope."""
        robots = self._owners(constraint)
        lowest = max(robots, key=self._rank.__getitem__)
        if len(robots) == 1:
            self.private[lowest].append(replace(constraint, model=None))
            return
        self._held.append((lowest, robots - {lowest}, replace(constraint, model=ConstraintModel.TKC)))
        for other in robots - {lowest}:
            self.link(lowest, other)
        self._show(constraint, lowest)

    def add_part(self, robot: str, part: Constraint) -> None:
        """Assign a part of a partially known constraint to `robot`."""
        (other,) = self._owners(part) - {robot}
        self._parts.setdefault((robot, frozenset(part.variables)), part)
        self._with[robot, other].append(replace(part, model=ConstraintModel.PKC))
        self.link(robot, other)
        self._show(part, max(robot, other, key=self._rank.__getitem__))

    def missing_parts(self) -> list[tuple[str, Constraint]]:
        """Return the missing parts of partially known constraints with their robots. These parts allow everything.

        Both robots in such a constraint have a part of it in their files.
        """
        missing = []
        for (robot, scope), part in self._parts.items():
            (other,) = self._owners(part) - {robot}
            if (other, scope) not in self._parts:
                anything = Relation(f"anything{len(scope)}", len(scope), Semantics.CONFLICTS, ())
                missing.append((other, Constraint(part.name, anything, part.variables, part.variables)))
        return missing

    def link(self, one: str, other: str) -> None:
        """Make the two robots neighbours."""
        higher, lower = sorted((one, other), key=self._rank.__getitem__)
        self._parents[lower].add(higher)
        self._children[higher].add(lower)

    def place(self) -> None:
        """Place every shared constraint under the lowest of its parents, in the order that readers of files compute."""
        seen = {robot: place for place, robot in enumerate(priority_order(self._parents))}
        for lowest, others, constraint in self._held:
            self._with[lowest, max(others, key=seen.__getitem__)].append(constraint)

    def parents_of(self, robot: str) -> tuple[Parent, ...]:
        """Return the parents of `robot`, in priority order."""
        names = sorted(self._parents[robot], key=self._rank.__getitem__)
        return tuple(Parent(name, tuple(self._with[robot, name])) for name in names)

    def children_of(self, robot: str) -> tuple[Child, ...]:
        """Return the children of `robot`, in priority order."""
        names = sorted(self._children[robot], key=self._rank.__getitem__)
        own = [variable.name for variable in self._variables[robot]]
        return tuple(
            Child(
                name,
                tuple(variable for variable in own if variable in self._shown[robot, name]),
                tuple(self._with[robot, name]),
            )
            for name in names
        )

    def _show(self, constraint: Constraint, lowest: str) -> None:
        for variable in constraint.variables:
            if variable in self._owner:
                self._shown[self._owner[variable], lowest].add(variable)

    def _owners(self, constraint: Constraint) -> set[str]:
        known = self._owner.keys() | self._outcomes.by_name.keys()
        unknown = [name for name in constraint.variables if name not in known]
        if unknown:
            raise ValueError(f"constraint {constraint.name} has a variable {unknown[0]!r}, which no robot owns")
        return {self._owner[name] for name in constraint.variables if name in self._owner}
