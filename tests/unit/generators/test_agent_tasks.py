"""The tasks of agent benchmarks: solutions are exactly what the papers demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import pytest

from robochoc.formats import check_team
from robochoc.generators.agentsnet import Task
from robochoc.generators.agentsnet_score import agentsnet_score
from robochoc.generators.draws import random_integer, seeded
from robochoc.generators.families import FAMILIES
from robochoc.generators.graphs import scale_free
from robochoc.generators.smart_grid import smart_grid
from robochoc.model.problem import INFINITE, Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.seats import GameOptions, Limits, play
from robochoc.verification.checker import constraint_cost
from tests.support.cases import cases
from tests.support.evaluation import digest
from tests.support.limits import HANG_S
from tests.support.seats import program

Values = Mapping[int, int]
AGENTS = 5
EDGES = scale_free(AGENTS).draw(seeded(0))


def covers(chosen: Values) -> bool:
    return all(chosen[one] or chosen[other] for one, other in EDGES)


def matches(chosen: Values) -> bool:
    pairs = {(one, other) for one, other in chosen.items() if other}
    linked = {*EDGES, *((other, one) for one, other in EDGES)}
    maximal = not any(not chosen[one] and not chosen[other] for one, other in EDGES)
    return pairs <= linked and pairs == {(other, one) for one, other in pairs} and maximal


SOLVED: Mapping[Task, Callable[[Values], bool]] = {
    Task.COLORING: lambda chosen: all(chosen[one] != chosen[other] for one, other in EDGES),
    Task.VERTEX_COVER: covers,
    Task.MATCHING: matches,
    Task.LEADER_ELECTION: lambda chosen: (
        sum(one == leader for one, leader in chosen.items()) == 1 and len({*chosen.values()}) == 1
    ),
    Task.CONSENSUS: lambda chosen: len({*chosen.values()}) == 1,
}


def task(name: str, agents: int = AGENTS) -> Team:
    return FAMILIES["agentsnet"](task=name, agents=agents, graph="scale-free")


def test_assignments_are_feasible_if_and_only_if_they_solve_the_task() -> None:
    with cases() as each:
        for name, solves in SOLVED.items():
            with each(name):
                team = task(name)
                check_team(team)
                constraints = [*team.constraints()]
                for values in product(*(variable.domain for variable in team.variables.values())):
                    assignment = dict(zip(team.variables, values, strict=True))
                    feasible = all(constraint_cost(one, assignment) < INFINITE for one in constraints)
                    assert feasible == solves(dict(enumerate(values, 1))), values


def test_scores_are_1_if_and_only_if_the_task_is_solved() -> None:
    with cases() as each:
        for name, solves in SOLVED.items():
            with each(name):
                team = task(name)
                for values in product(*(variable.domain for variable in team.variables.values())):
                    chosen = dict(enumerate(values, 1))
                    points = agentsnet_score(name, team, dict(zip(team.variables, values, strict=True)))
                    assert 0 <= points <= 1
                    minimal = name != Task.VERTEX_COVER or not any(
                        value and covers({**chosen, robot: 0}) for robot, value in chosen.items()
                    )
                    agreed = name == Task.LEADER_ELECTION  # the score ignores whom the other robots name
                    assert points == 1 if solves(chosen) and minimal else agreed or points < 1, values


def test_a_coordinator_costs_1() -> None:
    team = task("vertex-cover")
    outcome = solve(team, Options(protocol="central", runtime=Runtime.SIMULATOR))
    assert outcome.cost == min(
        sum(values) for values in product(range(2), repeat=AGENTS) if covers(dict(enumerate(values, 1)))
    )


@pytest.mark.parametrize("name", ["leader-election", "consensus"])
def test_agreement_requires_a_connected_graph(name: str) -> None:
    with pytest.raises(ValueError, match="the graph is not connected"):
        FAMILIES["agentsnet"](task=name, agents=4, degree=0)


def protocols(name: str) -> tuple[str, ...]:
    return ("dsa", "mgm", "gdba") if name == Task.VERTEX_COVER else ("abt", "awc", "afc-ng")


def test_protocols_solve_small_tasks() -> None:
    with cases() as each:
        for name in Task:
            for protocol in protocols(name):
                with each(f"{name}, {protocol}"):
                    team = task(name, 8)
                    outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, seed=1))
                    assert agentsnet_score(name, team, outcome.assignment) == 1


def test_players_of_seats_lie_between_random_and_optimal() -> None:
    team = FAMILIES["agentsnet"](task="vertex-cover", agents=12, graph="scale-free", seed=1)

    def paid(player: str) -> tuple[int, float]:
        game = play(team, GameOptions(others=player, rounds=30))
        return game.violations, game.regret or 0

    assert (0, 0) == paid("optimal") <= paid("mgm") <= paid("random")
    assert paid("random") > (0, 0)


def test_a_lying_seat_is_named() -> None:
    body = "move['announce'] = values[1 - best]"
    limits = Limits(timeout_s=HANG_S)
    report = play(task("vertex-cover"), GameOptions({"Robot1": program(body)}, others="mgm", rounds=3, limits=limits))
    assert [one.robot for one in report.seats if one.lies] == ["Robot1"]
    assert report["Robot1"].lies == (1, 2, 3)


def test_the_cost_of_a_grid_is_the_consumption_above_the_supply() -> None:
    team = smart_grid(agents=2, slots=6, window=2, supply=9, consumption=9, seed=3)
    check_team(team)
    for values in product(*(variable.domain for variable in team.variables.values())):
        assignment = dict(zip(team.variables, values, strict=True))
        assert sum(constraint_cost(one, assignment) for one in team.constraints()) == grid_cost(assignment)


def grid_cost(starts: Mapping[str, int]) -> int:
    """Return the cost by simulation, with the devices that are drawn for seed 3."""
    chance = seeded(3)
    used = dict.fromkeys(range(1, 7), 0)
    for start in starts.values():
        random_integer(chance, 1, 3)
        runs, consumed = random_integer(chance, 1, 3), random_integer(chance, 1, 9)
        for slot in range(start, start + runs):
            used[slot] += consumed
    supply = dict(zip(used, (2, 5, 7, 7, 5, 2), strict=True))
    return sum(max(0, used[slot] - supply[slot]) for slot in used)


def test_too_many_devices_in_a_slot() -> None:
    with pytest.raises(ValueError, match="devices can run in slot"):
        smart_grid(agents=100)


def test_seeds_give_the_same_problems_on_every_machine() -> None:
    teams = [task("matching"), smart_grid(agents=3, seed=1)]
    assert {team.name: digest(team) for team in teams} == {
        "agentsnet-matching-5-scale-free2-0": "2b56eb60735b2fbb",
        "smart-grid-3-2-24-3-3-30-40-1": "3ffaf5a6745a18a2",
    }
