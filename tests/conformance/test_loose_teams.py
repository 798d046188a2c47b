"""Every protocol, on every runtime, where links and variables are superfluous, in orders of every kind."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random

import pytest

from robochoc.model.orders import Order
from robochoc.model.outcome import Verdict
from robochoc.run import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.allocation_problems import ANY_TEAM
from tests.support.loose_problems import check_against_brute_force, every_order, loose_team, turned_interface
from tests.support.random_options import random_schedule

pytestmark = pytest.mark.usefixtures("quick_encryption")
EVERY_PROTOCOL = pytest.mark.parametrize("protocol", protocol_names())
FIRST, MANY = 3, 2000
IN_PROCESSES, ON_THE_NETWORK = 100, 20


def solved(protocol: str, seed: str, kind: int, runtime: Runtime = Runtime.SIMULATOR) -> Verdict:
    """Solve the team of `seed` in an order of the `kind` of that number; say so when it fails."""
    chance = Random(seed)
    costs = protocol_named(protocol).traits.costs and chance.random() < 0.7
    team = loose_team(protocol, chance, costs=costs)
    options = replace(random_schedule(chance), protocol=protocol)
    if runtime is not Runtime.SIMULATOR:
        options = Options(protocol=protocol, runtime=runtime, seed=options.seed)
    orders = every_order(team, chance)
    try:
        return check_against_brute_force(team, replace(options, order=orders[kind % len(orders)])).verdict
    except Exception as error:
        raise AssertionError(f"solved({protocol!r}, {seed!r}, {kind}, {runtime!r}): {error}") from error


@pytest.mark.parametrize("protocol", ANY_TEAM)
def test_a_turned_link_takes_a_variable_out_of_sight(protocol: str) -> None:
    """Domains were once compiled from the team in the files: eleven protocols found no solution, five crashed."""
    team = turned_interface()
    orders: list[Order | tuple[str, ...]] = [("C", "A", "B"), ("B", "C", "A"), Order.RANDOM]
    for order in orders:
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, order=order)
        assert check_against_brute_force(team, options).verdict is Verdict.SOLUTION


@EVERY_PROTOCOL
def test_loose_teams(protocol: str) -> None:
    for number in range(FIRST):
        solved(protocol, f"loose {protocol} {number}", number)


@pytest.mark.slow
@EVERY_PROTOCOL
def test_many_loose_teams(protocol: str) -> None:
    seen = Counter(solved(protocol, f"many {protocol} {number}", number) for number in range(MANY))
    assert not protocol_named(protocol).traits.complete or len(seen) > 1


@pytest.mark.slow
@EVERY_PROTOCOL
def test_loose_teams_in_processes(protocol: str) -> None:
    for number in range(IN_PROCESSES):
        solved(protocol, f"processes {protocol} {number}", number, Runtime.PROCESSES)


@pytest.mark.slow
@EVERY_PROTOCOL
def test_loose_teams_over_the_network(protocol: str) -> None:
    for number in range(ON_THE_NETWORK):
        solved(protocol, f"network {protocol} {number}", number, Runtime.NETWORK)
