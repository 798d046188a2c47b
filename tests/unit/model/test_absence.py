"""What constraints mean when robots are absent: a table of examples."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from random import Random

from robochoc.formats.global_constraints import check_global, read_form
from robochoc.model.absence import can_be_restated, may_count_when_absent, restated
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Function,
    GlobalPredicate,
    Predicate,
    Relation,
    Semantics,
    WhenAbsent,
)
from robochoc.model.expression import Type, parse, text
from tests.support.cases import looped

NAMES = ("A", "B", "C", "D")


def predicate(body: str, *terms: str | int) -> Constraint:
    """A constraint whose formal parameters are called X, Y, Z, W."""
    formals = ("X", "Y", "Z", "W")[: len(terms)]
    return Constraint("rule", Predicate("P1", formals, parse(body, formals, Type.BOOLEAN)), terms, terms)


def body_of(constraint: Constraint | None) -> str | None:
    """The body, about the actual variables."""
    if constraint is None:
        return None
    assert isinstance(constraint.definition, Predicate)
    written = text(constraint.definition.body)
    for formal, term in zip(constraint.definition.parameters, constraint.parameters, strict=True):
        written = written.replace(formal, str(term))
    return written


COUNT = "le(add(if(eq(X,1),1,0),if(eq(Y,1),1,0),if(eq(Z,1),1,0)),2)"


@looped(
    ("body", "left"),
    [
        (COUNT, "le(add(if(eq(A,1),1,0),if(eq(C,1),1,0)),2)"),
        (f"not({COUNT})", "not(le(add(if(eq(A,1),1,0),if(eq(C,1),1,0)),2))"),
        ("ge(add(X,Y,Z),3)", "ge(add(A,C),3)"),
        ("le(3,add(X,add(Y,Z)))", "le(3,add(A,C))"),
        ("ge(add(mul(3,X),mul(Y,5),Z),10)", "ge(add(mul(3,A),C),10)"),
        ("eq(sub(add(neg(X),neg(Y),mul(-2,Z)),1),-4)", "eq(sub(add(neg(A),mul(-2,C)),1),-4)"),
        ("in(add(X,Y,Z),set(2,4))", "in(add(A,C),set(2,4))"),
        ("not(and(ne(X,Y),ne(X,Z),ne(Y,Z),ne(X,3),ne(Y,3),ne(Z,3)))", "not(and(ne(A,C),ne(A,3),ne(C,3)))"),
        ("and(ge(add(X,Y,Z),2),le(add(X,Y,Z),4))", "and(ge(add(A,C),2),le(add(A,C),4))"),
        ("not(or(eq(min(X,Y,Z),1),gt(min(X,Y,Z),3)))", "not(or(eq(min(A,C),1),gt(min(A,C),3)))"),
        ("le(max(add(X,4),Y,sub(Z,2)),5)", "le(max(add(A,4),sub(C,2)),5)"),
        ("le(add(abs(sub(X,2)),abs(Y),abs(add(Z,1))),3)", "le(add(abs(sub(A,2)),abs(add(C,1))),3)"),
        ("or(eq(X,1),eq(Y,1),eq(Z,1))", "or(eq(A,1),eq(C,1))"),
        ("not(and(eq(X,1),eq(Y,1),eq(Z,1)))", "not(and(eq(A,1),eq(C,1)))"),
        ("le(max(add(X,4),add(Y,2),add(Z,3)),9)", "le(max(add(A,4),add(C,3)),9)"),
        ("lt(add(max(X,Y,Z),1),9)", "lt(add(max(A,C),1),9)"),
        ("gt(min(X,Y,Z),2)", "gt(min(A,C),2)"),
        ("and(ne(X,Y),ne(X,Z),ne(Y,Z))", "ne(A,C)"),
        ("le(add(1,if(ne(Y,X),1,0),if(and(ne(Z,X),ne(Z,Y)),1,0)),2)", "le(add(1,if(ne(C,A),1,0)),2)"),
        ("lt(add(X,Y),Z)", None),
        ("lt(add(X,Y,neg(Z)),0)", None),
        ("le(add(X,Y,mul(-1,Z)),0)", None),
        ("or(eq(X,1),eq(Y,2),eq(Z,1))", None),
        ("or(eq(X,1),ne(Y,1),eq(Z,1))", None),
        ("xor(gt(X,1),gt(Y,1),gt(Z,1))", None),
        ("ne(mod(add(X,Y,Z),3),0)", None),
        ("ge(abs(sub(add(X,Y),Z)),2)", None),
        ("le(add(mul(X,Y),mul(Y,Z)),3)", None),
    ],
)
def test_remaining_constraints_without_b(body: str, left: str | None) -> None:
    whole = predicate(body, "A", "B", "C")
    found = restated(whole, {"B", "elsewhere"})
    assert body_of(found) == left
    if found is not None:
        assert (found.name, found.variables, found.model, found.cost) == ("rule", ("A", "C"), whole.model, whole.cost)
        assert restated(found, {"A", "B", "C"}) is None
        assert found.definition.name.startswith("P1_")


def test_two_robots() -> None:
    assert body_of(restated(predicate("le(add(X,Y),5)", "A", "B"), {"B"})) == "le(A,5)"
    for body in ("ne(X,Y)", "lt(add(X,1),Y)", "eq(X,Y)", "le(sub(X,Y),3)", "ge(dist(X,Y),2)"):
        assert restated(predicate(body, "A", "B"), {"B"}) is None


def test_actual_numbers_count_as_numbers() -> None:
    whole = predicate("le(add(X,Y),Z)", "A", "B", 4)
    assert body_of(restated(whole, {"A"})) == "le(B,4)"
    assert restated(predicate("le(add(X,Y),Z)", "A", "B", "C"), {"A"}) is None


def test_robots_that_are_not_absent_have_no_effect() -> None:
    whole = predicate(COUNT, "A", "B", "C")
    assert restated(whole, {"Z"}) is whole
    assert restated(whole, set()) is whole


def test_the_order_of_departures_does_not_matter() -> None:
    bodies = [
        "le(add(1,if(ne(Y,X),1,0),if(and(ne(Z,X),ne(Z,Y)),1,0),if(and(ne(W,X),ne(W,Y),ne(W,Z)),1,0)),2)",
        "le(add(if(or(eq(X,1),eq(Y,1),eq(Z,1),eq(W,1)),1,0),if(or(eq(X,2),eq(Y,2),eq(Z,2),eq(W,2)),1,0)),1)",
        "ge(add(X,Y,Z,W),3)",
        "or(eq(X,1),eq(Y,1),eq(Z,1),eq(W,1))",
    ]
    for body in bodies:
        whole = predicate(body, *NAMES)
        for gone in itertools.permutations(NAMES):
            one_by_one: Constraint | None = whole
            for many in range(1, len(NAMES) + 1):
                one_by_one = None if one_by_one is None else restated(one_by_one, {gone[many - 1]})
                assert restated(whole, gone[:many]) == one_by_one


@looped(
    ("reference", "form", "left"),
    [
        ("global:allDifferent", "[ X0 X1 X2 ]", "[ X0 X2 ]"),
        ("global:allDifferent", "[ X0 X1 ]", None),
        ("global:weightedSum", "[ {2 X0} {3 X1} {1 X2} ] <le/> 4", "[ {2 X0} {1 X2} ] <le/> 4"),
        ("global:weightedSum", "[ {2 X0} {-3 X1} {1 X2} ] <le/> 4", None),
        ("global:weightedSum", "[ {2 X0} {3 X1} ] <le/> X2", None),
        ("global:cumulative", "[ {X0 2 1} {X1 2 <nil/> 3} {X2 4 2} ] <le/> 3", "[ {X0 2 1} {X2 4 2} ] <le/> 3"),
        ("global:cumulative", "[ {X0 2 1} {X1 2 1} ] 1", "[ {X0 2 1} ] 1"),
        ("global:element", "X0 [ 5 X1 7 ] X2", None),
    ],
)
def test_global_constraints_keep_their_form(reference: str, form: str, left: str | None) -> None:
    made = read_form(reference, form)
    scope = NAMES[: len(made.parameters)]
    found = restated(Constraint("C", made, scope, scope), {"B"})
    if left is None:
        assert found is None
        return
    assert found is not None
    assert isinstance(found.definition, GlobalPredicate)
    assert found.definition.form == read_form(reference, left).form
    assert found.parameters == tuple(name for name in scope if name != "B")
    check_global(found.definition)


def test_the_author_may_choose_another_meaning() -> None:
    whole = predicate(COUNT, "A", "B", "C")
    assert restated(replace(whole, when_absent=WhenAbsent.DROP), {"B"}) is None
    assert restated(replace(whole, when_absent=WhenAbsent.RESTATE), {"B"}) is not None
    failing = restated(replace(whole, when_absent=WhenAbsent.FAIL), {"A"})
    assert failing is not None
    assert failing.name == "rule"
    assert failing.variables == ("B",)
    assert {failing.price({"B": value}) for value in range(3)} == {INFINITE}
    nobody = restated(replace(whole, when_absent=WhenAbsent.FAIL), {"A", "B", "C"})
    assert nobody is not None
    assert nobody.price({}) == INFINITE


def test_constraints_that_can_be_restated() -> None:
    assert can_be_restated(predicate(COUNT, "A", "B", "C"))
    assert can_be_restated(predicate("ne(X,Y)", "A", "B"))
    assert not can_be_restated(predicate("lt(X,Y)", "A", "B"))
    assert not may_count_when_absent(predicate("ne(X,Y)", "A", "B"))
    assert may_count_when_absent(replace(predicate("ne(X,Y)", "A", "B"), when_absent=WhenAbsent.FAIL))
    assert may_count_when_absent(predicate(COUNT, "A", "B", "C"))
    assert not can_be_restated(replace(predicate(COUNT, "A", "B", "C"), model=ConstraintModel.PKC))
    table = Relation("R", 2, Semantics.SUPPORTS, ((1, 2),))
    assert not can_be_restated(Constraint("C", table, ("A", "B"), ("A", "B")))


def test_costs_that_are_one_of_two_numbers() -> None:
    body = parse(f"mul(2,if({COUNT},0,5))", ("X", "Y", "Z"), Type.INTEGER)
    found = restated(Constraint("C", Function("F", ("X", "Y", "Z"), body), NAMES[:3], NAMES[:3]), {"B"})
    assert found is not None
    assert {found.price({"A": a, "C": c}) for a, c in itertools.product((1, 2), repeat=2)} == {0}
    total = parse("add(X,Y)", ("X", "Y"), Type.INTEGER)
    assert restated(Constraint("C", Function("F", ("X", "Y"), total), NAMES[:2], NAMES[:2]), {"B"}) is None


def test_random_aggregates_mean_what_their_terms_say() -> None:
    chance = Random("aggregates")
    sides: dict[str, Callable[[int, int], bool]] = {"le": int.__le__, "ge": int.__ge__, "eq": int.__eq__}
    totals: dict[str, Callable[[list[int]], int]] = {"add": sum, "min": min, "max": max}
    for _ in range(200):
        operator, side = chance.choice(list(totals)), chance.choice(list(sides))
        weights = [chance.randint(1, 3) for _ in NAMES]
        limit = chance.randint(0, 9)
        terms = ",".join(f"mul({weight},{formal})" for weight, formal in zip(weights, "XYZW", strict=True))
        whole = predicate(f"{side}({operator}({terms}),{limit})", *NAMES)
        gone = set(chance.sample(NAMES, chance.randint(1, 3)))
        found = restated(whole, gone)
        assert found is not None
        values = {name: chance.randint(0, 3) for name in NAMES}
        paid = [weight * values[name] for weight, name in zip(weights, NAMES, strict=True) if name not in gone]
        assert found.allows(values) is sides[side](totals[operator](paid), limit)
