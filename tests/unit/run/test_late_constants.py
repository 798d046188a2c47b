"""Constant costs of robots that come and go: each counts while its robot is there."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.model.assembly import assemble
from robochoc.model.problem import (
    AddAgent,
    Constraint,
    CostUnits,
    Domain,
    ProblemKind,
    Relation,
    RemoveAgent,
    Robot,
    ScenarioEvent,
    Semantics,
    Variable,
)
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve

BITS = Domain("D", (range(2),))


def soft(name: str, scope: tuple[str, ...], **costs: int) -> Constraint:
    """A constraint whose tuples, written as words, have these costs."""
    rows = tuple(tuple(map(int, word[1:])) for word in costs)
    return Constraint(name, Relation(name, len(scope), Semantics.SOFT, rows, tuple(costs.values()), 1), scope, scope)


@pytest.mark.parametrize("protocol", ["central", "dpop"])
def test_a_constant_counts_while_its_robot_is_there(protocol: str) -> None:
    start = assemble(
        "t",
        {"a": [Variable("x", BITS)], "b": [Variable("y", BITS)]},
        [soft("c", ("x", "y"), _00=3, _11=-4)],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(constant=100),
    )
    private = replace(soft("p", ("w",), _0=7, _1=-2), model=None)
    late = Robot("z", (Variable("w", BITS),), ProblemKind.DISWCSP, private=(private,), costs=CostUnits(constant=1000))
    events = (ScenarioEvent((AddAgent(late),)), ScenarioEvent((RemoveAgent("a"),)))
    runtime = Runtime.PROCESSES if protocol == "central" else Runtime.SIMULATOR
    outcome = solve(replace(start, scenario=events), Options(protocol=protocol, runtime=runtime))
    assert [epoch.cost for epoch in outcome.epochs] == [96, 1094, 998]
