"""The scores of AgentsNet: how much of a task an assignment solves (arXiv 2507.08616 and the program of the paper)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import chain

from robochoc.generators.agentsnet import Task
from robochoc.model.problem import Team
from robochoc.system.suggestions import member


def _links(team: Team) -> list[tuple[int, int]]:
    """Return the edges of a task's graph, as numbers of robots."""
    scopes = {tuple(int(name[1:]) for name in one.variables) for one in team.constraints()}
    return [(one, other) for one, *others in scopes for other in others]


def agentsnet_score(task: Task | str, team: Team, assignment: Mapping[str, int | str]) -> Fraction:
    """Return the score of AgentsNet for an assignment, from 0 to 1; 1 means that the task is solved.

    Colouring: the share of links between different groups. Vertex cover: the share of covered links times the share of
    coordinators that cannot be removed. Matching: the share of robots whose choice is returned, or which have chosen
    nobody and could choose nobody. Leader election and consensus: 1 or 0.

    Args:
        task: The task.
        team: The team, from `agentsnet_on`.
        assignment: The values of all variables.

    Raises:
        ValueError: There is no such task.
    """
    chosen = {int(name[1:]): int(value) for name, value in assignment.items()}
    edges = _links(team)
    match member(Task, "task", task):
        case Task.COLORING:
            return Fraction(sum(chosen[one] != chosen[other] for one, other in edges), len(edges))
        case Task.VERTEX_COVER:
            return _cover_score(chosen, edges)
        case Task.MATCHING:
            near: dict[int, set[int]] = {number: set() for number in chosen}
            for one, other in edges:
                near[one].add(other)
                near[other].add(one)
            wrong = sum(
                chosen[partner] != robot if partner else any(not chosen[other] for other in near[robot])
                for robot, partner in chosen.items()
            )
            return 1 - Fraction(wrong, len(chosen))
        case Task.LEADER_ELECTION:
            return Fraction(sum(number == leader for number, leader in chosen.items()) == 1)
        case _:
            return Fraction(len({*chosen.values()}) == 1)


def _cover_score(chosen: Mapping[int, int], edges: Sequence[tuple[int, int]]) -> Fraction:
    """Return the share of covered edges times the share of coordinators without which an edge is not covered."""
    coordinators = [number for number, value in chosen.items() if value]
    if not coordinators:
        return Fraction(not edges)
    needed = {*chain.from_iterable((one, other) for one, other in edges if chosen[one] + chosen[other] == 1)}
    covered = sum(chosen[one] + chosen[other] > 0 for one, other in edges)
    full = covered == len(edges)
    minimal = sum(number in needed for number in coordinators) if full else len(coordinators)
    return Fraction(covered, len(edges) or 1) * Fraction(minimal, len(coordinators))
