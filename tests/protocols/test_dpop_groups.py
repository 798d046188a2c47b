"""DPOP's tables over the variables that constraints name, and their division into independent groups."""

from __future__ import annotations

import itertools
import math
import tracemalloc
from collections.abc import Sequence
from random import Random

import numpy as np
import pytest

import robochoc
from robochoc.model.problem import INFINITE
from robochoc.protocols.inference.dpop import UTIL, VALUE, Dimensions, Domain, Proceed, SplitDimensions, TableSizes
from robochoc.protocols.inference.dpop_groups import Parts, decoded, encoded, is_finer, partition_of, refined
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_complex_cost_team
from tests.support.dpop_robots import FEW, begun, products
from tests.support.problems import ON_ONE_MACHINE

GRID = list(itertools.product(range(3), range(2)))


def wide_model(robots: int, slots: int, *, linked: bool = False) -> robochoc.Model:
    """Robots with a slot and a task: two robots at most in a slot, different tasks; `linked`: a price of both."""
    model = robochoc.Model("wide")
    owned = []
    for number in range(robots):
        robot = model.robot(f"R{number}")
        owned.append((robot.variable("slot", range(slots)), robot.variable("task", range(robots))))
    for slot in range(slots):
        model.add(sum(one == slot for one, _ in owned) <= 2)
    for (_, one), (_, other) in itertools.combinations(owned, 2):
        model.add(one != other)
    prices = sum((3 * n + 1) * slot + (5 * n % 4) * task for n, (slot, task) in enumerate(owned))
    model.minimize(prices + sum(2 * abs(slot - task) for slot, task in owned) if linked else prices)
    return model


def parts_of(values: Sequence[tuple[int, ...]], charges: Sequence[float] = ()) -> int:
    return len(Parts(values, charges or [0.0] * len(values)).codes)


def test_all_combinations_of_values_are_independent_parts() -> None:
    assert parts_of(GRID) == 2
    assert parts_of([(*pair, last) for pair in GRID for last in (5, 6)]) == 3


def test_a_missing_combination_links_variables() -> None:
    assert parts_of(GRID[1:]) == 1
    assert parts_of([(*pair, last) for pair in GRID[1:] for last in (5, 6)]) == 2


def test_three_variables_may_be_linked_though_no_two_of_them_are() -> None:
    assert parts_of([(a, b, a ^ b) for a in (0, 1) for b in (0, 1)]) == 1
    assert parts_of([(a, c, b, a ^ b) for a in (0, 1) for b in (0, 1) for c in (0, 1)]) == 2


def test_private_costs_that_are_no_sum_link_variables() -> None:
    assert parts_of(GRID, [3.0 * slot + task for slot, task in GRID]) == 2
    assert parts_of(GRID, [3.0 * slot * task for slot, task in GRID]) == 1


def test_withdrawal_links_all_variables() -> None:
    values = [*GRID, (None, None)]
    assert len(Parts(values, [0.0] * 6 + [math.inf]).codes) == 1


def test_partitions_are_joined_over_combinations_that_exist() -> None:
    slots, tasks = partition_of(GRID[1:], (0,)), partition_of(GRID[1:], (1,))
    assert slots is not None
    assert tasks is not None
    assert slots.tolist() == [0, 1, 1, 2, 2]
    assert tasks.tolist() == [0, 1, 0, 1, 0]
    assert refined(slots, tasks) is None  # all five values are distinguished
    assert refined(slots, slots.copy()) is not None
    assert is_finer(None, slots)
    assert not is_finer(slots, tasks)
    np.testing.assert_array_equal(decoded(encoded(slots, 5), 5), slots)


@looped("codes", [bytes(5), bytes([0, 1, 1]), bytes([0, 2, 1, 1, 1]), bytes([1, 0, 0, 0, 0]), bytes(range(5))])
def test_invalid_codes_are_refused(codes: bytes) -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    said = SplitDimensions({"RA": 3, "RX": 5}, 9, 1, FEW, [TableSizes(9, {"RA": b""}), TableSizes(9, {"RX": codes})])
    with pytest.raises(ValueError, match="codes of 5 values"):
        replies(robot, ("RB", said))


@looped("tables", [[], [TableSizes(9, {"RY": b""})]])
def test_tables_outside_the_separator_are_refused(tables: list[TableSizes]) -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    with pytest.raises(ValueError, match="RB sent invalid dimensions"):
        replies(robot, ("RB", SplitDimensions({"RA": 3}, 9, 1, FEW, tables)))


def test_a_table_that_does_not_depend_on_a_robot_is_passed_on() -> None:
    """RC has the costs of RA's second variable in a table of its own, and RB does not join it with RA's first."""
    model = robochoc.Model("passed")
    a = model.robot("RA")
    first, second = a.variable("A", range(3)), a.variable("Z", range(2))
    b = model.robot("RB").variable("B", range(3))
    c = model.robot("RC").variable("C", range(3))
    model.minimize(robochoc.function(lambda a, b: abs(a - b), first, b) + 2 * abs(b - c) + abs(second - c))
    robot = begun(model.team, "RB", "A", "C")
    below = [TableSizes(9, {"RB": b""}), TableSizes(5, {"RA": bytes([0, 1] * 3)})]
    heard = [("RA", Domain([*GRID])), ("RC", SplitDimensions({"RA": 6, "RB": 3}, 9, 2, FEW, below))]
    ((_, said),) = replies(robot, *heard)
    assert isinstance(said, SplitDimensions)
    assert said.in_words(Wording("RB", "RA", ("RA", "RB", "RC"))).startswith(
        "the costs of my subtree are the sum of 2 tables: one over RA (3 values); one over RA (2 values); no cost is"
    )
    assert [one.axes for one in said.tables] == [{"RA": bytes([0, 0, 1, 1, 2, 2])}, {"RA": bytes([0, 1] * 3)}]
    assert replies(robot, ("RA", Proceed(["RA"]))) == [("RC", Proceed(["RB", "RA"]))]
    # For RB's values 0, 1 and 2, and then for RA's second variable.
    sent = replies(robot, ("RC", UTIL(1, bytes([4, 0, 1]))), ("RC", UTIL(1, bytes([5, 3]))))
    assert sent == [("RA", UTIL(1, bytes([1, 0, 1]))), ("RA", UTIL(1, bytes([5, 3])))]
    assert replies(robot, ("RA", VALUE([4]))) == [("RC", VALUE([1, 4]))]
    assert value(robot) == (1,)


def test_each_group_chooses_and_together_they_are_the_value() -> None:
    model = robochoc.Model("root")
    robot = model.robot("RA")
    first, second = robot.variable("A", range(3)), robot.variable("Z", range(2))
    others = [model.robot(f"R{name}").variable(name, range(3)) for name in "BC"]
    model.minimize(abs(first - others[0]) + abs(second - others[1]) + first)
    root = begun(model.team, "RA", below="BC")
    tables = {"RB": TableSizes(9, {"RA": bytes([0, 0, 1, 1, 2, 2])}), "RC": TableSizes(9, {"RA": bytes([0, 1] * 3)})}
    replies(root, *[(name, SplitDimensions({"RA": 6}, 9, 1, FEW, [table])) for name, table in tables.items()])
    sent = replies(root, ("RB", UTIL(1, bytes([9, 4, 4]))), ("RC", UTIL(1, bytes([8, 6]))))
    assert value(root) == (1, 1)
    assert root.findings.bound == 4 + 1 + 6
    assert sent == [("RB", VALUE([3])), ("RC", VALUE([3]))]


@looped("runtime", ON_ONE_MACHINE)
def test_independent_variables_get_tables_of_their_own(runtime: Runtime) -> None:
    """Tables over slot and task together would have 24^4 cells; those of slots have 4^5 / 4, those of tasks 6^5."""
    model = wide_model(6, 4)
    outcome = solve(model.team, Options(protocol="dpop", runtime=runtime))
    slots = [one for one in itertools.product(range(4), repeat=6) if max(map(one.count, one)) <= 2]
    cheapest_slots = min(sum((3 * n + 1) * slot for n, slot in enumerate(one)) for one in slots)
    cheapest_tasks = min(sum((5 * n % 4) * t for n, t in enumerate(one)) for one in itertools.permutations(range(6)))
    assert outcome.cost == cheapest_slots + cheapest_tasks
    assert outcome.metrics.messages["UTIL"] == 2 * 5
    assert outcome.metrics.messages["SplitDimensions"] == 5
    assert outcome.metrics.largest < 2 * 6**5 + 100


def test_private_costs_link_tables() -> None:
    model = wide_model(4, 4, linked=True)
    outcome = solve(model.team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert outcome.cost == least_cost(model.team)
    assert outcome.metrics.messages["UTIL"] == 3


@looped("linked", [False, True])
def test_arrays_of_divided_tables_take_no_more_memory_than_announced(*, linked: bool) -> None:
    model = wide_model(4, 10, linked=linked)
    values = [*itertools.product(range(10), range(4))]
    robot = begun(model.team, "R3", "210")
    above = ("R2", "R1", "R0")
    robot.problem.tables(dict.fromkeys(above, values))  # costs are cached
    ((_, said),) = replies(robot, *((name, Domain([*values])) for name in above))
    assert isinstance(said, Dimensions)
    tracemalloc.start()
    try:
        sent = replies(robot, ("R2", Proceed([*above])))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(sent) == (1 if linked else 2)
    assert peak < said.most.bytes + 100_000


@pytest.mark.parametrize("seeds", [range(40), pytest.param(range(40, 400), marks=pytest.mark.more)], ids=str)
def test_the_optimum_is_that_of_brute_force(seeds: range) -> None:
    split = 0
    for seed in seeds:
        team = random_complex_cost_team(Random(f"groups {seed}"))
        outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, seed=seed))
        least = least_cost(team)
        assert outcome.cost == (None if least == INFINITE else least)
        split += "SplitDimensions" in outcome.metrics.messages
    assert split > len(seeds) / 3


def test_ordinary_robots_send_dimensions_as_in_the_paper() -> None:
    messages = solve(products("ABC", "AB BC"), Options(protocol="dpop", runtime=Runtime.SIMULATOR)).metrics.messages
    assert messages["Dimensions"] == 2
    assert "SplitDimensions" not in messages
