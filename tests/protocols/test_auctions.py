"""What SSI, CBAA and CBBA have in common: the outcome of the sequential greedy algorithm, and its bounds."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from random import Random

import pytest

from robochoc.generators.tasks import Skills, tasks
from robochoc.model.allocation import TaskSpec, Worker, several_tasks
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Relation, Semantics
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized, user_cost
from robochoc.model.orders import with_order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.auctions.cbaa import WinningBids
from robochoc.protocols.auctions.cbba import Bundles
from robochoc.protocols.auctions.ssi import Bid, Won
from robochoc.protocols.message import Message
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.registry import protocol_named
from robochoc.solver.ace import AceProcess
from robochoc.solver.errors import UnsupportedError
from tests.support.agents import started_robot
from tests.support.allocation_problems import Allocation, greedy, idle, optimum, random_allocation
from tests.support.brute_force import least_cost
from tests.support.cases import cases, looped
from tests.support.cost_problems import with_costs
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.problems import shuffled, team_of
from tests.support.random_options import random_schedule

BUNDLING = ("ssi", "cbba")
AUCTIONS = (*BUNDLING, "cbaa")


def cost(allocation: Allocation, total: float) -> float:
    """`total`, a sum of normalised costs, as it is told to the user."""
    return float(user_cost(normalized(allocation.team), total))


def run(allocation: Allocation, protocol: str, chance: Random, solver: AceProcess) -> Outcome:
    """The outcome of a run on a random schedule; `solve` has it checked against all constraints."""
    options = replace(random_schedule(chance), protocol=protocol, messages=5000)
    outcome = solve(allocation.team, options, solver=solver)
    assert outcome.verdict is Verdict.SOLUTION, (allocation, options)
    assert outcome.verified
    return outcome


def any_order(allocation: Allocation, chance: Random) -> Allocation:
    return allocation._replace(team=with_order(allocation.team, shuffled(chance, allocation.team)))


@pytest.fixture
def warm(warm_ace: None) -> Iterator[AceProcess]:
    """A solver for robots with several variables that need not be started for each team."""
    del warm_ace
    with AceProcess() as ace:
        yield ace


@count("runs", 40, 2000)
@looped("protocol", AUCTIONS)
def test_the_outcome_is_that_of_the_sequential_greedy_algorithm(protocol: str, runs: int, warm: AceProcess) -> None:
    chance, found = Random(f"greedy {protocol}"), Counter[str]()
    for _ in range(runs):
        allocation = any_order(random_allocation(chance), chance)
        outcome = run(allocation, protocol, chance, warm)
        assert outcome.cost is not None
        expected = greedy(allocation, most=1 if protocol == "cbaa" else None)
        assert float(outcome.cost) == cost(allocation, expected), allocation
        assert float(outcome.cost) <= cost(allocation, optimum(allocation))
        found[allocation.model] += 1
        found["optimal"] += expected == optimum(allocation)
    assert min(found["assignment"], found["several"]) > runs // 4
    assert runs // 2 < found["optimal"] < runs


@count("runs", 40, 200)
@looped("protocol", AUCTIONS)
def test_with_diminishing_marginal_gain_at_least_half_of_the_optimum_is_gained(
    protocol: str, runs: int, warm: AceProcess
) -> None:
    """Choi et al., Theorem 2; Lehmann et al. 2006. Of CBAA where a robot can do one task only."""
    chance, worst = Random(f"half {protocol}"), 1.0
    for _ in range(runs):
        allocation = random_allocation(chance, dmg=True, model="assignment" if protocol == "cbaa" else None)
        outcome = run(allocation, protocol, chance, warm)
        assert outcome.cost is not None
        nothing, most = (cost(allocation, total(allocation)) for total in (idle, optimum))
        gained = float(outcome.cost) - nothing
        assert gained >= (most - nothing) / 2, allocation
        worst = min(worst, gained / (most - nothing) if most > nothing else 1)
    assert 0.5 <= worst < 1


def test_with_loads_there_is_no_such_bound() -> None:
    """A robot with room for 3 is sold a task of load 3 for 10, and not three of load 1 for 9 each."""
    profits = (("A", {1: 10, 2: 9, 3: 9, 4: 9}), ("B", dict.fromkeys((1, 2, 3, 4), -1)))
    workers = [Worker(f"R{name}", name, name, profit, 3) for name, profit in profits]
    variables, constraints = several_tasks(
        workers, {1: TaskSpec("1", 3), 2: TaskSpec("2"), 3: TaskSpec("3"), 4: TaskSpec("4")}
    )
    team = assemble("loads", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True))
    protocols = (*BUNDLING, "dpop")
    costs = [solve(team, Options(protocol=name, runtime=Runtime.SIMULATOR)).cost for name in protocols]
    assert costs == [10, 10, 27]


@count("runs", 40, 1000)
@looped("protocol", ["cbaa", "cbba"])
def test_in_rounds_it_ends_after_as_many_as_tasks_times_the_diameter(protocol: str, runs: int) -> None:
    """Choi et al., Theorem 1: rounds in which something is told, and one in which the last of it changes nothing."""
    chance, longest, wide = Random(f"rounds {protocol}"), 0, 0
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, schedule=ScheduleName.CYCLES)
    for number in range(runs):
        robots, count_of = chance.randint(2, 6), chance.randint(3, 6)
        team = any_tasks(robots, count_of, number, chance)
        cycles = solve(team, options).metrics.cycles or 0
        assert cycles <= count_of * diameter(team) + 1, (number, cycles)
        longest, wide = max(longest, cycles), max(wide, diameter(team))
    assert longest > 2
    assert wide > 1


def any_tasks(robots: int, number: int, seed: int, chance: Random) -> Team:
    """Return tasks of either model, which all robots can do, or those that have the skill if somebody has it."""
    model, skilled = chance.choice(["assignment", "several"]), chance.random() < 0.5
    try:
        return tasks(robots, number, seed, model=model, skills=Skills(3, 2) if skilled else Skills())
    except ValueError:
        return tasks(robots, number, seed, model=model)


def diameter(team: Team) -> int:
    """Return the largest distance between robots that are connected by what they share."""
    near = {one.name: {p.name for p in one.parents} | {c.name for c in one.children} for one in team.robots}
    return max(len(layers(near, name)) - 1 for name in near)


def layers(near: Mapping[str, set[str]], start: str) -> list[set[str]]:
    """Return the robots at distance 0, 1, ... of `start`."""
    found = [{start}]
    while more := {other for name in found[-1] for other in near[name]}.difference(*found):
        found.append(more)
    return found


@pytest.mark.parametrize(
    ("protocols", "runtimes"),
    [
        (("cbba",), (Runtime.PROCESSES,)),
        pytest.param(AUCTIONS, (Runtime.PROCESSES, Runtime.NETWORK), marks=pytest.mark.more),
    ],
    ids=("one", "all"),
)
def test_the_outcome_is_the_same_on_every_runtime(protocols: Sequence[str], runtimes: Sequence[Runtime]) -> None:
    team = tasks(4, 4, 3)
    with cases() as each:
        for protocol, runtime in itertools.product(protocols, runtimes):
            with each(f"{protocol} {runtime}"):
                simulated = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
                real = solve(team, Options(protocol=protocol, runtime=runtime, timeout=HANG_S))
                assert (real.verdict, real.assignment) == (Verdict.SOLUTION, simulated.assignment)
                assert real.verified


# What is no task allocation

NOT_BOTH = Relation("notBoth", 2, Semantics.CONFLICTS, ((1, 1),))
MUST = Relation("must", 1, Semantics.SUPPORTS, ((1,),))
OTHER_TEAMS: Sequence[tuple[Sequence[tuple[Relation, str]], str]] = (
    ([(replace(NOT_BOTH, arity=3, tuples=((1, 1, 1),)), "ABC")], "not over one"),
    ([(Relation("S", 2, Semantics.SOFT, ((1, 1),), (5,)), "AB")], "costs 5 for A = 1 and B = 1"),
    ([(Relation("D", 2, Semantics.CONFLICTS, ((0, 0), (1, 1))), "AB")], "cannot leave all tasks"),
    ([(NOT_BOTH, "AB"), (NOT_BOTH, "BC")], "A = 1 and C = 1 do not exclude each other"),
)


def priced(team: Team) -> Team:
    return replace(team, robots=tuple(replace(one, kind=ProblemKind.DISWCSP) for one in team.robots))


def team_with(constraints: Sequence[tuple[Relation, str]]) -> Team:
    made = [Constraint(one.name, one, tuple(scope), tuple(scope)) for one, scope in constraints]
    return with_costs(team_of(dict.fromkeys("ABC", (0, 1)), made))


def crews(able: int) -> Team:
    """Return a team of `able` robots and a task that needs two."""
    workers = [Worker(f"R{name}", name, name, {1: 9}) for name in "ABC"[:able]]
    variables, constraints = several_tasks(workers, {1: TaskSpec("1", robots=2)})
    return assemble("crews", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True))


@looped("protocol", AUCTIONS)
def test_other_teams_are_refused_with_the_reason(protocol: str) -> None:
    others = [(team_with(constraints), why) for constraints, why in OTHER_TEAMS] + [(crews(2), ""), (crews(3), "")]
    for team, why in others:
        with pytest.raises(UnsupportedError, match="is not a task allocation, and") as refused:
            solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
        assert why in str(refused.value)
        assert "; these do: " in str(refused.value)
    with pytest.raises(UnsupportedError, match="RA has no value that stands for no task"):
        solve(team_with([(NOT_BOTH, "AB"), (MUST, "A")]), Options(protocol=protocol, runtime=Runtime.SIMULATOR))


def test_a_robot_that_must_do_a_task_is_refused_among_processes_too() -> None:
    with pytest.raises(UnsupportedError, match="RA has no value that stands for no task"):
        solve(team_with([(NOT_BOTH, "AB"), (MUST, "A")]), Options(protocol="cbba", timeout=HANG_S))


@looped("protocol", AUCTIONS)
def test_two_ways_to_do_a_task_are_one_task_and_a_robot_without_values_ends_it(protocol: str) -> None:
    """A does it by 1 or 2, which costs less; B by 1."""
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR)
    either = Relation("either", 2, Semantics.CONFLICTS, ((1, 1), (2, 1)))
    price = Relation("price", 1, Semantics.SOFT, ((0,), (1,), (2,)), (9, 5, 2))
    wish = Relation("wish", 1, Semantics.SOFT, ((0,),), (6,))
    made = [Constraint("E", either, ("A", "B"), ("A", "B")), Constraint("P", price, ("A",), ("A",), None)]
    team = with_costs(team_of({"A": (0, 1, 2), "B": (0, 1)}, [*made, Constraint("W", wish, ("B",), ("B",), None)]))
    outcome = solve(team, options)
    assert outcome.assignment == {"A": 2, "B": 0}
    assert outcome.cost == least_cost(team) == 8
    none = Relation("none", 1, Semantics.SUPPORTS, ())
    assert solve(team_with([(NOT_BOTH, "AB"), (none, "A")]), options).verdict is Verdict.NO_SOLUTION


def test_a_lie_is_refused() -> None:
    """A task that the sender does not share, a winner that cannot have won, a bid that nobody makes."""
    team = normalized(tasks(3, 3, 1))
    first, second, third = team.order
    lies: dict[str, list[Message]] = {
        "ssi": [Won([(0, 9)], 1), Won([(7, 1)], 1), Bid(-1)],
        "cbaa": [WinningBids([one]) for one in (((0, 9), second, 1), ((0, 1), "X", 1), ((0, 1), third, 0))],
        "cbba": [
            Bundles([one], [0, 1, 0])
            for one in (((0, 9), second, 1), ((0, 1), "X", 1), ((0, 2), third, -1), ((0, 3), "", 1))
        ],
    }
    for protocol, told in lies.items():
        for lie in told:
            robot = started_robot(protocol_named(protocol), team, first)
            with pytest.raises(ValueError, match=r"task|bids"):
                robot.receive(second, lie)
