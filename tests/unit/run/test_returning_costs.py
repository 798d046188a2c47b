"""Robots that come back, by a scenario or after a loss: costs and symbols are those of the whole team."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from robochoc.formats import read_team, write_team
from robochoc.model.assembly import assemble
from robochoc.model.costs import normalized, told_cost
from robochoc.model.expression import Type, parse
from robochoc.model.problem import (
    AddAgent,
    AddValue,
    Constraint,
    CostUnits,
    Domain,
    Function,
    ProblemKind,
    RemoveAgent,
    RemoveValue,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.run.scenario import ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.checker import assignment_cost
from tests.support.losing import Losing

PRODUCT = Function("product", ("X", "Y"), parse("mul(X,Y)", ("X", "Y"), Type.INTEGER))


def product(x: range, y: range) -> Team:
    """Two robots whose values should multiply to much."""
    return assemble(
        "product",
        {"a": [Variable("x", Domain("D", (x,)))], "b": [Variable("y", Domain("E", (y,)))]},
        [Constraint("C", PRODUCT, ("x", "y"), ("x", "y"))],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=1),
    )


@pytest.mark.parametrize("protocol", ["adopt", "central"])
def test_who_comes_again_with_other_values_costs_what_they_say(protocol: str) -> None:
    poor = product(range(6), range(2))["b"]
    events = (ScenarioEvent((RemoveAgent("b"),)), ScenarioEvent((AddAgent(poor),)))
    team = replace(product(range(6), range(6)), scenario=events)
    outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
    assert [epoch.cost for epoch in outcome.epochs] == [Decimal(25), Decimal(0), Decimal(5)]


def test_who_was_lost_counts_values_that_are_still_to_come(tmp_path: Path) -> None:
    events = (ScenarioEvent((RemoveValue("x", 1),)), ScenarioEvent((AddValue("x", 9),)))
    write_team(product(range(2), range(3)), tmp_path / "team")
    team = normalized(replace(read_team(tmp_path / "team"), scenario=events))
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=1)
    *_, last = (played.team for played in journey.epochs(Losing(journey.team, ["b"]), lambda _: None))
    assert journey.failed_returns == []
    assert told_cost(last, assignment_cost(last, {"x": 9, "y": 2})) == Decimal(18)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('objective="maximize"', "", "another objective"),
        ('scale="0.1"', 'scale="0.01"', "finer costs"),
        ('nbValues="3">0..2', ">0..7", "y has new values"),
        ('<domain name="E" nbValues="3">0..2', '<domain name="E" type="symbolic">u v', "'u' is new to the team"),
    ],
)
def test_who_reads_costs_otherwise_stays_away(old: str, new: str, why: str, tmp_path: Path) -> None:
    parents_hold = product(range(2), range(3))
    turned = assemble(
        "product",
        {"b": parents_hold["b"].variables, "a": parents_hold["a"].variables},
        parents_hold.constraints(),
        kind=ProblemKind.DISWCSP,
        costs=parents_hold.robots[0].costs,
    )
    write_team(turned, tmp_path / "team")
    team = normalized(read_team(tmp_path / "team"))
    file = tmp_path / "team" / "b.xml"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=1)
    list(journey.epochs(Losing(journey.team, ["b"]), lambda _: None))
    assert journey.withdrawn == ["b"]
    assert why in journey.failed_returns[0]


FILE = """<instance><presentation type="DisCSP"/>
<domains><domain name="D" type="symbolic">{0}</domain></domains>
<variables><variable name="{1}" domain="D"/></variables>
<relations><relation name="r" semantics="supports">red red</relation></relations>
<agents_neighbours><agents_parent>{2}</agents_parent><agents_children>{3}</agents_children></agents_neighbours>
</instance>"""


def test_who_was_lost_knows_the_codes_of_the_team(tmp_path: Path) -> None:
    shared = '<agent name="a"><constraints><constraint name="C" reference="r" scope="x y"/></constraints></agent>'
    (tmp_path / "a.xml").write_text(FILE.format("green blue red", "x", "", '<agent name="b" variable="x"/>'))
    (tmp_path / "b.xml").write_text(FILE.format("red blue", "y", shared, ""))
    team = read_team(tmp_path)
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=1)
    *_, last = (played.team for played in journey.epochs(Losing(journey.team, ["b"]), lambda _: None))
    assert last == team
