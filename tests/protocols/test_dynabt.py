"""One test per rule of DynABT (Omomowo, Arana, Ahriz 2008), named for it; ABT's own are in `test_abt.py`."""

from __future__ import annotations

from dataclasses import replace

from robochoc.formats import PREDEFINED
from robochoc.model.change import apply_changes
from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    Domain,
    Parent,
    Relation,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Semantics,
    Team,
    Variable,
)
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.dynabt import DynABT, Nogood
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import replies, value
from tests.support.cases import looped
from tests.support.dynabt_robots import after, agent, change
from tests.support.problems import team_of
from tests.support.small_teams import DIFFERENT, differ, different, triangle

CAB, CBC, CAC = "RB<RA:C", "RC<RB:C", "RC<RA:C"  # keys of the triangle's constraints


def refuted() -> tuple[Team, DynABT]:
    """RA with one value, which RB rules out: there is no solution."""
    team = triangle(1)
    dynabt = agent(team, "RA")
    replies(dynabt, ("RB", Nogood({}, (1,), [CAB, "RB="])))
    return team, dynabt


def ruled_out(values: int = 2) -> tuple[Team, DynABT]:
    """RA, whose first value RB and RC rule out together."""
    team = triangle(values)
    dynabt = agent(team, "RA")
    replies(dynabt, ("RB", Nogood({}, (1,), [CAB, CBC, "RB=", "RC="])))
    return team, dynabt


# What explains a nogood


def test_a_direct_conflict_is_explained_by_its_constraint() -> None:
    dynabt = agent(triangle(), "RB")
    replies(dynabt, ("RA", Ok((1,))))
    assert list(dynabt.store) == [{"RA": (1,)}]
    assert dynabt.store.because(0) == {CAB}


def test_of_two_constraints_the_one_that_is_broken_explains() -> None:
    one_only = Constraint("one", DIFFERENT, ("A", 1), ("A", 1), model=None)
    team = team_of(dict.fromkeys("AB", (1, 2)), [differ("A", "B", "C1"), differ("A", "B", "C2"), one_only])
    dynabt = agent(team, "RB")
    replies(dynabt, ("RA", Ok((1,))))
    assert dynabt.store.because(0) == {"RB<RA:C1"}


def test_a_resolvent_is_explained_by_what_it_resolves_and_by_the_own_domain() -> None:
    dynabt = agent(triangle(), "RC")
    said = replies(dynabt, ("RA", Ok((1,))), ("RB", Ok((2,))))
    assert said[0] == ("RB", Nogood({"RA": (1,)}, (2,), [CAC, CBC, "RC="]))


def test_a_nogood_that_was_told_keeps_its_explanation() -> None:
    dynabt = agent(triangle(3), "RB")
    replies(dynabt, ("RA", Ok((1,))))
    replies(dynabt, ("RC", Nogood({"RA": (1,)}, (2,), [CAC, CBC, "RC="])))
    assert value(dynabt) == (3,)
    assert [dynabt.store.because(index) for index in (0, 1)] == [{CAB}, {CAC, CBC, "RC="}]


def test_an_explanation_is_passed_up() -> None:
    dynabt = agent(triangle(), "RB")
    replies(dynabt, ("RA", Ok((1,))))
    said = replies(dynabt, ("RC", Nogood({"RA": (1,)}, (2,), [CAC, CBC, "RC="])))
    assert said[0] == ("RA", Nogood({}, (1,), ["RB<RA:C", "RB=", "RC<RA:C", "RC<RB:C", "RC="]))


def test_the_empty_nogood_has_a_proof() -> None:
    dynabt = agent(triangle(1), "RA")
    replies(dynabt, ("RB", Nogood({}, (1,), [CAB, "RB="])))
    assert dynabt.verdict is Verdict.NO_SOLUTION
    assert dynabt.proof == {CAB, "RA=", "RB="}


# removeConstraint


def with_two_nogoods() -> tuple[Team, DynABT]:
    """RC, whose first value RA rules out, and whose second RB."""
    team = triangle(3)
    dynabt = agent(team, "RC")
    replies(dynabt, ("RA", Ok((1,))), ("RB", Ok((2,))))
    assert [dynabt.store.because(0), dynabt.store.because(1)] == [{CAC}, {CBC}]
    return team, dynabt


def test_remove_constraint_drops_the_nogoods_that_it_explains_and_no_others() -> None:
    team, dynabt = with_two_nogoods()
    change(dynabt, team, apply_changes(team, [RemoveConstraint("RC", "RA", "C")]))
    assert list(dynabt.store) == [{"RB": (2,)}]
    assert value(dynabt) == (3,)


def test_remove_constraint_drops_what_was_derived_from_it_far_away() -> None:
    team = triangle()
    for gone, left in ((CBC, 0), ("RD<RC:C", 1)):
        dynabt = agent(team, "RA")
        replies(dynabt, ("RB", Nogood({}, (1,), [CAB, CBC, "RB=", "RC="])))
        holder, _, rest = gone.partition("<")
        change(dynabt, team, apply_changes(team, [RemoveConstraint(holder, rest.removesuffix(":C"), "C")]))
        assert len(list(dynabt.store)) == left


def test_a_no_solution_goes_with_a_constraint_that_it_rests_on_and_no_other() -> None:
    team, dynabt = refuted()
    assert after(dynabt, team, RemoveConstraint("RC", "RB", "C"), lossless=False) == []
    assert dynabt.verdict is Verdict.NO_SOLUTION
    team, dynabt = refuted()
    said = after(dynabt, team, RemoveConstraint("RB", "RA", "C"), lossless=False)
    assert (dynabt.verdict, dynabt.proof) == (None, frozenset())
    assert ("RB", Ok((1,))) in said


def test_two_constraints_of_one_name_go_together() -> None:
    team = team_of(dict.fromkeys("AB", (1, 2)), [differ("A", "B"), differ("B", "A")])
    dynabt = agent(team, "RB")
    replies(dynabt, ("RA", Ok((1,))))
    change(dynabt, team, apply_changes(team, [RemoveConstraint("RB", "RA", "C")]))
    assert list(dynabt.store) == []


def test_a_constraint_that_comes_in_the_place_of_its_namesake_is_another() -> None:
    team = team_of(dict.fromkeys("AB", (1, 2)), [differ("A", "B")])
    dynabt = agent(team, "RB")
    replies(dynabt, ("RA", Ok((1,))))
    other = AddConstraint("RB", "RA", Constraint("C", PREDEFINED["le"], ("B", "A"), ("B", "A")))
    change(dynabt, team, apply_changes(team, [RemoveConstraint("RB", "RA", "C"), other]))
    assert list(dynabt.store) == []


# addConstraint


def test_additions_keep_nogoods_and_a_no_solution() -> None:
    team, dynabt = with_two_nogoods()
    change(dynabt, team, apply_changes(team, [AddConstraint("RD", "RA", differ("A", "D", "N"))]))
    assert list(dynabt.store) == [{"RA": (1,)}, {"RB": (2,)}]
    unsolvable = triangle(1)
    top = agent(unsolvable, "RA")
    replies(top, ("RB", Nogood({}, (1,), [CAB, "RB="])))
    assert after(top, unsolvable, AddConstraint("RD", "RA", differ("A", "D", "N")), lossless=False) == []
    assert top.verdict is Verdict.NO_SOLUTION


def test_add_constraint_links_the_new_child_and_tells_the_value_there_only() -> None:
    team = triangle()
    dynabt = agent(team, "RA")
    assert after(dynabt, team, AddConstraint("RD", "RA", differ("A", "D", "N"))) == [("RD", Ok((1,)))]
    assert dynabt.lower == ["RB", "RC", "RD"]
    assert replies(dynabt, ("RB", Nogood({}, (1,), [])))[-1] == ("RD", Ok((2,)))


def test_a_link_is_made_while_there_is_no_solution() -> None:
    team, dynabt = refuted()
    after(dynabt, team, AddConstraint("RD", "RA", differ("A", "D", "N")), lossless=False)
    assert "RD" in dynabt.lower


def test_add_constraint_is_checked_against_what_the_lower_robot_knows() -> None:
    team, dynabt = with_two_nogoods()
    assert value(dynabt) == (3,)
    not_that = Constraint("N", Relation("N", 2, Semantics.CONFLICTS, ((2, 3),)), ("B", "C"), ("B", "C"))
    said = after(dynabt, team, AddConstraint("RC", "RB", not_that))
    assert said[0] == ("RB", Nogood({"RA": (1,)}, (2,), [CAC, CBC, "RC<RB:N", "RC="]))


# adjustNogood


def test_values_that_go_take_their_nogoods_along() -> None:
    team, dynabt = with_two_nogoods()
    change(dynabt, team, apply_changes(team, [RemoveValue("C", 1)]))
    assert dynabt.problem.values == ((2,), (3,))
    assert [dynabt.store[index] for index in (0, 1)] == [{"RB": (2,)}, None]
    assert dynabt.store.because(0) == {CBC}
    assert value(dynabt) == (3,)


def test_who_loses_its_value_takes_another_and_tells_it_or_says_why_it_has_none() -> None:
    team, dynabt = with_two_nogoods()
    said = after(dynabt, team, RemoveValue("C", 3), AddValue("C", 7))
    assert said == [("RD", Ok((7,)))]
    team, dynabt = with_two_nogoods()
    said = after(dynabt, team, RemoveValue("C", 3))
    assert said[0] == ("RB", Nogood({"RA": (1,)}, (2,), [CAC, CBC, "RC="]))


@looped(("values", "changed", "left"), [
    (2, AddValue("C", 3), []), (3, RemoveValue("C", 3), [{}]), (2, RemoveAgent("RC"), []),
])  # fmt: skip
def test_resolvents_are_void_once_a_domain_that_they_rest_on_grows_or_its_robot_leaves(
    values: int, changed: Change, left: list[object]
) -> None:
    team, dynabt = ruled_out(values)
    assert value(dynabt) == (2,)
    change(dynabt, team, apply_changes(team, [changed]))
    assert list(dynabt.store) == left


def test_a_domain_that_grew_leaves_direct_conflicts() -> None:
    team, dynabt = with_two_nogoods()
    change(dynabt, team, apply_changes(team, [AddValue("C", 0)]))
    assert dynabt.problem.values == ((0,), (1,), (2,), (3,))
    assert [dynabt.store[index] for index in range(4)] == [None, {"RA": (1,)}, {"RB": (2,)}, None]
    assert value(dynabt) == (3,)


def test_a_no_solution_goes_when_a_domain_that_it_rests_on_grows() -> None:
    team = triangle(1)
    for variable, stands in (("B", False), ("A", False), ("D", True)):
        dynabt = agent(team, "RA")
        replies(dynabt, ("RB", Nogood({}, (1,), [CAB, "RB="])))
        change(dynabt, team, apply_changes(team, [AddValue(variable, 3)]))
        assert (dynabt.verdict is Verdict.NO_SOLUTION) is stands


# Robots come and go


def test_a_robot_that_left_is_forgotten() -> None:
    team, dynabt = with_two_nogoods()
    change(dynabt, team, apply_changes(team, [RemoveAgent("RA")]))
    assert (dynabt.view, dynabt.higher, list(dynabt.store)) == ({"RB": (2,)}, {"RB"}, [{"RB": (2,)}])


def test_a_child_that_left_is_told_nothing_more() -> None:
    team = triangle()
    dynabt = agent(team, "RA")
    said = after(dynabt, team, RemoveAgent("RB"), RemoveValue("A", 1))
    assert said == [("RC", Ok((2,)))]


def test_a_robot_that_comes_is_told_the_value_of_its_parents() -> None:
    team = triangle()
    newcomer = Robot(
        "RE", (Variable("E", Domain("D", (range(1, 3),))),), parents=(Parent("RA", (differ("A", "E", "N"),)),)
    )
    assert after(agent(team, "RA"), team, AddAgent(newcomer)) == [("RE", Ok((1,)))]
    assert after(agent(team, "RB"), team, AddAgent(newcomer)) == []


def test_a_robot_of_an_old_name_is_a_stranger() -> None:
    team, dynabt = ruled_out()
    again = replace(team["RD"], parents=(Parent("RA", (differ("A", "D", "N"),)),))
    new = apply_changes(team, [RemoveAgent("RD"), AddAgent(again)])
    dynabt.change(
        LocalProblem(agent_problems(new)["RA"]), PriorityOrder(new.order), Invalidated(frozenset(), frozenset({"RD"}))
    )
    dynabt.resume(lossless=True)
    assert dynabt.outbox == [("RD", Ok((2,)))]


def test_a_robot_that_joined_under_an_old_name_is_informed_if_it_becomes_a_child_later() -> None:
    team = different("ABC", "AB AC", 2)
    dynabt = agent(team, "RA")
    again = replace(team["RB"], parents=(Parent("RC", (differ("C", "B", "M"),)),))
    new = apply_changes(team, [RemoveAgent("RB"), AddAgent(again)])
    dynabt.change(
        LocalProblem(agent_problems(new)["RA"]), PriorityOrder(new.order), Invalidated(frozenset(), frozenset({"RB"}))
    )
    dynabt.resume(lossless=True)
    said = list(dynabt.outbox)
    dynabt.outbox.clear()
    said += after(dynabt, new, AddConstraint("RB", "RA", differ("A", "B", "N")))
    assert said == [("RB", Ok((1,)))]


# The search goes on


def test_values_are_told_once_more_after_an_epoch_that_was_broken_off_and_not_after_a_quiet_one() -> None:
    for lossless, said in ((True, []), (False, [("RD", Ok((3,)))])):
        team, dynabt = with_two_nogoods()
        assert after(dynabt, team, AddValue("A", 9), lossless=lossless) == said


def test_after_an_epoch_that_was_broken_off_links_are_asked_for_again() -> None:
    team = team_of(dict.fromkeys("ABC", (1, 2)), [differ("A", "C"), differ("B", "C")])
    dynabt = agent(team, "RB")
    replies(dynabt, ("RC", Nogood({"RA": (1,)}, (1,), [CAC])))
    assert dynabt.higher == {"RA"}
    assert after(dynabt, team, AddValue("C", 9), lossless=True) == []
    assert after(dynabt, team, AddValue("C", 9), lossless=False) == [("RA", AddLink()), ("RC", Ok((2,)))]


def test_who_changes_twice_before_it_goes_on_tells_all_that_is_new() -> None:
    """A robot was lost before all had taken in the change before."""
    team = triangle()
    first = apply_changes(team, [AddConstraint("RD", "RA", differ("A", "D", "N"))])
    dynabt = agent(team, "RA")
    change(dynabt, team, first)
    assert after(dynabt, first, RemoveAgent("RB")) == [("RD", Ok((1,)))]
    assert after(dynabt, apply_changes(first, [RemoveAgent("RB")]), AddValue("C", 9)) == []


def test_links_that_were_added_stay() -> None:
    team = triangle()
    dynabt = agent(team, "RA")
    replies(dynabt, ("RD", AddLink()))
    said = after(dynabt, team, RemoveValue("A", 1))
    assert [receiver for receiver, _ in said] == ["RB", "RC", "RD"]


def test_who_takes_another_value_tells_it_once() -> None:
    team = triangle()
    dynabt = agent(team, "RA")
    said = after(dynabt, team, AddConstraint("RD", "RA", differ("A", "D", "N")), RemoveValue("A", 1), lossless=False)
    assert said == [("RB", Ok((2,))), ("RC", Ok((2,))), ("RD", Ok((2,)))]
