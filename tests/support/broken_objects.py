"""Broken teams as Python objects: those cases of `broken.py` that data can express, and what only data can get wrong.

Every case starts from the team of `broken_case.TEAM`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

from robochoc.formats import PREDEFINED
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Child,
    ConstraintModel,
    Domain,
    Parent,
    ProblemKind,
    Relation,
    RemoveAgent,
    RemoveValue,
    Semantics,
    Topic,
    Variable,
)
from tests.support.breakages import (
    NEWCOMER,
    VALUES,
    Breakage,
    bound,
    child,
    constraint,
    domain,
    doubled,
    moved,
    nested,
    no_child,
    over,
    parents,
    predicate,
    relation,
    ring,
    robot,
    scenario,
    shared_variable,
    topic,
    turned_link,
    unseen_variable,
    weighted,
    with_robot,
)

AS_IN_FILES: dict[str, Breakage] = {
    "a domain of 10^9 values": domain(range(1, 10**9 + 1)),
    "a domain of 10^18 values": domain(range(1 - 10**18, 10**18)),
    "a reversed range": domain(range(4, 2)),
    "overlapping ranges": domain(range(1, 5), range(3, 7)),
    "an empty domain": domain(),
    "no variable": robot("Robot1", variables=()),
    "two variables of one name": robot("Robot2", variables=(Variable("V2", Domain("D1", (range(1, 5),))),) * 2),
    "a tuple too short": relation((1, 1), (2,), (3, 3)),
    "a tuple twice": relation((1, 1), (1, 1), (3, 3)),
    "a DisCSP cannot have a soft relation": relation((1, 1), semantics=Semantics.SOFT, costs=(5,)),
    "a defaultCost without soft": relation((1, 1), default_cost=1),
    "a predefined name": predicate(Apply("lt", (Name("X"), Name("Y"))), name="neq"),
    "two parameters of one name": predicate(Apply("ne", (Name("X"), Name("X"))), "X", "X", "i", "j"),
    "an unknown operator": predicate(Apply("nee", (Name("X"), Name("Y")))),
    "an unknown parameter": predicate(Apply("ne", (Name("X"), Name("Z")))),
    "a predicate that is a number": predicate(Apply("add", (Name("X"), Name("Y")))),
    "deep expressions": predicate(nested(9000)),
    "a topic over another's variable": topic(Name("V1")),
    "a topic of a Boolean": topic(Apply("eq", (Name("V3"), Constant(1)))),
    "no variables in a scope": over("C4", 1, 3),
    "too few terms": over("C5", "V2", "V3"),
    "a relation of another arity": over("C2", "V1", "V2", 3),
    "a parameter outside the scope": constraint("C1", scope=("V2", 1, 2)),
    "a scope that is not passed": constraint("C1", parameters=("V1", "V2", 1, 3)),
    "parameters of a relation": constraint(
        "C1", definition=Relation("r1", 2, Semantics.CONFLICTS, ((1, 1),)), parameters=("V1", "V2")
    ),
    "a private constraint with a part": constraint("C0", model=ConstraintModel.PKC),
    "another's variable in private": over("C0", "V1", "V2"),
    "own variables only with a parent": over("C4", "V3", 3),
    "others' variables only": over("C4", "V1", "W1"),
    "a DisCSP cannot have costs": constraint("C4", cost=3),
    "a relation cannot have a cost": weighted(constraint("C2", cost=3)),
    "a child that is not listed back": no_child("Robot3", "Robot2"),
    "each the other's parent": turned_link,
    "itself as neighbour": robot("Robot3", children=(Child("Robot3"),)),
    "a neighbour twice": robot("Robot3", children=(Child("Robot1"),)),
    "a cycle of parents": ring,
    "a DisWCSP among DisCSPs": robot("Robot2", kind=ProblemKind.DISWCSP),
    "two owners of one variable": shared_variable,
    "a variable that its owner does not have": over("C4", "V9", "V3"),
    "a constraint under the wrong parent": moved("C4", "Robot3", "Robot2"),
    "n-ary under the higher parent": moved("C5", "Robot3", "Robot1"),
    "n-ary in a higher file": over("C3", "V3", "V2", holder="Robot2"),
    "a PKC of three robots": constraint("C5", model=ConstraintModel.PKC),
    "a part over a third robot": over("C3", "V1", "V3", holder="Robot1"),
    "a part over what its owner shows to nobody": unseen_variable,
    "a child told what is not one's own": child("Robot3", "Robot2", variables=("V1",)),
    "a child told twice": child("Robot3", "Robot2", variables=("V2", "V2")),
    "a child told too little": child("Robot3", "Robot1", variables=("V1",)),
}
"""By the names of the cases in `broken.py`: the same mistakes, with the same messages."""


@dataclass(frozen=True)
class Wrong:
    """What is done to the team, and for each mistake where it is and what is said of it."""

    breakage: Breakage
    expected: tuple[tuple[str, str], ...]


def wrong(breakage: Breakage, *expected: tuple[str, str]) -> Wrong:
    return Wrong(breakage, expected)


OF_OBJECTS: dict[str, Wrong] = {
    "no robots": wrong(lambda team: replace(team, robots=()), ("team", "no robots")),
    "robots in a list": wrong(lambda team: replace(team, robots=cast("Any", list(team.robots))),
        ("team", "robots: a list instead of a tuple")),
    "a robot that is none": wrong(lambda team: replace(team, robots=(*team.robots, cast("Any", "Robot4"))),
        ("robot ?", "'Robot4' instead of a Robot")),
    "a name of the team without UTF-8": wrong(lambda team: replace(team, name="\udcff"),
        ("team", "its name cannot be encoded")),
    "two robots of one name": wrong(lambda team: replace(team, robots=(*team.robots, team["Robot3"])),
        ("robot Robot3", "a second robot 'Robot3'")),
    "a missing robot": wrong(lambda team: replace(team, robots=team.robots[:2]),
        ("robot Robot1, child Robot3", "the child 'Robot3' is not in the team"),
        ("robot Robot2, child Robot3", "the child 'Robot3' is not in the team")),
    "parents that are left out": wrong(parents("Robot3"),
        ("robot Robot1, child Robot3", "'Robot3' does not list 'Robot1' as its parent"),
        ("robot Robot2, child Robot3", "'Robot3' does not list 'Robot2' as its parent")),
    "a child before its parent": wrong(lambda team: replace(team, robots=team.robots[::-1]),
        ("robot Robot2", "the robot precedes its parent 'Robot1' in the team"),
        ("robot Robot3", "the robot precedes its parent 'Robot1' in the team")),
    "a robot's name with a blank": wrong(
        lambda team: replace(team, robots=(*team.robots, replace(NEWCOMER, name="The last"))),
        ("robot The last", "'The last' cannot be a robot's name"),
    ),
    "a robot called as the scenario's file": wrong(
        lambda team: replace(team, robots=(*team.robots, replace(NEWCOMER, name="scenario"))),
        ("robot scenario", "cannot be a robot's name"),
    ),
    "a robot's name longer than a file's": wrong(
        lambda team: replace(team, robots=(*team.robots, replace(NEWCOMER, name="R" * 252))),
        ("robot RRR", "cannot be a robot's name"),
    ),
    "a variable's name with a blank": wrong(
        lambda team: replace(team, robots=(*team.robots, replace(NEWCOMER, variables=(Variable("V L", VALUES),)))),
        ("robot Late, variable V L", "the name 'V L' is not allowed"),
    ),
    "a domain's name with a blank": wrong(
        robot("Robot2", variables=(Variable("V2", Domain("of values", (range(1, 5),))),)),
        ("robot Robot2, domain of values", "the name 'of values' is not allowed"),
    ),
    "a constraint without a name": wrong(constraint("C4", name=""), ("constraint", "the name '' is not allowed")),
    "a topic's name that no XML holds": wrong(robot("Robot3", topics=(Topic("/a\0b"),)),
        ("robot Robot3, topic", "is not allowed")),
    "two topics of one name": wrong(robot("Robot3", topics=(Topic("/a"), Topic("/a"))),
        ("robot Robot3, topic /a", "a second topic '/a'")),
    "a term that is no name": wrong(over("C4", "V1,V3"),
        ("robot Robot3, constraint C4 (V1,V3)", "'V1,V3' is neither a variable's name")),
    "a constant of 19 digits": wrong(over("C1", "V1", "V2", 1, 10**18),
        ("robot Robot2, constraint C1", "an integer has 19 digits")),
    "a constant of 5000 digits": wrong(
        constraint("C5", definition=PREDEFINED["ne"], scope=("V3", "V2", 10**5000), parameters=("V3", "V2")),
        ("robot Robot3, constraint C5", "an integer has 5001 digits"),
    ),
    "a weight of 0": wrong(robot("Robot1", weight=0), ("robot Robot1", 'weight="0" in <presentation> is not allowed')),
    "a weight of 5000 digits": wrong(robot("Robot1", weight=10**5000), ("robot Robot1", "(5001 digits)")),
    "a value of 19 digits": wrong(domain(range(10**18, 10**18 + 1)),
        ("robot Robot2, domain D1", "an integer has 19 digits")),
    "every second value": wrong(domain(range(1, 9, 2)), ("robot Robot2, domain D1", "range(1, 9, 2) has a step")),
    "ranges that descend": wrong(domain(range(5, 9), range(1, 3)),
        ("robot Robot2, domain D1", "ranges of domain D1 are not in order")),
    "a tuple's value of 19 digits": wrong(relation((1, -(10**18))),
        ("robot Robot2, relation r1", "an integer has 19 digits")),
    "more tuples than costs": wrong(weighted(relation((1, 1), (2, 2), semantics=Semantics.SOFT, costs=(5,))),
        ("robot Robot2, relation r1", "2 tuples, but 1 costs")),
    "costs without soft": wrong(relation((1, 1), costs=(5,)),
        ("robot Robot2, relation r1", "a conflicts relation cannot have costs")),
    "a cost of half": wrong(weighted(relation((1, 1), semantics=Semantics.SOFT, costs=(0.5,))),
        ("robot Robot2, relation r1", "the cost 0.5 is not an integer")),
    "a default cost that is no number": wrong(
        weighted(relation((1, 1), semantics=Semantics.SOFT, costs=(1,), default_cost=float("nan"))),
        ("robot Robot2, relation r1", "the cost nan is not an integer"),
    ),
    "a default cost below 0": wrong(
        weighted(relation((1, 1), semantics=Semantics.SOFT, costs=(1,), default_cost=float("-inf"))),
        ("robot Robot2, relation r1", "the cost -inf is not an integer"),
    ),
    "a cost of 19 digits": wrong(weighted(constraint("C4", cost=-(10**18))),
        ("robot Robot3, constraint C4 (V1 V3)", "an integer has 19 digits")),
    "a shared constraint without model": wrong(constraint("C4", model=None),
        ("robot Robot3, constraint C4 (V1 V3)", "lacks its model")),
    "a relation of no arity": wrong(constraint("C2", definition=Relation("r1", 0, Semantics.CONFLICTS, ())),
        ("robot Robot2, relation r1", "a relation cannot have the arity 0")),
    "an expression of exponential size": wrong(predicate(doubled(60)),
        ("robot Robot2, predicate p1", "the expression is too long")),
    "an alias for an operator": wrong(predicate(Apply("neq", (Name("X"), Name("Y")))),
        ("robot Robot2, predicate p1", "is parsed as another")),
    "a name that is a call": wrong(predicate(Apply("ne", (Name("abs(X)"), Name("Y")))),
        ("robot Robot2, predicate p1", "is parsed as another")),
    "a Boolean constant": wrong(predicate(Apply("ne", (Constant(True), Name("Y")))),
        ("robot Robot2, predicate p1", "expected a term, found a Constant")),
    "an operator of too few": wrong(predicate(Apply("ne", (Name("X"),))),
        ("robot Robot2, predicate p1", "'ne' takes 2 arguments, not 1")),
    "a totally known constraint twice": wrong(constraint("C3", "Robot1", model=ConstraintModel.TKC),
        ("robot Robot1, constraint C3 (V1 V2)", "totally known constraint (TKC) with the child 'Robot2'")),
    "another's variable shown": wrong(robot("Robot2", shown=("V1",)), ("robot Robot2", "`shown` contains 'V1'")),
    "a list of variables": wrong(
        lambda team: with_robot(team, replace(team["Robot2"], variables=cast("Any", [*team["Robot2"].variables]))),
        ("robot Robot2", "variables: a list instead of a tuple"),
    ),
    "a kind that is a word": wrong(robot("Robot2", kind="DisCSP"),
        ("robot Robot2", "kind: 'DisCSP' instead of one of ProblemKind")),
    "a value that is True": wrong(relation((1, cast("Any", True))),
        ("robot Robot2", "definition.tuples[0][1]: a bool instead of an integer")),
    "a scope that is a word": wrong(constraint("C4", scope="V1 V3"),
        ("robot Robot3", "constraints[0].scope: 'V1 V3' instead of a tuple")),
    "a definition that is a function": wrong(constraint("C4", definition=print),
        ("robot Robot3", "instead of Relation or Predicate or Function")),
    "a copy of what the robot is not in": wrong(child("Robot3", "Robot1", copies=(bound("V2", "V3"),)),
        ("robot Robot1, constraint C (V2 V3)", "the scope 'V2 V3' has no variable of this robot")),
    "a copy that its definition does not fit": wrong(child("Robot3", "Robot1", copies=(bound("V1", "V3", 3),)),
        ("robot Robot1, constraint C (V1 V3 3)", "ne requires 2 terms")),
    "a copy of another's part": wrong(
        child("Robot3", "Robot1", copies=(bound("V1", "V3", model=ConstraintModel.PKC),)),
        ("robot Robot1, constraint C (V1 V3)", "a copy of a partially known constraint (PKC)"),
    ),
    "a scenario's unknown robot": wrong(scenario(RemoveAgent("Robot9")), ("event 1", "there is no robot 'Robot9'")),
    "a scenario's value of 19 digits": wrong(scenario(AddValue("V1", 10**18)), ("event 1", "an integer has 19 digits")),
    "a scenario's time before the beginning": wrong(scenario(RemoveValue("V1", 1), after=-1),
        ("event 1", "after -1 messages")),
    "a scenario after which nobody is left": wrong(scenario(*(RemoveAgent(f"Robot{number}") for number in (1, 2, 3))),
        ("event 1", "all robots have left")),
    "a scenario's robot without variables": wrong(scenario(AddAgent(replace(NEWCOMER, variables=()))),
        ("robot Late", "the robot has no variables")),
    "a scenario's partially known constraint": wrong(
        scenario(AddConstraint("Robot2", "Robot1", bound("V1", "V2", model=ConstraintModel.PKC))),
        ("event 1", "a partially known constraint (PKC) in a scenario"),
    ),
    "a scenario's robot with a part": wrong(
        scenario(
            AddAgent(
                replace(
                    NEWCOMER,
                    parents=(Parent("Robot1", (bound("V1", "VL", model=ConstraintModel.PKC),)),),
                )
            )
        ),
        ("event 1", "(PKC) of a robot that a scenario adds"),
    ),
    "a scenario's constraint of too many": wrong(scenario(AddConstraint("Robot2", "Robot1", bound("V1", "V2", 3))),
        ("robot Robot2, constraint C (V1 V2 3)", "ne requires 2 terms")),
}  # fmt: skip
"""What files cannot say, or say in other words."""
