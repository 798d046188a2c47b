"""P-DSA: the same cycles as DSA on known values, and limits."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.chance import UNIT
from robochoc.protocols.key_stream import KeyStream, shuffled
from robochoc.protocols.private.p_dsa import PDSA
from robochoc.run import Options, Runtime, solve
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import UnsupportedError
from tests.support.cost_problems import with_costs
from tests.support.examples import count, drawn
from tests.support.private_problems import priced
from tests.support.problems import team_of

CYCLES = 4
PROBABILITY = 0.7
Costs = dict[tuple[int, int], dict[tuple[int, int], float]]


def options_of(**settings: str) -> Options:
    return Options(protocol="p-dsa", runtime=Runtime.SIMULATOR, cache=False, settings={"bits": "31", **settings})


def random_costs(chance: Random) -> tuple[Costs, Team]:
    """Return three or four robots with three values, and the costs of pairs of robots, by their numbers."""
    names = "ABCD"[: chance.choice((3, 4))]
    pairs = [(one, two) for one in range(len(names)) for two in range(one + 1, len(names)) if chance.random() < 0.7]
    rows = [(one, two) for one in range(3) for two in range(3)]
    prices = (0, 1, 2, 5, 9, INFINITE)
    costs = {pair: {row: chance.choice(prices) for row in rows} for pair in pairs or [(0, 1)]}
    constraints = [priced(names[one], names[two], rows) for (one, two), rows in costs.items()]
    return costs, with_costs(team_of(dict.fromkeys(names, (0, 1, 2)), constraints))


def dsa(costs: Costs, robots: int, seed: int) -> list[int]:
    """Return the values in the best cycle of DSA, variant A, with the random numbers of P-DSA's robots."""
    secrets = [KeyStream(seed, f"R{name}") for name in "ABCD"[:robots]]
    values = [shuffled([0, 1, 2], secret)[0] for secret in secrets]
    coins = [[secret(53) * UNIT < PROBABILITY for _ in range(CYCLES)] for secret in secrets]

    def number(cost: float) -> float:
        return 10**6 if cost == INFINITE else cost

    def cost(robot: int, value: int) -> float:
        now = [*values]
        now[robot] = value
        return sum(number(rows[now[one], now[two]]) for (one, two), rows in costs.items() if robot in {one, two})

    best, least = values, INFINITE
    for cycle in range(CYCLES):
        total = sum(cost(robot, values[robot]) for robot in range(robots))
        if total < least:
            best, least = values, total
        wanted = [min(range(3), key=lambda value, robot=robot: cost(robot, value)) for robot in range(robots)]  # type: ignore[misc]
        moves = [
            coins[robot][cycle] and cost(robot, wanted[robot]) < cost(robot, values[robot]) for robot in range(robots)
        ]
        values = [wanted[robot] if moves[robot] else values[robot] for robot in range(robots)]
    return best


@count("number", fast=4, slow=80)
def test_the_answer_is_that_of_dsa_on_known_values(number: int) -> None:
    for seed in range(number):
        costs, team = random_costs(drawn(f"p-dsa {seed}"))
        parameters = RunParameters(seed, {"bits": "31", "cycles": str(CYCLES)})
        with Simulation(team, PDSA, RandomChannels(seed), parameters=parameters) as simulation:
            found = simulation.search().assignments
        expected = dsa(costs, len(team.robots), seed)
        assert [found[f"R{name}"][name] for name in "ABCD"[: len(team.robots)]] == expected


def test_a_search_that_is_too_large_is_refused_before_it_begins() -> None:
    _, team = random_costs(Random(1))
    with pytest.raises(UnsupportedError, match=r"needs \d+ comparisons.*--set comparisons=N"):
        solve(team, options_of(comparisons="50"))


def test_a_robot_without_a_possible_value_ends_the_search() -> None:
    shared = priced("A", "B", {(1, 1): 1})
    never = Relation("never", 1, Semantics.CONFLICTS, ((1,),))
    alone = Constraint("n", never, ("C",), ("C",), model=None)
    domains = dict.fromkeys("ABC", (1,))
    assert solve(with_costs(team_of(domains, [shared])), options_of(cycles="2")).cost == 1
    assert solve(with_costs(team_of(domains, [shared, alone])), options_of(cycles="2")).verdict == Verdict.NO_SOLUTION


@pytest.mark.parametrize("protocol", ["pc-syncbb", "p-dsa", "p-mgm", "p-maxsum"])
def test_a_domain_that_a_change_has_emptied_ends_the_search(protocol: str) -> None:
    for empty in "AB":
        domains = {name: () if name == empty else (1,) for name in "ABC"}
        team = with_costs(team_of(domains, [priced("A", "B", {(1, 1): 1})]))
        assert Simulation(team, protocol_named(protocol), Concurrent(seed=0)).search().verdict == Verdict.NO_SOLUTION
