"""Whole teams of robots at their posts, from hand to hand: they solve, minimise, and check."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.authority.admission import InMemoryAuthority
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import RunParameters
from tests.support.allocation_problems import simple_allocation_team
from tests.support.brute_force import least_cost, solutions
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.encrypted_problems import affordable, short_settings
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.lone_robot import chain_of_three
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import known_to_both, random_team

pytestmark = pytest.mark.usefixtures("quick_encryption")


@pytest.mark.parametrize("protocol", ["abt", "afc-ng", "awc", "agile-abt", "afc-tree"])
def test_teams_solve_their_problems(protocol: str) -> None:
    verdicts = set()
    for seed in range(8):
        team = random_team(Random(seed))
        office = InMemoryNetwork(team, protocol_named(protocol))
        for _ in range(2):  # and again, from the beginning
            result = office.search()
            assert (result.verdict is Verdict.SOLUTION) is any(True for _ in solutions(team))
            assert not office.failures
            assert not office.objections
            if result.verdict is Verdict.SOLUTION:
                assert office.judge(result.assignments) == (True, 0)
                values = {name: value for own in result.assignments.values() for name, value in own.items()}
                assert all(constraint.allows(values) for constraint in team.constraints())
        assert {name: ending.assignment for name, ending in office.leave().items()} == result.assignments
        verdicts.add(result.verdict)
    assert verdicts == {Verdict.SOLUTION, Verdict.NO_SOLUTION}


@looped("name", protocol_names())
def test_nobody_is_doubted_who_is_honest(name: str) -> None:
    """By whatever protocol: the office refuses nothing, all counts agree, and so do both ends of each constraint."""
    protocol = protocol_named(name)
    chance = Random(4)
    draw = random_cost_team if protocol.traits.costs else random_team
    team = affordable(name, lambda: draw(chance, n_ary=False))
    if protocol.traits.allocates:
        team = simple_allocation_team(chance)
    parameters = RunParameters(settings=short_settings(name, 5))
    office = InMemoryNetwork(known_to_both(team), protocol, parameters=parameters)
    result = office.search()
    assert not office.failures
    assert not office.state.doubts_about_counts
    assert result.verdict is not Verdict.UNKNOWN
    if result.verdict is Verdict.SOLUTION:
        office.judge(result.assignments)
        private = sum(len(robot.private) for robot in team.robots)
        assert office.state.thoroughness == (len(list(team.constraints())) - private, private)
    assert not office.state.doubts_about_verdict


@pytest.mark.parametrize("protocol", ["dpop", "sfb"])
def test_teams_minimise_and_check_their_costs(protocol: str) -> None:
    for seed in range(5):
        team = random_cost_team(Random(seed))
        office = InMemoryNetwork(team, protocol_named(protocol))
        result = office.search()
        least = least_cost(team)
        if least == INFINITE:
            assert result.verdict is Verdict.NO_SOLUTION
        else:
            assert office.judge(result.assignments) == (True, least)


def test_partially_known_constraints_stay_with_their_holders() -> None:
    for seed in range(5):
        team = random_pkc_team(Random(seed))
        office = InMemoryNetwork(team, protocol_named("disfc"))
        result = office.search()
        assert (result.verdict is Verdict.SOLUTION) is any(True for _ in solutions(team))
        if result.verdict is Verdict.SOLUTION:
            assert office.judge(result.assignments) == (True, 0)


def test_messages_go_through_filters() -> None:
    team = random_team(Random(3))
    household = InMemoryAuthority(team.order)
    identities = {name: household.identity(name) for name in team.order}
    office = InMemoryNetwork(team, ABT, identities, ("signed", "sealed"))
    result = office.search()
    assert (result.verdict is Verdict.SOLUTION) is any(True for _ in solutions(team))
    assert not office.objections


def test_a_wrong_decision_does_not_pass_the_check() -> None:
    team = chain_of_three()
    office = InMemoryNetwork(team, ABT)
    decided = office.search().assignments
    assert decided == {"RA": {"A": 1}, "RB": {"B": 2}, "RC": {"C": 1}}
    assert office.judge(decided)[0]
    assert not office.judge({**decided, "RA": {"A": 2}})[0]
