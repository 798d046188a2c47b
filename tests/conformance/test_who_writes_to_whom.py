"""Who writes to whom: protocols that say they stay among those that share constraints do, and the others do not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.network.profile import possible_neighbours
from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.requirements import unmet_requirement
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.encoding import TooLargeError
from robochoc.verification.objective import withdrawal_cost
from tests.support.allocation_problems import simple_allocation_team
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.problems import random_team
from tests.support.sparse_teams import profiles_of, sparse_team

OURS = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]
WITHIN: list[type[Protocol]] = [
    FirstFit,
    *(protocol_named(name) for name in OURS if not protocol_named(name).traits.writes_to_non_neighbours),
]
BEYOND = [protocol_named(name) for name in OURS if protocol_named(name).traits.writes_to_non_neighbours]
MESSAGES = 400


def name_of(protocol: type[Protocol]) -> str:
    return protocol.__name__


def strangers(
    team: Team, protocol: type[Protocol], seed: int, parameters: RunParameters = DEFAULT_PARAMETERS
) -> set[tuple[str, str]]:
    """Who has written to whom without sharing a constraint."""
    known = possible_neighbours(profiles_of(team))
    found = set()

    def look(event: AnyEvent) -> None:
        if isinstance(event, Sent) and event.receiver not in known[event.sender]:
            found.add((event.sender, event.receiver))

    simulation = Simulation(team, protocol, RandomChannels(seed), observer=look, parameters=parameters)
    with simulation as session, suppress(TooLargeError):  # until then it has written as well
        session.search(messages=MESSAGES)
    return found


def random_teams(seed: int, *, costs: bool) -> Iterator[Team]:
    """Binary, n-ary, unconnected, complex (without what needs a solver); with costs too if `costs`."""
    chance = Random(seed)
    yield random_team(chance)
    yield open_hearted(random_complex_team(chance))
    yield sparse_team(seed)
    if costs:
        yield random_cost_team(chance)
        yield open_hearted(random_complex_cost_team(chance))


def open_hearted(team: Team) -> Team:
    """`team` without private constraints."""
    return replace(team, robots=tuple(replace(robot, private=()) for robot in team.robots))


@pytest.mark.usefixtures("quick_encryption")
@pytest.mark.parametrize("protocol", WITHIN, ids=name_of)
def test_who_stays_within_never_writes_to_a_stranger(protocol: type[Protocol]) -> None:
    for seed in range(4):
        allocations = [simple_allocation_team(Random(seed))] if protocol.traits.allocates else None
        for team in allocations or random_teams(seed, costs=protocol.traits.costs):
            if any(unmet_requirement(robot, protocol.traits, team.owner) for robot in team.robots):
                continue
            assert strangers(team, protocol, seed) == set()
            if protocol.traits.costs and not allocations:  # the last value is to withdraw
                assert (
                    strangers(team, protocol, seed, RunParameters(seed, withdrawal_cost=withdrawal_cost(team))) == set()
                )


@pytest.mark.parametrize("protocol", BEYOND, ids=name_of)
def test_who_goes_beyond_does_so_somewhere(protocol: type[Protocol]) -> None:
    assert any(strangers(sparse_team(seed), protocol, seed) for seed in range(20))


def test_both_kinds_are_there() -> None:
    assert set(map(name_of, WITHIN)) >= {"ADOPT", "BnBADOPT", "DPOP", "DSA", "FirstFit", "MGM", "MGM2", "MaxSum"}
    assert set(map(name_of, BEYOND)) >= {"ABT", "AFC", "AWC", "DisFC", "SBT", "SFB", "SyncBB"}
