"""P-MGM and P-Max-Sum: the answers of MGM and Max-Sum, with comparisons that are known before, and limits."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import TypeVar

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Robot, Semantics, Team
from robochoc.protocols.chance import UNIT
from robochoc.protocols.inference.maxsum import MaxSum
from robochoc.protocols.local_search.mgm import MGM
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.p_maxsum import PMaxSum
from robochoc.protocols.private.p_mgm import PMGM
from robochoc.protocols.private.shared_arithmetic import SharedArithmeticProtocol
from robochoc.protocols.private.shared_search import SharedSearchProtocol
from robochoc.protocols.protocol import Protocol
from robochoc.run import Options, Runtime, solve
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.local_problem import LocalProblem
from tests.support.cost_problems import random_cost_team, with_costs
from tests.support.examples import count, drawn
from tests.support.private_problems import priced
from tests.support.problems import team_of

T = TypeVar("T")
SCALE = 2**15
Answer = dict[str, dict[str, int]]


class OnKnownNumbers(SharedArithmeticProtocol):
    """The same steps on numbers instead of shares: a share of a constant polynomial is the number itself."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.degree = 0

    def reduce(self, products: Sequence[int], then: str) -> None:
        self.results = [one % self.field.prime for one in products]
        getattr(self, then)()

    def compare(self, numbers: Sequence[int], then: str) -> None:
        self.comparisons += len(numbers)
        self.results = [int(2 * (one % self.field.prime) < self.field.prime) for one in numbers]
        getattr(self, then)()


class KnownPMGM(OnKnownNumbers, PMGM):
    """P-MGM on known numbers."""


class KnownPMaxSum(OnKnownNumbers, PMaxSum):
    """P-Max-Sum on known numbers."""


class FirstMGM(MGM):
    """MGM that takes the first of several best values."""

    def any_of(self, choices: Sequence[T]) -> T:
        return choices[0]


class SecretMaxSum(MaxSum):
    """Max-Sum with the preferences of P-Max-Sum."""

    def start_with(self, preference: float) -> None:
        declared = self.problem.declared(self.problem.agent)
        drawn = {value: int(self.secret(53) * UNIT * preference * SCALE) / SCALE for value in declared}
        preferences = iter([drawn[value] for value in self.problem.values])
        self.chance = lambda: next(preferences)
        super().start_with(1)


def options_of(protocol: str, **settings: str) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False, settings=settings)


def chain(*domain: int) -> Team:
    """Return three robots in a row; the first values of A and C are expensive."""
    pairs = [priced(one, "B", {(1, 1): 9, (1, 2): 5}) for one in "AC"]
    return with_costs(team_of(dict.fromkeys("ABC", domain), pairs))


def answer(team: Team, protocol: type[Protocol], parameters: RunParameters) -> Answer:
    """Return the values in the cheapest cycle, and check the number of comparisons."""
    with Simulation(team, protocol, RandomChannels(parameters.seed), parameters=parameters) as simulation:
        result = simulation.search(messages=100_000)
        robots = [host.protocol for host in simulation._hosts.values()]  # noqa: SLF001 - to count comparisons
        if result.verdict == Verdict.NO_SOLUTION:
            return {}
        if not all(isinstance(robot, SharedSearchProtocol) for robot in robots):
            return cheapest_cycle(team, robots)
        for robot in robots:
            assert isinstance(robot, SharedSearchProtocol)
            assert robot.comparisons == robot.comparisons_needed()
    return result.assignments


def cheapest_cycle(team: Team, robots: Sequence[Protocol]) -> Answer:
    """Return the values in the first of the cheapest cycles of the whole team."""

    def values(robot: Protocol, cycle: int) -> dict[str, int]:
        trail = robot.findings.trail
        assert trail
        index = next(index for since, index in reversed(trail.entries) if since <= cycle)
        return robot.problem.solution(index)

    def cost(cycle: int) -> tuple[int, float]:
        chosen = {name: value for robot in robots for name, value in values(robot, cycle).items()}
        costs = [one.price(chosen) for one in team.constraints()]
        return costs.count(INFINITE), sum(one for one in costs if one < INFINITE)

    cycles = max(trail.cycle for robot in robots if (trail := robot.findings.trail))
    best = min(range(cycles + 1), key=cost)
    return {robot.problem.agent: values(robot, best) for robot in robots}


def of_connected(team: Team, found: Answer) -> Answer:
    """Return the values of robots that share constraints; the others may take any of their cheapest values."""
    connected = {team.owner[name] for one in team.constraints() if len(one.variables) > 1 for name in one.variables}
    return {name: values for name, values in found.items() if name in connected}


def with_finite_costs(team: Team, broken: float) -> Team:
    """Return the team whose shared constraints cost `broken` instead of infinity."""

    def finite(one: Constraint) -> Constraint:
        names = one.variables
        if len(names) == 1:
            return one
        rows = [*itertools.product(*(team.variables[name].domain for name in names))]
        costs = (min(one.price(dict(zip(names, row, strict=True))), broken) for row in rows)
        relation = Relation(one.name, len(names), Semantics.SOFT, tuple(rows), tuple(costs))
        return replace(one, definition=relation, scope=names, parameters=names)

    def changed(robot: Robot) -> Robot:
        parents = tuple(replace(one, constraints=tuple(map(finite, one.constraints))) for one in robot.parents)
        return replace(robot, private=tuple(map(finite, robot.private)), parents=parents)

    return replace(team, robots=tuple(map(changed, team.robots)))


def a_start(team: Team, chance: Random) -> dict[str, int]:
    """Return a possible value of each variable that has one."""
    alone = [one for one in team.constraints() if len(one.variables) == 1]
    found: dict[str, int] = {}
    for name, variable in team.variables.items():
        mine = [one for one in alone if one.variables == (name,)]
        possible = [value for value in variable.domain if all(one.price({name: value}) < INFINITE for one in mine)]
        found |= {name: chance.choice(possible)} if possible else {}
    return found


@count("problems", fast=40, slow=2_000)
def test_the_answer_of_p_mgm_is_that_of_mgm(problems: int) -> None:
    for seed in range(problems):
        chance = drawn(f"p-mgm {seed}")
        team = random_cost_team(chance, n_ary=False)
        cycles = {"cycles": str(chance.randint(1, 4))}
        parameters = RunParameters(seed, cycles, start=a_start(team, chance))
        expected = answer(team, FirstMGM, parameters)
        for protocol in (KnownPMGM, PMGM) if seed < 2 else (KnownPMGM,):
            found = answer(team, protocol, parameters._replace(settings={**cycles, "bits": "61"}))
            assert of_connected(team, found) == of_connected(team, expected)


@count("problems", fast=40, slow=2_000)
def test_the_answer_of_p_max_sum_is_that_of_max_sum(problems: int) -> None:
    choices = (("0", "0.01"), ("no", "yes"), ("hidden", "open"))
    for seed in range(problems):
        chance = drawn(f"p-maxsum {seed}")
        preference, split, topology = map(chance.choice, choices)
        common = {"cycles": str(chance.randint(1, 4)), "preference": preference}
        plain = {**common, "damping": "0", "split": "0.5" if split == "yes" else "0"}
        team = random_cost_team(chance, n_ary=False)
        finite = with_finite_costs(team, 2**36 / (SCALE if preference != "0" else 1))
        expected = answer(finite, SecretMaxSum, RunParameters(seed, plain))
        private = RunParameters(seed, {**common, "split": split, "topology": topology})
        for protocol in (KnownPMaxSum, PMaxSum) if seed < 1 else (KnownPMaxSum,):
            found = answer(team, protocol, private)
            assert of_connected(team, found) == of_connected(team, expected)


@pytest.mark.parametrize(("protocol", "needed"), [("p-dsa", 200), ("p-mgm", 240), ("p-maxsum", 431)])
def test_the_number_of_comparisons_is_known_before_the_search(protocol: str, needed: int) -> None:
    team = chain(1, 2, 3)
    with pytest.raises(UnsupportedError, match=rf"needs {needed} comparisons.*--set comparisons=N"):
        solve(team, options_of(protocol, comparisons="100"))


@pytest.mark.parametrize("protocol", ["p-mgm", "p-maxsum"])
def test_a_robot_without_a_possible_value_ends_the_search(protocol: str) -> None:
    shared = priced("A", "B", {(1, 1): 1})
    never = Relation("never", 1, Semantics.CONFLICTS, ((1,),))
    alone = Constraint("n", never, ("B",), ("B",), model=None)
    domains = dict.fromkeys("ABC", (1,))
    assert solve(with_costs(team_of(domains, [shared])), options_of(protocol)).cost == 1
    assert solve(with_costs(team_of(domains, [shared, alone])), options_of(protocol)).verdict == Verdict.NO_SOLUTION


def test_costs_with_preferences_may_be_too_large_for_a_small_field() -> None:
    team = with_costs(team_of(dict.fromkeys("ABC", (1, 2)), [priced("A", "B", {(1, 1): 999})]))
    options = options_of("p-maxsum", bits="31")
    with pytest.raises(UnsupportedError, match=r"too much for a field of 31 bits.*--set preference=0"):
        solve(team, options)
    assert solve(team, replace(options, settings={"bits": "31", "preference": "0"})).assignment


def test_an_open_topology_takes_fewer_comparisons() -> None:
    team = chain(1, 2)
    numbers = []
    for topology in ("open", "hidden"):
        parameters = RunParameters(0, {"topology": topology, "cycles": "1"})
        with Simulation(team, KnownPMaxSum, RandomChannels(0), parameters=parameters) as simulation:
            simulation.search()
            robot = simulation._hosts["RA"].protocol  # noqa: SLF001 - to count comparisons
            assert isinstance(robot, PMaxSum)
            numbers.append(robot.comparisons)
    assert numbers == [2 * 4 + 3 + 2, 3 * 4 + 3 + 2]
