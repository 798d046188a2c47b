"""Costs in files: decimals, negative ones, maximised ones, functions, constants; exact integers inside."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest

from robochoc.formats import InvalidInputError, read_robot, read_team, write_team
from robochoc.formats.costs import cost_text, read_cost
from robochoc.formats.diagnostics import MistakeError
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import text
from robochoc.model.problem import INFINITE, AddAgent, AddConstraint, ConstraintModel, Function, Relation, Semantics
from tests.support.broken_case import write_files
from tests.support.cases import looped

FILE = """\
<instance>
  <presentation type="DisWCSP"{presentation}/>
  <domains><domain name="D">1..3</domain></domains>
  <variables><variable name="{own}" domain="D"/></variables>
  <relations>{relations}</relations>
  <functions>
    <function name="far" return="int">
      <parameters>int X int Y</parameters>
      <expression><functional>neg(dist(X, Y))</functional></expression>
    </function>
  </functions>
  <constraints>{private}</constraints>
  <agents_neighbours>
    <agents_parent>{parents}</agents_parent>
    <agents_children>{children}</agents_children>
  </agents_neighbours>
</instance>
"""


def file(own: str, presentation: str = "", **parts: str) -> str:
    given = dict.fromkeys(("relations", "private", "parents", "children"), "") | parts
    return FILE.format(own=own, presentation=presentation, **given)


def own_relation(tmp_path: Path, relation: str, presentation: str = "") -> tuple[Relation, CostUnits]:
    """The relation as it is read in a file with this presentation."""
    private = '<constraint name="C" reference="r" scope="A"/>'
    (tmp_path / "RA.xml").write_text(file("A", presentation, relations=relation, private=private))
    robot = read_robot(tmp_path / "RA.xml")
    definition = robot.private[0].definition
    assert isinstance(definition, Relation)
    return definition, robot.costs


def test_decimals_and_negative_costs_are_integers_of_the_files_unit(tmp_path: Path) -> None:
    relation = '<relation name="r" arity="1" semantics="soft" defaultCost="+1.50">-0.25:1|2: 2 |infinity:3</relation>'
    read, units = own_relation(tmp_path, relation, ' constant="-7"')
    assert units == CostUnits(places=2, constant=-700)
    assert (read.costs, read.default_cost) == ((-25, 200, INFINITE), 150)
    assert units.in_user_units(-25) == Decimal("-7.25")


def test_a_cost_holds_until_the_next_one(tmp_path: Path) -> None:
    read, units = own_relation(tmp_path, '<relation name="r" semantics="soft">\n infinity: 1 |2| 4:3\n</relation>')
    assert (read.tuples, read.costs) == (((1,), (2,), (3,)), (INFINITE, INFINITE, 4))
    assert read.default_cost == INFINITE  # no defaultCost: what is not listed is forbidden
    assert units == CostUnits()


def test_a_relation_may_list_nothing(tmp_path: Path) -> None:
    empty = '<relation name="r" arity="1" nbTuples="0" semantics="soft" defaultCost="0.5"></relation>'
    read, units = own_relation(tmp_path, empty)
    assert (read.tuples, read.default_cost, units.places) == ((), 5, 1)


def test_minus_infinity_forbids_when_maximising(tmp_path: Path) -> None:
    relation = '<relation name="r" semantics="soft" defaultCost="0">-infinity:1|2:2</relation>'
    read, units = own_relation(tmp_path, relation, ' objective="maximize" scale="0.001"')
    assert units == CostUnits(maximize=True, places=3)
    assert read.costs == (INFINITE, 2000)


@looped("maximize", [False, True])
@looped("places", [0, 1, 9])
def test_a_cost_is_written_as_it_is_read(places: int, *, maximize: bool) -> None:
    units = CostUnits(maximize, places)
    for cost in (0, 1, -1, 10, -10, 123456789012, 10**18 - 1, 1 - 10**18, INFINITE):
        assert read_cost(cost_text(cost, units), units) == cost
    for word in ("", "1e3", "0x1", "1.", ".1", "--1", "1.0000000000", "inf", "nan"):
        with pytest.raises(MistakeError, match="is not a cost"):
            read_cost(word, units)


def team(tmp_path: Path, *files: str, **others: str) -> Path:
    write_files(tmp_path / "t", {f"R{name}.xml": text for name, text in zip("ABC", files, strict=False)} | others)
    return tmp_path / "t"


CHILD_OF_A = '<agent name="RA" id="1"><constraints>{}</constraints></agent>'


def test_a_team_counts_in_the_finest_unit_of_its_files(tmp_path: Path) -> None:
    relation = '<relation name="r" semantics="soft" defaultCost="1">infinity:1 1|2:2 2</relation>'
    shared = '<constraint name="C" reference="r" scope="A B" cost="infinity"/>'
    shared += '<constraint name="P" reference="eq" scope="A B" cost="-0.5"/>'
    shared += '<constraint name="F" reference="far" scope="A B"/>'
    folder = team(
        tmp_path,
        file("A", ' constant="0.001"', children='<agent name="RB" id="2"/>'),
        file("B", ' constant="2"', relations=relation, parents=CHILD_OF_A.format(shared)),
    )
    read = read_team(folder)
    assert [robot.costs for robot in read.robots] == [
        CostUnits(places=3, constant=1),
        CostUnits(places=3, constant=2000),
    ]
    of_relation, of_predicate, of_function = read["RB"].shared
    assert {one.model for one in read["RB"].shared} == {ConstraintModel.TKC}
    made = Relation("r", 2, Semantics.SOFT, ((1, 1), (2, 2)), (INFINITE, 2000), 1000)
    assert of_relation.definition == made
    assert of_predicate.cost == -500
    assert isinstance(of_function.definition, Function)
    assert text(of_function.definition.body) == "neg(dist(X,Y))"
    assert of_function.definition.cost((1, 3)) == -2
    write_team(read, tmp_path / "again" / "t")
    assert read_team(tmp_path / "again" / "t") == read


def test_copies_are_compared_in_one_unit(tmp_path: Path) -> None:
    def half(places: str) -> str:
        return f'<relation name="r" semantics="soft" defaultCost="{places}">1:1 1</relation>'

    shared = '<constraint name="C" reference="r" scope="A B"/><constraint name="F" reference="far" scope="{}"/>'
    above = f'<agent name="RB"><constraints>{shared.format("A B")}</constraints></agent>'
    folder = team(
        tmp_path,
        file("A", relations=half("0.5"), children=above),
        file("B", ' scale="0.001"', relations=half("0.500"), parents=CHILD_OF_A.format(shared.format("B A"))),
    )
    assert read_team(folder)["RA"].costs.places == 3
    (folder / "RB.xml").write_text(file("B", relations=half("0.25"), parents=CHILD_OF_A.format(shared.format("B A"))))
    with pytest.raises(
        InvalidInputError, match=r"differs: '1 2' is at a cost of -0\.5 here, and at a cost of -0\.75 in"
    ):
        read_team(folder)


def test_a_scenario_counts_in_the_unit_of_the_team(tmp_path: Path) -> None:
    scenario = """<scenario><event after="solved">
      <add_constraint agent="RB" parent="RA">
        <constraint name="N" reference="eq" scope="A B" cost="0.5"/>
      </add_constraint>
      <add_agent file="late/RC.xml"/>
    </event></scenario>"""
    late = file("C", parents=CHILD_OF_A.format('<constraint name="L" reference="ne" scope="A C" cost="0.25"/>'))
    folder = team(
        tmp_path,
        file("A", children='<agent name="RB"/>'),
        file("B", parents=CHILD_OF_A.format('<constraint name="C" reference="ne" scope="A B" cost="3"/>')),
        **{"scenario.xml": scenario, "late/RC.xml": late},
    )
    read = read_team(folder)
    assert read["RB"].shared[0].cost == 300
    added, joined = read.scenario[0].changes
    assert isinstance(added, AddConstraint)
    assert isinstance(joined, AddAgent)
    assert (added.constraint.cost, joined.robot.shared[0].cost, joined.robot.costs.places) == (50, 25, 2)
    (folder / "late" / "RC.xml").write_text(late.replace('"DisWCSP"', '"DisWCSP" objective="maximize"'))
    with pytest.raises(InvalidInputError, match="'RC' maximizes costs in a team that minimizes them"):
        read_team(folder)


def test_parts_of_a_constraint_may_cost(tmp_path: Path) -> None:
    part = '<constraint name="C" model="PKC" reference="far" scope="A B"/>'
    folder = team(
        tmp_path,
        file("A", children=f'<agent name="RB"><constraints>{part}</constraints></agent>'),
        file("B", parents=CHILD_OF_A.format(part)),
    )
    assert sum(one.price({"A": 1, "B": 3}) for one in read_team(folder).constraints()) == -4


@pytest.mark.parametrize("other", ["", '<constraint name="P" reference="ne" scope="B 1" cost="0.5"/>'])
def test_equal_texts_in_two_files_are_read_once_in_each_unit(tmp_path: Path, other: str) -> None:
    relation = '<relation name="r" arity="1" semantics="soft">4:1|2:2</relation>'
    for own, more in (("A", ""), ("B", other)):
        private = f'<constraint name="C" reference="r" scope="{own}"/>{more}'
        (tmp_path / f"R{own}.xml").write_text(file(own, relations=relation, private=private))
    one, second = read_team(tmp_path).robots
    definitions = [one.private[0].definition, second.private[0].definition]
    assert all(isinstance(read, Relation) and read.costs == ((40, 20) if other else (4, 2)) for read in definitions)
    assert one.variables[0].domain is second.variables[0].domain
    assert (definitions[0] is definitions[1]) is not bool(other)
