"""Equal constraints share their computed costs: what a robot computes, counts and refuses is as if it were alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random

import numpy as np
import pytest

from robochoc.model.problem import Constraint, Definition, Relation, Robot, Team
from robochoc.protocols.message import Value
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.examples import count, drawn
from tests.support.problems import random_team

TEAMS = (random_complex_cost_team, random_cost_team, random_complex_team, random_team)


def with_few_definitions(team: Team, chance: Random) -> Team:
    """Return `team` with few definitions and few domains, which have many constraints each."""
    domains = [variable.domain for variable in team.variables.values()][: chance.randint(1, 2)]
    known: dict[int, list[Definition]] = {}

    def one(constraint: Constraint) -> Constraint:
        definition = constraint.definition
        arity = definition.arity if isinstance(definition, Relation) else len(definition.parameters)
        alike = known.setdefault(arity, [])
        if not alike or chance.random() < 0.3:
            alike.append(definition)
        other = chance.choice(alike)
        return replace(constraint, definition=other) if type(other) is type(definition) else constraint

    def of(robot: Robot) -> Robot:
        parents = tuple(replace(p, constraints=tuple(map(one, p.constraints))) for p in robot.parents)
        variables = tuple(replace(one, domain=chance.choice(domains)) for one in robot.variables)
        private = robot.private if len(robot.variables) == 1 else ()  # otherwise a solver has to compile them
        return replace(robot, variables=variables, private=private, parents=parents)

    return replace(team, robots=tuple(map(of, team.robots)))


def outcome(act: Callable[[], object]) -> object:
    try:
        return act()
    except ValueError as error:
        return str(error)


def asked(problem: LocalProblem, values: dict[str, Sequence[Value]], chance: Random) -> list[object]:
    """Return the answers to random questions, each with the number of checks so far."""
    found: list[object] = []
    for _ in range(8):
        view = {name: chance.choice(choice) for name, choice in values.items() if choice and chance.random() < 0.8}
        view.pop(problem.agent, None)
        if view and chance.random() < 0.2:
            name = chance.choice(sorted(view))
            view[name] = tuple([None if part is None else part + 50 for part in view[name]])
        index = chance.randrange(len(problem.values)) if problem.values else None
        questions: list[Callable[[], object]] = [
            lambda: problem.costs(view),  # noqa: B023 - called in this turn
            lambda: problem.lexicographic_costs(view),  # noqa: B023
            lambda: problem.lower_bounds(values),
            problem.look_ahead,
            lambda: [problem.least_and_most(number) for number in range(len(problem.scopes(values)))],
            lambda: [(one.agents, one.joined().tolist()) for one in problem.tables(values)],
        ]
        if index is not None:
            questions += [
                lambda: problem.conflict(index, view),  # noqa: B023
                lambda: problem.cost(index, view),  # noqa: B023
                lambda: problem.conflicts_of([*range(len(problem.values))], view),  # noqa: B023
            ]
        if chance.random() < 0.1:
            problem.allow_undeclared()
        found += [outcome(chance.choice(questions)), problem.checks]
    return found


@count("teams", 60, 2000)
@pytest.mark.parametrize("withdrawal_cost", [None, 9])
def test_robots_that_share_evaluations_answer_like_robots_that_do_not(teams: int, withdrawal_cost: int | None) -> None:
    shared = 0
    for number in range(teams):
        chance = drawn(f"shared evaluations {withdrawal_cost} {number}")
        team = with_few_definitions(chance.choice(TEAMS)(chance), chance)
        parts = agent_problems(team, RunParameters(withdrawal_cost=withdrawal_cost))
        alone = [LocalProblem(part._replace(known=replace(part.known))) for part in parts.values()]
        together = [LocalProblem(part) for part in parts.values()]
        values: dict[str, Sequence[Value]] = {problem.agent: problem.values for problem in together}
        for one, other in zip(together, alone, strict=True):
            seed = chance.random()
            assert asked(one, values, Random(seed)) == asked(other, values, Random(seed))
        tables = [table for problem in together for table in problem.tables(values)]
        shared += len({id(table.charges) for table in tables}) < len(tables)
    assert shared if withdrawal_cost is None else not shared


@count("teams", 60, 2000)
def test_the_costs_of_a_robot_are_those_of_its_constraints_one_by_one(teams: int) -> None:
    for number in range(teams):
        chance = drawn(f"shared costs {number}")
        team = with_few_definitions(random_complex_cost_team(chance), chance)
        problems = {name: LocalProblem(part) for name, part in agent_problems(team).items()}
        values: dict[str, Sequence[Value]] = {name: problem.values for name, problem in problems.items()}
        for name, problem in problems.items():
            above = [parent.name for parent in team[name].parents]
            if not all(values[other] for other in [name, *above]):
                continue
            view = {other: chance.choice(values[other]) for other in above}
            for index, own in enumerate(problem.values):
                known = {
                    variable: part
                    for robot, value in [*view.items(), (name, own)]
                    for variable, part in zip(team[robot].interface, value, strict=True)
                    if part is not None
                }
                paid = [problem.charges[index], *(one.price(known) for one in team[name].shared)]
                assert problem.cost(index, view) == sum(paid)
            places = {other: values[other].index(view[other]) for other in above}
            tables = problem.tables({other: values[other] for other in above})
            rows = [table.joined()[tuple(places[other] for other in table.agents)] for table in tables]
            assert (sum(rows) + np.array(problem.charges, np.float64)).tolist() == problem.costs(view)
