"""What a robot's local problem says of broken constraints, one way held against another."""

from __future__ import annotations

import itertools
from collections import Counter
from random import Random

import pytest

from robochoc.model.orders import with_order
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    Relation,
    Robot,
    Semantics,
    Team,
)
from robochoc.protocols.message import Value
from robochoc.solver import local_problem
from robochoc.solver.agent_problem import AgentProblem, RunParameters, agent_problems
from robochoc.solver.compiled_domain import CompiledDomain
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.local_problem import LocalProblem
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.loose_problems import loosened
from tests.support.problems import random_team, team_of

EQUAL = Relation("R", 2, Semantics.SUPPORTS, ((1, 1), (2, 2)))
WIDE = {"RA": "AB", "RC": "C"}
ONE = Relation("R", 2, Semantics.SUPPORTS, ((1, 1),))


def test_all_broken_constraints_are_told_not_only_the_first() -> None:
    constraints = [Constraint("C", EQUAL, pair, pair) for pair in (("A", "D"), ("B", "D"), ("C", "D"))]
    problem = LocalProblem(agent_problems(team_of(dict.fromkeys("ABCD", (1, 2)), constraints))["RD"])
    view: dict[str, Value] = {"RA": (2,), "RB": (1,), "RC": (2,)}
    assert problem.conflicts(0, view) == [({"RA": (2,)}, "RD<RA:C"), ({"RC": (2,)}, "RD<RC:C")]
    assert problem.conflicts(1, view) == [({"RB": (1,)}, "RD<RB:C")]


def test_two_constraints_with_one_robot_are_both_told() -> None:
    names = ("A", "B")
    constraints = [Constraint("C1", EQUAL, names, names), Constraint("C2", ONE, names, names)]
    problem = LocalProblem(agent_problems(team_of(dict.fromkeys("AB", (1, 2)), constraints))["RB"])
    assert [key for _, key in problem.conflicts(1, {"RA": (1,)})] == ["RB<RA:C1", "RB<RA:C2"]
    assert [key for _, key in problem.conflicts(1, {"RA": (2,)})] == ["RB<RA:C2"]


def test_values_are_distinct_whatever_is_shown() -> None:
    """A robot that shows nothing looks the same withdrawn; one that cannot stay has to withdraw all the same."""
    chance = Random(5)
    for _ in range(30):
        team = loosened(random_team(chance), chance)
        turned = with_order(team, tuple(chance.sample(team.order, len(team.order))))
        for part in agent_problems(turned, RunParameters(withdrawal_cost=9)).values():
            problem = LocalProblem(part)
            assert len(set(problem.values)) == len(problem.values) == len(problem.charges) == len(problem.behind)
            assert ((None,) * len(part.robot.interface) in problem.values) or problem.charges[0] < 9
            for name in turned.order:
                declared = problem.declared(name)
                assert len(set(declared)) == len(declared) == problem.declared_count(name)
    alone = team_of({"A": (1, 2)}, [Constraint("C", Relation("N", 1, Semantics.SUPPORTS, ()), ("A",), ("A",))])
    (part,) = agent_problems(alone, RunParameters(withdrawal_cost=9)).values()
    assert LocalProblem(part).solution(0) == {}


def test_each_known_constraint_is_a_check_and_unknown_ones_are_passed_over() -> None:
    constraints = [Constraint("C", EQUAL, pair, pair) for pair in (("A", "C"), ("B", "C"))]
    problem = LocalProblem(agent_problems(team_of(dict.fromkeys("ABC", (1, 2)), constraints))["RC"])
    assert problem.conflicts(0, {}) == []
    assert problem.checks == 0
    problem.conflicts(0, {"RA": (1,)})
    assert problem.checks == 1
    problem.conflicts(0, {"RA": (1,), "RB": (2,)})
    assert problem.checks == 3


def test_conflicts_are_those_of_the_files() -> None:
    """Every robot of a scope tells just the constraints that its value and the others' break together."""
    chance = Random("conflicts")
    seen = Counter[int]()
    for _ in range(100):
        team = random_team(chance)
        given = {name: chance.choice(sorted(v.domain)) for name, v in team.variables.items()}
        shared = [c for r in team.robots for parent in r.parents for c in parent.constraints]
        for name, part in agent_problems(team, shared_scopes=True).items():
            problem = LocalProblem(part)
            if not team[name].interface:
                continue
            (own,) = team[name].interface
            for index, (value,) in enumerate(problem.values):
                assert value is not None
                broken = sum(own in c.variables and not c.allows({**given, own: value}) for c in shared)
                told = problem.conflicts(index, _view(team, given))
                assert len(told) == broken == problem.violation_count(index, _view(team, given))
                seen[min(broken, 2)] += 1
    assert min(seen[0], seen[1], seen[2]) > 50


def test_burdens_are_broken_constraints_and_what_the_others_charge() -> None:
    soft = Relation("S", 2, Semantics.SOFT, ((1, 1), (2, 1)), (3, 5), 0)
    prices = Relation("P", 1, Semantics.SOFT, ((1,), (2,)), (7, 0))
    constraints = [
        Constraint("C", EQUAL, ("A", "C"), ("A", "C")),
        Constraint("C", soft, ("B", "C"), ("B", "C")),
        Constraint("P", prices, ("C",), ("C",)),
    ]
    problem = LocalProblem(agent_problems(team_of(dict.fromkeys("ABC", (1, 2)), constraints))["RC"])
    assert problem.lexicographic_costs({}) == [(0, 7), (0, 0)]
    assert problem.checks == 0
    assert problem.lexicographic_costs({"RA": (1,), "RB": (1,)}) == [(0, 10), (1, 0)]
    assert problem.checks == 4
    assert problem.lexicographic_costs({"RA": (2,), "RB": (2,)}) == [(1, 12), (0, 0)]


def test_burdens_are_costs_where_nothing_is_broken() -> None:
    """They take as many checks; of what is broken `violated` says as much."""
    chance = Random("burdens")
    seen = Counter[bool]()
    for _ in range(80):
        team = random_cost_team(chance)
        given = {name: chance.choice(sorted(v.domain)) for name, v in team.variables.items()}
        for part in agent_problems(team, shared_scopes=True).values():
            problem = LocalProblem(part)
            view = {name: value for name, value in _view(team, given).items() if chance.random() < 0.8}
            costs = problem.costs(view)
            checks = problem.checks
            burdens = problem.lexicographic_costs(view)
            assert problem.checks == 2 * checks
            for index, (broken, cost) in enumerate(burdens):
                assert broken == problem.violation_count(index, view)
                assert (costs[index] == cost) if broken == 0 else (costs[index] == INFINITE > cost)
                seen[broken > 0] += 1
    assert min(seen[True], seen[False]) > 50


def test_the_first_conflict_is_the_one_that_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether conflicts are looked up one by one or for all values at once."""
    chance = Random("explained")
    for _ in range(60):
        team = random_complex_team(chance)
        for part in agent_problems(_any_domains(team, chance), shared_scopes=True).values():
            monkeypatch.setattr(local_problem, "MIN_TABLE_VALUES", chance.choice((1, 1000)))
            _compare(part, chance)


@pytest.mark.parametrize("few", [1, 1000], ids=["table", "masks"])
def test_conflicts_of_several_values_are_those_of_each_with_as_many_checks(
    few: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where robots are unknown or withdrawn, and from any place in the order on."""
    monkeypatch.setattr(local_problem, "MIN_TABLE_VALUES", few)
    chance = Random("conflicts of several")
    seen = Counter[int]()
    for _ in range(30):
        team = random_complex_team(chance)
        for part in agent_problems(_any_domains(team, chance), shared_scopes=True).values():
            problem, again = LocalProblem(part), LocalProblem(part)
            view: dict[str, Value] = {
                name: tuple([chance.choice([None, *part.known.domains[one]]) for one in names])
                for name, names in part.interfaces.items()
                if chance.random() < 0.8
            }
            indices = [index for index in range(len(problem.values)) if chance.random() < 0.7]
            for since in (-1, *range(len(part.order))):
                told = {i: conflict for conflict, some in problem.conflicts_of(indices, view, since) for i in some}
                each = {index: again.conflict(index, view, since) for index in indices}
                assert told == {index: conflict for index, conflict in each.items() if conflict is not None}
                assert problem.checks == again.checks
                seen[len(told)] += 1
    assert len(seen) > 2


def test_what_a_robot_adds_is_the_difference_that_it_makes() -> None:
    """Robots become known from the highest one on; constraints that wait for none are in the costs from the start."""
    chance = Random("added")
    seen = Counter[str]()
    for _ in range(80):
        team = random_complex_cost_team(chance)
        for part in agent_problems(_any_domains(team, chance), shared_scopes=True).values():
            problem, again = LocalProblem(part), LocalProblem(part)
            view: dict[str, Value] = {}
            costs = problem.costs(view)
            for name in part.order:
                if name == problem.agent:
                    continue
                aside = chance.random() < 0.1
                names = part.interfaces[name]
                view[name] = tuple([None if aside else chance.choice(list(part.known.domains[one])) for one in names])
                added = problem.added(name, view)
                if added is not None:
                    costs = [cost + more for cost, more in zip(costs, added, strict=True)]
                assert costs == again.costs(view)
                seen["nothing" if added is None else "aside" if aside else "something"] += 1
            assert problem.checks <= again.checks
    assert min(seen.values()) > 10, seen


def test_what_a_robot_adds_is_the_same_in_any_order_in_which_robots_become_known() -> None:
    chance = Random("added by")
    seen = Counter[str]()
    for _ in range(40):
        team = random_complex_cost_team(chance)
        for part in agent_problems(_any_domains(team, chance), shared_scopes=True).values():
            problem, again = LocalProblem(part), LocalProblem(part)
            view: dict[str, Value] = {}
            costs = problem.costs(view)
            checks = 0
            others = [name for name in part.order if name != problem.agent]
            for name in chance.sample(others, len(others)):
                view[name] = tuple([chance.choice(list(part.known.domains[one])) for one in part.interfaces[name]])
                added = problem.added_by(name, view)
                costs = [cost + more for cost, more in zip(costs, added, strict=True)]
                seen["something" if any(added) else "nothing"] += 1
                checks = again.checks
                assert costs == again.costs(view)
            assert problem.checks <= again.checks - checks or not view
    assert min(seen.values()) > 10, seen


def test_the_least_is_what_the_cheapest_values_of_the_others_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constraint by constraint, whatever the others' values in other constraints."""
    chance = Random("least")
    seen = Counter[bool]()
    for _ in range(80):
        team = random_cost_team(chance)
        shared = [c for robot in team.robots for parent in robot.parents for c in parent.constraints]
        robots = {name for name in team.order if chance.random() < 0.6}
        for name, part in agent_problems(team, shared_scopes=True).items():
            problem = LocalProblem(part)
            (own,) = (variable.name for variable in team[name].variables)
            least = problem.lower_bounds(robots - {name})
            for index, shown in enumerate(problem.values):
                if not shown:
                    continue
                (value,) = shown
                assert value is not None
                expected = 0.0
                for constraint in shared:
                    others = [one for one in constraint.variables if one != own]
                    if own in constraint.variables and {team.owner[one] for one in others} <= robots - {name}:
                        columns = [team.variables[one].domain for one in others]
                        expected += min(
                            constraint.price({own: value, **dict(zip(others, row, strict=True))})
                            for row in itertools.product(*columns)
                        )
                assert least[index] == expected
                seen[expected > 0] += 1
            monkeypatch.setattr(local_problem, "MAX_BOUNDED_ROWS", 0)
            assert problem.lower_bounds(robots) == [0] * len(problem.values)
            monkeypatch.undo()
    assert min(seen.values()) > 50, seen


def test_nothing_is_sure_to_be_charged_where_robots_may_step_aside() -> None:
    team = team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", ONE, ("A", "B"), ("A", "B"))])
    assert LocalProblem(agent_problems(team, shared_scopes=True)["RA"]).lower_bounds({"RB"}) == [0, INFINITE]
    assert LocalProblem(
        agent_problems(team, parameters=RunParameters(withdrawal_cost=1), shared_scopes=True)["RA"]
    ).lower_bounds({"RB"}) == [
        0,
        0,
        0,
    ]


def test_what_each_constraint_charges_adds_up_and_is_between_its_least_and_most() -> None:
    chance = Random("charged")
    seen = 0
    for _ in range(40):
        team = chance.choice((random_cost_team, random_complex_cost_team))(chance)
        view = _view(team, {name: chance.choice(sorted(v.domain)) for name, v in team.variables.items()})
        for part in agent_problems(_any_domains(team, chance), shared_scopes=True).values():
            one, other = LocalProblem(part), LocalProblem(part)
            charged = one.charged(view)
            total = [sum(prices) for prices in zip(one.charges, *(c.costs for c in charged), strict=True)]
            assert total == other.costs(view)
            assert one.checks == other.checks
            for number, _, codes, costs in charged:
                least, most = one.least_and_most(number)
                assert all(least <= cost <= most for cost in costs)
                assert len({*zip(codes, costs, strict=True)}) == len({*codes})
                seen += least < most
    assert seen > 50


def test_the_least_and_the_most_are_those_of_the_whole_table(monkeypatch: pytest.MonkeyPatch) -> None:
    soft = Relation("S", 2, Semantics.SOFT, ((1, 1), (2, 1)), (3, 5), 2)
    for relation, found, unseen in ((soft, (2, 5), (0, 5)), (EQUAL, (0, INFINITE), (0, INFINITE))):
        team = team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", relation, ("A", "B"), ("A", "B"))])
        problem = LocalProblem(agent_problems(team, shared_scopes=True)["RA"])
        assert problem.least_and_most(0) == found
        assert problem.checks == 4
        monkeypatch.setattr(local_problem, "MAX_BOUNDED_ROWS", 3)
        assert problem.least_and_most(0) == unseen
        monkeypatch.undo()


def _compare(part: AgentProblem, chance: Random) -> None:
    problem = LocalProblem(part)
    for index in range(len(problem.values)):
        view = {
            name: tuple([chance.choice(list(part.known.domains[variable])) for variable in variables])
            for name, variables in part.interfaces.items()
            if chance.random() < 0.8
        }
        told = problem.conflicts(index, view)
        assert problem.conflict_with_key(index, view) == next(iter(told), None)
        assert problem.violation_count(index, view) == len(told)


def _view(team: Team, given: dict[str, int]) -> dict[str, Value]:
    return {robot.name: tuple([given[name] for name in robot.interface]) for robot in team.robots}


def _any_domains(team: Team, chance: Random) -> CompiledTeam:
    """Some values for each robot, whatever its private constraints say."""

    def compile_robot(robot: Robot) -> CompiledDomain:
        names = tuple(variable.name for variable in robot.variables)
        rows = sorted({tuple([chance.choice(list(variable.domain)) for variable in robot.variables]) for _ in range(6)})
        by_value = {tuple([row[names.index(name)] for name in robot.interface]): row for row in rows}
        ones, noughts = (1,) * len(by_value), (0,) * len(by_value)
        return CompiledDomain(names, tuple(by_value), tuple(by_value.values()), ones, noughts, ones)

    return CompiledTeam(team, compile_robot)
