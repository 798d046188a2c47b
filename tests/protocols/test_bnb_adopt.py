"""One test per rule of BnB-ADOPT+ (Yeoh et al., JAIR 38, 2010; Gutierrez, Meseguer, AAAI 2010); see `test_bounding`."""

from __future__ import annotations

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bnb_adopt import BnBADOPT
from robochoc.protocols.optimization.bnb_adopt_messages import Cost, Value
from robochoc.protocols.optimization.bounding_messages import Terminate
from tests.support.agents import after, replies, value
from tests.support.pseudo_trees import context, placed, priced, root, to

TEAM = priced(
    "ZABCDE", {"ZA": [0] * 4, "ZB": [0, 1, 2, 0], "AB": [0, 3, 1, 0], "BC": [0] * 4, "BD": [0] * 4, "BE": [0] * 4}
)
"""B stands below A and, further up, Z; C and D are its children, and E is a pseudo-child."""


def middle() -> BnBADOPT:
    """B, after it has begun."""
    adopt = placed(BnBADOPT, TEAM, "RB", "RA", pseudo_parents=["RZ"], children=["RC", "RD"], pseudo_children=["RE"])
    adopt.outbox.clear()
    return adopt


def informed(threshold: float = INFINITE) -> BnBADOPT:
    """B, when it knows the values above, both 1."""
    return after(middle(), ("RZ", Value((1,), 1)), ("RA", Value((1,), 1, threshold)))


def both(*costs: Cost) -> list[tuple[str, Message]]:
    """The same from both children."""
    return [(child, cost) for cost in costs for child in ("RC", "RD")]


def test_start_takes_the_value_with_the_least_lower_bound_and_tells_all_around() -> None:
    team = priced("ABCD", {"B": [4, 1], "AB": [0] * 4, "BC": [0] * 4, "BD": [0] * 4})
    adopt = placed(BnBADOPT, team, "RB", "RA", children=["RC"], pseudo_children=["RD"])
    assert adopt.outbox == [("RC", Value((2,), 1)), ("RD", Value((2,), 1)), ("RA", Cost({}, 1, INFINITE))]


def test_priority_merge_keeps_the_larger_id_whoever_tells() -> None:
    adopt = after(informed(), ("RC", Cost(context(B=1, X=(1, 2), A=(2, 2)), 4, 7)))
    replies(adopt, ("RD", Cost(context(B=1, X=(2, 1)), 5, 7)), ("RA", Value((1,), 1)))
    assert adopt.context == context(A=(2, 2), Z=1, X=(1, 2))
    assert adopt.bounds["RC"].lb == [4, 0]
    assert adopt.bounds["RD"].lb == [0, 0]


def test_a_changed_value_voids_the_bounds_of_children_that_depend_on_it_and_the_threshold() -> None:
    adopt = after(informed(threshold=9), ("RC", Cost(context(B=1, Z=1), 4, 7)), ("RD", Cost(context(B=1, A=1), 3, 3)))
    said = replies(adopt, ("RZ", Value((2,), 2)))
    assert (adopt.bounds["RC"].lb, adopt.bounds["RC"].ub) == ([0, 0], [INFINITE, INFINITE])
    assert (adopt.bounds["RD"].lb, adopt.bounds["RD"].ub) == ([3, 0], [3, INFINITE])
    assert adopt.threshold == INFINITE
    assert to("RA", said) == [Cost(context(A=1, Z=(2, 2)), 3, INFINITE, True)], "the threshold is asked for"
    assert replies(adopt, ("RZ", Value((2,), 2))) == [], "once"


def test_a_value_that_was_not_known_voids_no_threshold_but_the_own_value_is_chosen_anew() -> None:
    adopt = after(middle(), ("RA", Value((2,), 1, 9)), ("RZ", Value((2,), 1)))
    assert adopt.threshold == 9
    assert value(adopt) == (2,)


def test_init_self_takes_the_value_with_the_least_lower_bound() -> None:
    adopt = informed()
    assert value(adopt) == (1,)
    said = replies(adopt, ("RZ", Value((2,), 2)), ("RA", Value((2,), 2)))
    assert value(adopt) == (2,)
    assert to("RE", said) == [Value((2,), 2)]


def test_a_value_is_kept_until_it_is_no_better_than_the_best_known_or_dearer_than_the_threshold() -> None:
    adopt = after(informed(), *both(Cost(context(B=1), 0, 5)))
    assert adopt.ub == 10
    for least, kept, own in ((3, [6, 4], 1), (5, [10, 4], 2)):
        replies(adopt, *both(Cost(context(B=1), least, 5)))
        assert (list(adopt.lower), value(adopt)) == (kept, (own,))
    adopt = informed(threshold=6)
    for least, own in ((2, 1), (3, 2)):
        replies(adopt, *both(Cost(context(B=1), least, 5)))
        assert value(adopt) == (own,)


def test_when_the_bounds_meet_the_value_is_the_one_that_is_known_to_cost_that() -> None:
    adopt = after(root(BnBADOPT), *both(Cost(context(B=1), 1, INFINITE)))
    said = replies(adopt, *both(Cost(context(B=2), 0, 0)))
    assert list(adopt.lower) == [2, 2]
    assert value(adopt) == (2,)
    assert to("RC", said) == [Value((2,), 2, 0), Terminate(context(B=(2, 2)))]


def test_a_child_s_threshold_is_what_is_left_when_the_others_cost_the_least() -> None:
    adopt = root(BnBADOPT)
    said = replies(adopt, ("RC", Cost(context(B=1), 4, 7)), ("RD", Cost(context(B=1), 1, 2)))
    assert adopt.ub == 9
    assert said == []  # lower thresholds alone are not worth a message
    said = replies(adopt, ("RC", Cost(context(B=1), 4, 7, True)), ("RD", Cost(context(B=1), 1, 2, True)))
    assert said == [("RC", Value((1,), 1, 8)), ("RD", Value((1,), 1, 5))]


def test_a_threshold_that_comes_with_the_change_is_not_asked_for_and_pseudo_children_get_none() -> None:
    adopt = informed(threshold=9)
    said = replies(adopt, ("RA", Value((2,), 2, 7)))
    assert adopt.threshold == 7
    assert to("RA", said) == [Cost(context(A=(2, 2), Z=1), 1, INFINITE)]
    said = replies(adopt, ("RZ", Value((2,), 2)), ("RA", Value((2,), 3, 6)))
    assert to("RE", said) == [Value((2,), 2)]
    assert to("RC", said) == [Value((2,), 2, 6)]


def test_a_child_that_asks_for_its_threshold_is_told_it_again_and_a_higher_one_though_the_value_is_the_same() -> None:
    adopt = informed(threshold=5)
    assert replies(adopt, ("RC", Cost(context(B=1), 0, INFINITE, True))) == [("RC", Value((1,), 1, 5))]
    assert replies(adopt, ("RA", Value((1,), 1, 6))) == [("RC", Value((1,), 1, 6))]


def test_nothing_else_is_told_twice_but_the_cost_with_a_new_id_of_the_same_value() -> None:
    adopt = informed()
    assert replies(adopt, ("RA", Value((1,), 1, 8)), ("RC", Cost(context(B=1), 0, INFINITE))) == []
    replies(adopt, ("RC", Cost(context(B=1, A=1), 4, 7)))
    said = replies(adopt, ("RA", Value((1,), 3)))
    assert adopt.bounds["RC"].lb == [4, 0], "it voids nothing"
    assert said == [("RA", Cost(context(A=(1, 3), Z=1), 4, INFINITE))]


def test_the_last_value_goes_to_all_neighbours_below() -> None:
    team = priced("BCD", {"B": [0, 2], "BC": [0] * 4, "BD": [0] * 4})
    adopt = placed(BnBADOPT, team, "RB", children=["RC"], pseudo_children=["RD"])
    said = replies(adopt, ("RC", Cost(context(B=1), 5, 5)), ("RC", Cost(context(B=2), 2, 2)))
    assert to("RD", said) == [Value((1,), 1), Value((2,), 2)]
    assert to("RC", said)[-1] == Terminate(context(B=(2, 2)))


def test_another_robot_ends_only_after_its_parent_when_its_bounds_meet_and_tells_it_nothing() -> None:
    adopt = after(informed(), *both(Cost(context(B=1), 1, 1)))
    assert adopt.lb == adopt.ub == 2
    assert not adopt.terminated
    said = replies(adopt, ("RA", Terminate(context(Z=1, A=1, X=2))))
    assert said == [(child, Terminate(context(Z=1, A=1, X=2, B=1))) for child in ("RC", "RD")]
    assert replies(adopt, ("RA", Value((2,), 2))) == []
    adopt = informed(threshold=1)
    said = replies(adopt, ("RA", Terminate(context(Z=1, A=(2, 2)))))
    assert (adopt.threshold, adopt.terminated) == (INFINITE, False)
    said += replies(adopt, *both(Cost(context(B=1, A=(2, 2)), 0, 0)))
    assert to("RA", said) == []
    assert said[-2:] == [(child, Terminate(context(Z=1, A=(2, 2), B=1))) for child in ("RC", "RD")]


def test_a_root_that_finds_all_values_infinite_ends_the_search_of_all_and_another_robot_says_so() -> None:
    adopt = after(root(BnBADOPT), ("RC", Cost(context(B=2), INFINITE, INFINITE)))
    assert replies(adopt, ("RC", Cost(context(B=1), INFINITE, INFINITE))) == []
    assert adopt.verdict is Verdict.NO_SOLUTION
    adopt = informed(threshold=5)
    said = replies(adopt, *both(*(Cost(context(B=number), INFINITE, INFINITE, True) for number in (1, 2))))
    assert to("RA", said) == [Cost(context(A=1, Z=1), INFINITE, INFINITE)]
    assert to("RC", said) == [Value((1,), 1, 0)]
