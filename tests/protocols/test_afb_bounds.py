"""What must hold of AFB's bounds whatever arrives when, against brute force."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.afb import AFB, CPA, FBEstimate
from tests.support.brute_force import least_cost
from tests.support.cost_problems import cost_of, random_cost_team


class Watched(AFB):
    """Has what it says of CPAs held against the whole team's least costs."""

    least_with: Callable[[tuple[Value, ...]], float]
    seen: Counter[str]

    def send(self, receiver: str, message: Message) -> None:
        if isinstance(message, CPA):
            values = tuple(own for own, _ in message.assignments)
            for length, least in enumerate(message.least):
                assert least <= self.least_with(values[:length])
            if not message.least:
                assert self.least_with(values) >= message.bound
                self.seen["jump" if len(values) < self.rank else "step"] += 1
        if isinstance(message, FBEstimate):
            self.seen["estimate"] += 1
        super().send(receiver, message)


def watch(team: Team, seen: Counter[str]) -> type[AFB]:
    """AFB for `team`, of robots with one variable each."""
    domains = [sorted(variable.domain) for variable in team.variables.values()]
    constraints = list(team.constraints())
    least: dict[tuple[Value, ...], float] = {}
    for values in itertools.product(*domains):
        cost = cost_of(dict(zip(team.variables, values, strict=True)), constraints)
        shown = tuple((one,) if robot.interface else () for one, robot in zip(values, team.robots, strict=True))
        for length in range(len(shown) + 1):
            least[shown[:length]] = min(cost, least.get(shown[:length], INFINITE))
    return type("Watched", (Watched,), {"least_with": staticmethod(least.__getitem__), "seen": seen})


@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 4))])
def test_no_bound_is_too_high_and_no_cpa_goes_back_from_a_better_solution(batch: int) -> None:
    chance = Random(f"bounds {batch}")
    seen = Counter[str]()
    for seed in range(30):
        team = random_cost_team(chance)
        schedule = RandomChannels(seed) if seed % 2 else Concurrent(seed, chance.choice((0, 5, 50)))
        Simulation(team, watch(team, seen), schedule).run(60)
    assert min(seen[kind] for kind in ("jump", "step", "estimate")) > 30, seen


def test_what_is_found_at_any_moment_is_on_both_sides_of_the_least_cost() -> None:
    for seed in range(10):
        team = random_cost_team(Random(seed))
        least = least_cost(team)
        for messages in (1, 5, 10, 20, 40, 80, 160):
            findings = Simulation(team, AFB, RandomChannels(seed)).search(60, messages).findings
            assert (findings[team.order[0]].bound or 0) <= least
            assert all(least <= found.best.cost for found in findings.values() if found.best is not None)
