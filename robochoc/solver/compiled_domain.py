"""Compiled domains: all local solutions of a robot, grouped by the values of its interface variables.

Paper, Section 4.1: a complex agent "can easily address and solve its local sub-problem and use solutions as a compiled
domain". Neighbours see only the interface variables, so local solutions that agree on these variables are one value; a
representative and the number of solutions are stored for each value.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

from robochoc.model.problem import Constraint, Domain, Robot, Value, Variable
from robochoc.solver.encoding import Codes, Component, Cost, Network, components, cost_function, is_soft
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

MAX_SOLUTIONS = 100_000
"""The default maximum number of local solutions of a robot."""

MAX_SHARED_VALUES = 256
"""The maximum number of local solutions of a robot that shares its compiled domain with equal robots."""

SolveNetwork = Callable[[Network], Iterable[Sequence[int]]]
"""Returns all solutions of a network with several variables, as codes; for example `AceProcess` in `solver/ace.py`."""


class TooManySolutionsError(RobochocError):
    """The robot has more local solutions, or values, than the limit."""

    def __init__(self, robot: str, limit: int) -> None:
        super().__init__(
            f"{robot} has more than {limit:,} local solutions; increase --local-solutions, or constrain its"
            " variables more"
        )
        self.robot = robot


@dataclass(frozen=True)
class CompiledDomain:
    """The values of a robot that its neighbours see.

    Attributes:
        variables: The names of all variables.
        values: The values of the interface variables, for each value of the robot.
        solutions: For each value, the values of `variables` in the cheapest local solution (the lexicographically first
            one).
        counts: The number of local solutions of each value.
        costs: The private cost of the cheapest local solution of each value.
        cheapest: The number of cheapest local solutions of each value.
    """

    variables: tuple[str, ...]
    values: tuple[tuple[int, ...], ...]
    solutions: tuple[tuple[int, ...], ...]
    counts: tuple[int, ...]
    costs: tuple[Cost, ...]
    cheapest: tuple[int, ...]

    @property
    def total(self) -> int:
        """The number of local solutions."""
        return sum(self.counts)

    def solution(self, index: int) -> dict[str, int]:
        """Return the values of all variables for the value at `index`; none for the last index, withdrawal."""
        return {} if index == len(self.values) else dict(zip(self.variables, self.solutions[index], strict=True))

    def behind(self, value: Value) -> dict[str, int]:
        """Return the values of all variables for an interface value. An unknown value means withdrawal."""
        return self.solution(self.values.index(value) if value in self.values else len(self.values))


@dataclass
class _Group:
    """Local solutions with the same interface values: the first of the cheapest, its cost, and their numbers."""

    solution: tuple[int, ...]
    cost: Cost
    count: int = 0
    cheapest: int = 0

    def add(self, solution: tuple[int, ...], cost: Cost) -> None:
        self.count += 1
        self.cheapest = (self.cheapest if cost >= self.cost else 0) + (cost <= self.cost)
        self.cost, self.solution = min((self.cost, self.solution), (cost, solution))


def compile_domain(robot: Robot, solve: SolveNetwork | None = None, limit: int = MAX_SOLUTIONS) -> CompiledDomain:
    """Return the compiled domain of `robot`, with values in the order of its variables and their values.

    Args:
        robot: The robot.
        solve: Returns all solutions of a network. Called for variables that private constraints connect.
        limit: The maximum number of local solutions.

    Raises:
        TooManySolutionsError: if there are more local solutions.
        UnsupportedError: if a network must be solved, and `solve` is missing.
    """
    if not robot.private and math.prod([len(one.domain) for one in robot.variables]) <= min(limit, MAX_SHARED_VALUES):
        names = tuple([variable.name for variable in robot.variables])
        shown = set(robot.interface)
        ranges = tuple([variable.domain.ranges for variable in robot.variables])
        return replace(_unconstrained_domain(ranges, tuple([name in shown for name in names])), variables=names)
    return _compiled(robot.name, robot.variables, robot.private, robot.interface, solve, limit)


@lru_cache(maxsize=64)
def _unconstrained_domain(domains: tuple[tuple[range, ...], ...], shown: tuple[bool, ...]) -> CompiledDomain:
    """Return the compiled domain of a robot without private constraints. In large teams, many robots share it."""
    variables = [Variable(str(number), Domain("", ranges)) for number, ranges in enumerate(domains)]
    interface = [variable.name for variable, is_shown in zip(variables, shown, strict=True) if is_shown]
    return _compiled("", variables, (), interface, None, MAX_SHARED_VALUES)


def _compiled(
    name: str,
    variables: Sequence[Variable],
    private: Sequence[Constraint],
    interface: Sequence[str],
    solve: SolveNetwork | None,
    limit: int,
) -> CompiledDomain:
    soft = [constraint for constraint in private if is_soft(constraint)]
    parts = components(variables, private, [constraint.variables for constraint in soft])
    if any(part.network.impossible for part in parts):
        return CompiledDomain(tuple(variable.name for variable in variables), (), (), (), (), ())
    seen = set(interface)
    paid = [[one for one in soft if _is_paid_in(one, part, parts[0])] for part in parts]
    grouped = [
        _grouped(part, seen, charged, _solutions(name, part, solve, limit))
        for part, charged in zip(parts, paid, strict=True)
    ]
    if math.prod(len(groups) for groups in grouped) > limit:
        raise TooManySolutionsError(name, limit)
    return _joined([one.name for one in variables], seen, [part.names for part in parts], grouped)


def _solutions(robot: str, part: Component, solve: SolveNetwork | None, limit: int) -> Iterable[Sequence[int]]:
    if not part.network.tables:
        if math.prod(map(len, part.network.domains)) > limit:
            raise TooManySolutionsError(robot, limit)
        return itertools.product(*part.network.domains)
    if solve is None:
        raise UnsupportedError(
            f"{robot} has private constraints among its variables, which require a solver to compile them"
        )
    return solve(part.network)


def _is_paid_in(constraint: Constraint, part: Component, first: Component) -> bool:
    """Return whether `constraint` is on variables in `part`; constraints on constants only belong to the `first`."""
    return part is first if not constraint.variables else constraint.variables[0] in part.names


def _grouped(
    part: Component, seen: set[str], soft: Iterable[Constraint], solutions: Iterable[Sequence[int]]
) -> list[_Group]:
    """Return the solutions of one component, grouped by the values of its variables in `seen`."""
    shown = [place for place, name in enumerate(part.names) if name in seen]
    prices = [cost_function(constraint, part.names) for constraint in soft]
    groups: dict[Codes, _Group] = {}
    for codes in solutions:
        solution = part.decoded(codes)
        cost = sum(price(solution) for price in prices)
        group = groups.setdefault(tuple([solution[place] for place in shown]), _Group(solution, cost))
        group.add(solution, cost)
    return list(groups.values())


def _joined(
    variables: Sequence[str], seen: Container[str], names: Sequence[Sequence[str]], grouped: Sequence[Sequence[_Group]]
) -> CompiledDomain:
    """Return the compiled domain with all combinations of the components' groups."""
    place = {name: index for index, name in enumerate(itertools.chain.from_iterable(names))}
    order = [place[name] for name in variables]
    shown = [index for index, name in enumerate(variables) if name in seen]
    found = []
    for combination in itertools.product(*grouped):
        flat = tuple(itertools.chain.from_iterable(group.solution for group in combination))
        solution = tuple([flat[index] for index in order])
        count = math.prod(group.count for group in combination)
        cheapest = math.prod(group.cheapest for group in combination)
        found.append((solution, count, sum(group.cost for group in combination), cheapest))
    found.sort()
    return CompiledDomain(
        variables=tuple(variables),
        values=tuple(tuple([solution[index] for index in shown]) for solution, *_ in found),
        solutions=tuple(solution for solution, *_ in found),
        counts=tuple(count for _, count, _, _ in found),
        costs=tuple(cost for _, _, cost, _ in found),
        cheapest=tuple(cheapest for *_, cheapest in found),
    )
