"""Compiled domains: a robot's local problem as protocols see it.

Paper, Section 4.1: a complex agent "can easily address and solve its local sub-problem and use solutions as a
compiled domain". So every robot is one variable to a protocol. Its values are the local solutions, seen from the
interface variables that neighbours know; the constraints it checks are those shared with its parents.

Constraint checks are counted here, and only here: one check is one evaluation of one shared constraint for one
value of the own domain (Meisels, Kaplansky, Razgon and Zivan 2002). Private constraints are settled once, when
the domain is compiled, and are not counted; nor are look-ups of nogoods.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from robochoc.expression import Undefined, compiled
from robochoc.message import Value
from robochoc.problem import INFINITE, Constraint, Predicate, Robot, Team

Interfaces = Mapping[str, tuple[str, ...]]
"""The variables that each robot shows to its neighbours, by the robot's name."""


class Unsupported(Exception):  # noqa: N818 - it is an answer, not a fault
    """The problem is well-formed, and this version (or this protocol) cannot take it; says why and what can."""


class LocalProblem:
    """What one robot knows: its compiled domain, its neighbours, and the constraints it has to check.

    `values[i]` is the i-th value as neighbours see it; `solution(i)` are the own variables' values behind it.
    `parents` and `children` are in priority order. `checks` counts constraint checks so far.
    """

    def __init__(self, robot: Robot, order: Sequence[str], interfaces: Interfaces) -> None:
        check_supported(robot)
        rank = {name: place for place, name in enumerate(order)}
        self.agent = robot.name
        self.parents = tuple(sorted((parent.name for parent in robot.parents), key=rank.__getitem__))
        self.children = tuple(sorted((child.name for child in robot.children), key=rank.__getitem__))
        self._solutions = _local_solutions(robot)
        seen = robot.interface
        self.values: tuple[Value, ...] = tuple(tuple(own[name] for name in seen) for own in self._solutions)
        if not seen:  # nobody looks: the local solutions are all alike, and one of them will do
            self.values = self.values[:1]
        self._constraints = _by_lowest_agent(
            [_SharedConstraint(constraint, self, robot, rank, interfaces) for constraint in robot.shared], rank
        )
        self.checks = 0

    def solution(self, index: int) -> dict[str, int]:
        """Values of all own variables when the compiled variable takes `values[index]`."""
        return dict(self._solutions[index])

    def conflict(self, index: int, view: Mapping[str, Value]) -> dict[str, Value] | None:
        """Why `values[index]` is against `view`: the assignments of the first constraint it breaks, or None.

        Constraints whose other robots are not all in `view` are passed over. The order is that of their lowest
        robot, the highest first, so the first conflict is also the one with the highest possible lowest variable.
        """
        for constraint in self._constraints:
            others = constraint.others(view)
            if others is None:
                continue
            self.checks += 1
            if not constraint.allowed(others) >> index & 1:
                return dict(zip(constraint.agents, others, strict=True))
        return None


class _SharedConstraint:
    """A constraint on the own compiled variable and those of `agents`, as bit masks over the own domain."""

    def __init__(
        self, constraint: Constraint, problem: LocalProblem, robot: Robot, rank: Mapping[str, int], known: Interfaces
    ) -> None:
        scope = set(constraint.variables)
        above = (parent.name for parent in robot.parents if scope.intersection(known[parent.name]))
        self.agents = tuple(sorted(above, key=rank.__getitem__))
        self._own = problem.values
        self._holds = _compiled_test(
            constraint, [*(name for agent in self.agents for name in known[agent]), *robot.interface]
        )
        self._masks: dict[tuple[Value, ...], int] = {}

    def others(self, view: Mapping[str, Value]) -> tuple[Value, ...] | None:
        """The values of `agents` in `view`; None as long as one of them is unknown."""
        try:
            return tuple([view[agent] for agent in self.agents])
        except KeyError:
            return None

    def allowed(self, others: tuple[Value, ...]) -> int:
        """The own values that go with `others`: bit i for the i-th. Made at the first look, then kept."""
        mask = self._masks.get(others)
        if mask is None:
            given = tuple(part for value in others for part in value)
            mask = sum(1 << index for index, own in enumerate(self._own) if self._holds((*given, *own)))
            self._masks[others] = mask
        return mask


def check_supported(robot: Robot) -> None:
    """Raise `Unsupported` when `robot`'s local problem is more than this version can compile."""
    if len(robot.variables) > 1:
        raise Unsupported(
            f"{robot.name} has {len(robot.variables)} variables; this version solves teams of robots with one variable"
            " each (compiled domains of complex robots are the next step)"
        )


def interfaces(team: Team) -> dict[str, tuple[str, ...]]:
    """What every robot of `team` shows to its neighbours."""
    return {robot.name: robot.interface for robot in team.robots}


def _local_solutions(robot: Robot) -> list[dict[str, int]]:
    """All assignments of the (one) variable that the private constraints allow, in domain order."""
    tests = [
        _compiled_test(constraint, [variable.name for variable in robot.variables]) for constraint in robot.private
    ]
    (variable,) = robot.variables
    return [{variable.name: value} for value in variable.domain if all(test((value,)) for test in tests)]


def _compiled_test(constraint: Constraint, names: Sequence[str]) -> Callable[[Sequence[int]], bool]:
    """`constraint` as a test of the values of the variables `names`."""
    place = {name: index for index, name in enumerate(names)}
    terms = [(place[term], 0) if isinstance(term, str) else (None, term) for term in constraint.parameters]

    def arguments(values: Sequence[int]) -> list[int]:
        return [constant if index is None else values[index] for index, constant in terms]

    definition = constraint.definition
    if not isinstance(definition, Predicate):
        return lambda values: definition.cost(arguments(values)) < INFINITE
    if constraint.cost < INFINITE:
        return lambda values: True  # noqa: ARG005 - a soft predicate forbids nothing
    body = compiled(definition.body, definition.parameters)

    def holds(values: Sequence[int]) -> bool:
        try:
            return bool(body(arguments(values)))
        except Undefined:
            return False

    return holds


def _by_lowest_agent(constraints: list[_SharedConstraint], rank: Mapping[str, int]) -> tuple[_SharedConstraint, ...]:
    return tuple(
        sorted(constraints, key=lambda c: (max((rank[agent] for agent in c.agents), default=-1), len(c.agents)))
    )
