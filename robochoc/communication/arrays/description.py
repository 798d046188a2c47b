"""A team as arrays describe it, before it is laid out for a run: robots are numbers, in priority order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from robochoc.communication.arrays.kinds import Floats, Integers
from robochoc.model.message import Value, encode
from robochoc.protocols.shared.cycles import Domain
from robochoc.protocols.shared.cycles import Value as ValueMessage
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.compiled import LocalProblem


@dataclass(frozen=True)
class Held:
    """Constraints of one shape, each as one of its robots knows it.

    Attributes:
        owners: The robots that know them.
        others: The other robots of each scope, a column for each, the highest first.
        tables: Different tables of costs: an axis for each of the others, then one for the owner's values. `inf`
            forbids.
        which: The table of each.
        numbers: The place of each among all that its owner knows.
    """

    owners: Integers
    others: Integers
    tables: Floats
    which: Integers
    numbers: Integers


@dataclass(frozen=True)
class Description:
    """A team: robot 0 is the highest in the order.

    Attributes:
        names: The robots' names: their random numbers follow from these.
        sizes: How many values each robot has.
        degrees: How many neighbours each robot has.
        neighbours: The neighbours of robot 0, then of robot 1, and so on, each in the order.
        charges: What each value of robot 0 costs it alone, then of robot 1, and so on. None: nothing.
        held: The constraints, as each robot knows them.
        value_bytes: How long a message is that tells a value, in the order of `charges`; a number if all are as long.
        domain_bytes: How long a message is that tells all values, by robot; a number if all are as long.
        table_checks: How many checks it takes to make the tables of each robot. None: an entry is a check.
    """

    names: Sequence[str]
    sizes: Integers
    degrees: Integers
    neighbours: Integers
    charges: Floats | None
    held: Sequence[Held]
    value_bytes: Integers | int
    domain_bytes: Integers | int
    table_checks: Integers | None = None


def described(parts: Mapping[str, AgentProblem]) -> Description:
    """Return the team whose robots are given `parts`, in priority order.

    Raises:
        UnsupportedError: when a constraint's table is too large.
    """
    rank = {name: place for place, name in enumerate(parts)}
    problems = [LocalProblem(part) for part in parts.values()]
    domains = {problem.agent: problem.values for problem in problems}
    draft = _Draft()
    for place, problem in enumerate(problems):
        draft.add(place, problem, rank, domains)
    return Description(
        names=list(parts),
        sizes=np.array([len(problem.values) for problem in problems], np.int64),
        degrees=np.array([len(problem.neighbours) for problem in problems], np.int64),
        neighbours=np.array([rank[name] for problem in problems for name in problem.neighbours], np.int64),
        charges=np.array([charge for problem in problems for charge in problem.charges], np.float64),
        held=draft.held(),
        value_bytes=np.array([_told(value) for problem in problems for value in problem.values], np.int64),
        domain_bytes=np.array([len(encode(Domain(list(problem.values)))) for problem in problems], np.int64),
        table_checks=np.array([problem.checks for problem in problems], np.int64),
    )


def _told(value: Value) -> int:
    return len(encode(ValueMessage(value)))


@dataclass
class _Shape:
    """Constraints whose tables have one shape."""

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
    """Constraints by the shape of their tables; equal tables are kept once."""

    def __init__(self) -> None:
        self._shapes: dict[tuple[int, ...], _Shape] = {}

    def add(
        self, place: int, problem: LocalProblem, rank: Mapping[str, int], domains: Mapping[str, Sequence[Value]]
    ) -> None:
        """Add what the robot at `place` knows."""
        for number, table in enumerate(problem.tables(domains)):
            shape = self._shapes.setdefault(table.charges.shape, _Shape())
            shape.add(place, [rank[name] for name in table.agents], table.charges, number)

    def held(self) -> list[Held]:
        """Return the constraints."""
        return [
            Held(
                np.array(shape.owners, np.int64),
                np.array(shape.others, np.int64).reshape(len(shape.owners), len(size) - 1),
                np.stack(shape.tables),
                np.array(shape.which, np.int64),
                np.array(shape.numbers, np.int64),
            )
            for size, shape in self._shapes.items()
        ]
