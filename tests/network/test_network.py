"""Teams over a real network on loopback, against brute force, and against what the other runtimes see."""

from __future__ import annotations

import time
from random import Random

import pytest

from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.communication.session import is_past
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Decided, Lost, Received, Refused, Registered, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.findings import NO_FINDINGS
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import TooLargeError
from robochoc.verification.checker import assignment_cost, violations
from tests.support.brute_force import least_cost, solutions
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.paused_abt import CHAIN, CrashingABT, OverloadedABT, PausedABT
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team
from tests.support.solver_networks import compiled_by_brute_force

TIMEOUT_S = HANG_S
FEW = (("afc-ng", ("signed", "sealed")), ("awc", ()), ("dynabt", ("signed",)))
MANY = ("abt", "afc-ng", "awc", "dynabt", "sbt", "agile-abt", "afc-tree", "sfb", "dpop", "adopt")


def run_over_network(
    team: Team | CompiledTeam,
    protocol: str,
    settings: NetworkSettings = NetworkSettings(),
    events: list[AnyEvent] | None = None,
) -> tuple[SearchResult, tuple[bool, float] | None]:
    """The result, and what the robots themselves say of the values that were decided."""
    observer = None if events is None else events.append
    with LocalNetwork(team, protocol_named(protocol), settings=settings, observer=observer) as network:
        result = network.search(TIMEOUT_S)
        found = result.verdict is Verdict.SOLUTION
        return result, network.master.checked(result.assignments) if found and not settings.private else None


def agrees(
    team: Team,
    protocol: str,
    filters: tuple[str, ...] = (),
) -> Verdict:
    """The verdict is brute force's, and the robots' own check agrees with the checker's."""
    result, checked = run_over_network(compiled_by_brute_force(team), protocol, NetworkSettings(filters))
    truth = next(solutions(team), None)
    assert result.verdict is (Verdict.NO_SOLUTION if truth is None else Verdict.SOLUTION), (team, protocol)
    assert not result.lost
    if truth is not None:
        assert not list(violations(team, assignment_of(result)))
        assert checked == (True, 0.0)
    return result.verdict


def assignment_of(result: SearchResult) -> dict[str, int]:
    return {name: value for values in result.assignments.values() for name, value in values.items()}


@looped(("protocol", "filters"), FEW)
def test_random_problems(protocol: str, filters: tuple[str, ...]) -> None:
    """A random team with constraints over several robots, of both kinds of verdict in the two seeds."""
    agrees(random_team(Random(f"network {protocol}"), n_ary=protocol_named(protocol).traits.n_ary), protocol, filters)


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(6))
@pytest.mark.parametrize("protocol", MANY)
def test_more_random_problems(protocol: str, batch: int) -> None:
    chance = Random(f"network {protocol} {batch}")
    team = random_team(chance, n_ary=protocol_named(protocol).traits.n_ary)
    agrees(team, protocol, chance.choice([(), ("signed",), ("sealed",), ("signed", "sealed")]))


@count("many", 1, 20)
def test_partially_known_constraints(many: int) -> None:
    for number in range(many):
        agrees(random_pkc_team(Random(3 + number)), ("disfc", "abt")[number % 2])


@count("many", 1, 8)
def test_complex_robots(many: int) -> None:
    for number in range(many):
        agrees(random_complex_team(Random(f"network {number}")), "abt", ("signed", "sealed"))


@pytest.mark.parametrize("protocol", ["dpop", "sfb", pytest.param("adopt", marks=pytest.mark.slow)])
@count("many", 1, 6)
def test_costs(protocol: str, many: int) -> None:
    for number in range(many):
        chance = Random(f"network {number}")
        assert_least_cost(random_cost_team(chance, n_ary=protocol_named(protocol).traits.n_ary), protocol)


def assert_least_cost(team: Team, protocol: str) -> None:
    result, checked = run_over_network(team, protocol)
    least = least_cost(team)
    if least == INFINITE:
        assert result.verdict is Verdict.NO_SOLUTION
        return
    assert result.verdict is Verdict.SOLUTION, "whether that is optimal is for who asked to say"
    assert assignment_cost(team, assignment_of(result)) == least
    assert checked == (True, least)


def test_local_search_ends_by_itself() -> None:
    """An incomplete protocol need not find the best; what it decides is told, and its cost agreed on."""
    team = random_cost_team(Random("network mgm"), n_ary=False)
    with LocalNetwork(team, protocol_named("mgm"), parameters=RunParameters(settings={"cycles": "20"})) as network:
        result = network.search(TIMEOUT_S)
        held, told = network.master.checked(result.assignments)
    assert set(result.assignments) == set(team.order)
    assert (assignment_cost(team, assignment_of(result)) < INFINITE) is held
    if held:
        assert assignment_cost(team, assignment_of(result)) == told


@pytest.mark.parametrize("filters", [("signed", "sealed"), pytest.param((), marks=pytest.mark.slow)])
def test_four_queens(filters: tuple[str, ...]) -> None:
    """All that happens is observed: who comes, and every message twice."""
    events: list[AnyEvent] = []
    result, _ = run_over_network(queens3d(4), "abt", NetworkSettings(filters), events=events)
    assert (result.verdict, result.witness) == (Verdict.NO_SOLUTION, "Robot1.1")
    assert {e.robot for e in events if isinstance(e, Registered)} == set(queens3d(4).order)
    sent = sum(isinstance(e, Sent) for e in events)
    assert sent == sum(result.metrics.messages.values())
    assert sum(isinstance(e, Received) for e in events) <= sent
    assert not [e for e in events if isinstance(e, Refused | Lost)]


def test_what_is_observed_of_a_solution_is_complete() -> None:
    events: list[AnyEvent] = []
    result, checked = run_over_network(CHAIN, "abt", events=events)
    assert checked == (True, 0.0)
    assert sum(isinstance(e, Sent) for e in events) == sum(isinstance(e, Received) for e in events)
    decided = {e.robot: e.assignment for e in events if isinstance(e, Decided)}
    assert decided == result.assignments


def test_a_private_run_tells_no_values() -> None:
    result, _ = run_over_network(CHAIN, "abt", NetworkSettings(private=True))
    assert result.verdict is Verdict.SOLUTION
    assert not any(result.assignments.values())
    assert all(findings == NO_FINDINGS for findings in result.findings.values())


def test_what_the_robots_check_is_what_the_checker_checks() -> None:
    """Where values are wrong as well: RX1 is told that RX0 has its own."""
    with LocalNetwork(CHAIN, protocol_named("abt")) as network:
        result = network.search(TIMEOUT_S)
        wrong = {**result.assignments, "RX0": {"X0": result.assignments["RX1"]["X1"]}}
        assert list(violations(CHAIN, {name: v for values in wrong.values() for name, v in values.items()}))
        assert network.master.checked(wrong) == (False, 0.0)


def test_the_limit_on_messages_ends_a_search_that_would_not_end_by_itself() -> None:
    """Robots are not held up while the master counts: a short search may be over before it has."""
    for_ever = RunParameters(settings={"cycles": "1000000000"})
    team = random_cost_team(Random("limits"), n_ary=False)
    with LocalNetwork(team, protocol_named("mgm"), parameters=for_ever) as network:
        result = network.search(messages=20)
        assert result.verdict is Verdict.UNKNOWN
        assert sum(result.metrics.messages.values()) >= 20


def test_when_the_time_is_over_there_is_what_was_decided_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time is over when the test says so: when robots have begun to talk."""
    events: list[AnyEvent] = []
    an_hour = 3600.0

    def is_over(deadline: float | None) -> bool:
        far = deadline is not None and deadline > time.monotonic() + an_hour / 2
        return is_past(deadline) or (far and any(isinstance(event, Received) for event in list(events)))

    for module in ("master_loop", "network.master"):
        monkeypatch.setattr(f"robochoc.communication.{module}.is_past", is_over)
    parameters = RunParameters(settings={"file": "/nowhere"})
    with LocalNetwork(CHAIN, PausedABT, observer=events.append, parameters=parameters) as network:
        result = network.search(timeout=an_hour)
    assert result.verdict is Verdict.UNKNOWN
    assert not result.lost
    assert set(result.assignments) == set(CHAIN.order)


def test_a_problem_that_is_too_much_for_a_robot() -> None:
    """It says so, and the run ends with that."""
    with LocalNetwork(CHAIN, OverloadedABT) as network, pytest.raises(TooLargeError, match="this is too much for RX2"):
        network.search(TIMEOUT_S)


def test_a_robot_that_breaks() -> None:
    with (
        LocalNetwork(CHAIN, CrashingABT) as network,
        pytest.raises(RobotsLostError, match="RX2 was lost: ValueError: out of"),
    ):
        network.search(TIMEOUT_S)
