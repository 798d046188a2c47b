"""The problem a team solves, as data: the paper's tuple (A, X, D, C, psi) (Section 3.1).

A :class:`Team` is a set of :class:`Robot` objects (A); each owns variables (X) with domains (D), which is
psi; constraints (C) are *private* to a robot or *shared* between robots. Nothing here reads, writes, sends or
searches: `formats` makes these objects from XML, `solver` compiles them, `protocols` see only what was compiled.

Values are integers. Costs are integers or :data:`INFINITE`; a broken hard constraint costs `INFINITE`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

from robochoc.model.expression import Expression, UndefinedValueError, evaluate
from robochoc.model.ranges import merge_ranges

Assignment = Mapping[str, int]
"""Values of variables, by name."""

Term = str | int
"""What may stand in a scope: a variable's name or an integer constant (Figure 2 writes `V1.1 V3.1 1 3`)."""

INFINITE = math.inf
"""The cost of breaking a hard constraint."""


class ProblemKind(StrEnum):
    """What a team minimises: nothing (satisfaction), or the sum of costs."""

    DISCSP = "DisCSP"
    DISWCSP = "DisWCSP"


class ConstraintModel(StrEnum):
    """Who knows a shared constraint (Brito and Meseguer, CP 2003): all of it, or each robot its part."""

    TKC = "TKC"
    PKC = "PKC"


class Semantics(StrEnum):
    """What the tuples of a relation are: the allowed ones, the forbidden ones, or the ones with a cost."""

    SUPPORTS = "supports"
    CONFLICTS = "conflicts"
    SOFT = "soft"


@dataclass(frozen=True)
class Domain:
    """A finite set of integers, kept as disjoint ascending ranges so that a large one costs nothing.

    Ranges that follow one another without a gap become one: equal sets are equal domains, however they are written.
    """

    name: str
    ranges: tuple[range, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", merge_ranges(self.ranges))

    def __iter__(self) -> Iterator[int]:
        for part in self.ranges:
            yield from part

    def __len__(self) -> int:
        return sum(len(part) for part in self.ranges)

    def __contains__(self, value: object) -> bool:
        return any(value in part for part in self.ranges)


@dataclass(frozen=True)
class Variable:
    """A decision of the robot that owns it. Names are unique in a team."""

    name: str
    domain: Domain


@dataclass(frozen=True)
class Relation:
    """A constraint's meaning in extension: tuples of `arity` integers.

    `costs` runs parallel to `tuples` and is empty unless the semantics is `soft`; tuples that a soft relation
    does not list cost `default_cost`.
    """

    name: str
    arity: int
    semantics: Semantics
    tuples: tuple[tuple[int, ...], ...]
    costs: tuple[float, ...] = ()
    default_cost: float = 0

    @cached_property
    def _listed(self) -> dict[tuple[int, ...], float]:
        if self.semantics is Semantics.SOFT:
            return dict(zip(self.tuples, self.costs, strict=True))
        return dict.fromkeys(self.tuples, 0 if self.semantics is Semantics.SUPPORTS else INFINITE)

    def cost(self, values: Sequence[int]) -> float:
        """What the tuple `values` costs: 0 or `INFINITE` unless the relation is soft."""
        listed = self._listed.get(tuple(values))
        if listed is not None:
            return listed
        match self.semantics:
            case Semantics.SUPPORTS:
                return INFINITE
            case Semantics.CONFLICTS:
                return 0
            case Semantics.SOFT:
                return self.default_cost


@dataclass(frozen=True)
class Predicate:
    """A constraint's meaning in intension: a Boolean expression over formal `parameters` (all integers)."""

    name: str
    parameters: tuple[str, ...]
    body: Expression

    def holds(self, arguments: Sequence[int]) -> bool:
        """Whether the body is true of `arguments`; an undefined body (division by zero) is not."""
        try:
            return bool(evaluate(self.body, dict(zip(self.parameters, arguments, strict=True))))
        except UndefinedValueError:
            return False


@dataclass(frozen=True)
class Constraint:
    """A relation or predicate applied to a scope of variables and integer constants.

    `parameters` is what a predicate's formal parameters receive; for a relation it equals `scope`.
    `cost` is what breaking a predicate costs (a `DisWCSP`'s; `INFINITE`: a hard constraint).
    Names need not be unique: Figure 2 calls every constraint `C5`.
    """

    name: str
    definition: Relation | Predicate
    scope: tuple[Term, ...]
    parameters: tuple[Term, ...]
    model: ConstraintModel | None = ConstraintModel.TKC
    cost: float = INFINITE
    line: int = field(default=0, compare=False)

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The distinct variables of the scope, in its order."""
        return tuple(dict.fromkeys(term for term in self.scope if isinstance(term, str)))

    def price(self, assignment: Assignment) -> float:
        """What `assignment` (of at least the scope's variables) pays here: 0 where the constraint holds."""
        values = [assignment[term] if isinstance(term, str) else term for term in self.parameters]
        if isinstance(self.definition, Relation):
            return self.definition.cost(values)
        return 0 if self.definition.holds(values) else self.cost

    def allows(self, assignment: Assignment) -> bool:
        """Whether `assignment` does not break this constraint; a soft one it may pay for."""
        return self.price(assignment) < INFINITE


@dataclass(frozen=True)
class Topic:
    """Where a robot's decision is published (ROS Layer Unit); x, y and z say where it sends the robot."""

    name: str
    type: str = "geometry_msgs/PoseStamped"
    x: Expression | None = None
    y: Expression | None = None
    z: Expression | None = None


@dataclass(frozen=True)
class Parent:
    """A neighbour of higher priority, and the constraints shared with it that this robot holds."""

    name: str
    constraints: tuple[Constraint, ...] = ()
    line: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Child:
    """A neighbour of lower priority: the own variables it must be told, and this robot's part of PKCs.

    `copies` are TKC constraints that the child holds, and this robot's file repeats. Across machines the robot holds
    the answer against them too; nobody else asks for them, they are no part of what makes two robots equal, and no
    file is written with them.
    """

    name: str
    variables: tuple[str, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    line: int = field(default=0, compare=False)
    copies: tuple[Constraint, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Robot:
    """One agent: all that its own file says, and so all that it knows."""

    name: str
    variables: tuple[Variable, ...]
    kind: ProblemKind = ProblemKind.DISCSP
    private: tuple[Constraint, ...] = ()
    parents: tuple[Parent, ...] = ()
    children: tuple[Child, ...] = ()
    topics: tuple[Topic, ...] = ()
    file: str = field(default="", compare=False)
    shown: tuple[str, ...] = ()
    """Own variables that neighbours see though nothing here says so: a parent's part of a PKC looks at them."""
    weight: int = 1
    """What it counts when as few robots as possible are to step aside: one of weight 3 as much as three of 1."""

    @cached_property
    def shared(self) -> tuple[Constraint, ...]:
        """The constraints this robot holds towards its parents: it is the lowest of each one's scope."""
        return tuple(constraint for parent in self.parents for constraint in parent.constraints)

    @cached_property
    def interface(self) -> tuple[str, ...]:
        """The own variables that neighbours see: those in shared constraints, in the order of `variables`."""
        parts = (constraint for child in self.children for constraint in child.constraints)
        seen = {name for constraint in (*self.shared, *parts) for name in constraint.variables}
        seen.update(name for child in self.children for name in child.variables)
        seen.update(self.shown)
        return tuple(variable.name for variable in self.variables if variable.name in seen)


@dataclass(frozen=True)
class RemoveAgent:
    """The robot leaves, with its variables and every constraint it shares."""

    name: str


@dataclass(frozen=True)
class AddAgent:
    """A robot comes, with the lowest priority: it names parents only."""

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
    """`agent` shares another constraint with `parent` from now on."""

    agent: str
    parent: str
    constraint: Constraint


@dataclass(frozen=True)
class RemoveConstraint:
    """All constraints called `name` that `agent` shares with `parent` go."""

    agent: str
    parent: str
    name: str


Change = RemoveAgent | AddAgent | RemoveValue | AddValue | AddConstraint | RemoveConstraint


@dataclass(frozen=True)
class ScenarioEvent:
    """Changes that happen together, one after the other; they open an epoch.

    `after` so many messages of the epoch before (None, or if there are not so many: once that is solved).
    """

    changes: tuple[Change, ...]
    after: int | None = None


@dataclass(frozen=True)
class Team:
    """Robots that belong together, in priority order (the highest first)."""

    name: str
    robots: tuple[Robot, ...]
    scenario: tuple[ScenarioEvent, ...] = ()
    """How the problem changes over time: then it is a DDisCSP, and this its function delta."""

    @cached_property
    def _by_name(self) -> dict[str, Robot]:
        return {robot.name: robot for robot in self.robots}

    def __getitem__(self, name: str) -> Robot:
        return self._by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def get(self, name: str) -> Robot | None:
        """The robot called `name`, if it is in the team."""
        return self._by_name.get(name)

    @property
    def dynamic(self) -> bool:
        """Whether a scenario changes the problem over time."""
        return bool(self.scenario)

    @property
    def kind(self) -> ProblemKind:
        """A team with costs is a DisWCSP as a whole; one that all have left is a DisCSP."""
        return self.robots[0].kind if self.robots else ProblemKind.DISCSP

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
        """C: every constraint of every file, the parts of partially known ones included."""
        for robot in self.robots:
            yield from robot.private
            yield from robot.shared
            for child in robot.children:
                yield from child.constraints
