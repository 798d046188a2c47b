"""Variables with their domains, and constraints as data: in extension, and in intension (predicates, functions).

Costs are integers in the unit of their robot's `CostUnits` (`model/costs.py`), or `INFINITE` for violated hard
constraints, whether the sum is minimised or maximised. Costs may be negative; protocols get normalised costs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from enum import StrEnum
from functools import cached_property
from typing import assert_never

from robochoc.model.expression import Constant, Expression, Name, UndefinedValueError, evaluate, with_arguments
from robochoc.model.real import RealInterval, RealParameters
from robochoc.system.lazy_dataclass import dataclass

Assignment = Mapping[str, int]
"""Values of variables, by name."""

Term = str | int
"""A term of a scope: a variable's name or an integer constant (Figure 2 writes `V1.1 V3.1 1 3`)."""

INFINITE = math.inf
"""The cost of violating a hard constraint."""


class ConstraintModel(StrEnum):
    """The distribution of knowledge about shared constraints (Brito and Meseguer, CP 2003).

    Totally known (TKC): the holder knows the whole constraint. Partially known (PKC): each robot knows its own part.
    """

    TKC = "TKC"
    PKC = "PKC"


class WhenAbsent(StrEnum):
    """The meaning of a constraint when one of its robots is absent, if its author has chosen one (`model/absence.py`).

    The constraint is restated for the remaining robots, dropped, or counted as violated.
    """

    RESTATE = "restate"
    DROP = "drop"
    FAIL = "fail"


class Semantics(StrEnum):
    """The meaning of a relation's tuples: they are allowed (supports), forbidden (conflicts), or have a cost (soft)."""

    SUPPORTS = "supports"
    CONFLICTS = "conflicts"
    SOFT = "soft"


@dataclass(frozen=True)
class Domain:
    """A finite set of integers, as disjoint ascending ranges.

    Adjacent ranges are merged, so that equal sets are equal domains.

    Attributes:
        name: Its name.
        ranges: The values.
        symbols: The names of all symbols of the team, if the domain is symbolic: the value 2 means `symbols[2]`. All
            symbolic domains of a team have the same `symbols`, so that equal values have equal names.
        real: The interval, if the values are real numbers. The values are then numbers of steps (`model/real.py`).
    """

    name: str
    ranges: tuple[range, ...]
    symbols: tuple[str, ...] = ()
    real: RealInterval | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", merge_ranges(self.ranges))

    def __iter__(self) -> Iterator[int]:
        for part in self.ranges:
            yield from part

    def __len__(self) -> int:
        return sum(len(part) for part in self.ranges)

    def __contains__(self, value: object) -> bool:
        return any(value in part for part in self.ranges)

    @property
    def possible(self) -> Domain | range:
        """The values that a robot may choose: those of the domain, or all steps of its interval (`any_step`)."""
        return range(self.real.low, self.real.high + 1) if self.real and self.real.any_step else self

    def label(self, value: int) -> float | str:
        """Return `value`, its name if the domain is symbolic, or its number if the domain is real."""
        if self.real is not None:
            return self.real.number(value)
        return self.symbols[value] if 0 <= value < len(self.symbols) else value


@dataclass(frozen=True)
class Variable:
    """A decision of the robot that owns it. Names are unique in a team."""

    name: str
    domain: Domain


@dataclass(frozen=True)
class Relation:
    """The definition of a constraint in extension: tuples of integers.

    Attributes:
        name: Its name.
        arity: The length of each tuple.
        semantics: The meaning of the tuples.
        tuples: The tuples.
        costs: The cost of each tuple. Empty unless the semantics is `soft`.
        default_cost: The cost of tuples not listed in a soft relation.
        symbolic: The columns that contain symbols.
    """

    name: str
    arity: int
    semantics: Semantics
    tuples: tuple[tuple[int, ...], ...]
    costs: tuple[float, ...] = ()
    default_cost: float = 0
    symbolic: tuple[int, ...] = ()

    @cached_property
    def _listed(self) -> dict[tuple[int, ...], float]:
        if self.semantics == Semantics.SOFT:
            return dict(zip(self.tuples, self.costs, strict=True))
        return dict.fromkeys(self.tuples, 0 if self.semantics == Semantics.SUPPORTS else INFINITE)

    @property
    def prices(self) -> tuple[Mapping[tuple[int, ...], float], float]:
        """The costs of the listed tuples, and the cost of all others: 0 or `INFINITE` unless the relation is soft."""
        match self.semantics:
            case Semantics.SUPPORTS:
                return self._listed, INFINITE
            case Semantics.CONFLICTS:
                return self._listed, 0
            case Semantics.SOFT:
                return self._listed, self.default_cost

    @cached_property
    def finite_costs(self) -> tuple[float, float]:
        """The smallest and the largest finite cost of a tuple; 0 and 0 if there is none."""
        finite = [cost for cost in {*self.costs, self.default_cost} if cost < INFINITE] or [0]
        return min(finite), max(finite)

    def cost(self, values: Sequence[int]) -> float:
        """Return the cost of the tuple `values`: 0 or `INFINITE` unless the relation is soft."""
        listed, other = self.prices
        return listed.get(tuple(values), other)


@dataclass(frozen=True)
class Predicate:
    """The definition of a constraint in intension: a Boolean expression over formal `parameters`.

    Parameters are integers. Those in `symbolic`, and constants compared with them, are symbols. Those in `real` are
    real numbers, and the body is over their steps.
    """

    name: str
    parameters: tuple[str, ...]
    body: Expression
    symbolic: tuple[str, ...] = ()
    real: RealParameters | None = None

    def holds(self, arguments: Sequence[int]) -> bool:
        """Return whether the body is true for `arguments`. An undefined value (division by zero) counts as false."""
        try:
            return bool(evaluate(self.body, dict(zip(self.parameters, arguments, strict=True))))
        except UndefinedValueError:
            return False


@dataclass(frozen=True)
class GlobalPredicate(Predicate):
    """A global constraint of XCSP 2.1, with an equivalent body (`formats/global_constraints.py` creates both).

    Attributes:
        form: The parameters in XCSP 2.1, with formal parameters for variables: `[ { 1 X0 } { -1 X1 } ] <le/> 3`.
    """

    form: str = ""


@dataclass(frozen=True)
class Function:
    """The definition of a cost function in intension: an integer expression over `parameters`, whose value is the cost.

    The value is in units of 10**-`places` of the user's unit, whatever `CostUnits.places` is. As in predicates,
    parameters in `symbolic` are symbols, and those in `real` are real numbers.
    """

    name: str
    parameters: tuple[str, ...]
    body: Expression
    symbolic: tuple[str, ...] = ()
    real: RealParameters | None = None
    places: int = 0

    def cost(self, arguments: Sequence[int]) -> float:
        """Return the cost of `arguments`: `INFINITE` if the value is undefined (division by zero)."""
        try:
            return evaluate(self.body, dict(zip(self.parameters, arguments, strict=True)))
        except UndefinedValueError:
            return INFINITE


Definition = Relation | Predicate | Function
"""The definition of a constraint."""


@dataclass(frozen=True)
class Constraint:
    """A relation, predicate or function, applied to a scope of variables and integer constants.

    Attributes:
        name: The name, which need not be unique: Figure 2 calls every constraint `C5`.
        definition: The relation, predicate or function.
        scope: The variables and constants.
        parameters: The actual parameters of a predicate. For a relation they equal `scope`.
        model: The distribution of knowledge about a shared constraint. None: the constraint is private.
        cost: The cost of violating a predicate, in a DisWCSP. `INFINITE`: a hard constraint.
        line: The line in the file from which the constraint was read.
        offset: The number subtracted from each cost of the constraint, so that no cost is negative (`model/costs.py`).
        when_absent: The meaning when a robot is absent. None: the form of the constraint determines it.
        objective: The objective to which the costs belong, in a team with several objectives. Empty: there is one.
        original: The original form of a constraint that was restated for the remaining robots.
        absent: The variables of `original` whose robots are absent.
        robots: The robots of `original`, in priority order, if some of them have left the team.
    """

    name: str
    definition: Definition
    scope: tuple[Term, ...]
    parameters: tuple[Term, ...]
    model: ConstraintModel | None = ConstraintModel.TKC
    cost: float = INFINITE
    line: int = field(default=0, compare=False)
    offset: int = 0
    when_absent: WhenAbsent | None = None
    objective: str = ""
    original: Constraint | None = field(default=None, compare=False, repr=False)
    absent: tuple[str, ...] = field(default=(), compare=False, repr=False)
    robots: tuple[str, ...] = field(default=(), compare=False, repr=False)

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The distinct variables of the scope, in its order."""
        return tuple(dict.fromkeys([term for term in self.scope if isinstance(term, str)]))

    @property
    def has_costs(self) -> bool:
        """True if the constraint is a soft relation, a function, or a predicate with a finite cost."""
        match self.definition:
            case Relation(semantics=semantics):
                return semantics == Semantics.SOFT
            case Predicate():
                return self.cost < INFINITE
            case Function():
                return True
            case never:
                assert_never(never)

    @property
    def is_hard(self) -> bool:
        """True if some values violate the constraint by its definition. A function may also be undefined."""
        match self.definition:
            case Predicate():
                return self.cost == INFINITE
            case Relation() as relation:
                return relation.semantics != Semantics.SOFT or INFINITE in {relation.default_cost, *relation.costs}
            case Function():
                return False
            case never:
                assert_never(never)

    @property
    def applied(self) -> Expression:
        """The body of the predicate or function, over the constraint's variables.

        Raises:
            TypeError: if the constraint is a relation, which has no body.
        """
        if isinstance(self.definition, Relation):
            raise TypeError("a relation has no body")
        terms = (Name(term) if isinstance(term, str) else Constant(term) for term in self.parameters)
        return with_arguments(self.definition.body, dict(zip(self.definition.parameters, terms, strict=True)))

    def price(self, assignment: Assignment) -> float:
        """Return the cost of `assignment`, which must contain the scope. 0: the constraint is satisfied."""
        values = [assignment[term] if isinstance(term, str) else term for term in self.parameters]
        if isinstance(self.definition, Predicate):
            return 0 if self.definition.holds(values) else self.cost
        return self.definition.cost(values)

    def allows(self, assignment: Assignment) -> bool:
        """Return whether the cost of `assignment` is finite."""
        return self.price(assignment) < INFINITE


def merge_ranges(ranges: tuple[range, ...]) -> tuple[range, ...]:
    """Return `ranges` with adjacent ranges merged. Invalid ranges (overlapping, empty, with a step) stay unchanged."""
    together: list[range] = []
    for part in ranges:
        before = together[-1] if together else range(0)
        if before and part and before.step == part.step == 1 and before.stop == part.start:
            together[-1] = range(before.start, part.stop)
        else:
            together.append(part)
    return ranges if len(together) == len(ranges) else tuple(together)


def united_ranges(ranges: Iterable[range]) -> tuple[range, ...]:
    """Return the disjoint ascending ranges of all integers in `ranges`, which have no step and may overlap."""
    together: list[range] = []
    for part in sorted(filter(None, ranges), key=lambda one: one.start):
        if together and part.start <= together[-1].stop:
            together[-1] = range(together[-1].start, max(together[-1].stop, part.stop))
        else:
            together.append(part)
    return tuple(together)


def nameless(known: object) -> object:
    """Return `known` with an unnamed definition if it is a constraint, for comparisons that must ignore the name."""
    return replace(known, definition=replace(known.definition, name="")) if isinstance(known, Constraint) else known
