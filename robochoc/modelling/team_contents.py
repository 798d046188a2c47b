"""The contents of an existing team, from which a model can start."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from robochoc.model.constraint import Constraint, Variable
from robochoc.model.cost_units import CostUnits, common_units
from robochoc.model.finer_units import in_finer_units
from robochoc.model.problem import AddConstraint, Change, ConstraintModel, ProblemKind, ScenarioEvent, Team
from robochoc.modelling.codes import NUMBER, DomainCodes, Symbols, kind_of
from robochoc.modelling.errors import SourceLine
from robochoc.modelling.terms import ModelVariable
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class TeamContents:
    """The contents of a team, except the robots' names and variables.

    Attributes:
        kind: The kind of problem.
        units: The units of the team's costs.
        constraints: The constraints, except partially known constraints.
        parts: The parts of partially known constraints, by the robot that knows them.
        links: Pairs of neighbours, the parent first.
        events: The scenario.
        objectives: The names of the objectives, if there are several.
    """

    kind: ProblemKind
    units: CostUnits
    constraints: Sequence[Constraint]
    parts: Mapping[str, Sequence[Constraint]]
    links: Sequence[tuple[str, str]]
    events: Sequence[ScenarioEvent]
    objectives: Sequence[str] = ()

    @property
    def names(self) -> set[str]:
        """The names of the team's constraints."""
        return {one.name for one in self._all}

    @property
    def number(self) -> int:
        """The number of constraints, without those that events add."""
        return len(self.constraints) + sum(map(len, self.parts.values()))

    @property
    def definitions(self) -> set[str]:
        """The names of the team's relations, predicates and functions."""
        return {one.definition.name for one in self._all}

    @property
    def _all(self) -> Iterable[Constraint]:
        added = [c.constraint for event in self.events for c in event.changes if isinstance(c, AddConstraint)]
        return [*self.constraints, *(one for parts in self.parts.values() for one in parts), *added]


def contents_of(team: Team) -> TeamContents:
    """Return the contents of `team`."""
    units = common_units(robot.costs for robot in team.robots)
    constraints: list[Constraint] = []
    parts: dict[str, list[Constraint]] = {}
    for robot in team.robots:
        finer = 10 ** (units.places - robot.costs.places)
        held = [*robot.private, *robot.shared, *(one for child in robot.children for one in child.constraints)]
        for one in (in_finer_units(constraint, finer) for constraint in held):
            if one.model == ConstraintModel.PKC:
                parts.setdefault(robot.name, []).append(one)
            else:
                constraints.append(one)
    links = [(parent.name, robot.name) for robot in team.robots for parent in robot.parents]
    return TeamContents(team.kind, units, constraints, parts, links, team.scenario, team.objectives)


def model_variable(variable: Variable, owner: str, symbols: Symbols, place: SourceLine) -> ModelVariable:
    """Return a team's variable as a variable of a model."""
    domain = variable.domain
    for symbol in domain.symbols:
        symbols.code(symbol)
    codes = DomainCodes(NUMBER, domain.ranges, 10**domain.real.places if domain.real else 1, real=domain.real)
    if domain.symbols:
        codes = DomainCodes(kind_of(""), domain.ranges, user_values={value: domain.symbols[value] for value in domain})
    made = ModelVariable(variable.name, codes, owner, place)
    made.domain_name = domain.name
    return made


def changes_in_finer_units(changes: Iterable[Change], factor: int) -> tuple[Change, ...]:
    """Return `changes` with the costs of added constraints in a smaller unit. Added robots declare their own unit."""
    return tuple(
        replace(change, constraint=in_finer_units(change.constraint, factor))
        if isinstance(change, AddConstraint)
        else change
        for change in changes
    )
