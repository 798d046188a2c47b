"""What all synchronous local searches have in common: phases, cycles, the trail, the end."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.findings import Trail
from robochoc.protocols.local_search.a_dsa import ADSA
from robochoc.protocols.local_search.cocoa import CoCoA
from robochoc.protocols.local_search.d_gibbs import DGibbs
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import SettingsError, read_settings
from robochoc.protocols.shared.cycles import CycleProtocol, Value
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.incumbent import best_known
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.checker import violations
from robochoc.verification.objective import withdrawal_cost
from tests.support.agents import replies, robot_of, started, started_robot
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, assignments_by_cycle, domains_of, played
from tests.support.problems import team_of
from tests.support.small_teams import DIFFERENT

NAMES = {
    protocol_named(name): name
    for name in protocol_names()
    if issubclass(protocol_named(name), CycleProtocol) and protocol_named(name).traits.costs and name != "a-dsa"
}
ALL = looped("protocol", NAMES)
NOT_IN_STEP = [ADSA, CoCoA, DGibbs]


def chain(*, names: str = "ABC", values: int = 3) -> Team:
    """Each differs from the next; a last robot D that nobody knows."""
    constraints = [Constraint("C", DIFFERENT, pair, pair) for pair in pairwise(names)]
    return team_of(dict.fromkeys(f"{names}D", range(1, values + 1)), constraints)


def test_a_phase_is_over_when_all_neighbours_have_been_heard() -> None:
    """A message ahead of its phase is kept for that; a packet may end two phases."""
    robot = robot_of(DSA, chain(), "RB")
    assert started(robot) == [("RA", Value((1,))), ("RC", Value((1,)))]
    for packet, own, cycle in (
        ([("RA", Value((1,)))], None, 0),
        ([("RC", Value((1,)))], 2, 1),
        ([("RA", Value((3,))), ("RA", Value((2,)))], None, 1),
        ([("RC", Value((2,)))], 1, 2),
        ([("RC", Value((1,)))], 3, 3),
    ):
        assert replies(robot, *packet) == ([] if own is None else [("RA", Value((own,))), ("RC", Value((own,)))])
        assert robot.cycle == cycle
    replies(robot, *((name, Value((1,))) for name in ("RA", "RA", "RC", "RC")))
    assert robot.cycle == 5


def test_the_trail_has_an_entry_for_each_change_and_after_so_many_cycles_a_robot_is_silent() -> None:
    robot = started_robot(DSA, chain(names="AB"), "RB")
    for value in (1, 1, 3, 2):
        replies(robot, ("RA", Value((value,))))
    assert robot.findings.trail == Trail([(0, 0), (1, 1), (4, 0)], 4)
    robot = robot_of(DSA, chain(names="AB"), "RB")
    robot.settings = read_settings(DSA, {"cycles": "2"})  # type: ignore[assignment, misc]
    started(robot)
    assert replies(robot, ("RA", Value((1,))))
    assert replies(robot, ("RA", Value((2,)))) == []
    assert robot.cycle == 2


@looped("protocol", [*NAMES, *NOT_IN_STEP])
def test_a_robot_without_neighbours_takes_its_cheapest_value_at_once_or_ends_the_search(
    protocol: type[Protocol],
) -> None:
    prices = Relation("P", 1, Semantics.SOFT, ((1,), (2,), (3,)), (4, 0, 2))
    robot = robot_of(protocol, team_of({"A": (1, 2, 3)}, [Constraint("P", prices, ("A",), ("A",))]), "RA")
    assert (started(robot), robot.assignment) == ([], {"A": 2})
    assert protocol in NOT_IN_STEP or robot.findings.trail == Trail([(0, 0)], 100)
    pair = [Constraint("C", DIFFERENT, ("A", "B"), ("A", "B"))]
    robot = robot_of(protocol, team_of({"A": (1,), "B": ()}, pair), "RB")
    assert (started(robot), robot.verdict) == ([], Verdict.NO_SOLUTION)


@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in (1, 2))])
@ALL
def test_whatever_the_delays_the_course_is_the_same(protocol: type[CycleProtocol], batch: int) -> None:
    chance = Random(f"delays {protocol.__name__} {batch}")
    for seed in range(20 if batch else 8):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            one, other = (played(team, protocol, any_schedule(chance), seed, cycles=9) for _ in range(2))
            assert one.verdict is other.verdict
            if one.verdict is Verdict.SOLUTION:
                assert one.findings == other.findings
                assert one.metrics.messages == other.metrics.messages


@count("teams", 6, 30)
@ALL
def test_the_answer_is_the_cheapest_cycle(protocol: type[CycleProtocol], teams: int) -> None:
    chance = Random(f"cheapest {protocol.__name__}")
    for seed in range(teams):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            result = played(team, protocol, Concurrent(seed), seed, cycles=12)
            if result.verdict is Verdict.NO_SOLUTION:
                continue
            costs = [sum(c.price(values) for c in team.constraints()) for values in assignments_by_cycle(team, result)]
            options = Options(
                protocol=NAMES[protocol], runtime=Runtime.SIMULATOR, seed=seed, settings={"cycles": "12"}, repair=False
            )
            outcome = solve(team, options)
            assert outcome.cost == (None if min(costs) == INFINITE else min(costs))


@ALL
def test_the_fewest_violations_of_any_cycle_are_reported(protocol: type[CycleProtocol]) -> None:
    """Four robots with three values, all different: each cycle violates one of six constraints at least."""
    pairs = [*combinations("ABCD", 2)]
    team = team_of(dict.fromkeys("ABCD", range(1, 4)), [Constraint("".join(two), DIFFERENT, two, two) for two in pairs])
    for seed in range(5):
        result = played(team, protocol, Concurrent(seed), seed, cycles=2)
        broken = [
            sum(one.price(values) == INFINITE for one in team.constraints())
            for values in assignments_by_cycle(team, result)
        ]
        options = Options(protocol=NAMES[protocol], runtime=Runtime.SIMULATOR, seed=seed, settings={"cycles": "2"})
        repaired, outcome = solve(team, options), solve(team, replace(options, repair=False))
        assert (repaired.repair, outcome.repair) == ("gdba", None)
        assert repaired.violations is not None
        assert outcome.violations is not None
        assert repaired.violations.number <= outcome.violations.number
        assert (outcome.violations.number, outcome.violations.hard) == (min(broken), 6)
        assert len(outcome.violations.first) == min(broken) > 0


@count("teams", 12, 60)
@ALL
def test_who_may_step_aside_does_so_rather_than_break_anything(protocol: type[CycleProtocol], teams: int) -> None:
    chance = Random(f"aside {protocol.__name__}")
    aside = 0
    for seed in range(teams):
        team = random_hard_team(chance)
        price = withdrawal_cost(team)
        parameters = RunParameters(seed, {"cycles": "25"}, withdrawal_cost=price)
        result = Simulation(team, protocol, any_schedule(chance), parameters=parameters).search()
        assert result.verdict is Verdict.SOLUTION
        found = best_known(CompiledTeam(team), result, price)
        assert found
        absent = [robot.name for robot in team.robots if robot.variables[0].name not in found.assignment]
        assert not list(violations(team, found.assignment, absent))
        aside += len(absent) > 0
    assert aside > teams // 4


def test_where_no_cycle_is_a_solution_that_is_said_or_robots_withdraw() -> None:
    """Settings are not those of the protocol that says which robots withdraw."""
    team = team_of(dict.fromkeys("AB", (1,)), [Constraint("C", DIFFERENT, ("A", "B"), ("A", "B"))])
    options = Options(protocol="maxsum", runtime=Runtime.SIMULATOR, settings={"cycles": "3"})
    outcome = solve(team, replace(options, protocol="dsa", repair=False))
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.reason == (
        "dsa ended, and found no assignment that satisfies all hard constraints; "
        "the best assignment violates 1 of 1 hard constraint: C of RB"
    )
    outcome = solve(team, replace(options, withdraw=Withdrawal.MAXIMAL))
    assert outcome.verdict is Verdict.SOLUTION
    assert len(outcome.withdrawn) == 1


@ALL
def test_there_is_at_least_one_cycle_and_unconnected_parts_of_the_team_end_with_the_same(
    protocol: type[CycleProtocol],
) -> None:
    for cycles, why in (("0", "cycles is 0; it must be 1 or more"), ("-1", "cycles is -1; it must be 1"), ("x", "int")):
        with pytest.raises(SettingsError, match=why):
            read_settings(protocol, {"cycles": cycles})
    result = played(chain(), protocol, Concurrent(0), cycles=7)
    assert {found.trail.cycle for found in result.findings.values() if found.trail} == {7}


def test_the_docs_name_all_that_go_through_cycles() -> None:
    metrics = (Path(__file__).parents[2] / "docs" / "reference" / "metrics.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| cycles \((.*?)\)", metrics, re.MULTILINE)
    cyclic = {name for name in protocol_names() if issubclass(protocol_named(name), CycleProtocol)}
    assert {*re.findall("`(.*?)`", row)} == {*cyclic, "d-gibbs"}
