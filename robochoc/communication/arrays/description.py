"""The description of a team by arrays, before its layout for a run. Robots are numbers, in priority order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from robochoc.communication.arrays.array_types import Floats, Integers
from robochoc.protocols.message import Value, encode
from robochoc.protocols.shared.cycles import Domain
from robochoc.protocols.shared.cycles import Value as ValueMessage
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class KnownConstraints:
    """Constraints whose tables have the same shape, each as known by one of its robots.

    Attributes:
        owners: The robot that knows each constraint.
        others: The other robots in each scope, one column per robot, highest first.
        tables: Distinct tables of costs: one axis for each of the others, then one for the owner's values. `inf` means
            forbidden.
        which: The index of each constraint's table.
        numbers: The index of each constraint among all constraints that its owner knows.
    """

    owners: Integers
    others: Integers
    tables: Floats
    which: Integers
    numbers: Integers


@dataclass(frozen=True)
class Description:
    """A team. Robot 0 is the highest in the order.

    Attributes:
        names: The robots' names, which determine their random numbers.
        sizes: The number of values of each robot.
        degrees: The number of neighbours of each robot.
        neighbours: The neighbours of robot 0, then those of robot 1, and so on, each list in priority order.
        charges: The unary cost of each value of robot 0, then of robot 1, and so on. None: no unary costs.
        held: The constraints, as known by each robot.
        value_bytes: The size of the message with each value, in the order of `charges`. A single number if all are
            equal.
        domain_bytes: The size of the message with all values, by robot. A single number if all are equal.
        table_checks: The constraint checks for building each robot's tables. None: one check per entry.
        starts: The index of each robot's start value; -1: unknown. None: no start values are known.
    """

    names: Sequence[str]
    sizes: Integers
    degrees: Integers
    neighbours: Integers
    charges: Floats | None
    held: Sequence[KnownConstraints]
    value_bytes: Integers | int
    domain_bytes: Integers | int
    table_checks: Integers | None = None
    starts: Integers | None = None


def describe_team(parts: Mapping[str, AgentProblem]) -> Description:
    """Return the description of the team with these `parts`, which are in priority order.

    Raises:
        UnsupportedError: when a constraint's table is too large.
    """
    rank = {name: place for place, name in enumerate(parts)}
    problems = [LocalProblem(part) for part in parts.values()]
    domains = {problem.agent: problem.values for problem in problems}
    draft = _Draft()
    for place, problem in enumerate(problems):
        draft.add(place, problem, rank, domains)
    starts = [problem.start for problem in problems]
    return Description(
        names=list(parts),
        sizes=np.array([len(problem.values) for problem in problems], np.int64),
        degrees=np.array([len(problem.neighbours) for problem in problems], np.int64),
        neighbours=np.array([rank[name] for problem in problems for name in problem.neighbours], np.int64),
        charges=np.array([charge for problem in problems for charge in problem.charges], np.float64),
        held=draft.held(),
        value_bytes=np.array([_value_bytes(value) for problem in problems for value in problem.values], np.int64),
        domain_bytes=np.array([len(encode(Domain(list(problem.values)))) for problem in problems], np.int64),
        table_checks=np.array([problem.checks for problem in problems], np.int64),
        starts=None if not any(part.parameters.start for part in parts.values()) else _indices(starts),
    )


def _indices(starts: Sequence[int | None]) -> Integers:
    return np.array([-1 if start is None else start for start in starts], np.int64)


def _value_bytes(value: Value) -> int:
    return len(encode(ValueMessage(value)))


@dataclass
class _Shape:
    """Constraints whose tables have the same shape."""

    owners: list[int] = field(default_factory=list)
    others: list[list[int]] = field(default_factory=list)
    tables: list[Floats] = field(default_factory=list)
    which: list[int] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    known: dict[bytes, int] = field(default_factory=dict)

    def add(self, owner: int, others: list[int], table: Floats, number: int) -> None:
        same = self.known.setdefault(table.tobytes(), len(self.tables))
        if same == len(self.tables):
            self.tables.append(table)
        self.owners.append(owner)
        self.others.append(others)
        self.which.append(same)
        self.numbers.append(number)


class _Draft:
    """Collects constraints by the shape of their tables. Equal tables are stored once."""

    def __init__(self) -> None:
        self._shapes: dict[tuple[int, ...], _Shape] = {}

    def add(
        self, place: int, problem: LocalProblem, rank: Mapping[str, int], domains: Mapping[str, Sequence[Value]]
    ) -> None:
        """Add the constraints known by the robot with index `place`."""
        for number, table in enumerate(problem.tables(domains)):
            charges = table.joined()
            shape = self._shapes.setdefault(charges.shape, _Shape())
            shape.add(place, [rank[name] for name in table.agents], charges, number)

    def held(self) -> list[KnownConstraints]:
        """Return the constraints."""
        return [
            KnownConstraints(
                np.array(shape.owners, np.int64),
                np.array(shape.others, np.int64).reshape(len(shape.owners), len(size) - 1),
                np.stack(shape.tables),
                np.array(shape.which, np.int64),
                np.array(shape.numbers, np.int64),
            )
            for size, shape in self._shapes.items()
        ]
