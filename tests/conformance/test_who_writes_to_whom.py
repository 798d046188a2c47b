"""Who writes to whom: protocols that say they stay among those that share constraints do, and the others do not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

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
from robochoc.solver.errors import TooLargeError
from robochoc.verification.objective import withdrawal_cost
from tests.support.allocation_problems import simple_allocation_team
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.examples import count, drawn
from tests.support.problems import random_team
from tests.support.sparse_teams import profiles_of, sparse_team

pytestmark = [pytest.mark.fresh, pytest.mark.usefixtures("quick_encryption")]
OURS = [protocol for name in protocol_names() if (protocol := protocol_named(name)).__module__.startswith("robochoc.")]
WITHIN: list[type[Protocol]] = [FirstFit, *(one for one in OURS if not one.traits.writes_to_non_neighbours)]
BEYOND = [one for one in OURS if one.traits.writes_to_non_neighbours]
MESSAGES = 250


def strangers(
    team: Team, protocol: type[Protocol], seed: int, parameters: RunParameters = DEFAULT_PARAMETERS
) -> set[tuple[str, str]]:
    """Return pairs of sender and receiver that share no constraint."""
    known = possible_neighbours(profiles_of(team))
    found = set()

    def look(event: AnyEvent) -> None:
        if isinstance(event, Sent) and event.receiver not in known[event.sender]:
            found.add((event.sender, event.receiver))

    simulation = Simulation(team, protocol, RandomChannels(seed), observer=look, parameters=parameters)
    with simulation as session, suppress(TooLargeError):  # until then it has written as well
        session.search(messages=MESSAGES)
    return found


def random_teams(protocol: type[Protocol], seed: int) -> Iterator[Team]:
    """Yield unconnected, binary, n-ary and complex teams, in which no robot needs a solver."""
    chance = drawn(f"who writes {seed}")
    if protocol.traits.allocates:
        yield simple_allocation_team(chance)
        return
    yield sparse_team(chance.getrandbits(32))
    yield random_team(chance)
    yield open_hearted(random_complex_team(chance))
    if protocol.traits.costs:
        yield random_cost_team(chance)
        yield open_hearted(random_complex_cost_team(chance))


def open_hearted(team: Team) -> Team:
    """`team` without private constraints."""
    return replace(team, robots=tuple(replace(robot, private=()) for robot in team.robots))


@count("seeds", 1, 8)
@looped("protocol", WITHIN)
def test_who_stays_within_never_writes_to_a_stranger(protocol: type[Protocol], seeds: int) -> None:
    for seed in range(seeds):
        for team in random_teams(protocol, seed):
            if any(unmet_requirement(robot, protocol.traits, team.owner) for robot in team.robots):
                continue
            assert strangers(team, protocol, seed) == set(), seed
            if protocol.traits.costs and not protocol.traits.allocates:  # the last value is to withdraw
                withdrawing = RunParameters(seed, withdrawal_cost=withdrawal_cost(team))
                assert strangers(team, protocol, seed, withdrawing) == set(), seed


@looped("protocol", BEYOND)
def test_who_goes_beyond_does_so_somewhere(protocol: type[Protocol]) -> None:
    assert any(strangers(sparse_team(seed), protocol, seed) for seed in range(20))


def test_both_kinds_are_there() -> None:
    assert {one.__name__ for one in WITHIN} >= {"ADOPT", "BnBADOPT", "DPOP", "DSA", "FirstFit", "MGM", "MGM2", "MaxSum"}
    assert {one.__name__ for one in BEYOND} >= {"ABT", "AFC", "AWC", "DisFC", "SBT", "SFB", "SyncBB"}
