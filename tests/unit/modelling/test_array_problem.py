"""Problems made from numpy arrays: the same runs as of the same team made of objects; arrays that do not fit."""

from __future__ import annotations

import doctest
import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import robochoc.modelling.array_problem
from robochoc.communication.arrays.cycle_run import Draws, cycles_of
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.modelling.array_problem import ArrayProblem
from robochoc.protocols.chance import Chance
from robochoc.run.registry import UnknownProtocolError, protocol_named
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import RefutedError
from tests.support.cases import looped
from tests.support.cost_problems import cost_of, with_costs
from tests.support.examples import count
from tests.support.problems import team_of

PROTOCOLS = ("dsa", "mgm", "mgm2", "maxsum")
PAIR = [(0, 1)]
SAME = np.eye(2)


def random_arrays(seed: int) -> dict[str, Any]:
    """Arguments of a small problem: one table, one for each edge, or a choice of some; edges may be there twice."""
    draw = np.random.default_rng(seed)
    robots, values, many = (int(draw.integers(low, high)) for low, high in ((2, 7), (1, 5), (0, 10)))
    edges = [draw.permutation(robots)[:2] for _ in range(many)]
    kind = draw.integers(3)
    count_ = {0: 1, 1: max(many, 1), 2: 3}[int(kind)]
    tables = draw.choice([0, 0, 1, 2, 300, np.inf], (count_, values, values), p=[0.3, 0.2, 0.2, 0.1, 0.1, 0.1])
    if kind == 0 and draw.random() < 0.5:
        tables = np.maximum(tables, tables.swapaxes(1, 2))
    return {
        "robots": robots,
        "values": values,
        "edges": np.array(edges, int).reshape(-1, 2),
        "tables": tables,
        "which": draw.integers(count_, size=many),
        "charges": draw.integers(4, size=(robots, values)) if draw.random() < 0.5 else None,
    }


def team_of_arrays(given: dict[str, Any]) -> Team:
    """The same team as objects."""
    robots, values = given["robots"], given["values"]
    domains = {f"X{number:03}": tuple(range(values)) for number in range(robots)}
    names = list(domains)
    constraints = []
    for number, (edge, which) in enumerate(zip(given["edges"], given["which"], strict=True)):
        scope = (names[edge[0]], names[edge[1]])
        constraints.append(soft(f"C{number}", scope, given["tables"][which]))
    if given["charges"] is not None:
        constraints += [
            soft(f"U{name}", (name,), charges) for name, charges in zip(names, given["charges"], strict=True)
        ]
    return with_costs(team_of(domains, constraints))


def soft(name: str, scope: tuple[str, ...], table: NDArray[np.float64]) -> Constraint:
    rows = tuple(itertools.product(*(range(size) for size in table.shape)))
    costs = tuple(INFINITE if np.isinf(table[row]) else int(table[row]) for row in rows)
    return Constraint(name, Relation(name, len(scope), Semantics.SOFT, rows, costs, 0), scope, scope)


@pytest.mark.parametrize("protocol", PROTOCOLS)
@count("many", 15, 800)
def test_arrays_run_as_the_team_of_objects(protocol: str, many: int) -> None:
    for seed in range(many):
        given = random_arrays(seed)
        team = team_of_arrays(given)
        problem = ArrayProblem(**given, names=team.order)
        run = problem.run(protocol, seed=seed, cycles=5)
        course = [one.values[run.layout.places].tolist() for one in cycles_of(run)]
        objects = Simulation(
            team, protocol_named(protocol), Concurrent(0), parameters=RunParameters(seed, {"cycles": "5"})
        ).search()
        assert (run.verdict or Verdict.SOLUTION) is objects.verdict
        if objects.verdict is Verdict.NO_SOLUTION:
            continue
        assert [next(iter(found.values())) for found in objects.assignments.values()] == course[-1]
        metrics = run.metrics(0)
        for name in ("messages", "bytes", "largest", "checks", "ncccs"):
            assert getattr(metrics, name) == getattr(objects.metrics, name), name
        names = [robot.variables[0].name for robot in team.robots]
        costs = [cost_of(dict(zip(names, values, strict=True)), list(team.constraints())) for values in course]
        assert run.costs == costs[: len(run.costs)]


def test_without_nccc_counts_all_else_is_the_same() -> None:
    problem = ArrayProblem(**random_arrays(3))
    with_, without = problem.solve("mgm2", cycles=9), problem.solve("mgm2", cycles=9, ncccs=False)
    assert with_.costs == without.costs
    assert (with_.metrics.ncccs > 0, without.metrics.ncccs) == (True, 0)
    assert with_.metrics.messages == without.metrics.messages


def test_the_answer_is_the_cheapest_cycle() -> None:
    draw = np.random.default_rng(1)
    edges = [pair for pair in itertools.combinations(range(12), 2) if draw.random() < 0.5]
    problem = ArrayProblem(12, 3, edges, np.eye(3))
    found = problem.solve("dsa", variant="C", probability=1.0, cycles=40)
    assert found.values is not None
    assert found.cost == min(found.costs) == problem.cost(found.values)
    assert found.costs[-1] > min(found.costs)
    assert len(found.costs) == 41


def test_what_cannot_be_is_said() -> None:
    forbidden = ArrayProblem(2, 2, PAIR, np.full((2, 2), np.inf))
    found = forbidden.solve("dsa", cycles=3)
    assert (found.verdict, found.values, found.cost) == (Verdict.UNKNOWN, None, None)
    assert forbidden.solve("maxsum").verdict is Verdict.NO_SOLUTION


def test_robots_may_be_alone() -> None:
    found = ArrayProblem(3, 2, [], SAME, charges=[[1, 0], [0, 0], [2, 5]]).solve("mgm")
    assert found.values is not None
    assert (found.values.tolist(), found.cost, found.metrics.messages) == ([1, 0, 0], 2, {})


def test_a_limit_on_time_ends_the_run_after_a_cycle() -> None:
    assert len(ArrayProblem(2, 2, PAIR, SAME).solve("dsa", timeout=0, cycles=10**9).costs) < 10**6


def test_a_wrong_sum_is_refuted(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ArrayProblem(2, 2, PAIR, SAME)
    monkeypatch.setattr(problem, "cost", lambda _: 7.0)
    with pytest.raises(RefutedError, match="the answer costs 7, but the run reported 0"):
        problem.solve()


def test_a_solution_is_shown_in_a_line() -> None:
    problem = ArrayProblem(2, 2, PAIR, SAME)
    assert repr(problem.solve("dsa", cycles=3)) == "<solution, cost 0: the best of 3 cycles, 6 messages>"
    assert repr(ArrayProblem(2, 1, PAIR, [[np.inf]]).solve("dsa", cycles=1)).startswith(
        "<unknown: the best of 1 cycle, "
    )


@looped(
    ("changed", "said"),
    [
        ({"robots": 0}, "must be 1 or more"),
        ({"edges": [(0, 0)]}, "two different robots"),
        ({"edges": [(0, 2)]}, "numbers from 0 to 1"),
        ({"tables": np.eye(3)}, r"tables must have the shape \(2, 2\)"),
        ({"which": [0, 0]}, "one table for each edge"),
        ({"which": [1]}, "`which` must contain numbers"),
        ({"charges": [[1, 2]]}, r"charges must have the shape \(2, 2\)"),
        ({"tables": SAME / 2}, "integers of 0 or more, or inf"),
        ({"tables": -SAME}, "integers of 0 or more, or inf"),
        ({"tables": np.full((2, 2), np.nan)}, "integers of 0 or more, or inf"),
        ({"charges": np.full((2, 2), np.inf)}, "charges must be integers"),
        ({"names": ["A", "A"]}, "each robot must have a unique name"),
        ({"names": ["A", "A", "B"]}, "each robot must have a unique name"),
        ({"names": [1, 2]}, "each robot must have a unique name"),
        ({"robots": 2.0}, "robots must be an integer, not 2.0"),
        ({"robots": 10**12}, "at most 2,147,483,648 robots"),
        ({"edges": [0, 1]}, "edges must have two columns"),
        ({"edges": [(0, 1, 0), (1, 0, 1)]}, "edges must have two columns"),
        ({"edges": [(0, 0.7)]}, "edges are not an array of integers"),
        ({"edges": [(0, np.nan)]}, "edges are not an array of integers"),
        ({"edges": [[False, True]]}, "edges are not an array of integers"),
        ({"which": [0.5]}, "which are not an array of integers"),
        ({"tables": 1}, r"tables must have the shape \(2, 2\)"),
        ({"tables": SAME * 1j}, "tables are not an array of numbers"),
        ({"tables": [[1], [1, 2]]}, "tables are not an array of numbers"),
        ({"tables": [[0, 10**30], [0, 0]]}, "tables are not an array of numbers"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(changed: dict[str, Any], said: str) -> None:
    given = {"robots": 2, "values": 2, "edges": PAIR, "tables": SAME, **changed}
    with pytest.raises(ValueError, match=said):
        ArrayProblem(**given)


@pytest.mark.parametrize("values", [[0], [0, 2], [-1, 0], [0, 0.5]])
def test_the_cost_is_that_of_values_that_there_are(values: list[float]) -> None:
    with pytest.raises(ValueError, match=r"a value from 0 to 1|values are not an array of integers"):
        ArrayProblem(2, 2, PAIR, SAME).cost(values)


@looped("protocol", PROTOCOLS)
@looped("cost", [2**45, 2**50])
def test_costs_of_all_robots_are_exact_above_what_floats_and_64_bits_hold(protocol: str, cost: int) -> None:
    """A chain of 5,000 robots: some 2^57 and 2^62; each edge is counted twice."""
    chain = [(robot, robot + 1) for robot in range(4999)]
    problem = ArrayProblem(5000, 2, chain, cost + SAME, charges=np.tile([cost, cost + 1], (5000, 1)))
    run = problem.run(protocol, cycles=2)
    found = [one.values[run.layout.places].tolist() for one in cycles_of(run)]
    costs = [
        (4999 + 5000) * cost + sum(values) + sum(one == other for one, other in itertools.pairwise(values))
        for values in found
    ]
    assert run.costs == costs
    assert [problem.cost(values) for values in found] == costs


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_there_may_be_no_edges_and_no_tables(protocol: str) -> None:
    found = ArrayProblem(3, 2, [], np.empty((0, 2, 2)), charges=[[1, 0], [0, 1], [3, 2]]).solve(protocol)
    assert found.values is not None
    assert (found.values.tolist(), found.cost) == ([1, 0, 1], 2)


def test_names_may_be_an_array() -> None:
    names = np.array(["A", "B"])
    assert ArrayProblem(2, 2, PAIR, SAME, names=names).names == ["A", "B"]


def test_protocols_and_settings_are_looked_up() -> None:
    problem = ArrayProblem(2, 2, PAIR, SAME)
    assert repr(problem) == "<array problem: 2 robots, 1 edges, 2 values>"
    with pytest.raises(UnsupportedError, match=r"ABT has no array implementation; use robochoc\.Model, or one of"):
        problem.solve("abt")
    with pytest.raises(UnsupportedError, match=r"settings: .*cycle"):
        problem.solve("dsa", cycle=3)
    with pytest.raises(robochoc.OptionError, match="ArrayProblem has no option 'runtime'"):
        problem.solve("dsa", runtime="simulator")
    with pytest.raises(UnknownProtocolError):
        problem.solve("das")


def test_the_example_in_the_documentation() -> None:
    assert doctest.testmod(robochoc.modelling.array_problem).failed == 0


def test_all_draw_at_once_what_each_draws() -> None:
    names = [f"R{number}" for number in range(50)]
    draws, streams = Draws(-3, names, 50), [Chance(-3, name) for name in names]
    some = np.arange(0, 50, 3)
    for rows in (np.arange(50), some, some, np.arange(50)):
        assert draws.draw(rows).tolist() == [streams[row]() for row in rows]
    assert draws.choose(some, np.ones(len(some), np.int64)).tolist() == [0] * len(some)
    assert draws.choose(some, np.full(len(some), 7)).tolist() == [int(streams[row]() * 7) for row in some]


@pytest.mark.parametrize("protocol", ["dsa", "mgm", "mgm2"])
def test_a_run_begins_from_known_values(protocol: str) -> None:
    for seed in range(12):
        problem = ArrayProblem(**random_arrays(seed))
        draw = np.random.default_rng(seed)
        start = draw.integers(-1, problem.values, size=problem.robots)
        first = next(cycles_of(problem.run(protocol, seed=seed, start=start, cycles=3)))
        values = dict(zip(first.layout.robots.tolist(), first.values.tolist(), strict=True))
        active = {*problem.edges.ravel().tolist()}
        assert all(values[robot] == start[robot] for robot in active if start[robot] >= 0)
        whole = problem.solve(protocol, seed=seed, cycles=5)
        if whole.values is not None:
            again = problem.solve(protocol, seed=seed + 1, start=whole.values, cycles=5)
            assert again.cost is not None
            assert whole.cost is not None
            assert again.cost <= whole.cost


def test_invalid_starts_are_refused() -> None:
    problem = ArrayProblem(2, 2, PAIR, SAME)
    for start in ([0], [0, 2], [0, -2]):
        with pytest.raises(ValueError, match="start must have a value from 0 to 1, or -1, for each of 2 robots"):
            problem.solve(start=start)
