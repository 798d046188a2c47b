"""DynABT when complex robots show other variables than before (`Void.agents`): one test per rule."""

from __future__ import annotations

from robochoc.model.change import apply_changes
from robochoc.model.problem import AddAgent, AddConstraint, Child, Domain, Parent, RemoveAgent, Robot, Team, Variable
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.protocols.satisfaction.dynabt import Nogood
from robochoc.solver.explanation import invalidated_by
from tests.support.agents import replies, value
from tests.support.dynabt_robots import after, agent
from tests.support.small_teams import differ


def pair(*variables: str) -> Team:
    """RA with A1 and A2, of which RB sees `variables`. RB differs from A1."""
    bits = Domain("D", (range(1, 3),))
    above = Robot("RA", (Variable("A1", bits), Variable("A2", bits)), children=(Child("RB", variables),))
    below = Robot("RB", (Variable("B", bits),), parents=(Parent("RA", (differ("A1", "B", "C"),)),))
    return Team("pair", (above, below))


A2B = AddConstraint("RB", "RA", differ("A2", "B", "N"))


def test_who_shows_other_variables_begins_anew_with_what_it_shows() -> None:
    team = pair("A1")
    dynabt = agent(team, "RA")
    replies(dynabt, ("RB", Nogood({}, (1,), ["RB<RA:C", "RB="])))
    assert value(dynabt) == (2,)
    said = after(dynabt, team, A2B)
    assert said == [("RB", Ok((1, 1)))]
    assert list(dynabt.store) == []


def test_the_values_of_one_who_shows_other_variables_mean_nothing_any_more() -> None:
    team = pair("A1")
    dynabt = agent(team, "RB")
    replies(dynabt, ("RA", Ok((1,))))
    assert invalidated_by(team, apply_changes(team, [A2B])).agents == {"RA"}
    assert after(dynabt, team, A2B) == []
    assert (dynabt.view, list(dynabt.store), value(dynabt)) == ({}, [], (2,))
    said = replies(dynabt, ("RA", Ok((2, 1))))
    assert said == [("RA", Nogood({}, (2, 1), ["RB<RA:C", "RB<RA:N", "RB="]))]


def test_a_child_that_shows_other_variables_is_told_the_value_again() -> None:
    bits = Domain("D", (range(1, 3),))
    parents = (Parent("RB", (differ("B", "C1", "C"),)),)
    child = Robot("RC", (Variable("C1", bits), Variable("C2", bits)), parents=parents)
    above = Robot("RB", (Variable("B", bits),), children=(Child("RC", ("B",)),))
    team = Team("two", (above, child))
    change_ = AddConstraint("RC", "RB", differ("B", "C2", "N"))
    assert invalidated_by(team, apply_changes(team, [change_])).agents == {"RC"}
    assert after(agent(team, "RB"), team, change_) == [("RC", Ok((1,)))]


def test_values_that_look_alike_but_are_of_other_variables_are_others() -> None:
    team = pair("A1")
    bits = Domain("D", (range(1, 3),))
    other = Robot("RC", (Variable("C", bits),), parents=(Parent("RA", (differ("A2", "C", "N"),)),))
    dynabt = agent(team, "RA")
    replies(dynabt, ("RB", Nogood({}, (1,), [])))
    assert (dynabt.problem.values, value(dynabt)) == (((1,), (2,)), (2,))
    assert after(dynabt, team, RemoveAgent("RB"), AddAgent(other)) == [("RC", Ok((1,)))]
    assert (dynabt.problem.values, list(dynabt.store)) == (((1,), (2,)), [])
