"""One test per rule of AWC (Yokoo, Durfee, Ishida, Kuwabara, IEEE TKDE 10(5), 1998, Section 5), named for it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics
from robochoc.protocols.message import Value
from robochoc.protocols.satisfaction.awc import AWC, NogoodList, StoredNogood
from robochoc.protocols.satisfaction.awc_messages import AddLink, Nogood, Ok
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.cases import looped
from tests.support.complex_problems import complex_team
from tests.support.problems import team_of
from tests.support.small_teams import differ, odd_triple, triangle

agent = partial(started_robot, AWC)


def nogood(assignments: Mapping[str, Value]) -> Nogood:
    return Nogood({name: (said, 0) for name, said in assignments.items()})


def test_start_takes_the_first_value_and_tells_it_with_priority_0_to_all_neighbours() -> None:
    assert started(robot_of(AWC, triangle(), "RB")) == [("RA", Ok((1,), 0)), ("RC", Ok((1,), 0))]


def test_a_larger_priority_is_higher_and_of_equals_the_first_in_the_order() -> None:
    second = [("RA", Ok((2,), 0)), ("RC", Ok((2,), 0))]
    for other, priority, said in (("RC", 0, []), ("RA", 0, second), ("RC", 1, second)):
        assert replies(agent(triangle(), "RB"), (other, Ok((1,), priority))) == said


def test_a_value_that_higher_robots_allow_is_kept_whatever_lower_ones_say() -> None:
    awc = agent(triangle(3), "RB")
    assert replies(awc, ("RA", Ok((2,), 0)), ("RC", Ok((1,), 0))) == []
    assert value(awc) == (1,)


def test_the_view_is_checked_once_a_packet_has_been_read() -> None:
    awc = agent(triangle(3), "RC")
    said = replies(awc, ("RA", Ok((1,), 0)), ("RB", Ok((2,), 0)))
    assert said == [(name, Ok((3,), 0)) for name in ("RA", "RB", "RD")]


def test_of_the_allowed_values_the_one_with_fewest_conflicts_with_lower_robots_is_taken() -> None:
    """A nogood with lower robots counts as a conflict."""
    for packet in ([("RC", Ok((2,), 0))], [("RC", Ok((1,), 0)), ("RC", nogood({"RB": (2,), "RC": (1,)}))]):
        awc = agent(triangle(3), "RB", *packet)
        replies(awc, ("RA", Ok((1,), 0)))
        assert value(awc) == (3,)


def test_backtrack_tells_the_nogood_to_all_robots_in_it_and_goes_above_all_neighbours() -> None:
    """It takes the value with the fewest conflicts with all neighbours."""
    awc = agent(triangle(), "RC")
    said = replies(awc, ("RA", Ok((1,), 3)), ("RB", Ok((2,), 5)), ("RD", Ok((1,), 7)))
    learnt = Nogood({"RA": ((1,), 3), "RB": ((2,), 5)})
    assert said == [("RA", learnt), ("RB", learnt), *((name, Ok((2,), 8)) for name in ("RA", "RB", "RD"))]
    assert (awc.priority, value(awc)) == (8, (2,))


def test_a_nogood_that_has_been_sent_before_is_not_sent_again_and_changes_nothing() -> None:
    awc = agent(triangle(), "RC", ("RA", Ok((1,), 0)), ("RB", Ok((2,), 0)))
    assert replies(awc, ("RA", Ok((1,), 2)), ("RB", Ok((2,), 2))) == []
    assert awc.priority == 1
    assert replies(awc, ("RA", Ok((2,), 2)), ("RB", Ok((1,), 2)))
    assert awc.priority == 3


def test_an_empty_nogood_or_domain_ends_the_search_without_solution_and_nothing_is_said_after_it() -> None:
    awc = agent(triangle(1), "RA")
    assert replies(awc, ("RB", nogood({"RA": (1,)}))) == []
    assert awc.verdict is Verdict.NO_SOLUTION
    assert replies(awc, ("RB", AddLink()), ("RB", Ok((1,), 9))) == []
    never = Relation("R", 1, Semantics.SUPPORTS, ())
    team = team_of({"A": (1,), "B": (1,)}, [differ("A", "B"), Constraint("C", never, ("A",), ("A",))])
    assert agent(team, "RA").verdict is Verdict.NO_SOLUTION


def test_the_lowest_robot_of_a_nogood_keeps_to_it_for_good() -> None:
    awc = agent(triangle(3), "RB")
    assert replies(awc, ("RA", Ok((2,), 0)), ("RA", nogood({"RA": (2,), "RB": (1,)}))) != []
    assert value(awc) == (3,)
    for other, own in ((3, 1), (2, 3)):
        replies(awc, ("RA", Ok((other,), 0)))
        assert value(awc) == (own,)


def test_a_robot_that_is_not_the_lowest_of_a_nogood_keeps_to_it_only_once_it_is() -> None:
    awc = agent(triangle(3), "RA")
    assert replies(awc, ("RB", Ok((2,), 0)), ("RB", nogood({"RA": (1,), "RB": (2,)}))) == []
    assert replies(awc, ("RB", Ok((2,), 1))) == [("RB", Ok((3,), 0)), ("RC", Ok((3,), 0))]


def test_a_nogood_with_a_robot_that_is_no_neighbour_makes_it_one_and_only_then_is_believed() -> None:
    awc = agent(triangle(), "RA", ("RC", Nogood({"RA": ((1,), 0), "RB": ((2,), 4)})))
    assert awc.view == {}
    awc = agent(triangle(), "RA")
    said = replies(awc, ("RC", Nogood({"RA": ((1,), 0), "RD": ((2,), 4)})))
    assert said[:2] == [("RD", AddLink()), ("RD", Ok((1,), 0))]
    assert said[2:] == [(name, Ok((2,), 0)) for name in ("RB", "RC", "RD")]
    assert (awc.view["RD"], awc.priorities["RD"]) == ((2,), 4)


def test_add_link_tells_the_value_to_the_new_neighbour_now_and_later_once() -> None:
    awc = agent(triangle(), "RA")
    assert replies(awc, ("RD", AddLink())) == [("RD", Ok((1,), 0))]
    replies(awc, ("RD", AddLink()))
    assert replies(awc, ("RB", nogood({"RA": (1,)}))).count(("RD", Ok((2,), 0))) == 1


def test_an_n_ary_constraint_is_checked_by_the_lowest_robot_at_present() -> None:
    awc = agent(odd_triple(), "RA")
    assert replies(awc, ("RB", Ok((1,), 0)), ("RC", Ok((1,), 1))) == []
    assert awc.problem.checks == 0
    assert replies(awc, ("RB", Ok((1,), 1))) == [("RB", Ok((2,), 0)), ("RC", Ok((2,), 0))]


def test_what_is_known_to_hold_is_not_checked_again() -> None:
    awc = agent(triangle(3), "RB", ("RA", Ok((2,), 0)))
    assert (checks := awc.problem.checks)
    replies(awc, ("RC", Ok((1,), 0)), ("RA", Ok((2,), 0)))
    assert awc.problem.checks == checks


def test_a_nogood_that_names_a_part_of_a_value_rules_out_all_that_look_alike() -> None:
    owned = {"RA": ["A1", "A2"], "RB": ["B"]}
    domains = {"A1": (1, 2), "A2": (1, 2), "B": (1, 2)}
    awc = agent(complex_team(owned, domains, [differ("A1", "B"), differ("A2", "B")]), "RA")
    assert value(awc) == (1, 1)
    replies(awc, ("RB", nogood({"RA": (1, None)})))
    assert value(awc) == (2, 1)
    replies(awc, ("RB", nogood({"RA": (None, 1)})))
    assert value(awc) == (2, 2)


@looped(("said", "stands"), [((1, 9), True), ((2, 1), False), (None, False), ((None, 1), False)])
def test_a_nogood_stands_when_all_that_it_names_is_known_to_be_so(said: Value | None, stands: bool) -> None:  # noqa: FBT001
    nogoods = NogoodList()
    nogoods.add("RB", {"RA": (1, None), "RB": (1,)})
    view = {} if said is None else {"RA": said}
    assert (nogoods.applicable(view) == [StoredNogood({"RA": (1, None)}, (1,))]) is stands


def test_a_nogood_is_kept_once_and_waits_until_its_robot_says_so() -> None:
    nogoods = NogoodList()
    for _ in range(2):
        nogoods.add("RC", {"RA": (1,), "RB": (2,), "RC": (1,)})
    view = {"RA": (2,), "RB": (2,)}
    assert nogoods.applicable(view) == []
    nogoods.update("RB", (2,))
    assert nogoods.applicable({**view, "RA": (1,)}) == [], "it waits for RA alone, which has not said so"
    nogoods.update("RA", (1,))
    assert len(nogoods.applicable({**view, "RA": (1,)})) == 1
