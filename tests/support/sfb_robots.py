"""Robots of SFB, alone or introduced to each other, and what they say."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from itertools import groupby
from typing import TypeVar

from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.run_lengths import Run
from robochoc.protocols.optimization.sfb import SFB, Above, Below, Charges, CPAs, Domain, SFBSettings
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import replies
from tests.support.pseudo_trees import Costs, priced

CHAIN: Costs = {"AB": (3, 1, 0, 2), "BC": (0, 4, 2, 1), "A": (0, 1)}
"""RA and RB, RB and RC; the cheapest is RA 2, RB 1, RC 1, for 1."""


T = TypeVar("T", bound=Hashable)


def grouped(items: Iterable[T]) -> tuple[list[T], list[Run]]:
    """The distinct `items`, in order of first occurrence, and the runs."""
    places: dict[T, int] = {}
    numbers = [places.setdefault(item, len(places)) for item in items]
    return list(places), [(place, len(list(same))) for place, same in groupby(numbers)]


def above(domains: Iterable[Domain]) -> Above:
    """The message for robots with these domains, in priority order."""
    return Above(*grouped(domains))


def below(robots: Iterable[tuple[Domain, Charges]], most: int) -> Below:
    """The message for robots with these domains and charges, in priority order."""
    kinds, runs = grouped(robots)
    return Below([domain for domain, _ in kinds], [charges for _, charges in kinds], runs, most)


def team(costs: Costs) -> Team:
    """Robots RA, RB, ...: for each scope in `costs` what its combinations of values cost."""
    return priced("".join(sorted({*"".join(costs)})), costs)


def agents(problem: Team, settings: SFBSettings | None = None) -> dict[str, SFB]:
    """The protocol objects of all robots, not started."""
    order = PriorityOrder(problem.order)
    found = {name: SFB(LocalProblem(part), order) for name, part in agent_problems(problem, shared_scopes=True).items()}
    for robot in found.values():
        setattr(robot, "settings", settings or robot.settings)  # noqa: B010 - for mypy the class has them
    return found


def introduced(
    problem: Team, settings: SFBSettings | None = None, *, begun: bool = True
) -> tuple[dict[str, SFB], list[CPAs]]:
    """All robots know each other's values; and what the first one says then. `begun`: as if a CPA had gone before."""
    robots = agents(problem, settings)
    for robot in robots.values():
        robot.first_sent = begun
    said: list[CPAs] = []
    todo = []
    for robot in robots.values():
        robot.start()
        todo += [(robot.problem.agent, *one) for one in robot.outbox]
        robot.outbox.clear()
    while todo:
        sender, receiver, message = todo.pop(0)
        if isinstance(message, CPAs):
            said.append(message)
        else:
            todo += [(receiver, *one) for one in replies(robots[receiver], (sender, message))]
    return robots, said


def rows(message: Message) -> list[list[int]]:
    """What `message` holds, as numbers of one byte each."""
    assert isinstance(message, CPAs)
    width = len(message.rows) // message.count
    return [list(message.rows[place : place + width]) for place in range(0, len(message.rows), width)]


def cpas(*partial: Sequence[int], least: int = 11, ceiling: int = 11) -> CPAs:
    """A message of CPAs in problems whose costs fit into a byte."""
    return CPAs(len(partial), bytes([number for row in partial for number in row]), least, ceiling)


def row(bound: int) -> list[int]:
    """A CPA for RB in CHAIN, with that bound."""
    return [bound, bound, 1, 0, 0, 0, 0]
