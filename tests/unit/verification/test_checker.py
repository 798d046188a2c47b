"""The checker: right where protocols are, and not fooled where they are not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

import pytest
from hypothesis import given

import robochoc.run.orchestrator
import robochoc.verification.checker
from robochoc.generators.queens3d import queens3d
from robochoc.model.expression import Type, parse
from robochoc.model.problem import INFINITE, Constraint, Domain, Predicate, Relation, Robot, Semantics, Team, Variable
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.run import Options, Runtime, solve
from robochoc.verification.checker import (
    RefutedError,
    assignment_cost,
    constraint_cost,
    has_local_solution,
    needlessly_withdrawn,
    violated_constraints,
    violations,
)
from robochoc.verification.second_opinion import total_cost
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.problems import ON_ONE_MACHINE, team_of, teams


def some_assignments(team: Team) -> Iterator[dict[str, int]]:
    """The first value everywhere, the last one, and mixtures."""
    values = {name: list(variable.domain) for name, variable in team.variables.items()}
    for shift in range(6):
        yield {name: own[(shift * place) % len(own)] for place, (name, own) in enumerate(values.items())}


@given(team=teams)
@examples(50, slow=1000)
def test_it_agrees_with_the_model_of_the_problem(team: Team) -> None:
    for assignment in some_assignments(team):
        truth = all(constraint.allows(assignment) for constraint in team.constraints())
        assert (not list(violations(team, assignment))) is truth


def test_every_kind_of_fault_is_told() -> None:
    team = queens3d(2)
    assert list(violations(team, {"V1.1": 1, "V1.2": 1, "V2.1": 3, "V9.9": 1}))[:4] == [
        "V2.1 = 3 is not in its domain",
        "V2.2 has no value",
        "V9.9 is not a variable of a robot that flies",
        "constraint C5 is broken by V1.1 = 1, V1.2 = 1",
    ]


def test_a_robot_that_stepped_aside_must_not_be_placed_and_need_not_be() -> None:
    team = queens3d(2)
    rest = ("Robot1.2", "Robot2.1", "Robot2.2")
    assert not list(violations(team, {"V1.1": 1}, rest))
    assert next(violations(team, {"V1.1": 1, "V1.2": 2}, rest)) == "V1.2 is not a variable of a robot that flies"


def test_whoever_could_join_is_named() -> None:
    domains = {"A": (1, 2), "B": (1, 2)}
    differ = Relation("R", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    team = team_of(domains, [Constraint("C", differ, ("A", "B"), ("A", "B"))])
    assert list(needlessly_withdrawn(team, {"A": 1}, ("RB",))) == ["RB"]


@looped(
    ("semantics", "row", "expected"),
    [
        (Semantics.SUPPORTS, (1, 2), 0),
        (Semantics.SUPPORTS, (2, 2), INFINITE),
        (Semantics.CONFLICTS, (1, 2), INFINITE),
        (Semantics.CONFLICTS, (2, 2), 0),
        (Semantics.SOFT, (1, 2), 5),
        (Semantics.SOFT, (2, 2), 1),
    ],
)
def test_prices_in_extension(semantics: Semantics, row: tuple[int, int], expected: float) -> None:
    soft = semantics is Semantics.SOFT
    relation = Relation("R", 2, semantics, ((1, 2),), (5,) if soft else (), 1 if soft else 0)
    constraint = Constraint("C", relation, ("A", "B"), ("A", "B"))
    assignment = dict(zip("AB", row, strict=True))
    assert constraint_cost(constraint, assignment) == expected == constraint.price(assignment)


def test_an_undefined_predicate_is_a_broken_one() -> None:
    predicate = Predicate("p", ("X", "Y"), parse("eq(div(X, Y), 0)", ("X", "Y"), Type.BOOLEAN))
    constraint = Constraint("C", predicate, ("A", "B"), ("A", "B"), cost=7)
    assert constraint_cost(constraint, {"A": 1, "B": 0}) == 7
    team = team_of({"A": (1,), "B": (0,)}, [constraint])
    assert assignment_cost(team, {"A": 1, "B": 0}) == 7


def alone(variables: dict[str, Sequence[int]], *constraints: Constraint) -> Robot:
    """A robot without neighbours."""
    domains = {name: Domain(name, tuple(range(value, value + 1) for value in own)) for name, own in variables.items()}
    return Robot("R", tuple(Variable(name, domain) for name, domain in domains.items()), private=constraints)


EQUAL = Relation("E", 2, Semantics.SUPPORTS, ((1, 1), (2, 2), (3, 3)))


def test_a_robot_has_a_local_solution_if_its_private_constraints_have_one() -> None:
    forbids_one = Constraint("F", Relation("F", 1, Semantics.CONFLICTS, ((1,),)), ("B",), ("B",))
    equal = Constraint("E", EQUAL, ("A", "B"), ("A", "B"))
    assert has_local_solution(alone({"A": (1, 2), "B": (1, 2)}, equal, forbids_one)) is True
    assert has_local_solution(alone({"A": (1, 2), "B": (1,)}, equal, forbids_one)) is False
    assert has_local_solution(alone({"A": (1, 2), "B": (3, 4)}, equal)) is False
    dear = Constraint("S", Relation("S", 1, Semantics.SOFT, ((1,),), (9,)), ("A",), ("A",))
    assert has_local_solution(alone({"A": (1,)}, dear)) is True, "a cost rules nothing out"


def test_who_tries_too_often_leaves_it_open(monkeypatch: pytest.MonkeyPatch) -> None:
    equal = Constraint("E", EQUAL, ("A", "B"), ("A", "B"))
    robot = alone({"A": (1, 2), "B": (3, 4)}, equal)  # two values of A, each with two of B: six tries
    monkeypatch.setattr(robochoc.verification.checker, "MAX_TRIES", 7)
    assert has_local_solution(robot) is False
    monkeypatch.setattr(robochoc.verification.checker, "MAX_TRIES", 5)
    assert has_local_solution(robot) is None
    assert has_local_solution(alone({"A": (1, 2, 3), "B": (3,)}, equal)) is None
    monkeypatch.setattr(robochoc.verification.checker, "MAX_TRIES", 6)
    assert has_local_solution(alone({"A": (1, 2, 3), "B": (3,)}, equal)) is True


def test_who_cannot_join_is_not_named() -> None:
    conflict = Relation("R", 2, Semantics.CONFLICTS, ((1, 1), (2, 1)))
    team = team_of({"A": (1, 2), "B": (1,), "C": (1,)}, [Constraint("C", conflict, ("A", "B"), ("A", "B"))])
    assert list(needlessly_withdrawn(team, {"A": 1}, ("RB", "RC"))) == ["RC"]
    assert list(needlessly_withdrawn(team, {"B": 1}, ("RA", "RC"))) == ["RC"]
    assert list(needlessly_withdrawn(team, {}, ("RA", "RB", "RC"))) == ["RA", "RB", "RC"], "each for itself"


def test_costs_are_of_constraints_whose_variables_all_have_values() -> None:
    price = Relation("P", 2, Semantics.SOFT, ((1, 1),), (4,), 1)
    team = team_of(
        dict.fromkeys("ABC", (1, 2)), [Constraint(f"C{at}", price, tuple(at), tuple(at)) for at in ("AB", "BC")]
    )
    assert [assignment_cost(team, at) for at in ({"A": 1}, {"A": 1, "B": 1}, {"A": 1, "B": 1, "C": 2})] == [0, 4, 5]
    assert total_cost(team, {"A": 1, "B": 1}, None) == 4
    assert total_cost(team, {"A": 1}, 10) == 20


class Liar(Protocol):
    """Takes its first value, whatever others say."""

    messages: ClassVar[object] = Ok

    def start(self) -> None:
        self.value = 0

    def receive(self, sender: str, message: Message) -> None:
        raise AssertionError((sender, message))


@pytest.mark.parametrize("runtime", ON_ONE_MACHINE)
def test_a_protocol_that_lies_is_refuted(monkeypatch: pytest.MonkeyPatch, runtime: Runtime) -> None:
    monkeypatch.setattr(robochoc.run.orchestrator, "protocol_named", lambda _name: Liar)
    with pytest.raises(RefutedError, match=r"broken by V1\.1 = 1, V1\.2 = 1"):
        solve(queens3d(3), Options(runtime=runtime))


@given(teams)
@examples(40)
def test_violated_constraints_are_those_that_cost_infinity(team: Team) -> None:
    for assignment in some_assignments(team):
        found = violated_constraints(team, assignment)
        broken = [one for one in team.constraints() if constraint_cost(one, assignment) == INFINITE]
        assert found.number == len(broken)
        assert [one.name for one in found.first] == [one.name for one in broken[:5]]
        assert found.hard >= found.number


def test_soft_constraints_are_not_hard() -> None:
    y = ("A", "B")
    hard = Relation("R", 2, Semantics.SOFT, ((0, 0), (1, 1)), (INFINITE, 3), 0)
    soft = Relation("S", 2, Semantics.SOFT, ((0, 0),), (5,), 1)
    same = Predicate("P", ("X", "Y"), parse("eq(X,Y)", ("X", "Y"), Type.BOOLEAN))
    constraints = [
        Constraint("hard", hard, y, y),
        Constraint("soft", soft, y, y),
        Constraint("costly", same, y, y, cost=7),
        Constraint("same", same, y, y),
    ]
    team = team_of(dict.fromkeys("AB", range(2)), constraints)
    assert str(violated_constraints(team, {"A": 0, "B": 0})) == "1 of 2 hard constraints: hard of RB"
    assert str(violated_constraints(team, {"A": 0, "B": 1})) == "1 of 2 hard constraints: same of RB"
    assert violated_constraints(team, {"A": 1, "B": 1}).number == 0
