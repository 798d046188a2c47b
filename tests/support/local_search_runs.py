"""Runs of local search, cycle by cycle where it goes through cycles."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from random import Random

from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Assignment, Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LexicographicCost, LocalProblem


def any_schedule(chance: Random) -> Schedule:
    return chance.choice(
        (RandomChannels(chance.getrandbits(32)), Concurrent(0), Concurrent(0, chance.choice((3, 200))))
    )


def played(team: Team, protocol: type[Protocol], schedule: Schedule, seed: int = 0, **settings: object) -> SearchResult:
    """A run of simple robots to its own end."""
    parameters = RunParameters(seed, {name: str(value) for name, value in settings.items()})
    result = Simulation(team, protocol, schedule, parameters=parameters).search()
    assert result.verdict in {Verdict.SOLUTION, Verdict.NO_SOLUTION}
    return result


def domains_of(team: Team) -> dict[str, list[int]]:
    """The values that each variable may have by its robot's own constraints; one variable a robot."""
    domains = {}
    for name, part in agent_problems(team).items():
        (variable,) = team[name].variables
        problem = LocalProblem(part)
        domains[variable.name] = [problem.solution(index)[variable.name] for index in range(len(problem.values))]
    return domains


def assignments_by_cycle(team: Team, result: SearchResult) -> list[Assignment]:
    """The values that all robots had in each cycle."""
    domains = domains_of(team)
    trails = {team[name].variables[0].name: found.trail for name, found in result.findings.items()}
    (last,) = {trail.cycle for trail in trails.values() if trail}
    course: list[Assignment] = []
    for cycle in range(last + 1):
        changed = {
            name: domains[name][index]
            for name, trail in trails.items()
            for when, index in (trail.entries if trail else ())
            if when == cycle
        }
        course.append({**(course[-1] if course else {}), **changed})
    return course


def cost_of_assignment(team: Team, assignment: Assignment) -> LexicographicCost:
    """Return the number of constraints that `assignment` breaks, and the cost of the others."""
    prices = [constraint.price(assignment) for constraint in team.constraints()]
    return prices.count(INFINITE), sum(price for price in prices if price < INFINITE)


def is_optimal(team: Team, assignment: Assignment, together: int) -> bool:
    """Whether no `together` neighbours can do better by moving at once (k-optimality; Pearce, Tambe 2007)."""
    now = cost_of_assignment(team, assignment)
    return all(cost_of_assignment(team, other) >= now for other in _moves(team, assignment, together))


def _moves(team: Team, assignment: Assignment, together: int) -> Iterator[Assignment]:
    domains = domains_of(team)
    for names in itertools.combinations(domains, together):
        if together == 1 or any({*names} <= {*constraint.variables} for constraint in team.constraints()):
            for values in itertools.product(*(domains[name] for name in names)):
                yield {**assignment, **dict(zip(names, values, strict=True))}


def never_rises(burdens: Sequence[LexicographicCost]) -> bool:
    return all(after <= before for before, after in itertools.pairwise(burdens))
