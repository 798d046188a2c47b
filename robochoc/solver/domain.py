"""Compiled domains: all local solutions of a robot, grouped by what its neighbours can see of them.

Paper, Section 4.1: a complex agent "can easily address and solve its local sub-problem and use solutions as a
compiled domain". Neighbours see the interface variables only, so local solutions that agree there are one value to
them; of each such group one representative and the number of its members are kept.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from robochoc.problem import Robot
from robochoc.solver.encoding import Codes, Component, Network, Unsupported, components

MOST_SOLUTIONS = 100_000
"""How many local solutions a robot may have, unless more are asked for."""

SolveNetwork = Callable[[Network], Iterable[Sequence[int]]]
"""All solutions of a network of several variables, in codes; `solver/ace.py` has one."""


class TooManySolutions(Exception):  # noqa: N818 - a limit that was reached
    """The robot has more local solutions, or values, than the limit."""

    def __init__(self, robot: str, limit: int) -> None:
        super().__init__(
            f"{robot} has more than {limit:,} local solutions; raise the limit (--local-solutions), or constrain its"
            " variables more"
        )
        self.robot = robot


@dataclass(frozen=True)
class CompiledDomain:
    """A robot's values as neighbours see them.

    `values[i]` holds the interface variables' values; `solutions[i]` one local solution behind it (the values of
    `variables`, the lexicographically first), and `counts[i]` the number of local solutions that look like it.
    """

    variables: tuple[str, ...]
    values: tuple[tuple[int, ...], ...]
    solutions: tuple[tuple[int, ...], ...]
    counts: tuple[int, ...]

    @property
    def total(self) -> int:
        """The number of local solutions."""
        return sum(self.counts)


@dataclass
class _Group:
    """Local solutions that look alike: the first of them, and how many there are."""

    solution: tuple[int, ...]
    count: int


def compiled_domain(robot: Robot, solve: SolveNetwork | None = None, limit: int = MOST_SOLUTIONS) -> CompiledDomain:
    """The compiled domain of `robot`, values in the order of its variables and their values.

    `solve` is asked for the solutions of what private constraints connect; a robot without such needs none. Raises
    `TooManySolutions`, and `Unsupported` when there is a part to solve and no `solve`.
    """
    parts = components(robot.variables, robot.private)
    if any(part.network.impossible for part in parts):
        return CompiledDomain(tuple(variable.name for variable in robot.variables), (), (), ())
    grouped = [_grouped(part, set(robot.interface), _solutions(robot, part, solve)) for part in parts]
    if math.prod(len(groups) for groups in grouped) > limit:
        raise TooManySolutions(robot.name, limit)
    return _joined(robot, [part.names for part in parts], grouped)


def _solutions(robot: Robot, part: Component, solve: SolveNetwork | None) -> Iterable[Sequence[int]]:
    if len(part.names) == 1:
        return ((code,) for code in part.network.domains[0])
    if solve is None:
        raise Unsupported(f"{robot.name} has private constraints among its variables, and no solver to compile them")
    return solve(part.network)


def _grouped(part: Component, seen: set[str], solutions: Iterable[Sequence[int]]) -> list[_Group]:
    """Solutions of one part that agree on its variables in `seen`, joined."""
    shown = [place for place, name in enumerate(part.names) if name in seen]
    groups: dict[Codes, _Group] = {}
    for codes in solutions:
        solution = part.decoded(codes)
        group = groups.setdefault(tuple([solution[place] for place in shown]), _Group(solution, 0))
        group.count += 1
        group.solution = min(group.solution, solution)
    return list(groups.values())


def _joined(robot: Robot, names: Sequence[Sequence[str]], grouped: Sequence[Sequence[_Group]]) -> CompiledDomain:
    """Every combination of the parts' groups."""
    variables = tuple(variable.name for variable in robot.variables)
    place = {name: index for index, name in enumerate(itertools.chain.from_iterable(names))}
    order = [place[name] for name in variables]
    shown = [index for index, name in enumerate(variables) if name in robot.interface]
    found = []
    for combination in itertools.product(*grouped):
        flat = tuple(itertools.chain.from_iterable(group.solution for group in combination))
        found.append((tuple([flat[index] for index in order]), math.prod(group.count for group in combination)))
    found.sort()
    return CompiledDomain(
        variables=variables,
        values=tuple(tuple([solution[index] for index in shown]) for solution, _ in found),
        solutions=tuple(solution for solution, _ in found),
        counts=tuple(count for _, count in found),
    )
