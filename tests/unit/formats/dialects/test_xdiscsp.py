"""XDisCSP 1.0 as DisChoco and DCOPSolver write it: small files, written for these tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from robochoc.formats import InvalidInputError, check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign, recognise
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, ConstraintModel, Domain, Function, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Type, parse
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError
from tests.support.foreign_problems import imported, optimum, written


def xdiscsp(constraints: str, relations: str, *, kind: str = "DCOP", model: str = "TKC", more: str = "") -> str:
    return f"""<instance>
  <presentation name="i" type="{kind}" benchmark="Random" model="Complex"
    constraintModel="{model}" format="XDisCSP 1.0"/>
  <agents nbAgents="2"><agent name="A1" id="1" description="first"/><agent name="A2" id="2"/></agents>
  <domains nbDomains="1"><domain name="D1" nbValues="2">1..2</domain></domains>
  <variables nbVariables="3"><variable agent="A1" name="X1.1" id="1" domain="D1" description="of A1"/>
    <variable agent="A2" name="X2.1" id="1" domain="D1"/><variable agent="A2" name="X2.2" id="2" domain="D1"/>
  </variables>
  <constraints nbConstraints="1" {more}>{constraints}</constraints>
  <relations nbRelations="1">{relations}</relations>
  <GuiPresentation type="{kind}" name="i"/></instance>"""


def over(scope: str, reference: str = "R0", more: str = "") -> str:
    return f'<constraint name="C" model="TKC" arity="2" scope="{scope}" reference="{reference}" {more}/>'


SOFT = '<relation name="R0" semantics="soft" defaultCost="infinity">7:1 1|4:1 2|5:2 1|6:2 2</relation>'
HARD = '<relation name="R0" arity="2" semantics="conflicts">1 1|2 2</relation>'


def test_a_dcop(tmp_path: Path) -> None:
    found = imported(xdiscsp(over("X1.1 X2.1") + over("X2.1 X2.2"), SOFT), tmp_path)
    check_team(found.team)
    assert (found.dialect, found.team.order, found.names) == ("xdiscsp", ("A1", "A2"), {})
    assert optimum(found.team) == 9


def test_a_constant_and_a_bound(tmp_path: Path) -> None:
    found = imported(xdiscsp(over("X1.1 X2.1"), SOFT, more='initialCost="10" maximalCost="5"'), tmp_path)
    assert optimum(found.team) == 14
    assert [note.kind for note in found.notes] == ["constant", "bound"]
    none = imported(xdiscsp(over("X1.1 X2.1"), SOFT, more='initialCost="0" maximalCost="4"'), tmp_path)
    assert optimum(none.team) is None


def test_a_violated_constraint_of_a_maxdiscsp_costs_1(tmp_path: Path) -> None:
    pairs = over("X1.1 X2.1") + over("X1.1 X2.2") + over("X2.1 X2.2") + over("X1.1 X2.1", "eq")
    assert optimum(imported(xdiscsp(pairs, HARD, kind="MaxDisCSP"), tmp_path).team) == 1
    assert optimum(imported(xdiscsp(pairs, HARD, kind="DisCSP"), tmp_path).team) is None


SIDES = (
    '<relation name="R0" arity="2" semantics="soft" defaultCost="9 9">1 2:1 1|5 0:1 2|0 infinity:2 1|2 2:2 2</relation>'
)


def test_two_costs_a_tuple_are_parts_of_two_robots(tmp_path: Path) -> None:
    found = imported(xdiscsp(over("X1.1 X2.1"), SIDES, kind="ADCOP"), tmp_path)
    check_team(found.team)
    ((part,),) = (child.constraints for child in found.team["A1"].children)
    ((other,),) = (parent.constraints for parent in found.team["A2"].parents)
    assert (part.model, other.model) == (ConstraintModel.PKC, ConstraintModel.PKC)
    assert [one.price({"X1.1": 1, "X2.1": 2}) for one in (part, other)] == [5, 0]
    assert optimum(found.team) == 3
    turned = imported(xdiscsp(over("X2.1 X1.1"), SIDES, kind="ADCOP"), tmp_path).team
    ((first,),) = (parent.constraints for parent in turned["A2"].parents)
    assert first.price({"X1.1": 2, "X2.1": 1}) == 5
    alone = imported(xdiscsp(over("X2.1 X2.2"), SIDES, kind="ADCOP"), tmp_path).team
    assert optimum(alone) == 3
    assert len(alone["A2"].private) == 2


def test_partially_known_constraints_say_who_knows_them(tmp_path: Path) -> None:
    part = over("X1.1 X2.1", more='ownerId="2"').replace("TKC", "PKC")
    found = imported(xdiscsp(part, HARD, kind="DisCSP", model="PKC"), tmp_path)
    check_team(found.team)
    ((held,),) = (parent.constraints for parent in found.team["A2"].parents)
    assert held.model is ConstraintModel.PKC
    assert not held.allows({"X1.1": 1, "X2.1": 1})
    with pytest.raises(InvalidInputError, match=r"a partially known constraint \(PKC\) 'C' without ownerId"):
        imported(xdiscsp(part.replace("ownerId", "id"), HARD, kind="DisCSP"), tmp_path)


def test_two_files_are_two_problems(tmp_path: Path) -> None:
    files = [tmp_path / "one.xml", tmp_path / "two.xml"]
    for file in files:
        file.write_text(xdiscsp(over("X1.1 X2.1"), SOFT))
    with pytest.raises(InvalidInputError, match=r"two\.xml: is a second problem"):
        read_foreign(files, ImportOptions())


@pytest.mark.parametrize(
    "relation", [SIDES.replace("5 0:", "5:"), SIDES.replace("5 0:", "5 0 1:"), SIDES.replace("9 9", "9 9 x")]
)
def test_some_tuples_with_two_costs_are_refused(relation: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError):
        imported(xdiscsp(over("X1.1 X2.1"), relation), tmp_path)


def test_robots_own_files_are_not_of_this_kind(four: Path, tmp_path: Path) -> None:
    assert [recognise(file) for file in sorted(four.iterdir())] == [None] * 16
    ours = tmp_path / "A1.xml"
    ours.write_text('<instance><presentation format="XDisCSP 1.0"/><agents_neighbours/></instance>')
    assert recognise(ours) is None


def team_with(constraint: Constraint, units: CostUnits = CostUnits()) -> Team:  # noqa: B008
    domain = Domain("D", (range(200),))
    variables = {name: [Variable(f"x{name}", domain)] for name in "abc"}
    return assemble("t", variables, [constraint], kind=ProblemKind.DISWCSP, costs=units)


def _soft(cost: int) -> Constraint:
    return Constraint("c", Relation("r", 1, Semantics.SOFT, ((1,),), (cost,), 0), ("xa",), ("xa",))


def test_dcopsolver_finds_the_format_the_type_and_a_benchmark_in_the_presentation() -> None:
    (content,) = written("xdiscsp", team_with(_soft(1))).values()
    presentation = etree.fromstring(content).find("presentation")
    assert presentation is not None
    wanted = {"format": "XDisCSP 1.0", "type": "DCOP", "benchmark": "RandomDCOP"}
    assert {name: presentation.get(name) for name in wanted} == wanted


def test_what_cannot_be_written_is_refused_by_name() -> None:
    names = ("X", "Y", "Z")
    function = Function("f", names, parse("add(X,Y,Z)", names, Type.INTEGER))
    scope = ("xa", "xb", "xc")
    for team, message in (
        (team_with(_soft(-1)), "integer costs of 0 or more, but c has -1"),
        (team_with(_soft(1), CostUnits(places=1)), "integer costs of 0 or more, but c has 0.1"),
        (team_with(_soft(1), CostUnits(maximize=True)), "does not support utilities"),
        (team_with(Constraint("c", function, scope, scope)), "c over xa xb xc has 8,000,000 combinations"),
    ):
        with pytest.raises(UnsupportedError, match=message):
            written("xdiscsp", team)
