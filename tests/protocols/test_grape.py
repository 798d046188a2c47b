"""GRAPE (Jang, Shin, Tsourdos, IEEE T-RO 34(6), 2018): its rules, Nash stability by brute force, and its bound."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.tasks import tasks
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.constraint import Constraint, Relation, Semantics
from robochoc.model.costs import normalized
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.auctions.grape import GRAPE, Partition
from robochoc.run import Options, Runtime, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.agents import replies, robot_of, started
from tests.support.allocation_problems import Congestion, plain, random_congestion, simple_allocation_team
from tests.support.cases import looped
from tests.support.cost_problems import with_costs
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.local_search_runs import any_schedule, played
from tests.support.problems import team_of
from tests.support.random_options import random_schedule

TASK, OTHER = (0, 1), (0, 2)
"""Two tasks, as each robot names them."""


def team_of_three(*worth: tuple[int, int], cost: float = INFINITE) -> Team:
    """A, B and C; the tasks 1 and 2 are worth so much to each. Each pair that does the same pays `cost`."""
    both = ((1, 1), (2, 2))
    if cost == INFINITE:
        shared = Relation("alone", 2, Semantics.CONFLICTS, both)
    else:
        shared = Relation("crowd", 2, Semantics.SOFT, both, (int(cost), int(cost)))
    made = [Constraint("S", shared, pair, pair) for pair in itertools.combinations("ABC", 2)]
    for name, (one, other) in zip("ABC", worth, strict=True):
        saves = Relation(f"U{name}", 1, Semantics.SOFT, ((0,), (1,), (2,)), (100, 100 - one, 100 - other))
        made.append(Constraint("U", saves, (name,), (name,), None))
    return with_costs(team_of(dict.fromkeys("ABC", (0, 1, 2)), made))


def robot_a(*worth: tuple[int, int], cost: float = INFINITE, chances: tuple[float, ...] = (0.5,)) -> GRAPE:
    """A, which has joined task 1 in the first move, with half of the largest stamp unless `chances` say otherwise."""
    robot = robot_of(GRAPE, team_of_three(*(worth or ((9, 5), (8, 4), (7, 3))), cost=cost), "RA", *chances)
    started(robot)
    return robot


HALF = 1 << 31


def test_a_robot_that_is_not_satisfied_joins_the_best_coalition_and_tells_it() -> None:
    robot = robot_of(GRAPE, team_of_three((9, 5), (8, 4), (7, 3)), "RA", 0.5)
    first = Partition(1, HALF, "RA", {"RA": TASK})
    assert started(robot) == [("RB", first), ("RC", first)]
    assert robot.satisfied


def test_a_robot_that_gains_nowhere_stays() -> None:
    robot = robot_of(GRAPE, team_of_three((0, -5), (8, 4), (7, 3)), "RA")
    assert started(robot) == []
    assert robot.satisfied


def test_the_partition_with_more_moves_counts() -> None:
    newer = Partition(2, 0, "RB", {"RB": TASK, "RC": OTHER})
    robot = robot_a()
    assert replies(robot, ("RB", newer)) == [("RC", newer)]
    assert robot.partition == newer
    assert robot.assignment == {"A": 0}


def test_of_equally_many_moves_the_larger_stamp_counts() -> None:
    robot = robot_a()
    newer, older = (Partition(1, HALF + more, "RB", {"RB": TASK}) for more in (1, -1))
    assert replies(robot, ("RB", older)) == []
    assert robot.partition.mover == "RA"
    moved = Partition(2, 0, "RA", {"RB": TASK, "RA": OTHER})
    assert replies(robot, ("RB", newer)) == [("RB", moved), ("RC", moved)]


def test_of_equal_stamps_the_robot_of_higher_priority_counts() -> None:
    robot = robot_a()
    assert replies(robot, ("RB", Partition(1, HALF, "RB", {"RB": TASK}))) == []
    assert robot.partition.mover == "RA"


def test_of_several_partitions_the_newest_is_taken_over() -> None:
    robot = robot_a()
    old, new = (Partition(number, 0, "RB", {"RB": TASK, "RC": OTHER}) for number in (2, 3))
    assert replies(robot, ("RB", old), ("RC", new)) == [("RB", new)]


def test_who_is_satisfied_and_hears_nothing_newer_does_nothing() -> None:
    robot = robot_a()
    assert replies(robot, ("RB", Partition(1, 7, "RB", {"RB": OTHER}))) == []
    assert robot.assignment == {"A": 1}


def test_a_robot_that_is_in_a_partition_that_it_takes_over_is_so() -> None:
    robot = robot_a()
    newer = Partition(5, 0, "RB", {"RA": OTHER, "RB": TASK})
    assert replies(robot, ("RB", newer)) == [("RC", newer)]
    assert robot.assignment == {"A": 2}


def test_half_of_what_pairs_cost_is_paid() -> None:
    """Task 1 gains 9, and pairs there cost 10: with one other robot A keeps 4, less than the 5 of task 2."""
    robot = robot_a((9, 5), (8, 4), (7, 3), cost=10)
    (_, moved), _ = replies(robot, ("RB", Partition(2, 0, "RB", {"RB": TASK, "RC": TASK})))
    assert moved == Partition(3, 0, "RA", {"RB": TASK, "RC": TASK, "RA": OTHER})
    robot = robot_a((11, 5), (8, 4), (7, 3), cost=10)
    (_, moved), _ = replies(robot, ("RB", Partition(2, 0, "RB", {"RB": TASK})))
    assert moved == Partition(3, 0, "RA", {"RB": TASK, "RA": TASK})


def test_a_lie_is_refused() -> None:
    for lie in (
        Partition(0, 0, "RB", {}),
        Partition(2, -1, "RB", {}),
        Partition(2, 1 << 32, "RB", {}),
        Partition(2, 0, "RX", {}),
        Partition(2, 0, "RB", {"RX": TASK}),
        Partition(2, 0, "RB", {"RA": (0, 9)}),
    ):
        with pytest.raises(ValueError, match=r"unknown robots|invalid stamp|cannot do"):
            robot_a().receive("RB", lie)


# What it ends in


def share(team: Team, values: dict[str, int], robot: str) -> float:
    """What a robot pays: its own costs, and half of those that it shares. Nothing of it is the protocol's."""
    own = {variable.name for variable in team[robot].variables}
    met = [one for one in team.constraints() if own & {*one.variables}]
    return sum(one.price(values) / len(one.variables) for one in met)


def is_nash_stable(team: Team, values: dict[str, int]) -> bool:
    """Return whether no robot pays less with another value, as long as all others keep theirs."""
    return all(
        share(team, {**values, variable.name: other}, robot.name) >= share(team, values, robot.name)
        for robot in team.robots
        for variable in robot.variables
        for other in variable.domain
    )


def values_of(team: Team, chance: Random) -> tuple[dict[str, int], int]:
    """Return the values that a run on any schedule ends with, and how many moves the last partition counts."""
    moves = 0

    def look(event: AnyEvent) -> None:
        nonlocal moves
        if isinstance(event, Sent):
            moves = max(moves, event.content["evolution"])

    with Simulation(team, GRAPE, any_schedule(chance), observer=look) as session:
        result = session.search(messages=20_000)
    assert result.verdict is Verdict.SOLUTION
    return {name: value for own in result.assignments.values() for name, value in own.items()}, moves


@count("runs", 80, 5000)
def test_it_ends_in_a_nash_stable_partition(runs: int) -> None:
    chance, several = Random("stable"), 0
    for number in range(runs):
        congestion = random_congestion(chance)
        team = plain(congestion.team)
        values, moves = values_of(team, chance)
        assert is_nash_stable(team, values), number
        robots = len(team.robots)
        assert moves <= robots * (robots + 1) // 2
        done = Counter(value for value in values.values() if value)
        several += max(done.values(), default=0) > 1
    assert runs // 5 < several < runs


@count("runs", 80, 2000)
def test_so_it_does_where_robots_exclude_each_other(runs: int) -> None:
    chance, found = Random("exclusive"), 0
    while found < runs:
        team = simple_allocation_team(chance)
        if any(len(robot.variables) > 1 for robot in team.robots):
            continue
        found += 1
        assert is_nash_stable(team, values_of(team, chance)[0])


def gained(congestion: Congestion, values: tuple[int, ...]) -> float:
    done = Counter(value for value in values if value)
    paid = sum(congestion.cost[task - 1] * number * (number - 1) / 2 for task, number in done.items() if number > 1)
    return sum(own[value - 1] for own, value in zip(congestion.worth, values, strict=True) if value) - paid


@count("runs", 80, 2000)
def test_where_coalitions_never_gain_less_with_more_robots_half_of_the_optimum_is_gained(runs: int) -> None:
    chance, worst = Random("half"), 1.0
    for _ in range(runs):
        congestion = random_congestion(chance, monotone=True)
        values, _ = values_of(plain(congestion.team), chance)
        choices = range(len(congestion.cost) + 1)
        best = max(gained(congestion, one) for one in itertools.product(choices, repeat=len(congestion.worth)))
        found = gained(congestion, tuple(values[f"V{at}"] for at in range(len(congestion.worth))))
        assert best / 2 <= found <= best
        worst = min(worst, found / best)
    assert 0.5 <= worst < 1


@pytest.mark.more
@looped("runtime", [Runtime.PROCESSES, Runtime.NETWORK])
def test_it_ends_so_on_every_runtime(runtime: Runtime) -> None:
    team = plain(random_congestion(Random(4)).team)
    outcome = solve(team, Options(protocol="grape", runtime=runtime, timeout=HANG_S))
    assert outcome.verdict is Verdict.SOLUTION
    assert outcome.verified
    assert is_nash_stable(team, outcome.assignment)


@count("runs", 20, 500)
def test_costs_are_told_as_the_team_has_them(runs: int) -> None:
    """`solve` has the answer checked; the cost is what the tasks gain, less what pairs cost."""
    chance = Random("told")
    for _ in range(runs):
        congestion = random_congestion(chance)
        outcome = solve(congestion.team, replace(random_schedule(chance), protocol="grape"))
        values = tuple(outcome.assignment[f"V{at}"] for at in range(len(congestion.worth)))
        assert outcome.cost == gained(congestion, values)


def test_pairs_that_cost_different_amounts_are_refused() -> None:
    """The game is anonymous: who else is there does not matter."""
    dear, cheap = (Relation(f"S{cost}", 2, Semantics.SOFT, ((1, 1),), (cost,)) for cost in (5, 4))
    made = [
        Constraint("S", one, pair, pair) for one, pair in ((dear, ("A", "B")), (cheap, ("B", "C")), (dear, ("A", "C")))
    ]
    team = with_costs(team_of(dict.fromkeys("ABC", (0, 1)), made))
    with pytest.raises(UnsupportedError, match="a task whose pairs of robots cost 4 and 5"):
        solve(team, Options(protocol="grape", runtime=Runtime.SIMULATOR))


def test_congestion_is_for_grape_alone() -> None:
    team = team_of_three((9, 5), (8, 4), (7, 3), cost=3)
    for other in ("ssi", "cbaa", "cbba"):
        with pytest.raises(UnsupportedError, match="costs 3 for A = 1 and B = 1: it is not only an exclusion"):
            solve(team, Options(protocol=other, runtime=Runtime.SIMULATOR))


def test_the_seed_decides_who_moves_first() -> None:
    team = normalized(tasks(5, 2, 3))
    found = {str(played(team, GRAPE, Concurrent(0), seed).assignments) for seed in range(9)}
    assert len(found) > 1
