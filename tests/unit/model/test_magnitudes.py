"""Numbers that are too large: every team is exact, or is refused with the expression and the bound that it reaches."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import InvalidInputError, check_event, check_team, read_team, write_team
from robochoc.model.assembly import assemble
from robochoc.model.change import apply_changes
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import (
    OPERATORS,
    Apply,
    Constant,
    ExcessiveValueError,
    Expression,
    Name,
    UndefinedValueError,
    compile_expression,
    evaluate,
    parse,
)
from robochoc.model.expression.bounds import Interval, excess
from robochoc.model.expression.tree import Type
from robochoc.model.magnitudes import MagnitudeError, Magnitudes
from robochoc.model.problem import (
    AddConstraint,
    AddValue,
    Constraint,
    Domain,
    Function,
    Predicate,
    ProblemKind,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.model.team_edits import ChangeError
from tests.support.examples import count

INTEGERS = [name for name, operator in OPERATORS.items() if operator.gives is Type.INTEGER and name != "if"]


def drawn(chance: Random, depth: int) -> Expression:
    """Return a random integer expression over X and Y."""
    if depth == 0 or chance.random() < 0.2:
        leaves: list[Expression] = [Name("X"), Name("Y"), Constant(chance.choice((-3, 0, 2, 10**6, 10**17)))]
        return chance.choice(leaves)
    if chance.random() < 0.2:
        test = Apply("lt", (drawn(chance, depth - 1), drawn(chance, depth - 1)))
        return Apply("if", (test, drawn(chance, depth - 1), drawn(chance, depth - 1)))
    name = chance.choice(INTEGERS)
    many = 3 if OPERATORS[name].variadic and chance.random() < 0.4 else len(OPERATORS[name].takes)
    return Apply(name, tuple(drawn(chance, depth - 1) for _ in range(many)))


def exceeds(body: Expression, values: dict[str, int]) -> bool:
    """Return whether a result of the expression is too large, by both evaluators."""
    found = []
    compiled = compile_expression(body, ("X", "Y"))
    evaluators: list[Callable[[], int]] = [lambda: evaluate(body, values), lambda: compiled([*values.values()])]
    for compute in evaluators:
        try:
            compute()
            found.append(False)
        except ExcessiveValueError:
            found.append(True)
        except UndefinedValueError:
            found.append(False)
    assert found[0] == found[1] or "pow" in str(body) or "div" in str(body)  # which of two mistakes comes first
    return any(found)


@count("number", fast=300, slow=20_000)
def test_an_excess_is_found_where_there_is_one(number: int) -> None:
    seen = {True: 0, False: 0}
    for seed in range(number):
        chance = Random(seed)
        body = drawn(chance, 3)
        domains = {
            name: sorted({chance.choice((-2, 0, 1, 3, 50, 10**9, 4 * 10**17)) for _ in range(2)}) for name in "XY"
        }
        truth = any(exceeds(body, dict(zip("XY", row, strict=True))) for row in itertools.product(*domains.values()))
        limits = {name: Interval(values[0], values[-1]) for name, values in domains.items()}
        assert excess(body, limits) or not truth
        ranges = {name: Domain("D", tuple(range(one, one + 1) for one in values)) for name, values in domains.items()}
        predicate = Predicate("p", ("X", "Y"), Apply("ge", (body, Constant(0))))
        try:
            Magnitudes(ranges).check(Constraint("C", predicate, ("X", "Y"), ("X", "Y")))
            refused = False
        except MagnitudeError:
            refused = True
        assert refused == truth, body
        seen[truth] += 1
    assert min(seen.values()) > number / 10


def team(body: str, *, values: tuple[range, ...] = (range(1, 10**5),), cost: bool = False, places: int = 0) -> Team:
    """Return a team of two robots with one constraint on `body`."""
    expression = parse(body, ("X", "Y"), Type.INTEGER if cost else Type.BOOLEAN)
    definition = (Function if cost else Predicate)("f", ("X", "Y"), expression)
    own = {f"R{n}": [Variable(f"V{n}", Domain("D", values))] for n in (1, 2)}
    kind = ProblemKind.DISWCSP if cost or places else ProblemKind.DISCSP
    constraint = Constraint("C1", definition, ("V1", "V2"), ("V1", "V2"))
    return assemble("t", own, [constraint], kind=kind, costs=CostUnits(places=places))


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda: team("eq(mul(X,Y,X,Y),1)"),
         "'mul(V1,V2,V1,V2)' may reach 99996000059999600001, beyond the limit of 2^63"),
        (lambda: team("eq(pow(X,Y),1)"), "'pow(V1,V2)' may reach 10^1000 and more"),
        (lambda: team("ge(sub(0,mul(X,Y,10)),neg(mul(X,X,X,Y)))"), "'mul(V1,V1,V1,V2)' may reach"),
        (lambda: team("mul(X,Y,900000000)", cost=True),
         "the cost 'mul(V1,V2,900000000)' may reach 8999820000900000000"),
        (lambda: team("mul(X,Y)", cost=True, places=9), "costs have at most 18 digits in units of 10^-9"),
    ],
)  # fmt: skip
def test_the_expression_and_its_bound_are_named(made: Callable[[], Team], says: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        check_team(made())
    assert says in str(refused.value)
    assert "constraint C1 (V1 V2)" in str(refused.value)


def test_an_excess_that_no_value_reaches_is_accepted() -> None:
    few = (range(3), range(10**9, 10**9 + 1))
    check_team(team("eq(if(lt(X,5),0,mul(Y,10)),1)", values=few))
    check_team(team("eq(if(lt(X,5),pow(7,X),0),49)", values=few))
    check_team(team("mul(X,Y)", cost=True, values=(range(10**8 - 5, 10**8),)))
    with pytest.raises(InvalidInputError, match="may reach"):
        check_team(team("eq(pow(7,X),49)", values=few))


def test_files_name_the_line(tmp_path: Path) -> None:
    write_team(team("eq(mul(X,Y,X,Y),1)", values=(range(1, 4),)), tmp_path / "t")
    for file in (tmp_path / "t").iterdir():
        file.write_text(re.sub(r' nbValues="\d+"', "", file.read_text()).replace("1..3", "1..99999"))
    with pytest.raises(InvalidInputError) as refused:
        read_team(tmp_path / "t")
    assert re.search(r"R2\.xml:\d+: 'mul\(V1,V2,V1,V2\)' may reach 9999", str(refused.value))


def test_changes_that_bring_an_excess_are_refused() -> None:
    small = team("eq(mul(X,Y,X,Y),1)", values=(range(1, 4),))
    larger = AddValue("V1", 10**17)
    with pytest.raises(ChangeError, match=r"'mul\(V1,V2,V1,V2\)' may reach"):
        apply_changes(small, [larger])
    with pytest.raises(InvalidInputError, match=r"event 1 of the scenario: 'mul\(V1,V2,V1,V2\)' may reach"):
        check_team(replace(small, scenario=(ScenarioEvent((larger,)),)))
    with pytest.raises(InvalidInputError, match=r"an event: 'mul\(V1,V2,V1,V2\)' may reach"):
        check_event(small, ScenarioEvent((AddValue("V9", 3), larger)))  # the first is for a robot that may have left
    cubes = Predicate("g", ("X", "Y"), parse("eq(pow(mul(10000,X),add(Y,4)),1)", ("X", "Y"), Type.BOOLEAN))
    added = AddConstraint("R2", "R1", Constraint("C2", cubes, ("V1", "V2"), ("V1", "V2")))
    with pytest.raises(ChangeError, match="beyond the limit"):
        apply_changes(small, [added])
