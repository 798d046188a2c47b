"""Target tracking and task allocation: the best is what positions, ways and skills say."""

from __future__ import annotations

import itertools
from decimal import ROUND_HALF_UP, Decimal, localcontext
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team
from robochoc.generators.tasks import DrawnTasks, Skills, Travel, drawn_tasks, tasks
from robochoc.generators.tracking import Field, drawn_field, tracking
from robochoc.model.allocation import Distance, distance_between
from robochoc.model.problem import Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.evaluation import best, digest
from tests.support.examples import examples


def cost(team: Team, protocol: str) -> Fraction:
    found = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR)).cost
    assert found is not None
    return Fraction(found)


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    teams = [
        tracking(4, 5, 6, 3),
        tasks(4, 3, 5),
        tasks(4, 4, 5, travel=Travel(20, Distance.STRAIGHT, 2), skills=Skills(3, 2)),
        tasks(3, 4, 5, model="several", capacity=4),
    ]
    assert {team.name: digest(team) for team in teams} == {
        "tracking-4-5-6x6-1-2-100-30-3": "579e9aaf5e625e7e",
        "tasks-assignment-4-3-100-200-1of1-streets-5": "422ff5ba9e540887",
        "tasks-assignment-4-4-20-200-2of3-straight2-5": "7aad6bdaa27583c1",
        "tasks-several-3-4-100-200-1of1-streets-4-5": "6e33e05bb51e41b3",
    }


# Tracking


def uncovered(field: Field, requirement: int) -> int:
    """Return the least that can be left uncovered, by complex numbers: a cell is a point of the plane."""

    def point(cell: int) -> complex:
        return complex(cell // field.side, cell % field.side)

    cells = range(field.side**2)
    reach = [
        [one for one in cells if abs(point(one) - point(start)) <= field.mobility + 1e-9] for start in field.starts
    ]
    found = []
    for places in itertools.product(*reach):
        left = 0
        for target in field.targets:
            near = [abs(point(one) - point(target)) <= field.sensing + 1e-9 for one in places]
            left += max(0, requirement - sum(itertools.compress(field.credibility, near)))
        found.append(left)
    return min(found)


@given(st.integers(1, 4), st.integers(1, 5), st.integers(3, 7), st.integers(0, 2**32))
@examples(15)
def test_tracking_leaves_as_little_as_can_be(agents: int, targets: int, side: int, seed: int) -> None:
    team = tracking(agents, targets, side, seed, requirement=40)
    check_team(team)
    field = drawn_field(Random(seed), (agents, targets, side), 30, 1, 2)
    assert len(set(field.starts)) == agents
    assert len(set(field.targets)) == targets
    assert best(team) == uncovered(field, 40)


@pytest.mark.parametrize("seed", range(2))
def test_protocols_track(seed: int) -> None:
    wanted = uncovered(drawn_field(Random(seed), (4, 6, 7), 30, 1, 2), 100)
    team = tracking(4, 6, 7, seed)
    assert cost(team, "dpop") == cost(team, "central") == wanted


def test_targets_that_nobody_can_see_are_a_constant() -> None:
    team = tracking(1, 16, 4, mobility=0, sensing=0, requirement=7, credibility=1)
    assert team.robots[0].costs.constant == 15 * 7
    assert best(team) == 16 * 7 - 1


# Tasks


def profits(problem: DrawnTasks, *, several: bool) -> int:
    """Return the best profit, by giving each task to nobody or to a robot that can do it."""
    found = []
    for doers in itertools.product((0, *problem.profit), repeat=len(problem.load)):
        given_to = [(robot, task) for task, robot in enumerate(doers, 1) if robot]
        room = dict.fromkeys(problem.profit, 0)
        for robot, task in given_to:
            room[robot] += problem.load[task] if several else 1
        able = all(task in problem.profit[robot] for robot, task in given_to)
        if able and max(room.values()) <= (problem.capacity if several else 1):
            found.append(sum(problem.profit[robot][task] for robot, task in given_to))
    return max(found)


@given(st.integers(1, 3), st.integers(1, 3), st.integers(1, 2), st.booleans(), st.integers(0, 2**32))
@examples(20)
def test_tasks_bring_as_much_as_can_be(agents: int, count: int, each: int, several: bool, seed: int) -> None:  # noqa: FBT001
    ways, skills = Travel(60, Distance.STRAIGHT, 3), Skills(2, each)
    problem = drawn_tasks(Random(seed), (agents, count, 100), ways, skills, 3)
    model = "several" if several else "assignment"
    if several and not any(problem.profit.values()):
        with pytest.raises(ValueError, match="no robot has a skill"):
            tasks(agents, count, seed, worth=100, travel=ways, skills=skills, model=model)
        return
    team = tasks(agents, count, seed, worth=100, travel=ways, skills=skills, model=model)
    check_team(team)
    assert team.robots[0].costs.maximize
    assert best(team) == Fraction(profits(problem, several=several), 1000)


@pytest.mark.parametrize("model", ["assignment", "several"])
def test_protocols_allocate(model: str) -> None:
    for seed in range(2):
        wanted = profits(drawn_tasks(Random(seed), (4, 4, 200), Travel(), Skills(2, 1), 3), several=model == "several")
        team = tasks(4, 4, seed, skills=Skills(2, 1), model=model)
        assert cost(team, "dpop") == cost(team, "central") == wanted


@given(st.integers(0, 10_000), st.integers(0, 10_000), st.integers(0, 9))
@examples(40)
def test_straight_ways_are_rounded_exactly(across: int, along: int, places: int) -> None:
    with localcontext() as context:
        context.prec = 60
        exact = Decimal(across**2 + along**2).sqrt()
        rounded = exact.quantize(Decimal(1).scaleb(-places), ROUND_HALF_UP)
    assert distance_between((0, along), (across, 0), Distance.STRAIGHT, places) == rounded.scaleb(places)
    assert distance_between((0, along), (across, 0), Distance.STREETS, places) == (across + along) * 10**places
