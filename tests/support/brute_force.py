"""The truth about a team, by trying everything: its solutions, and the least cost.

Variables get values one after the other, and each constraint is looked at as soon as its variables have theirs: what
breaks one is not continued, and no combination is looked up twice.
"""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.model.problem import INFINITE, Assignment, Constraint, Team


class _Tree:
    """All assignments of a team, by the number of variables that have values."""

    def __init__(self, team: Team) -> None:
        self.names = list(team.variables)
        self.domains = [tuple(variable.domain) for variable in team.variables.values()]
        place = {name: number for number, name in enumerate(self.names, 1)}
        self._due: list[list[tuple[Constraint, dict[tuple[int, ...], float]]]] = [[] for _ in range(len(place) + 1)]
        for constraint in team.constraints():
            self._due[max((place[name] for name in constraint.variables), default=0)].append((constraint, {}))

    def price(self, depth: int, assignment: Assignment) -> float:
        """What those constraints cost whose last variable is that of this depth."""
        total: float = 0
        for constraint, known in self._due[depth]:
            row = tuple(assignment[name] for name in constraint.variables)
            if row not in known:
                known[row] = constraint.price(assignment)
            total += known[row]
        return total


def solutions(team: Team) -> Iterator[dict[str, int]]:
    """All assignments that every constraint allows, one after the other."""
    return (assignment for assignment, _ in priced_solutions(team))


def priced_solutions(team: Team) -> Iterator[tuple[dict[str, int], float]]:
    """All assignments that every constraint allows, one after the other, with what they cost."""
    tree, assignment = _Tree(team), dict[str, int]()

    def extend(depth: int, paid: float) -> Iterator[tuple[dict[str, int], float]]:
        paid += tree.price(depth, assignment)
        if paid == INFINITE:
            return
        if depth == len(tree.names):
            yield dict(assignment), paid
            return
        for value in tree.domains[depth]:
            assignment[tree.names[depth]] = value
            yield from extend(depth + 1, paid)

    return extend(0, 0)


def least_cost(team: Team) -> float:
    """The cost of the cheapest assignment; `INFINITE` when all break something hard."""
    tree, assignment = _Tree(team), dict[str, int]()
    best = INFINITE

    def extend(depth: int, paid: float) -> None:
        nonlocal best
        paid += tree.price(depth, assignment)  # no price is negative
        if paid >= best:
            return
        if depth == len(tree.names):
            best = paid
            return
        for value in tree.domains[depth]:
            assignment[tree.names[depth]] = value
            extend(depth + 1, paid)

    extend(0, 0)
    return best
