"""The checker: right where protocols are, and not fooled where they are not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import pytest
from hypothesis import given

import robochoc.run.orchestrator
from robochoc.generators.queens3d import queens3d
from robochoc.model.expression import Type, parse
from robochoc.model.message import Message
from robochoc.model.problem import INFINITE, Constraint, Predicate, Relation, Semantics, Team
from robochoc.protocols.abt import Ok
from robochoc.protocols.protocol import Protocol
from robochoc.run import Options, Runtime, solve
from robochoc.verification.checker import (
    RefutedError,
    assignment_cost,
    constraint_cost,
    needlessly_withdrawn,
    violations,
)
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
        "V9.9 is no variable of a robot that flies",
        "constraint C5 is broken by V1.1 = 1, V1.2 = 1",
    ]


def test_a_robot_that_stepped_aside_must_not_be_placed_and_need_not_be() -> None:
    team = queens3d(2)
    rest = ("Robot1.2", "Robot2.1", "Robot2.2")
    assert not list(violations(team, {"V1.1": 1}, rest))
    assert next(violations(team, {"V1.1": 1, "V1.2": 2}, rest)) == "V1.2 is no variable of a robot that flies"


def test_whoever_could_join_is_named() -> None:
    domains = {"A": (1, 2), "B": (1, 2)}
    differ = Relation("R", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    team = team_of(domains, [Constraint("C", differ, ("A", "B"), ("A", "B"))])
    assert list(needlessly_withdrawn(team, {"A": 1}, ("RB",))) == ["RB"]


@pytest.mark.parametrize(
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
