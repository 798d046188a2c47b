"""One test per rule of SyncABB (Grinshpoun, Grubshtein, Zivan, Netzer, Meisels, JAIR 47, 2013), named for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import pytest

from robochoc.model.assembly import Extras, assemble
from robochoc.model.problem import INFINITE, Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable
from robochoc.protocols.asymmetric.syncabb import CPA, CPABack, FullBack, Priced, SyncABB, SyncABBSettings, TooCostly
from robochoc.protocols.optimization.syncbb import Backtrack, BestPath, Terminate
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped

NONE = BestPath(math.inf)


def priced(scope: str, costs: Mapping[tuple[int, int], float]) -> Constraint:
    relation = Relation("R", 2, Semantics.SOFT, tuple(costs), tuple(costs.values()), 0)
    return Constraint(scope, relation, tuple(scope), tuple(scope))


def chain() -> Team:
    """A, B, C, two values each; A and C, and B and C, have costs of their own."""
    parts = {
        "RA": [priced("AC", {(1, 1): 7})],
        "RB": [priced("BC", {(1, 1): 3, (2, 2): INFINITE})],
        "RC": [priced("AC", {(1, 1): 1, (1, 2): 2}), priced("BC", {(1, 1): 4})],
    }
    own = {f"R{name}": [Variable(name, Domain("D", (range(1, 3),)))] for name in "ABC"}
    return assemble("chain", own, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts))


def cpa(*values: int, paid: float, best: BestPath = NONE) -> CPA:
    return CPA([(one,) for one in values], paid, best)


def agent(name: str, phases: Literal[1, 2] = 1) -> SyncABB:
    """The protocol object of one robot, started, with nothing left to say."""
    robot = robot_of(SyncABB, chain(), name)
    robot.settings = SyncABBSettings(phases)  # type: ignore[misc] # as the host does
    started(robot)
    return robot


def middle(phases: Literal[1, 2] = 1) -> SyncABB:
    """B, which has heard that A = 1; as it shares nothing partially known above, it hands its value 1 on at once."""
    robot = agent("RB", phases)
    assert replies(robot, ("RA", cpa(1, paid=0))) == [("RC", cpa(1, 1, paid=0))]
    return robot


def test_a_robot_adds_a_value_with_its_own_side() -> None:
    assert replies(agent("RC"), ("RB", cpa(1, 1, paid=0))) == [("RB", CPABack("RC", (1,), 5, math.inf, ["RA"]))]


def test_a_robot_before_adds_its_side_and_sends_it_further_back() -> None:
    robot = middle()
    back = CPABack("RC", (1,), 5, 20, ["RA"])
    assert replies(robot, ("RC", back)) == [("RA", CPABack("RC", (1,), 8, 20, []))]


def test_the_last_one_that_is_asked_tells_the_holder_the_sum() -> None:
    assert replies(agent("RA"), ("RB", CPABack("RC", (1,), 8, 20, []))) == [("RC", Priced(15))]


@looped("bound", [8, 7])
def test_a_cpa_that_reaches_the_bound_goes_straight_back(bound: int) -> None:
    robot = middle()
    assert replies(robot, ("RC", CPABack("RC", (1,), 5, bound, ["RA"]))) == [("RC", TooCostly())]


def test_what_the_own_side_forbids_is_too_costly_without_a_bound() -> None:
    robot = agent("RB")
    replies(robot, ("RA", cpa(1, paid=0)), ("RC", Backtrack(NONE)))
    assert value(robot) == (2,)
    assert replies(robot, ("RC", CPABack("RC", (2,), 2, math.inf, ["RA"]))) == [("RC", TooCostly())]


def test_then_the_holder_takes_its_next_value() -> None:
    robot = agent("RC")
    replies(robot, ("RB", cpa(1, 1, paid=0)))
    assert replies(robot, ("RB", TooCostly())) == [("RB", CPABack("RC", (2,), 2, math.inf, ["RA"]))]
    assert replies(robot, ("RA", TooCostly())) == [("RB", Backtrack(NONE))]


def test_the_last_robot_keeps_the_best_and_looks_for_a_better_one() -> None:
    robot = agent("RC")
    replies(robot, ("RB", cpa(1, 1, paid=0)))
    assert replies(robot, ("RA", Priced(15))) == [("RB", CPABack("RC", (2,), 2, 15, ["RA"]))]
    assert replies(robot, ("RA", Priced(2))) == [("RB", Backtrack(BestPath(2, ((1,), (1,), (2,)))))]


def test_at_the_end_all_take_the_best() -> None:
    robot = agent("RC")
    replies(robot, ("RA", Terminate(BestPath(2, ((1,), (1,), (2,))))))
    assert value(robot) == (2,)


def test_with_two_phases_only_a_complete_cpa_goes_back() -> None:
    full = FullBack([(1,), (1,), (1,)], 5, math.inf)
    assert replies(agent("RC", 2), ("RB", cpa(1, 1, paid=0))) == [("RB", full)]


def test_with_two_phases_each_robot_adds_its_sides_towards_all_after_it() -> None:
    robot = middle(2)
    values: list[tuple[int | None, ...]] = [(1,), (1,), (1,)]
    assert replies(robot, ("RC", FullBack(values, 5, 20))) == [("RA", FullBack(values, 8, 20))]
    assert replies(robot, ("RC", FullBack(values, 5, 8))) == [("RC", TooCostly())]
    assert replies(agent("RA", 2), ("RB", FullBack(values, 8, 20))) == [("RC", Priced(15))]


@looped("message", [
    CPABack("RB", (1,), 0, 9, []), CPABack("RC", (1,), 0, 9, ["RC"]),
    CPABack("RC", (1,), 0, 9, ["nobody"]), FullBack([(1,)], 0, 9),
])  # fmt: skip
def test_a_cpa_that_cannot_be_is_refused(message: CPABack | FullBack) -> None:
    robot = middle()
    with pytest.raises(ValueError, match="CPA"):
        replies(robot, ("RC", message))


def test_a_side_without_an_own_value_is_refused() -> None:
    with pytest.raises(ValueError, match="has no value in it"):
        replies(agent("RB"), ("RC", CPABack("RC", (1,), 0, 9, [])))


@looped(("robot", "message"), [
    ("RC", cpa(1, paid=0)), ("RC", cpa(1, 3, paid=0)), ("RC", CPA([(1,), (1, 1)], 0, NONE)),
    ("RC", CPA([(1,), ()], 0, NONE)), ("RA", CPABack("RC", (1, 1), 0, math.inf, [])),
    ("RA", CPABack("RC", (), 0, math.inf, [])), ("RA", FullBack([(1,), (1,), ()], 0, math.inf)),
])  # fmt: skip
def test_a_cpa_with_values_that_cannot_be_is_refused(robot: str, message: CPA | CPABack | FullBack) -> None:
    with pytest.raises(ValueError, match="R"):
        replies(agent(robot), ("RB", message))
