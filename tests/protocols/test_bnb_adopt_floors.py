"""The heuristic of BnB-ADOPT+ and ADOPT(k): what subtrees cost at least is told before the search."""

from __future__ import annotations

from robochoc.generators.random_csp import random_csp
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.adopt_k import ADOPTk, ADOPTkSettings
from robochoc.protocols.optimization.bnb_adopt import BnBADOPT
from robochoc.protocols.optimization.bnb_adopt_messages import BnBADOPTSettings, Cost, Domain, Floor, Value
from tests.support.agents import after, assert_refused, replies, sent, value
from tests.support.cases import looped
from tests.support.pseudo_trees import context, placed, priced
from tests.support.spent import spent

TEAM = priced("ZABCD", {"ZA": [0] * 4, "ZB": [0, 1, 2, 0], "AB": [5, 3, 1, 2], "BC": [0] * 4, "BD": [0] * 4})
"""B stands below A and, further up, Z; C and D are its children."""


class WithFloors(BnBADOPT):
    """BnB-ADOPT+ with the heuristic."""

    settings = BnBADOPTSettings("dp")


class WithShares(ADOPTk):
    """ADOPT(k) with the heuristic."""

    settings = ADOPTkSettings("dp", 3)


def middle(kind: type[BnBADOPT] = WithFloors) -> BnBADOPT:
    """B, after it has begun."""
    return placed(kind, TEAM, "RB", "RA", pseudo_parents=["RZ"], children=["RC", "RD"])


def test_children_are_asked_with_the_own_values_and_lower_bounds_begin_at_their_floors() -> None:
    """Nothing else is said before they answer. The first value is the best by the floors."""
    robot = middle()
    assert sent(robot) == [("RC", Domain([(1,), (2,)])), ("RD", Domain([(1,), (2,)]))]
    assert replies(robot, ("RZ", Value((1,), 1)), ("RC", Floor([0, 0]))) == []
    robot = after(middle(), ("RC", Floor([4, 0])), ("RD", Floor([1, 2])))
    assert (list(robot.lower), value(robot)) == ([5, 2], (2,))


def test_the_floor_is_the_least_of_what_is_paid_with_the_parent_and_of_the_children_s_floors() -> None:
    robot = middle()
    robot.outbox.clear()
    said = replies(robot, ("RA", Domain([(1,), (2,)])), ("RC", Floor([4, 0])), ("RD", Floor([1, 2])))
    assert said[0] == ("RA", Floor([min(5 + 5, 3 + 2), min(1 + 5, 2 + 2)]))


def test_a_changed_value_voids_bounds_and_shares_of_the_threshold_down_to_the_floors() -> None:
    for kind in (WithFloors, WithShares):
        robot = after(middle(kind), ("RA", Value((1,), 1)), ("RC", Floor([4, 0])), ("RD", Floor([1, 2])))
        assert not isinstance(robot, ADOPTk) or robot.t == {"RC": [4, 0], "RD": [1, 2]}
        replies(robot, ("RC", Cost(context(B=1, A=1), 9, 9)), ("RA", Value((2,), 2)))
        assert (robot.bounds["RC"].lb, robot.bounds["RC"].ub) == ([4, 0], [INFINITE, INFINITE])
        assert not isinstance(robot, ADOPTk) or robot.t == {"RC": [4, 0], "RD": [1, 2]}


def test_what_cannot_be_is_refused() -> None:
    wrong = [
        ("RZ", Domain([(1,)])),
        ("RA", Domain([])),
        ("RA", Domain([(9,)])),
        ("RA", Floor([0, 0])),
        ("RC", Floor([0])),
    ]
    assert_refused(middle, wrong, r"R[ABCZ]")


@looped("seed", range(3))
def test_two_messages_a_robot_save_more_than_they_cost(seed: int) -> None:
    team = random_csp(8, 4, 0.3, 0, seed, connected=True, max_cost=20)
    plain, ours = (spent([team], "bnb-adopt", heuristic=heuristic) for heuristic in ("none", "dp"))
    assert not {"Domain", "Floor"} & {*plain.by_type}
    assert ours.by_type["Domain"] == ours.by_type["Floor"] == 7
    assert ours.messages < plain.messages
