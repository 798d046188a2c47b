"""The best cycle, found by the robots themselves: one test per rule of Zivan, Okamoto, Peled (AIJ 212, 2014), 3."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterator
from random import Random
from typing import cast

import pytest

from robochoc.communication.arrays.session import ArraysRun
from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Team
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import SettingsError, read_settings
from robochoc.protocols.shared.anytime import Best, BreadthFirstTree, Paid, Place, Step
from robochoc.protocols.shared.cycles import CycleProtocol, Value
from robochoc.run import Options, Runtime, solve
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.incumbent import costs_by_cycle
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.objective import Objective, withdrawal_cost
from tests.support.agents import assert_refused, robot_of, sent, started
from tests.support.cases import cases, looped
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule
from tests.support.problems import team_of
from tests.support.small_teams import DIFFERENT

IN_CYCLES = [
    name
    for name in protocol_names()
    if issubclass(protocol_named(name), CycleProtocol)
    and protocol_named(name).__module__.startswith("robochoc.")
    and not protocol_named(name).traits.asymmetric
    and name != "a-dsa"
]
REPORTS = {"Place", "Step", "Paid", "Best"}


def path(size: int, **domains: tuple[int, ...]) -> Team:
    names = [f"X{number:02}" for number in range(size)]
    constraints = [Constraint("C", DIFFERENT, pair, pair) for pair in itertools.pairwise(names)]
    return team_of({**dict.fromkeys(names, (1, 2, 3)), **domains}, constraints)


def run(team: Team, name: str, chance: Random, seed: int, price: float | None = None, **settings: str) -> SearchResult:
    given = {"cycles": "12", **settings}
    parameters = RunParameters(seed, given, withdrawal_cost=price)
    return Simulation(team, protocol_named(name), any_schedule(chance), parameters=parameters).search()


def costs_of(team: Team, result: SearchResult, price: float | None) -> tuple[float, float]:
    """Return the cost of the robots' last values, and that of the best cycle."""
    compiled = CompiledTeam(team)
    objective = Objective(team, price)
    objective.change(result.assignments)
    trails = {name: found.trail for name, found in result.findings.items() if found.trail}
    return objective.cost, min(costs_by_cycle(compiled, trails, price))


@pytest.mark.parametrize("name", IN_CYCLES)
@count("teams", 2, 150)
def test_at_the_end_each_robot_holds_its_value_of_the_best_cycle(name: str, teams: int) -> None:
    """Whatever the protocol and the delays; n-ary, hard and unconnected, and where robots may withdraw.

    The search itself sends the same messages as without.
    """
    chance = Random(f"best {name}")
    minimises = protocol_named(name).traits.costs
    for seed, withdraw in itertools.product(range(teams), (False, True) if minimises else (False,)):
        team = random_cost_team(chance) if minimises and not withdraw else random_hard_team(chance)
        price = withdrawal_cost(team) if withdraw else None
        result = run(team, name, chance, seed, price, anytime="yes")
        plain = run(team, name, chance, seed, price)
        assert result.verdict is plain.verdict
        if plain.verdict is not Verdict.SOLUTION:
            continue
        counts = {kind: many for kind, many in result.metrics.messages.items() if kind not in REPORTS}
        assert counts == plain.metrics.messages
        if minimises:
            assert result.findings == plain.findings
            held, best = costs_of(team, result, price)
            assert held == best


def test_that_is_often_not_the_last_cycle() -> None:
    chance = Random("moved")
    teams = [random_cost_team(chance) for _ in range(8)]
    runs = [(run(t, "gdba", chance, 0, anytime="yes", scope="E"), run(t, "gdba", chance, 0, scope="E")) for t in teams]
    assert sum(one.assignments != other.assignments for one, other in runs) > 1


def test_a_breakout_that_ends_early_holds_its_solution() -> None:
    outcome = solve(
        path(6), Options(protocol="dba", runtime=Runtime.SIMULATOR, settings={"cycles": "90", "anytime": "yes"})
    )
    assert outcome.verdict is Verdict.SOLUTION
    assert 1 < outcome.metrics.messages["Paid"] < 5 * 90


def test_one_message_for_each_edge_and_two_for_each_of_the_tree_in_each_cycle() -> None:
    for size in (2, 5, 9):
        messages = run(path(size), "dsa", Random(size), 0, anytime="yes").metrics.messages
        assert messages["Step"] == messages["Paid"] == messages["Best"] == 13 * (size - 1)


def trees_of(team: Team, chance: Random) -> dict[str, BreadthFirstTree]:
    """The trees that robots build whose messages arrive in any order."""
    parts = {name: robot_of(DSA, team, name).problem for name in team.order}
    trees = {name: BreadthFirstTree(name, part.neighbours, PriorityOrder(team.order)) for name, part in parts.items()}
    trees = {name: tree for name, tree in trees.items() if parts[name].neighbours}
    channels: dict[tuple[str, str], deque[Message]] = {}

    def send(name: str, sent: list[tuple[str, Message]]) -> None:
        for receiver, message in sent:
            channels.setdefault((name, receiver), deque()).append(message)

    for name, tree in trees.items():
        send(name, tree.start())
    while waiting := [pair for pair, messages in channels.items() if messages]:
        sender, receiver = chance.choice(waiting)
        place = channels[sender, receiver].popleft()
        assert isinstance(place, Place)
        send(receiver, trees[receiver].receive(sender, place))
    return trees


@count("teams", 15, 1000)
def test_the_tree_is_breadth_first_whatever_the_delays(teams: int) -> None:
    chance = Random("trees")
    for _ in range(teams):
        team = random_hard_team(chance)
        trees = trees_of(team, chance)
        linked = {name: robot_of(DSA, team, name).problem.neighbours for name in trees}
        assert {name: tree.parent for name, tree in trees.items()} == {
            name: tree.parent for name, tree in trees_of(team, chance).items()
        }
        for root in (name for name, tree in trees.items() if tree.parent is None):
            distances = {root: 0}
            for name in _by_distance(root, linked, distances):
                tree = trees[name]
                assert tree.parent is None or distances[tree.parent] == distances[name] - 1
                assert {*tree.children} == {other for other in trees if trees[other].parent == name}
                assert tree.height == trees[root].height
                assert team.order.index(root) <= team.order.index(name)
            assert trees[root].height == max(distances.values())


def _by_distance(root: str, linked: dict[str, tuple[str, ...]], distances: dict[str, int]) -> Iterator[str]:
    queue = deque([root])
    while queue:
        name = queue.popleft()
        for other in linked[name]:
            if other not in distances:
                distances[other] = distances[name] + 1
                queue.append(other)
    yield from distances


def test_a_robot_remembers_twice_the_height_and_a_few() -> None:
    team = path(6)
    with cases() as each:
        for name in ("dsa", "mgm2", "maxsum"):
            with each(name):
                remembered = [most for seed in range(6) for most in remembered_in(team, name, seed)]
                assert max(remembered) > 3


def remembered_in(team: Team, name: str, seed: int) -> list[int]:
    """Return how many steps the robots remember, at each event of a run. Checks that each remembers few."""
    found: list[int] = []

    def look(_: AnyEvent) -> None:
        for host in simulation._hosts.values():  # noqa: SLF001 - what a robot remembers is nobody else's
            anytime = cast("CycleProtocol", host.protocol)._anytime  # noqa: SLF001
            if anytime is not None and anytime.tree.height is not None:
                assert anytime.remembered <= 2 * anytime.tree.height + 4
                found.append(anytime.remembered)

    settings = {"cycles": "60", "anytime": "yes"}
    simulation = Simulation(
        team,
        protocol_named(name),
        any_schedule(Random(seed)),
        observer=look,
        parameters=RunParameters(seed, settings),
    )
    simulation.search()
    return found


def robot(cycles: str = "3", **settings: str) -> DSA:
    """X01 between X00, the root, and X02."""
    it = robot_of(DSA, path(3), "X01".replace("X", "RX"))
    it.settings = read_settings(DSA, {"cycles": cycles, "anytime": "yes", **settings})  # type: ignore[assignment, misc]
    started(it)
    return it


def ready() -> DSA:
    """After the tree is built: both children are below X00."""
    it = robot()
    it.receive("RX00", Place("RX00", 0, None, None, None))
    it.receive("RX02", Place("RX02", 0, None, None, None))
    it.receive("RX00", Place("RX00", 0, None, None, None))
    it.receive("RX02", Place("RX00", 2, "RX01", 0, None))
    it.receive("RX00", Place("RX00", 0, None, 2, 2))
    it.receive("RX02", Place("RX00", 2, "RX01", 0, None))
    it.outbox.clear()
    return it


def test_the_search_begins_once_the_tree_is_complete() -> None:
    assert (robot().cycle, ready().cycle) == (-1, 0)


def priced_step() -> DSA:
    """The same, when it has reported to X00 how much a step costs."""
    it = ready()
    it.receive("RX00", Step((1,)))
    assert it.outbox == []
    it.receive("RX02", Paid(4))
    ((receiver, paid),) = sent(it)
    assert (receiver, type(paid)) == ("RX00", Paid)
    return it


def test_what_a_step_costs_goes_up_and_the_best_comes_down() -> None:
    it = priced_step()
    it.receive("RX00", Best(0))
    assert it.outbox == [("RX02", Best(0))]


def test_what_cannot_be_is_refused() -> None:
    wrong = [("RX00", Best(0)), ("RX02", Best(0)), ("RX02", Step((1,))), ("RX02", Paid(-1)), ("RX02", Paid(math.nan))]
    assert_refused(ready, wrong, r"RX0[02] sent an unexpected or invalid (Best|Step|Paid)")
    assert_refused(priced_step, [("RX00", Best(7))], "neither the latest one nor the one before")
    places = [Place("nobody", 0, None, None, None), Place("RX00", 3, None, None, None)]
    assert_refused(robot, [("RX00", place) for place in places], "RX00 sent a place that is in no tree")
    it = robot(anytime="no")
    with pytest.raises(ValueError, match="--set anytime=yes"):
        it.receive("RX00", Step((1,)))
    it.receive("RX00", Value((1,)))


def test_robots_without_values_ignore_places() -> None:
    it = robot_of(DSA, path(3, X01=()), "RX01")
    it.settings = read_settings(DSA, {"anytime": "yes"})  # type: ignore[assignment, misc]
    started(it)
    assert it.verdict is Verdict.NO_SOLUTION
    it.receive("RX00", Place("RX00", 0, None, None, None))
    assert it.outbox == []


def test_if_all_steps_break_something_the_last_values_stay() -> None:
    team = team_of(dict.fromkeys("AB", (1,)), [Constraint("C", DIFFERENT, ("A", "B"), ("A", "B"))])
    result = run(team, "dsa", Random(0), 0, anytime="yes")
    assert costs_of(team, result, None) == (INFINITE, INFINITE)
    assert result.assignments == {"RA": {"A": 1}, "RB": {"B": 1}}


@looped(
    ("protocol", "value", "why"),
    [
        ("dsa", "maybe", "anytime"),
        ("a-dsa", "yes", "anytime=yes requires robots that go through cycles together"),
        ("d-gibbs", "yes", "'anytime' is not a setting of this protocol: it has cycles, temperature"),
        ("acls", "yes", "'anytime' is not a setting of this protocol: it has"),
        ("mcs-mgm", "yes", "'anytime' is not a setting of this protocol: it has"),
        ("gca-mgm", "yes", "'anytime' is not a setting of this protocol: it has"),
    ],
)
def test_who_cannot_refuses_the_setting(protocol: str, value: str, why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        read_settings(protocol_named(protocol), {"anytime": value})


def test_arrays_refuse_it() -> None:
    with pytest.raises(UnsupportedError, match="anytime=yes cannot be used with --runtime arrays"):
        ArraysRun(path(3), DSA, parameters=RunParameters(0, {"anytime": "yes"}))


def test_processes_find_the_best_cycle_too() -> None:
    team = random_cost_team(Random(1))
    settings = {"cycles": "10", "anytime": "yes"}
    one = solve(team, Options(protocol="dsa", settings=settings, seed=3))
    other = solve(team, Options(protocol="dsa", runtime=Runtime.SIMULATOR, settings=settings, seed=3))
    assert (one.cost, one.metrics.messages) == (other.cost, other.metrics.messages)


def test_a_protocol_from_outside_is_told_which_messages_it_lacks() -> None:
    class Own(CycleProtocol):
        messages = Value

        def start_cycles(self) -> None:
            self.choose(0)

    with pytest.raises(UnsupportedError, match="needs `AnytimeMessage` among the `messages` of protocol own"):
        refuse_settings("own", Own, {"anytime": "yes"})
    refuse_settings("own", Own, {"anytime": "no"})
    refuse_settings("dsa", DSA, {"anytime": "yes"})
