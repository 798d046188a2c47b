"""What every protocol has of its base class, and what its traits let through."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import pytest

from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Parent,
    Relation,
    Robot,
    Semantics,
    Variable,
)
from robochoc.protocols.requirements import unmet_requirement
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink
from robochoc.protocols.traits import ENDS_WITH_EITHER, ENDS_WITH_PROOF, UNDECLARED, Traits
from tests.support.agents import robot_of
from tests.support.cases import looped
from tests.support.small_teams import different

NOT_BOTH = Relation("N", 2, Semantics.CONFLICTS, ((0, 0),))
NOT_ALL = Relation("T", 3, Semantics.CONFLICTS, ((0, 0, 0),))
BITS = Domain("D", (range(2),))
OWNERS = {"A": "RA", "B": "RB", "B2": "RB", "C": "RC"}


agent = partial(robot_of, ABT, different("AB", "AB", 2))


def test_a_robot_alone_ends_the_search_with_what_its_protocol_declares_only() -> None:
    robot = agent("RA")
    for verdict in (Verdict.SOLUTION, Verdict.OPTIMAL, Verdict.UNKNOWN):
        with pytest.raises(ValueError, match=rf"it has concluded {verdict}, .* may conclude only no-solution"):
            robot.conclude(verdict)
        assert robot.verdict is None
    robot.conclude(Verdict.NO_SOLUTION)
    assert robot.verdict is Verdict.NO_SOLUTION


@looped(("concludes", "verdict", "fault"), [
    (ENDS_WITH_EITHER, "solution", ""), (ENDS_WITH_PROOF, "no-solution", ""),
    (UNDECLARED, "unknown", ""),
    (ENDS_WITH_EITHER, "unknown", "it has concluded unknown, but a robot of this protocol may conclude only solution"),
    (UNDECLARED, "optimal", "it has concluded optimal, but"),
    (UNDECLARED, "nonsense", "it has concluded an invalid verdict, but"),
    ((), "solution", "it has concluded solution, but a robot of this protocol may conclude only nothing"),
])  # fmt: skip
def test_verdicts_that_are_not_declared_are_faults(concludes: tuple[Verdict, ...], verdict: str, fault: str) -> None:
    told = Traits(concludes=concludes).conclusion_error(verdict)
    assert told.startswith(fault)
    assert bool(told) is bool(fault)


def test_a_protocol_that_declares_nothing_may_write_to_all_and_gets_nothing_special() -> None:
    assert Traits() == Traits(
        complete=True,
        synchronous=False,
        costs=False,
        n_ary=True,
        partially_known=False,
        shared_scopes=False,
        writes_to_non_neighbours=True,
        tree=False,
        dynamic=False,
        concludes=tuple(verdict for verdict in Verdict if verdict is not Verdict.OPTIMAL),
        tables=False,
    )


def test_a_message_carries_the_checks_that_were_done_when_it_was_sent() -> None:
    robot = agent("RB")
    robot.send("RA", AddLink())
    robot.problem.checks += 3
    robot.send("RA", AddLink())
    assert robot.outbox == [("RA", AddLink()), ("RA", AddLink())]
    assert robot.checks_at_send == [0, 3]


def test_a_robot_without_a_value_has_no_assignment_and_nothing_to_tell() -> None:
    robot = agent("RB")
    assert robot.assignment == {}
    robot.value = 1
    assert robot.assignment == {"B": 2}
    assert (robot.incumbent, robot.checked_against, tuple(robot.kept_nogoods)) == (None, None, ())
    assert (robot.tried(0), robot.value_notes(0)) == (False, {})


def holder(relation: Relation, scope: Sequence[str]) -> Robot:
    """A robot that holds a constraint with a robot above it."""
    constraint = Constraint("C", relation, tuple(scope), tuple(scope))
    return Robot("RA", (Variable("A", BITS),), parents=(Parent("RB", constraints=(constraint,)),))


@looped(("relation", "scope", "traits", "unmet"), [
    (NOT_ALL, ("A", "B", "C"), Traits(n_ary=False), "RA holds a constraint over more than two robots (C)"),
    (NOT_ALL, ("A", "B", "B2"), Traits(n_ary=False), ""), (NOT_ALL, ("A", "B", "C"), Traits(), ""),
    (NOT_BOTH, ("A", "B"), Traits(n_ary=False), ""),
])  # fmt: skip
def test_constraints_over_more_than_two_robots(
    relation: Relation, scope: tuple[str, ...], traits: Traits, unmet: str
) -> None:
    assert unmet_requirement(holder(relation, scope), traits, OWNERS) == unmet


def test_partially_known_constraints_are_for_those_who_take_them() -> None:
    part = Constraint("C", NOT_BOTH, ("A", "B"), ("A", "B"), ConstraintModel.PKC)
    robot = Robot("RA", (Variable("A", BITS),), children=(Child("RB", constraints=(part,)),))
    assert unmet_requirement(robot, Traits(partially_known=True), OWNERS) == ""
    assert unmet_requirement(robot, Traits(), OWNERS) == "RA shares a partially known constraint (PKC, C)"
