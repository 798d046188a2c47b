"""One test per rule of ADOPT (Modi et al., Artificial Intelligence 161, 2005, Section 3); see `test_bounding`."""

from __future__ import annotations

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.adopt import ADOPT
from robochoc.protocols.optimization.adopt_messages import Cost, Threshold, Value
from robochoc.protocols.optimization.bounding_messages import Terminate
from tests.support.agents import after, replies, value
from tests.support.pseudo_trees import context, middle, placed, priced, root, to


def informed(z: int = 1, a: int = 1) -> ADOPT:
    """B, when it knows the values above."""
    return after(middle(ADOPT), ("RZ", Value((z,), 1)), ("RA", Value((a,), 1)))


def test_initialize_takes_the_value_with_the_least_lower_bound_and_tells_all_around() -> None:
    team = priced("ABCD", {"B": [4, 1], "AB": [0] * 4, "BC": [0] * 4, "BD": [0] * 4})
    adopt = placed(ADOPT, team, "RB", "RA", children=["RC"], pseudo_children=["RD"])
    assert adopt.outbox == [
        ("RC", Value((2,), 1)),
        ("RD", Value((2,), 1)),
        ("RC", Threshold(1 - 1, {})),
        ("RA", Cost({}, 1, INFINITE)),
    ]


def test_a_value_is_added_to_the_context_and_what_it_costs_to_the_bounds() -> None:
    adopt = middle(ADOPT)
    said = replies(adopt, ("RA", Value((2,), 1)))
    assert adopt.context == context(A=2)
    assert list(adopt.lower) == [1, 0]
    assert to("RA", said) == [Cost(context(A=2), 0, INFINITE)]


def test_a_cost_bounds_the_child_s_subtree_for_the_value_in_its_context_unless_that_is_obsolete() -> None:
    adopt = after(informed(), ("RC", Cost(context(B=2, A=1), 4, 7)))
    assert (adopt.bounds["RC"].lb, adopt.bounds["RC"].ub) == ([0, 4], [INFINITE, 7])
    assert list(adopt.lower) == [0, 8]
    replies(adopt, ("RA", Value((2,), 2)), ("RC", Cost(context(B=1, A=1), 4, 7)))
    assert (adopt.bounds["RC"].lb, adopt.bounds["RC"].ub) == ([0, 0], [INFINITE, INFINITE])
    assert adopt.context == context(A=(2, 2), Z=1)


def test_a_cost_tells_values_of_robots_further_up_and_newer_ones_of_neighbours_but_no_older_ones() -> None:
    adopt = after(informed(), ("RC", Cost(context(B=1, X=(1, 2), A=(2, 2)), 4, 7)))
    assert adopt.context == context(A=(2, 2), Z=1, X=(1, 2))
    assert list(adopt.lower) == [5, 1]
    replies(adopt, ("RD", Cost(context(B=1, X=(2, 1)), 5, 7)))
    assert adopt.context["RX"] == ((1,), 2)
    assert (adopt.bounds["RC"].lb, adopt.bounds["RD"].lb) == ([4, 0], [0, 0])


def test_a_changed_value_voids_the_bounds_that_rest_on_it_and_the_same_value_again_none() -> None:
    adopt = after(informed(), ("RC", Cost(context(B=1, A=1), 4, 7)), ("RD", Cost(context(B=1, Z=1), 3, 3)))
    replies(adopt, ("RA", Value((2,), 2)))
    assert (adopt.bounds["RC"].lb, adopt.bounds["RC"].ub, adopt.t["RC"]) == ([0, 0], [INFINITE, INFINITE], [0, 0])
    assert (adopt.bounds["RD"].lb, adopt.bounds["RD"].ub) == ([3, 0], [3, INFINITE])
    adopt = after(informed(), ("RC", Cost(context(B=1, A=1), 4, 7)))
    said = replies(adopt, ("RA", Value((2,), 2)), ("RA", Value((1,), 3)), ("RC", Cost(context(B=1, A=1), 4, 7)))
    assert adopt.bounds["RC"].lb == [4, 0]
    assert to("RA", said) == [Cost(context(A=(1, 3), Z=1), 4, INFINITE)]


def test_a_value_is_left_once_its_lower_bound_is_above_the_threshold_or_that_is_ub() -> None:
    """In the second case it takes the value with the least upper bound."""
    adopt = after(informed(), ("RA", Threshold(4, {})))
    replies(adopt, ("RC", Cost(context(B=1), 4, 9)))
    assert value(adopt) == (1,)
    said = replies(adopt, ("RC", Cost(context(B=1), 5, 9)))
    assert value(adopt) == (2,)
    assert to("RC", said)[0] == Value((2,), 2)
    adopt = after(informed(), ("RA", Threshold(9, {})), *((child, Cost(context(B=2), 0, 1)) for child in ("RC", "RD")))
    assert adopt.threshold == adopt.ub == 6
    assert value(adopt) == (2,)


def test_the_threshold_stays_between_lb_and_ub() -> None:
    adopt = after(informed(), ("RA", Threshold(2, {})))
    assert adopt.threshold == 2
    replies(adopt, ("RC", Cost(context(B=1), 5, 9)))
    assert adopt.threshold == adopt.lb == 4
    replies(adopt, *((child, Cost(context(B=1), 0, 1)) for child in ("RC", "RD")), ("RA", Threshold(99, {})))
    assert adopt.threshold == adopt.ub == 2


def test_a_threshold_in_another_context_waits_until_it_fits() -> None:
    adopt = after(informed(), ("RA", Threshold(7, {"RZ": (2,)})))
    assert adopt.threshold == 0
    replies(adopt, ("RZ", Value((2,), 2)))
    assert adopt.threshold == 7
    replies(adopt, ("RZ", Value((1,), 3)), ("RA", Threshold(3, {"RZ": (2,)})))
    assert adopt.threshold == 7


def test_the_threshold_is_split_among_the_children_within_their_bounds() -> None:
    adopt = after(informed(), ("RC", Cost(context(B=1), 1, 3)), ("RD", Cost(context(B=1, A=1), 2, 9)))
    for threshold, left, right in ((8, 3, 5), (4, 1, 3)):
        said = replies(adopt, ("RA", Threshold(threshold, {})))
        assert said == [("RC", Threshold(left, {})), ("RD", Threshold(right, {"RA": (1,)}))]
    adopt = root(ADOPT)
    assert replies(adopt, ("RD", Cost(context(B=1), 1, 9))) == [("RD", Threshold(1, {}))]
    assert adopt.t == {"RC": [0, 0], "RD": [1, 0]}


def test_nothing_is_told_twice_and_what_is_paid_is_looked_up_only_when_a_neighbour_above_has_another_value() -> None:
    adopt = informed()
    checks = adopt.problem.checks
    packet = [("RA", Value((1,), 1)), ("RC", Cost(context(B=1), 0, INFINITE)), ("RA", Threshold(0, {}))]
    assert replies(adopt, *packet) == []
    replies(adopt, ("RC", Cost(context(B=1, X=1), 4, 7)), ("RA", Value((1,), 2)), ("RA", Threshold(3, {})))
    assert adopt.problem.checks == checks


def test_another_robot_ends_only_after_its_parent_with_the_last_values_above_when_its_bounds_meet() -> None:
    adopt = after(informed(), *((child, Cost(context(B=1), 1, 1)) for child in ("RC", "RD")), ("RA", Threshold(2, {})))
    assert adopt.threshold == adopt.ub == 2
    assert not adopt.terminated
    said = replies(adopt, ("RA", Terminate(context(Z=1, A=1, X=2))))
    assert said == [(child, Terminate(context(Z=1, A=1, X=2, B=1))) for child in ("RC", "RD")]
    assert replies(adopt, ("RA", Value((2,), 2))) == []
    adopt = informed()
    said = replies(adopt, ("RA", Threshold(1, {})), ("RA", Terminate(context(Z=1, A=(2, 2)))))
    assert list(adopt.lower) == [1, 1]
    more = replies(adopt, *((child, Cost(context(B=1, A=(2, 2)), 0, 0)) for child in ("RC", "RD")))
    assert more[-2:] == [(child, Terminate(context(Z=1, A=(2, 2), B=1))) for child in ("RC", "RD")]
    assert to("RA", [*said, *more]) == [], "nothing is told to a parent that has ended"


def test_a_root_that_finds_all_values_infinite_ends_the_search_of_all() -> None:
    adopt = after(root(ADOPT), ("RC", Cost(context(B=1), INFINITE, INFINITE)))
    assert value(adopt) == (2,)
    assert replies(adopt, ("RC", Cost(context(B=(2, 2)), INFINITE, INFINITE))) == []
    assert adopt.verdict is Verdict.NO_SOLUTION


def test_another_robot_that_finds_all_values_infinite_says_so() -> None:
    adopt = informed()
    packet = [("RC", Cost(context(B=number), INFINITE, INFINITE)) for number in (1, 2)]
    assert replies(adopt, *packet) == [("RA", Cost(context(A=1, Z=1), INFINITE, INFINITE))]
    said = replies(adopt, ("RA", Value((2,), 2)), ("RC", Cost(context(B=1, A=(2, 2)), INFINITE, INFINITE)))
    assert to("RA", said) == [Cost(context(A=(2, 2), Z=1), INFINITE, INFINITE)]
