"""One test per rule of HS-CAI (Chen et al., AAAI 2020); its search is in `test_branching`."""

from __future__ import annotations

import itertools
import math
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.branching import Result
from robochoc.protocols.optimization.hs_cai import (
    CPA,
    HSCAI,
    MOST_CELLS,
    Axis,
    CtxtUtil,
    Domain,
    HSCAISettings,
    InferCtxt,
    PreUtil,
    least_over,
    limited_axes,
    table_of,
)
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies
from tests.support.cases import looped
from tests.support.pseudo_trees import placed, priced, unplaced

TEAM = priced("ABC", {"B": [0, 1], "AB": [0, 3, 2, 0], "BC": [0] * 4, "AC": [0] * 4})
"""B below A has the child C, which is a pseudo-child of A."""
A, B = ("RA", 0, 2), ("RB", 1, 2)
FROM_C = PreUtil([B], [A], 20, [4, 2])
"""C's table, over B alone."""


def middle(k: int = 1, t: int = 1) -> HSCAI:
    """B, before anyone has told anything."""
    robot = unplaced(HSCAI, TEAM, "RB")
    robot.settings = HSCAISettings(k, t)  # type: ignore[misc]  # as the host does
    robot.parent, robot.children, robot.placed = "RA", ("RC",), True
    robot.start_in_tree()
    return robot


def informed(t: int = 1) -> HSCAI:
    """B, which has told its table."""
    robot = middle(t=t)
    replies(robot, ("RA", Domain([(1,), (2,)], 0)), ("RC", FROM_C))
    return robot


def search(robot: HSCAI, place: int, bound: float = INFINITE) -> list[tuple[str, Message]]:
    """Return B's messages after a CPA with a value of A, before both values are searched without success."""
    said = replies(robot, ("RA", CPA(bound, {"RA": place})))
    while robot.searching:
        replies(robot, ("RC", Result(INFINITE, {})))
    return said


def test_robots_below_learn_values_and_depth_from_the_top_down() -> None:
    root = placed(HSCAI, TEAM, "RA", children=["RB"], pseudo_children=["RC"])
    assert root.outbox == [(name, Domain([(1,), (2,)], 0)) for name in ("RB", "RC")]
    assert replies(middle(), ("RA", Domain([(1,), (2,)], 0))) == [("RC", Domain([(1,), (2,)], 1))]


def test_the_table_before_the_search_has_the_least_costs_of_the_subtree() -> None:
    robot = middle()
    said = replies(robot, ("RA", Domain([(1,), (2,)], 0)), ("RC", FROM_C))
    assert said[-1] == ("RA", PreUtil([A], [], 1 + 3 + 20, [min(0 + 4, 4 + 2), min(2 + 4, 1 + 2)]))


def test_the_highest_robots_are_left_out() -> None:
    axes = [("RX", 4, 3), ("RY", 1, 3), ("RZ", 7, 3)]
    assert limited_axes(axes, 2) == [("RX", 4, 3), ("RZ", 7, 3)]
    assert limited_axes(axes, 3) == [("RY", 1, 3), ("RX", 4, 3), ("RZ", 7, 3)]
    assert limited_axes([("RX", 1, MOST_CELLS), ("RY", 2, 2)], 3) == [("RY", 2, 2)]


def test_a_table_is_a_lower_bound_whatever_is_left_out() -> None:
    chance = Random(1)
    names: list[Axis] = [("RX", 0, 2), ("RY", 1, 3), ("RZ", 2, 2)]
    sizes = {name: size for name, _, size in names} | {"RO": 3}
    for _ in range(30):
        tables = []
        for _ in range(3):
            some = chance.sample(sorted(sizes), chance.randint(1, 3))
            axes: list[Axis] = [(name, 0, sizes[name]) for name in some]
            cells = math.prod(sizes[name] for name in some)
            tables.append(table_of(axes, [chance.choice((0, 3, 7, INFINITE)) for _ in range(cells)]))
        charges = [chance.randint(0, 5) for _ in range(3)]
        kept = limited_axes(names, chance.randint(1, 3))
        told = table_of(kept, least_over(kept, "RO", charges, tables))
        for places in itertools.product(*(range(size) for _, _, size in names)):
            at = {name: place for (name, _, _), place in zip(names, places, strict=True)}
            real = min(
                charge + sum(float(table.at({**at, "RO": own}).costs) for table in tables)
                for own, charge in enumerate(charges)
            )
            bound = float(told.at(at).costs)
            assert bound <= real
            assert len(kept) < len(names) or bound == real


def test_the_bounds_of_a_search_are_the_table_s() -> None:
    robot = informed()
    assert replies(robot, ("RA", CPA(9, {"RA": 0}))) == [("RC", CPA(9, {"RB": 0, "RA": 0}))]
    assert robot.branches["RC"].lower == [4, 2]
    assert robot.local == [0, 1 + 3]


def test_values_that_cost_the_bound_are_not_searched() -> None:
    assert replies(informed(), ("RA", CPA(4, {"RA": 0}))) == [("RA", Result(INFINITE, {}))]


def test_a_value_that_stays_for_more_than_t_searches_is_inferred_with() -> None:
    robot = informed(t=2)
    for _ in range(3):
        assert ("RC", InferCtxt({"RA": 1})) not in search(robot, 1)
    assert search(robot, 1)[0] == ("RC", InferCtxt({"RA": 1}))
    robot = informed(t=1)
    said = [message for place in (0, 0, 1, 1, 0, 0) for _, message in search(robot, place)]
    assert not any(isinstance(message, InferCtxt) for message in said), "the values change too often"


def test_one_inference_at_a_time_and_none_twice() -> None:
    robot = informed(t=1)
    said = [message for _ in range(5) for _, message in search(robot, 1) if isinstance(message, InferCtxt)]
    assert said == [InferCtxt({"RA": 1})]
    replies(robot, ("RC", CtxtUtil([B], [9, 9])))
    assert not any(isinstance(message, InferCtxt) for _, message in search(robot, 1))


def test_a_tighter_table_holds_while_the_values_last() -> None:
    for place, lower in ((1, [9, 2]), (0, [4, 2])):
        robot = informed(t=1)
        for _ in range(3):
            search(robot, 1)
        replies(robot, ("RC", CtxtUtil([B], [9, 1])), ("RA", CPA(INFINITE, {"RA": place})))
        assert robot.branches["RC"].lower == lower


def test_a_tighter_table_counts_for_the_search_that_goes_on() -> None:
    robot = informed(t=1)
    search(robot, 1)
    search(robot, 1)
    replies(robot, ("RA", CPA(INFINITE, {"RA": 1})), ("RC", CtxtUtil([B], [9, 8])))
    assert robot.branches["RC"].lower == [9, 8]


def test_a_robot_that_is_asked_asks_those_below_that_lack_the_values() -> None:
    robot = informed()
    assert replies(robot, ("RA", InferCtxt({"RA": 0}))) == [("RC", InferCtxt({"RA": 0}))]
    assert replies(robot, ("RC", CtxtUtil([B], [9, 8]))) == [("RA", CtxtUtil([], [min(9, 4 + 8)]))]


def test_a_request_for_the_parent_s_parent_waits_for_the_one_for_the_parent() -> None:
    robot = informed()
    replies(robot, ("RA", InferCtxt({"RA": 0})))
    assert replies(robot, ("RA", InferCtxt({"RA": 1}))) == []
    with pytest.raises(ValueError, match="too many open requests"):
        replies(robot, ("RA", InferCtxt({"RA": 1})))
    said = replies(robot, ("RC", CtxtUtil([B], [9, 8])))
    assert said == [("RA", CtxtUtil([], [9])), ("RC", InferCtxt({"RA": 1}))]
    assert replies(robot, ("RC", CtxtUtil([B], [6, 8]))) == [("RA", CtxtUtil([], [6 + 2]))]


def test_answers_come_in_the_order_of_the_requests() -> None:
    robot = informed(t=1)
    for _ in range(3):
        search(robot, 1)
    replies(robot, ("RA", InferCtxt({"RA": 0})))
    assert replies(robot, ("RC", CtxtUtil([B], [7, 7]))) == []
    assert replies(robot, ("RC", CtxtUtil([B], [5, 5]))) == [("RA", CtxtUtil([], [5]))]
    assert robot.tighter["RC"].context == {"RA": 1}


@looped(("sender", "message", "fault"), [
    ("RC", Domain([(1,)], 0), "invalid domain from"), ("RA", Domain([], 0), "invalid domain from"),
    ("RA", PreUtil([], [], 0, [3]), "repeated table from"),
    ("RC", PreUtil([B], [], 0, [3]), "do not form a table"),
    ("RC", PreUtil([("RB", 1, 3)], [], 0, [3, 3, 3]), "another depth or number of values"),
    ("RC", PreUtil([("RA", 1, 2)], [], 0, [3, 3]), "another depth or number of values"),
    ("RA", CPA(3, {"RA": 0}), "lacks values of robots above"),
    ("RA", InferCtxt({"RA": 0}), "cannot infer a table"), ("RC", CtxtUtil([], [3]), "sent an unexpected table"),
])  # fmt: skip
def test_what_cannot_be_is_refused(sender: str, message: Message, fault: str) -> None:
    robot = middle()
    if isinstance(message, PreUtil):
        replies(robot, ("RA", Domain([(1,), (2,)], 0)))
    with pytest.raises(ValueError, match=fault):
        replies(robot, (sender, message))


def test_places_beyond_a_domain_and_tables_of_other_robots_are_refused() -> None:
    for message in (CPA(3, {"RA": 2}), CPA(3, {}), InferCtxt({"RA": -1}), InferCtxt({"RX": 0})):
        with pytest.raises(ValueError, match="RB"):
            replies(informed(), ("RA", message))
    robot = informed()
    replies(robot, ("RA", InferCtxt({"RA": 0})))
    with pytest.raises(ValueError, match="a table over other robots"):
        replies(robot, ("RC", CtxtUtil([("RX", 0, 2)], [1, 1])))


@looped("k", [1, 2, 9])
def test_no_table_is_over_more_than_k_robots_and_the_optimum_is_the_same(k: int) -> None:
    seen = 0
    for seed in range(4):
        team = random_csp(7, 3, 0.6, 0, seed, connected=True, max_cost=50)
        events: list[AnyEvent] = []
        settings = {"k": str(k), "t": "1"}
        options = Options(protocol="hs-cai", runtime=Runtime.SIMULATOR, settings=settings, cache=False)
        outcome = solve(team, options, observer=events.append)
        assert outcome.cost == solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, cache=False)).cost
        for event in events:
            if isinstance(event, Sent) and event.type in {"PreUtil", "CtxtUtil"}:
                seen += 1
                assert len(event.content["axes"]) <= k
    assert seen
