"""The team whose costs are the worst of all scenarios, for the risk `worst` (docs/guides/uncertainty.md).

The maximum of a sum is not the sum of the maxima. So all soft constraints that depend on common random variables,
directly or through other constraints, become one constraint: a table of the worst sum of their costs. This needs all
files, and is limited in size.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Domain,
    Function,
    Relation,
    Semantics,
)
from robochoc.model.cost_units import CostUnits, common_units
from robochoc.model.problem import Robot, Team
from robochoc.model.random_variable import RandomVariable
from robochoc.model.uncertainty import Outcomes, UncertaintyError, declared_robots, named, random_variables
from robochoc.system.plain_text import counted

MAX_ROWS = 200_000
"""The maximum number of rows in a table of worst costs."""
MAX_EVALUATIONS = 2_000_000
"""The maximum number of costs that are computed for such a table: rows, times scenarios, times constraints."""


_Price = Callable[[tuple[int, ...]], float]


def worst_case(team: Team) -> Team:
    """Return the team with the variables of `team`, in which an assignment costs the most that it can cost.

    Args:
        team: The deterministic equivalent of a problem with random variables (`model/uncertainty.py`), which does not
            change.

    Raises:
        UncertaintyError: if a table would be too large.
    """
    declared = declared_robots(team.robots)
    outcomes = Outcomes(random_variables(team))
    units = common_units(robot.costs for robot in team.robots)
    tables = _Tables(outcomes, {name: one.domain for name, one in team.variables.items()}, units)
    constraints: list[Constraint] = []
    soft: list[Constraint] = []
    for constraint in (one for robot in declared for one in (*robot.private, *robot.shared)):
        randoms = outcomes.on_which(constraint.scope)
        if constraint.model == ConstraintModel.PKC:
            continue
        if randoms and constraint.has_costs:
            soft.append(constraint)
        else:
            constraints += [outcomes.in_scenario(constraint, one) for _, one in outcomes.scenarios(randoms)]
    constraints += [tables.table(group, randoms) for group, randoms in connected(outcomes, soft)]
    return assemble(
        team.name,
        {robot.name: robot.variables for robot in team.robots},
        constraints,
        kind=team.kind,
        costs=units,
        extras=Extras(
            links=[(parent.name, robot.name) for robot in team.robots for parent in robot.parents],
            topics={robot.name: robot.topics for robot in team.robots},
            weights={robot.name: robot.weight for robot in team.robots},
            parts={robot.name: parts for robot in team.robots if (parts := _parts(robot))},
        ),
    )


def connected(
    outcomes: Outcomes, constraints: Iterable[Constraint]
) -> Iterator[tuple[list[Constraint], list[RandomVariable]]]:
    """Yield groups of `constraints` without common random variables, each with its random variables."""
    groups: list[tuple[list[Constraint], dict[str, RandomVariable]]] = []
    for constraint in constraints:
        found = {one.name: one for one in outcomes.on_which(constraint.scope)}
        joined, apart = [constraint], []
        for group, names in groups:
            if names.keys() & found.keys():
                joined, found = group + joined, names | found
            else:
                apart.append((group, names))
        groups = [*apart, (joined, found)]
    return ((group, list(names.values())) for group, names in groups)


def _parts(robot: Robot) -> list[Constraint]:
    held = itertools.chain(robot.shared, *(child.constraints for child in robot.children))
    return [one for one in held if one.model == ConstraintModel.PKC]


class _Tables:
    def __init__(self, outcomes: Outcomes, domains: Mapping[str, Domain], units: CostUnits) -> None:
        self._outcomes = outcomes
        self._domains = domains
        self._units = units

    def table(self, group: Sequence[Constraint], randoms: Sequence[RandomVariable]) -> Constraint:
        """Return one constraint with the worst sum of the costs of `group`, which depends on `randoms`."""
        number = math.prod(len(one.outcomes) for one in randoms)
        terms = itertools.chain.from_iterable(one.variables for one in group)
        decisions = (self._outcomes.decisions(term) for term in terms if term not in self._outcomes.by_name)
        names = tuple(dict.fromkeys(itertools.chain.from_iterable(decisions)))
        rows = math.prod(len(self._domains[name]) for name in names)
        if rows > MAX_ROWS or rows * number * len(group) > MAX_EVALUATIONS:
            raise UncertaintyError(
                f"the worst case of the costs that depend on {named(randoms)} has {rows:,}"
                f" combinations of {counted(len(names), 'variable')}, in {number:,} scenarios",
                f"use --risk expected, or at most {MAX_ROWS:,} combinations and {MAX_EVALUATIONS:,} computed costs",
            )
        cases = [
            [self._price(self._outcomes.in_scenario(one, scenario), names) for one in group]
            for _, scenario in self._outcomes.scenarios(randoms)
        ]
        tuples = tuple(itertools.product(*(self._domains[name] for name in names)))
        costs = tuple(self._worst(cases, row) for row in tuples)
        name = ".".join(["worst", *(one.name for one in randoms)])
        symbolic = tuple(place for place, one in enumerate(names) if self._domains[one].symbols)
        relation = Relation(name, len(names), Semantics.SOFT, tuples, costs, INFINITE, symbolic)
        return Constraint(name, relation, names, names)

    def _price(self, constraint: Constraint, names: Sequence[str]) -> _Price:
        """Return the cost of `constraint` as a function of the values of `names`. Equal values are evaluated once."""
        own = [(name, names.index(name)) for name in constraint.variables]
        places, definition = self._units.places, constraint.definition
        unit = 10 ** (places - definition.places) if isinstance(definition, Function) else 1
        known: dict[tuple[int, ...], float] = {}

        def price(row: tuple[int, ...]) -> float:
            key = tuple([row[place] for _, place in own])
            if key not in known:
                known[key] = constraint.price({name: row[place] for name, place in own}) * unit
            return known[key]

        return price

    def _worst(self, cases: Iterable[Sequence[_Price]], row: tuple[int, ...]) -> float:
        totals = [sum(price(row) for price in case) for case in cases]
        return min(totals) if self._units.maximize and INFINITE not in totals else max(totals)
