"""What a change of the problem makes void: which keys, and whose values."""

from __future__ import annotations

from dataclasses import replace

from robochoc.formats import PREDEFINED
from robochoc.model.change import apply_changes
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Child,
    ConstraintModel,
    Domain,
    Parent,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Team,
    Variable,
)
from robochoc.model.team_edits import without_robots
from robochoc.solver.explanation import domain_key, invalidated_by
from tests.support.cases import looped
from tests.support.problems import team_of
from tests.support.small_teams import differ, named_constraint, newcomer, triangle


def told(old: Team, new: Team) -> tuple[set[str], set[str]]:
    keys, agents = invalidated_by(old, new)
    return set(keys), set(agents)


@looped(
    ("change", "keys", "agents"),
    [
        (RemoveConstraint("RC", "RB", "C"), {"RC<RB:C"}, set()),
        (AddConstraint("RC", "RB", named_constraint("N", "B", "C")), set(), set()),
        (AddConstraint("RC", "RB", differ("C", "B")), set(), set()),
        (AddConstraint("RD", "RA", named_constraint("N", "A", "D")), set(), set()),
        (RemoveValue("B", 1), set(), set()),
        (AddValue("B", 3), {"RB="}, set()),
        (AddAgent(newcomer(Parent("RA"))), set(), set()),
        (RemoveAgent("RB"), {"RB=", "RB<RA:C", "RC<RB:C"}, {"RB"}),
        (RemoveAgent("RD"), {"RD=", "RD<RC:C"}, {"RD"}),
    ],
)
def test_what_a_change_makes_void(change: Change, keys: set[str], agents: set[str]) -> None:
    assert told(triangle(), apply_changes(triangle(), [change])) == (keys, agents)


def test_what_comes_back_in_one_event_was_never_gone() -> None:
    back: list[Change] = [RemoveValue("B", 1), AddValue("B", 1), RemoveConstraint("RB", "RA", "C"), differ_again()]
    assert told(triangle(), apply_changes(triangle(), back)) == (set(), set())


def differ_again() -> AddConstraint:
    return AddConstraint("RB", "RA", differ("A", "B"))


def test_another_constraint_of_the_same_name_voids_what_the_first_explained() -> None:
    changes: list[Change] = [
        RemoveConstraint("RB", "RA", "C"),
        AddConstraint("RB", "RA", named_constraint("C", "A", "B")),
    ]
    assert told(triangle(), apply_changes(triangle(), changes)) == ({"RB<RA:C"}, set())


def test_an_n_ary_constraint_is_void_with_any_of_its_robots() -> None:
    team = team_of(dict.fromkeys("ABC", (1, 2)), [named_constraint("N", "A", "B", "C")])
    assert told(team, without_robots(team, ["RA"])) == ({"RA=", "RC<RB:N"}, {"RA", "RC"}), (
        "RC has nothing to show any more"
    )


def test_a_domain_grows_with_other_private_constraints_and_other_variables() -> None:
    bits = Domain("D", (range(2),))
    private = replace(named_constraint("P", "A1", "A2"), model=None)
    one = Robot("RA", (Variable("A1", bits), Variable("A2", bits)), private=(private,))
    free = replace(one, private=())
    other = replace(one, private=(replace(private, definition=PREDEFINED["le"]),))
    more = replace(free, variables=(*one.variables, Variable("A3", bits)))
    for old, new, grown in ((one, free, True), (free, one, False), (one, other, True), (free, more, True)):
        assert invalidated_by(Team("t", (old,)), Team("t", (new,))).keys == ({domain_key("RA")} if grown else set())


def test_who_shows_other_variables_means_something_else() -> None:
    bits = Domain("D", (range(1, 3),))
    above = Robot("RA", (Variable("A", bits), Variable("W", bits)), children=(Child("RB", ("A",)),))
    below = Robot("RB", (Variable("B", bits),), parents=(Parent("RA", (differ("A", "B"),)),))
    team = Team("pair", (above, below))
    more = apply_changes(team, [AddConstraint("RB", "RA", differ("W", "B"))])
    assert told(team, more) == (set(), {"RA"})
    alone = without_robots(team, ["RB"])
    assert invalidated_by(team, alone).agents == {"RA", "RB"}


def test_parts_of_partially_known_constraints_have_keys_of_their_own() -> None:
    part = replace(named_constraint("P", "A", "B"), model=ConstraintModel.PKC)
    above, below = triangle().robots[:2]
    held = replace(above, children=(Child("RB", ("A",), (part,)),))
    empty = replace(above, children=(Child("RB", ("A",)),))
    below = replace(below, children=())
    assert invalidated_by(Team("t", (held, below)), Team("t", (empty, below))).keys == {"RA>RB:P"}
