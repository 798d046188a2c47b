"""Constraints on the wire: they come as they were sent, and what cannot be is refused without much ado."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.network.constraint_records import (
    MOST_TERMS,
    PredicateRecord,
    RelationRecord,
    SharedConstraintError,
    SharedRecord,
    known_of,
    record_of,
)
from robochoc.formats import PREDEFINED
from robochoc.generators.queens3d import queens3d
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Semantics, Team
from robochoc.solver.explanation import KeyedConstraint, constraints_above, parts_below
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.examples import examples
from tests.support.growth import operations
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team

MAKERS: list[Callable[[Random], Team]] = [
    random_team,
    random_complex_team,
    random_cost_team,
    random_complex_cost_team,
    random_pkc_team,
]
NE = PredicateRecord("ne", ("X", "Y"), "ne(X, Y)")
TABLE = RelationRecord("t", 2, Semantics.SOFT, ((1, 2), (2, 1)), (3, INFINITE), 0)


def shared(definition: PredicateRecord | RelationRecord = NE, **news: object) -> SharedRecord:
    record = SharedRecord("R2<R1:C", "C", definition, ("A", "B"), ("A", "B"), ConstraintModel.TKC, INFINITE)
    return msgspec.structs.replace(record, **news)


def sent(known: KeyedConstraint) -> KeyedConstraint:
    return known_of(msgspec.msgpack.decode(msgspec.msgpack.encode(record_of(known)), type=SharedRecord))


@given(make=st.sampled_from(MAKERS), seed=st.integers(0, 2**32))
@examples(80)
def test_constraints_come_as_they_were_sent(make: Callable[[Random], Team], seed: int) -> None:
    for robot in make(Random(seed)).robots:
        for known in chain(constraints_above(robot), (part for _, part in parts_below(robot))):
            assert sent(known) == known
            assert repr(sent(known)) == repr(known)  # an integer stays one


@looped("model", ["planar", "full"])
def test_queens_come_as_they_were_sent(model: str) -> None:
    for robot in queens3d(3, model).robots:
        for known in constraints_above(robot):
            assert sent(known) == known


@looped("name", sorted(PREDEFINED))
def test_what_is_built_in_comes_as_it_was_sent(name: str) -> None:
    definition = PREDEFINED[name]
    scope = tuple(f"V{place}" for place in range(len(definition.parameters)))
    known = KeyedConstraint("R2<R1:C", Constraint("C", definition, scope, scope))
    assert sent(known) == known


def test_good_records_are_taken() -> None:
    assert known_of(shared()).constraint.allows({"A": 1, "B": 2})
    assert known_of(predicate(parameters=("_X", "Y"), body="lt(_X, Y)")).constraint.allows({"A": 1, "B": 2})
    assert known_of(shared(TABLE)).constraint.price({"A": 1, "B": 2}) == 3
    assert known_of(shared(parameters=("A", "A"))).constraint.variables == ("A", "B")
    assert known_of(shared(scope=("A", "B", 3), parameters=("A", 3))).constraint.allows({"A": 1})


def table(**news: object) -> SharedRecord:
    return shared(msgspec.structs.replace(TABLE, **news))


def predicate(**news: object) -> SharedRecord:
    return shared(msgspec.structs.replace(NE, **news))


NAN = float("nan")
MANY = tuple(f"V{place}" for place in range(MOST_TERMS + 1))


def hostile() -> list[tuple[str, SharedRecord]]:
    return [
        ("no terms", shared(scope=(), parameters=())),
        ("no variable", shared(scope=(1, 2), parameters=(1, 2))),
        ("no name", shared(scope=("A", "B C"), parameters=("A", "B C"))),
        ("empty name", shared(scope=("A", ""), parameters=("A", ""))),
        ("unknown argument", shared(parameters=("A", "C"))),
        ("unknown constant", shared(parameters=("A", 1))),
        ("too few arguments", shared(parameters=("A",))),
        ("too many arguments", shared(parameters=("A", "B", "A"))),
        ("huge scope", shared(scope=MANY)),
        ("many arguments", shared(scope=("A", "B"), parameters=("A",) * (MOST_TERMS + 1))),
        ("NaN", shared(cost=NAN)),
        ("negative", shared(cost=-1)),
        ("minus infinite", shared(cost=-INFINITE)),
        ("short tuple", table(tuples=((1, 2), (1,)))),
        ("long tuple", table(tuples=((1, 2), (1, 2, 3)))),
        ("lying arity", table(arity=3)),
        ("negative arity", table(arity=-1, tuples=(), costs=())),
        ("too few costs", table(costs=(1,))),
        ("too many costs", table(costs=(1, 2, 3))),
        ("costs of supports", table(semantics=Semantics.SUPPORTS)),
        ("a tuple twice", table(tuples=((1, 2), (1, 2)))),
        ("NaN in a table", table(costs=(NAN, 1))),
        ("negative in a table", table(costs=(1, -1))),
        ("NaN by default", table(default_cost=NAN)),
        ("negative by default", table(default_cost=-0.5)),
        ("an integer", predicate(body="add(X, Y)")),
        ("no expression", predicate(body="ne(X,")),
        ("empty", predicate(body="")),
        ("code", predicate(body="__import__('os').system('true')")),
        ("unknown function", predicate(body="exec(X)")),
        ("unknown name", predicate(body="ne(X, Z)")),
        ("deep", predicate(body="not(" * 5000 + "ne(X, Y)" + ")" * 5000)),
        ("deep parentheses", predicate(body="(" * 30_000 + "ne(X, Y)" + ")" * 30_000)),
        ("long", predicate(body="and(" + "ne(X, Y), " * 100_000 + "ne(X, Y))")),
        ("large number", predicate(body=f"ne(X, {'9' * 1000})")),
        ("a parameter twice", predicate(parameters=("X", "X"))),
        ("many parameters", predicate(parameters=tuple(f"X{n}" for n in range(300_000)), body="ne(X1, X2)")),
        ("long names", predicate(name="N" * 1_000_000, body="")),
    ]


AT_ONCE = 10_000_000
"""Operations of Python: about a second."""


@looped(("name", "record"), hostile)
def test_hostile_records_are_refused_at_once(name: str, record: SharedRecord) -> None:
    del name
    faults: list[str] = []

    def refuse() -> None:
        with pytest.raises(SharedConstraintError) as caught:
            known_of(record)
        faults.append(str(caught.value))

    assert operations(refuse) < AT_ONCE
    assert len(faults[0]) < 500


@given(body=st.text(max_size=40) | st.text("andeqXY(),01 ", max_size=40))
def test_any_body_is_an_expression_or_refused(body: str) -> None:
    try:
        known = known_of(predicate(body=body))
    except SharedConstraintError:
        return
    known.constraint.allows({"A": 1, "B": 2})
    assert sent(known) == known
