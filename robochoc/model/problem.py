"""The problem solved by a team, as data: the paper's tuple (A, X, D, C, psi) (Section 3.1).

A `Team` is a set of `Robot` objects (A). Each robot owns variables (X) with domains (D); psi is this ownership.
Constraints (C) are *private* to a robot, or *shared* between robots. Domains, variables and constraints are defined in
`model/constraint.py`, and can be imported from here.

These are plain data. `formats` reads them from XML, `solver` compiles them, and `protocols` use only compiled problems.
Values are integers, with names in symbolic domains. Costs are integers in the unit `Robot.costs`, or `INFINITE` for
violated hard constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field, replace
from enum import StrEnum
from functools import cached_property
from importlib import import_module

from robochoc.model.absence import DroppedConstraint
from robochoc.model.constraint import (
    INFINITE,
    Assignment,
    Constraint,
    ConstraintModel,
    Definition,
    Domain,
    Function,
    GlobalPredicate,
    Predicate,
    Relation,
    Semantics,
    Term,
    Variable,
    WhenAbsent,
)
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits, common_units
from robochoc.model.expression import Expression
from robochoc.model.random_variable import RandomVariable
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted

__all__ = [
    "INFINITE",
    "AddAgent",
    "AddConstraint",
    "AddValue",
    "Assignment",
    "Change",
    "Child",
    "Constraint",
    "ConstraintModel",
    "CostUnits",
    "Definition",
    "Domain",
    "Function",
    "GlobalPredicate",
    "Parent",
    "Predicate",
    "ProblemKind",
    "RandomVariable",
    "Relation",
    "RemoveAgent",
    "RemoveConstraint",
    "RemoveValue",
    "Robot",
    "ScenarioEvent",
    "Semantics",
    "Team",
    "Term",
    "Topic",
    "Value",
    "Variable",
    "WhenAbsent",
]

Value = tuple[int | None, ...]
"""A robot's value as seen by its neighbours: the values of its interface variables, in the order of its file.

In a nogood, None is the value of an irrelevant variable: the nogood holds for each of the variable's values.
"""


class ProblemKind(StrEnum):
    """The kind of a team's problem: satisfaction (DisCSP), or optimisation of the sum of costs (DisWCSP, a DCOP)."""

    DISCSP = "DisCSP"
    DISWCSP = "DisWCSP"


@dataclass(frozen=True)
class Topic:
    """A topic on which a robot's decision is published (ROS Layer unit).

    `x`, `y`, `z` are the waypoint's position, in units of 10**-`places` (`waypoints.position`). `sources` are the
    expressions over real variables from which they were made, if the robot has such variables.
    """

    name: str
    type: str = "geometry_msgs/PoseStamped"
    x: Expression | None = None
    y: Expression | None = None
    z: Expression | None = None
    sources: tuple[Expression | None, ...] = field(default=(), compare=False)
    places: int = 0


@dataclass(frozen=True)
class Parent:
    """A neighbour of higher priority, with the shared constraints that this robot holds for both."""

    name: str
    constraints: tuple[Constraint, ...] = ()
    line: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Child:
    """A neighbour of lower priority.

    Attributes:
        name: The neighbour's name.
        variables: This robot's own variables that the child must know.
        constraints: This robot's parts of partially known constraints with the child.
        line: The line in the robot's file that lists the child.
        copies: Copies in the robot's file of the child's TKC constraints. In a run across machines the robot also uses
            them to check the answer. Copies are ignored when robots are compared, and are not written to files.
    """

    name: str
    variables: tuple[str, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    line: int = field(default=0, compare=False)
    copies: tuple[Constraint, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Robot:
    """One agent, with the contents of its file. The agent has no other knowledge.

    Attributes:
        name: The robot's name, unique in the team.
        variables: The robot's decision variables.
        kind: The kind of problem, the same in the whole team.
        private: Constraints on the robot's own variables only.
        parents: Neighbours of higher priority, with the constraints shared with them.
        children: Neighbours of lower priority.
        topics: The topics for the robot's decisions.
        file: The file that the robot was read from, if any.
        shown: Variables that neighbours see only because they occur in a parent's part of a partially known constraint.
        weight: The weight of a withdrawal: a robot of weight 3 counts as much as three robots of weight 1.
        costs: The unit of the robot's costs, and whether their sum is minimised or maximised.
        symbols: The names of the team's symbols, if none of the robot's domains is symbolic.
        user_units: The user's units of costs, if the robot's costs are normalised (`model/costs.py`).
        objectives: The names of the team's objectives, if there are several (`model/objectives.py`).
        random: The random variables in the robot's file.
        declared: The robot as in its file, if this robot is its deterministic equivalent (`model/uncertainty.py`).
        sampled: True if its costs are averages over samples of random variables, instead of expectations.
    """

    name: str
    variables: tuple[Variable, ...]
    kind: ProblemKind = ProblemKind.DISCSP
    private: tuple[Constraint, ...] = ()
    parents: tuple[Parent, ...] = ()
    children: tuple[Child, ...] = ()
    topics: tuple[Topic, ...] = ()
    file: str = field(default="", compare=False)
    shown: tuple[str, ...] = ()
    weight: int = 1
    costs: CostUnits = PLAIN_COSTS
    symbols: tuple[str, ...] = ()
    user_units: CostUnits = PLAIN_COSTS
    objectives: tuple[str, ...] = ()
    random: tuple[RandomVariable, ...] = ()
    declared: Robot | None = field(default=None, compare=False, repr=False)
    sampled: bool = field(default=False, compare=False, repr=False)

    def constraints(self) -> Iterator[Constraint]:
        """Yield every constraint in the robot's file: private and shared ones, and parts of partially known ones."""
        yield from self.private
        yield from self.shared
        for child in self.children:
            yield from child.constraints

    def with_constraints(self, convert: Callable[[Constraint], Constraint]) -> Robot:
        """Return this robot with each constraint, and each copy of a child's constraint, replaced by `convert`."""
        return replace(
            self,
            private=tuple(map(convert, self.private)),
            parents=tuple(replace(one, constraints=tuple(map(convert, one.constraints))) for one in self.parents),
            children=tuple(
                replace(one, constraints=tuple(map(convert, one.constraints)), copies=tuple(map(convert, one.copies)))
                for one in self.children
            ),
        )

    @cached_property
    def shared(self) -> tuple[Constraint, ...]:
        """The shared constraints that this robot holds, since it is the lowest robot in their scopes."""
        return tuple(constraint for parent in self.parents for constraint in parent.constraints)

    @cached_property
    def symbol_table(self) -> tuple[str, ...]:
        """The names of the team's symbols: the value 2 means the symbol at index 2."""
        return next((one.domain.symbols for one in self.variables if one.domain.symbols), self.symbols)

    @cached_property
    def interface(self) -> tuple[str, ...]:
        """The interface variables, which neighbours see, in the order of `variables`."""
        parts = (constraint for child in self.children for constraint in child.constraints)
        seen = {name for constraint in (*self.shared, *parts) for name in constraint.variables}
        seen.update(name for child in self.children for name in child.variables)
        seen.update(self.shown)
        return tuple(variable.name for variable in self.variables if variable.name in seen)


@dataclass(frozen=True)
class RemoveAgent:
    """The robot leaves, with its variables. Its shared constraints are restated or dropped (`model/absence.py`)."""

    name: str


@dataclass(frozen=True)
class AddAgent:
    """A robot joins with the lowest priority. It has parents only."""

    robot: Robot


@dataclass(frozen=True)
class RemoveValue:
    """A variable loses a value of its domain."""

    variable: str
    value: int


@dataclass(frozen=True)
class AddValue:
    """A variable's domain gains a value."""

    variable: str
    value: int


@dataclass(frozen=True)
class AddConstraint:
    """`agent` and `parent` share another constraint."""

    agent: str
    parent: str
    constraint: Constraint


@dataclass(frozen=True)
class RemoveConstraint:
    """All constraints called `name` shared by `agent` and `parent` are removed."""

    agent: str
    parent: str
    name: str


Change = RemoveAgent | AddAgent | RemoveValue | AddValue | AddConstraint | RemoveConstraint


@dataclass(frozen=True)
class ScenarioEvent:
    """An event in a scenario: changes that happen together. Each event opens an epoch.

    Attributes:
        changes: The changes, in the order in which they are applied.
        after: The number of messages in the previous epoch after which the event happens. If None, or if there are
            fewer messages, it happens when the previous epoch is solved.
    """

    changes: tuple[Change, ...]
    after: int | None = None


@dataclass(frozen=True)
class Team:
    """The robots of one problem, in priority order (highest first).

    Attributes:
        name: The team's name.
        robots: The robots.
        scenario: The changes of the problem over time. A team with events is a DDisCSP, with the scenario as its delta.
        dropped: Constraints that were dropped because robots left (`model/absence.py`).
    """

    name: str
    robots: tuple[Robot, ...]
    scenario: tuple[ScenarioEvent, ...] = ()
    dropped: tuple[DroppedConstraint, ...] = field(default=(), compare=False, repr=False)

    def __repr__(self) -> str:
        return f"<team {self.name}: {counted(len(self.robots), 'robot')}>"

    def _repr_html_(self) -> str:
        html: str = import_module("robochoc.modelling.team_html").team_html(self)  # by name: the model needs no HTML
        return html

    @cached_property
    def _by_name(self) -> dict[str, Robot]:
        return {robot.name: robot for robot in self.robots}

    def __getitem__(self, name: str) -> Robot:
        return self._by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def get(self, name: str) -> Robot | None:
        """Return the robot called `name`, or None if the team has no such robot."""
        return self._by_name.get(name)

    @property
    def dynamic(self) -> bool:
        """Return whether a scenario changes the problem over time."""
        return bool(self.scenario)

    @property
    def kind(self) -> ProblemKind:
        """The kind of problem, the same for all robots. Without robots it is a DisCSP."""
        return self.robots[0].kind if self.robots else ProblemKind.DISCSP

    @property
    def objectives(self) -> tuple[str, ...]:
        """The names of the objectives, the same for all robots. Empty: the team has a single cost, or none."""
        return self.robots[0].objectives if self.robots else ()

    @cached_property
    def user_units(self) -> CostUnits:
        """The user's units of costs, for a normalised team (`model/costs.py`)."""
        return common_units(robot.user_units for robot in self.robots)

    @cached_property
    def order(self) -> tuple[str, ...]:
        """The total priority order: the robots' names, highest priority first."""
        return tuple(robot.name for robot in self.robots)

    @cached_property
    def owner(self) -> dict[str, str]:
        """psi: the robot that owns each variable."""
        return {variable.name: robot.name for robot in self.robots for variable in robot.variables}

    @cached_property
    def variables(self) -> dict[str, Variable]:
        """X, by name, in priority order."""
        return {variable.name: variable for robot in self.robots for variable in robot.variables}

    def constraints(self) -> Iterator[Constraint]:
        """Yield C: every constraint of every robot, and the parts of partially known ones."""
        for robot in self.robots:
            yield from robot.constraints()
