"""What is done by one robot at most, as constraints say it: tasks, and teams that are no task allocations."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from random import Random

import pytest

from robochoc.model.constraint import Constraint, ConstraintModel, Predicate, Relation, Semantics
from robochoc.model.expression import Type, parse
from robochoc.model.problem import INFINITE, Team
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.encoding import cost_function
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exclusions import Evaluations, SharedTask, allocation_fault, tasks_of
from tests.support.allocation_problems import random_allocation, random_congestion
from tests.support.examples import count
from tests.support.problems import team_of

NOT_THE_SAME = Predicate("notSame", ("X", "Y"), parse("or(eq(X, 0), ne(X, Y))", ("X", "Y"), Type.BOOLEAN))


def not_the_same(*scope: str) -> Constraint:
    return Constraint("notSame", NOT_THE_SAME, scope, scope)


def conflicts(*scope: str, rows: Sequence[tuple[int, ...]]) -> Constraint:
    relation = Relation("r", len(scope), Semantics.CONFLICTS, tuple(rows))
    return Constraint("r", relation, scope, scope)


def soft(*scope: str, rows: Mapping[tuple[int, int], int]) -> Constraint:
    relation = Relation("s", len(scope), Semantics.SOFT, tuple(rows), tuple(rows.values()))
    return Constraint("s", relation, scope, scope)


def tasks_in(team: Team, robot: str, *, congestion: bool = False) -> tuple[SharedTask, ...]:
    return tasks_of(agent_problems(team, shared_scopes=True)[robot], congestion=congestion)[1]


THREE = {"A": (0, 1, 2), "B": (0, 1, 2), "C": (0, 2)}
ALLOCATION = team_of(THREE, [not_the_same("A", "B"), not_the_same("A", "C"), not_the_same("B", "C")])


def test_a_task_has_the_own_choices_and_those_of_all_others_that_exclude_them_in_priority_order() -> None:
    assert tasks_in(ALLOCATION, "RA") == (
        SharedTask(((0, 1),), {"RB": frozenset({(0, 1)})}),
        SharedTask(((0, 2),), {"RB": frozenset({(0, 2)}), "RC": frozenset({(0, 2)})}),
    )
    assert [list(task.others) for task in tasks_in(ALLOCATION, "RC")] == [["RA", "RB"]]


def test_two_values_that_exclude_the_same_are_two_ways_to_do_one_task() -> None:
    team = team_of({"A": (0, 1, 2), "B": (0, 7)}, [conflicts("A", "B", rows=[(1, 7), (2, 7)])])
    assert tasks_in(team, "RA") == (SharedTask(((0, 1), (0, 2)), {"RB": frozenset({(0, 7)})}),)
    assert tasks_in(team, "RB") == (SharedTask(((0, 7),), {"RA": frozenset({(0, 1), (0, 2)})}),)


def test_a_robot_that_shares_nothing_has_no_task() -> None:
    team = team_of({"A": (0, 1), "B": (0, 1), "C": (0, 1)}, [not_the_same("A", "B")])
    assert tasks_in(team, "RC") == ()


def test_each_pair_of_values_of_each_constraint_is_one_check() -> None:
    problems = agent_problems(ALLOCATION, shared_scopes=True)
    assert [tasks_of(problems[name])[0] for name in ("RA", "RB", "RC")] == [9 + 6, 9 + 6, 6 + 6]


def test_the_order_of_a_scope_does_not_matter() -> None:
    turned = team_of(THREE, [not_the_same("B", "A"), not_the_same("C", "A"), not_the_same("C", "B")])
    for robot in ("RA", "RB", "RC"):
        assert tasks_in(turned, robot) == tasks_in(ALLOCATION, robot)


def test_a_team_that_shares_exclusions_alone_has_no_fault() -> None:
    assert allocation_fault(ALLOCATION) == ""
    assert allocation_fault(team_of({"A": (0, 1)}, [])) == ""


NOT_A_PAIR = (
    "which is not over one variable of each of two robots (in a list of tasks: delete after:, and robots: of tasks)"
)


@pytest.mark.parametrize(
    ("domains", "constraints", "fault"),
    [
        ({"A": (0, 1), "B": (0, 1), "C": (0, 1)}, [conflicts("A", "B", "C", rows=[(1, 1, 1)])],
         f"RC shares 'r', {NOT_A_PAIR}"),
        ({"A": (0, 1), "B": (0, 1)}, [soft("A", "B", rows={(1, 1): 4})],
         "'s' costs 4 for A = 1 and B = 1: it is not only an exclusion"),
        (
            {"A": (1, 2), "B": (0, 1, 2)},
            [not_the_same("A", "B")],
            (
                "RA cannot leave all tasks to others: each value of A excludes another robot's, which may mean"
                " that a task requires several robots"
            ),
        ),
        ({"A": (0, 1), "B": (0, 1), "C": (0, 1)}, [not_the_same("A", "B"), not_the_same("B", "C")],
         "A = 1 and C = 1 do not exclude each other, although both exclude the same choices of others"),
    ],
    ids=["n-ary", "soft", "no idle value", "no clique"],
)  # fmt: skip
def test_what_is_no_task_allocation_is_told(
    domains: dict[str, tuple[int, ...]], constraints: list[Constraint], fault: str
) -> None:
    assert allocation_fault(team_of(domains, constraints)) == fault


def test_a_partially_known_constraint_is_no_exclusion() -> None:
    parts = Constraint("p", NOT_THE_SAME, ("A", "B"), ("A", "B"), ConstraintModel.PKC)
    fault = allocation_fault(team_of({"A": (0, 1), "B": (0, 1)}, [parts]))
    assert fault == f"RB shares 'p', {NOT_A_PAIR}"


def test_too_many_pairs_of_values_are_refused_before_any_is_looked_at() -> None:
    team = team_of({"A": range(2001), "B": range(2000)}, [not_the_same("A", "B")])
    assert allocation_fault(team) == "'notSame' has 4,002,000 pairs of values, more than 4,000,000"


def test_the_finite_cost_that_is_told_does_not_depend_on_what_was_looked_at_before() -> None:
    crowd = soft("A", "B", rows={(3, 3): 1, (2, 2): 5})
    fault = "'s' costs 5 for A = 2 and B = 2: it is not only an exclusion"
    allocation_fault(team_of({"A": (0, 3), "B": (0, 3)}, [crowd]))
    for _ in range(2):
        assert allocation_fault(team_of({"A": (0, 2, 3), "B": (0, 2, 3)}, [crowd])) == fault


# Congestion


def test_with_congestion_what_pairs_of_robots_cost_is_the_task_s_and_several_constraints_add_up() -> None:
    rows = {(1, 1): 3, (2, 2): 4}
    scopes = [("A", "B"), ("A", "C"), ("B", "C")]
    made = [soft(*scope, rows=rows) for scope in scopes] + [soft(*scope, rows={(1, 1): 2}) for scope in scopes]
    team = team_of(dict.fromkeys("ABC", (0, 1, 2)), made)
    assert allocation_fault(team, congestion=True) == ""
    assert allocation_fault(team) != ""
    assert [task.cost for task in tasks_in(team, "RB", congestion=True)] == [5, 4]


def test_pairs_that_cost_different_amounts_are_no_congestion() -> None:
    made = [soft(*scope, rows={(1, 1): cost}) for scope, cost in ((("A", "B"), 3), (("A", "C"), 3), (("B", "C"), 4))]
    team = team_of(dict.fromkeys("ABC", (0, 1)), made)
    assert allocation_fault(team, congestion=True) == "A = 1 shares a task whose pairs of robots cost 3 and 4"
    with pytest.raises(UnsupportedError, match="RB shares a task that costs 3 with one robot, and 4 with another"):
        tasks_in(team, "RB", congestion=True)


# Random problems


@count("runs", 60, 1500)
def test_tasks_are_what_brute_force_finds(runs: int) -> None:
    """For random allocations and congestion, whatever was evaluated in this process before."""
    chance, found = Random("exclusions"), 0
    for number in range(runs):
        congestion = number % 2 == 1
        team = random_congestion(chance).team if congestion else random_allocation(chance, simple=True).team
        assert allocation_fault(team, congestion=congestion) == ""
        for robot in team.order:
            for task in tasks_in(team, robot, congestion=congestion):
                assert others_of(team, robot, task) == dict(task.others)
                found += 1
    assert found > runs


def others_of(team: Team, robot: str, task: SharedTask) -> dict[str, frozenset[tuple[int, int]]]:
    """Return which choices of other robots cost something together with the first own choice of `task`."""
    shown = {one.name: one.interface for one in team.robots}
    place, value = task.own[0]
    own, found = shown[robot][place], dict[str, set[tuple[int, int]]]()
    for constraint in team.constraints():
        if own in constraint.variables and len(constraint.variables) > 1:
            (other,) = {*constraint.variables} - {own}
            owner = team.owner[other]
            for theirs in team.variables[other].domain if owner != robot else ():
                if constraint.price({own: value, other: theirs}):
                    found.setdefault(owner, set()).add((shown[owner].index(other), theirs))
    return {name: frozenset(choices) for name, choices in found.items()}


def test_evaluations_that_are_kept_or_dropped_say_the_same() -> None:
    chance = Random("kept")
    kept, dropped = Evaluations(most=10**6), Evaluations(most=5)
    relation = soft("A", "B", rows={(a, b): chance.randint(0, 2) for a in range(6) for b in range(6)})
    cost_of = cost_function(relation, ("A", "B"))
    for _ in range(50):
        columns = tuple(tuple(sorted(chance.sample(range(6), chance.randint(1, 6)))) for _ in "AB")
        expected = {pair: cost for pair in itertools.product(*columns) if (cost := cost_of(pair))}
        for one in (kept, dropped):
            assert dict(one.costs(relation, ("A", "B"), (0, 1), (columns[0], columns[1]))) == expected
    assert INFINITE not in expected.values()
