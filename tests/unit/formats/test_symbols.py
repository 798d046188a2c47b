"""Symbolic domains: names in files, codes in one table of the team inside."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.cli.reports.outcome import task_table
from robochoc.formats import InvalidInputError, check_team, read_robot, read_team, robot_in, robot_xml, write_team
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.problem import (
    AddAgent,
    AddValue,
    Constraint,
    Domain,
    Predicate,
    Relation,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from tests.support.broken_case import write_files
from tests.support.cases import looped

A = """\
<instance>
  <presentation type="DisCSP"/>
  <domains>
    <domain name="D" type="symbolic" nbValues="3">red green dark-blue</domain>
    <domain name="I">1..3</domain>
  </domains>
  <variables><variable name="A" domain="D"/><variable name="N" domain="I"/></variables>
  <predicates>
    <predicate name="warm">
      <parameters>symbol X int Y</parameters>
      <expression><functional>or(in(X, set(red, 'dark-blue')), and(ne(X, 'green'), eq(Y, 2)))</functional></expression>
    </predicate>
  </predicates>
  <constraints><constraint name="P" reference="warm" scope="A N"/></constraints>
  <agents_neighbours><agents_parent/><agents_children><agent name="RB"/></agents_children></agents_neighbours>
</instance>
"""
B = """\
<instance>
  <presentation type="DisCSP"/>
  <domains><domain name="I">1..3</domain></domains>
  <variables><variable name="B" domain="I"/></variables>
  <relations><relation name="r" semantics="supports">green 1|red 2</relation></relations>
  <agents_neighbours>
    <agents_parent>
      <agent name="RA"><constraints><constraint name="C" reference="r" scope="A B"/></constraints></agent>
    </agents_parent>
    <agents_children><agent name="RC"/></agents_children>
  </agents_neighbours>
</instance>
"""
C = """\
<instance>
  <presentation type="DisCSP"/>
  <domains><domain name="D" type="symbolic">green left red</domain></domains>
  <variables><variable name="C" domain="D"/></variables>
  <agents_neighbours>
    <agents_parent>
      <agent name="RA"><constraints><constraint name="C" reference="ne" scope="A C"/></constraints></agent>
      <agent name="RB"/>
    </agents_parent>
    <agents_children/>
  </agents_neighbours>
</instance>
"""
A3 = A.replace('<agent name="RB"/>', '<agent name="RB"/><agent name="RC"/>')
TABLE = ("red", "green", "dark-blue", "left")


def files(tmp_path: Path, **others: str) -> Path:
    write_files(tmp_path / "t", {"RA.xml": A3, "RB.xml": B, "RC.xml": C} | others)
    return tmp_path / "t"


def test_a_file_alone_has_a_table_of_its_own(tmp_path: Path) -> None:
    robot = read_robot(files(tmp_path) / "RC.xml")
    assert robot.variables[0].domain == Domain("D", (range(3),), ("green", "left", "red"))
    assert [robot.variables[0].domain.label(value) for value in range(3)] == ["green", "left", "red"]


def test_a_team_has_one_table(tmp_path: Path) -> None:
    team = read_team(files(tmp_path))
    assert {robot.symbol_table for robot in team.robots} == {TABLE}
    assert team["RA"].symbols == ()
    assert team["RB"].symbols == TABLE
    assert team.variables["A"].domain == Domain("D", (range(3),), TABLE)
    assert list(team.variables["C"].domain) == [0, 1, 3]
    (warm,) = team["RA"].private
    assert isinstance(warm.definition, Predicate)
    assert warm.definition.symbolic == ("X",)
    allowed = [(a, n) for a in range(3) for n in (1, 2, 3) if warm.allows({"A": a, "N": n})]
    assert allowed == [(0, 1), (0, 2), (0, 3), (2, 1), (2, 2), (2, 3)]
    (shared,) = team["RB"].shared
    assert shared.definition == Relation("r", 2, Semantics.SUPPORTS, ((1, 1), (0, 2)), symbolic=(0,))


def test_every_written_file_says_the_same_codes(tmp_path: Path) -> None:
    team = read_team(files(tmp_path))
    write_team(team, tmp_path / "again" / "t")
    assert read_team(tmp_path / "again" / "t") == team
    for robot in team.robots:
        content = robot_xml(robot)
        assert b'<domain name="symbols" type="symbolic">red green dark-blue left</domain>' in content
        assert robot_in(content, robot.name) == robot


def test_a_scenario_names_symbols(tmp_path: Path) -> None:
    scenario = """<scenario>
      <event after="solved"><remove_value variable="A" value="red"/><add_value variable="A" value="purple"/></event>
      <event after="solved"><add_agent file="late/RD.xml"/></event>
    </scenario>"""
    late = C.replace('name="C" domain="D"', 'name="E" domain="D"').replace("A C", "A E").replace("left", "pink")
    folder = files(tmp_path, **{"scenario.xml": scenario, "late/RD.xml": late})
    team = read_team(folder)
    first, second = team.scenario
    assert first.changes == (RemoveValue("A", 0), AddValue("A", 4))
    (joined,) = second.changes
    assert isinstance(joined, AddAgent)
    table = (*TABLE, "purple", "pink")
    assert {robot.symbol_table for robot in (*team.robots, joined.robot)} == {table}
    check_team(replace(team))
    for wrong, told in (
        ('value="red"', "'A' has no value left (its domain is red green dark-blue)"),
        ('value="1', "'1' cannot be a symbol"),
    ):
        new = {'value="red"': scenario.replace('"red"', '"left"')}.get(wrong, scenario.replace('"purple"', '"1"'))
        (folder / "scenario.xml").write_text(new)
        with pytest.raises(InvalidInputError) as caught:
            read_team(folder)
        assert told in str(caught.value)


@looped(
    ("file", "old", "new", "told"),
    [
        ("RA.xml", "dark-blue</", "dark-blue red</", "RA.xml:4: the symbol 'red' occurs twice"),
        ("RA.xml", "dark-blue</", "1..4</", "RA.xml:4: '1..4' cannot be a symbol"),
        ("RA.xml", "dark-blue</", "a:b</", "RA.xml:4: 'a:b' cannot be a symbol"),
        ("RA.xml", "dark-blue</", f"{'x' * 101}</", "cannot be a symbol"),
        ("RA.xml", 'nbValues="3"', 'nbValues="4"', "RA.xml:4: nbValues is 4, but there are 3"),
        ("RA.xml", "symbol X", "word X", "RA.xml:9: invalid parameters"),
        ("RA.xml", "symbol X int Y", "int X int Y", "RA.xml:11: predicate warm: unknown name 'red'"),
        ("RA.xml", "eq(Y, 2)", "eq(Y, red)", "RA.xml:11: predicate warm: argument 1 of 'eq' must be a symbol"),
        ("RA.xml", "eq(Y, 2)", "eq(X, 2)", "argument 2 of 'eq' must be a symbol, but '2' is integer"),
        ("RA.xml", "eq(Y, 2)", "lt(X, red)", "argument 1 of 'lt' must be integer, but 'X' is a symbol"),
        ("RA.xml", "set(red, ", "set(red, 1, ", "a member of the set must be a symbol"),
        ("RA.xml", 'scope="A N"', 'scope="N A"', "RA.xml:14: warm expects a symbol, but 'N' is an integer"),
        (
            "RA.xml",
            'reference="warm" scope="A N"',
            'reference="eq" scope="A N"',
            "'A' is a symbol, but 'N' is an int",
        ),
        (
            "RA.xml",
            'reference="warm" scope="A N"',
            'reference="eq" scope="A 1"',
            "'A' is a symbol, but '1' is an int",
        ),
        ("RA.xml", 'reference="warm" scope="A N"', 'reference="lt" scope="A N"', "lt expects an integer, but 'A'"),
        ("RA.xml", "set(red, ", "set(rad, ", "RA.xml:9: no domain of the team has the symbol 'rad' (did you mean"),
        ("RA.xml", "</variables>", '</variables><topics><topic name="t" x="A"/></topics>', "x of the topic: the expr"),
        (
            "RA.xml",
            "</variables>",
            '</variables><topics><topic name="t" x="if(eq(A,rad),1,2)"/></topics>',
            "RA.xml:7: no domain of the team has the symbol 'rad' (did you mean",
        ),
        ("RB.xml", "|red 2", "|2 2", "RB.xml:5: '2' is a number in a column of symbols"),
        ("RB.xml", "|red 2", "|red pink", "RB.xml:5: 'pink' is not an integer"),
        ("RB.xml", 'scope="A B"', 'scope="N B"', "RB.xml:8: r expects a symbol, but 'N' is"),
        ("RB.xml", "green 1|red 2", "1 1|2 2", "RB.xml:8: r expects an integer, but 'A' is a symbol"),
    ],
)
def test_symbols_and_integers_are_not_mixed(tmp_path: Path, file: str, old: str, new: str, told: str) -> None:
    folder = files(tmp_path)
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    with pytest.raises(InvalidInputError) as caught:
        read_team(folder)
    assert len(caught.value.diagnostics) == 1, caught.value
    assert told in str(caught.value)


# --- built in Python ----------------------------------------------------------------------------------------------

RED, GREEN = Constant(0), Constant(1)
COLOURS = Domain("D", (range(2),), ("red", "green"))


def built() -> Team:
    own = {
        "RA": [Variable("A", COLOURS)],
        "RB": [Variable("B", COLOURS)],
        "RC": [Variable("N", Domain("I", (range(3),)))],
    }
    either = Predicate("p", ("X", "Y"), Apply("or", (Apply("eq", (Name("X"), RED)), Apply("eq", (Name("Y"), GREEN)))))
    relation = Relation("r", 2, Semantics.CONFLICTS, ((0, 0), (1, 2)))
    constraints = [
        Constraint("P", either, ("A", "B"), ("A", "B")),
        Constraint("R", relation, ("A", "N"), ("A", "N")),
    ]
    return assemble("t", own, constraints)


def test_what_is_a_symbol_follows_from_the_domains(tmp_path: Path) -> None:
    team = built()
    check_team(team)
    assert team["RB"].shared[0].definition.symbolic == ("X", "Y")
    assert team["RC"].symbols == ("red", "green")
    assert team["RC"].shared[0].definition.symbolic == (0,)
    write_team(team, tmp_path / "t")
    assert read_team(tmp_path / "t") == team
    assert "or(eq(X,'red'),eq(Y,'green'))" in (tmp_path / "t" / "RB.xml").read_text()


def changed(team: Team, name: str, **fields: object) -> Team:
    return replace(team, robots=tuple(replace(r, **fields) if r.name == name else r for r in team.robots))  # type: ignore[arg-type]


def variable(symbols: tuple[str, ...], *ranges: range) -> tuple[Variable, ...]:
    return (Variable("A", Domain("D", ranges or (range(2),), symbols)),)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"variables": variable(("red", "blue"))}, "robot RB: its symbols differ from those of 'RA'"),
        ({"variables": variable(("red", "red"))}, "robot RA, domain D: a symbol occurs twice"),
        ({"variables": variable(("red", "7"))}, "robot RA, domain D: '7' cannot be a symbol"),
        (
            {"variables": variable(("red", "green"), range(3))},
            "robot RA, domain D: the value 2 of",
        ),
        ({"symbols": ("x",)}, "robot RA: its symbolic domains have different tables of symbols"),
    ],
)
def test_tables_that_are_none(fields: dict[str, object], told: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        check_team(changed(built(), "RA", **fields))
    assert told in str(caught.value)


def test_a_constraint_that_was_not_marked() -> None:
    body = Apply("eq", (Name("X"), RED))
    private = (Constraint("P", Predicate("p", ("X",), body), ("A",), ("A",), None),)
    robot = Robot("RA", (Variable("A", COLOURS),), private=private)
    with pytest.raises(InvalidInputError, match="p expects an integer, but 'A' is a symbol"):
        check_team(Team("t", (robot,)))
    unknown = Relation("r", 1, Semantics.SUPPORTS, ((5,),), symbolic=(0,))
    robot = replace(robot, private=(Constraint("P", unknown, ("A",), ("A",), None),))
    with pytest.raises(InvalidInputError, match="the value 5 in column 0 is not the code of a symbol"):
        check_team(Team("t", (robot,)))


def test_a_value_that_is_no_symbol_cannot_be_added() -> None:
    team = replace(built(), scenario=(ScenarioEvent((AddValue("A", 2),)),))
    with pytest.raises(InvalidInputError, match="the value 2 of 'A' is not the code of a symbol"):
        check_team(team)


def test_an_empty_relation_may_be_over_a_symbol_and_an_integer(tmp_path: Path) -> None:
    for semantics, solutions in (("supports", 0), ("conflicts", 3 * 3 * 3)):
        empty = f'<relation name="r" arity="2" semantics="{semantics}"/>'
        text = B.replace('<relation name="r" semantics="supports">green 1|red 2</relation>', empty)
        folder = tmp_path / semantics
        write_files(folder, {"RA.xml": A, "RB.xml": text.replace('<agent name="RC"/>', "")})
        team = read_team(folder)
        (constraint,) = team["RB"].shared
        allowed = [
            (one, other)
            for one in team.variables["A"].domain
            for other in team.variables["B"].domain
            if constraint.price({"A": one, "B": other}) == 0
        ]
        assert len(allowed) * 3 == solutions
        write_team(team, tmp_path / f"{semantics}-again")
        assert read_team(tmp_path / f"{semantics}-again")["RB"].shared == (constraint,)


def test_two_symbols_are_not_reported_as_tasks(tmp_path: Path) -> None:
    team = read_team(files(tmp_path))
    binary = Domain("D", (range(2),), ("red", "green"))
    alone = replace(team["RA"], variables=(Variable("RA.A", binary),), private=(), children=())
    assert task_table(Team("one", (alone,)), {"RA.A": "red"}) == []
    plain = replace(alone, variables=(Variable("RA.A", Domain("D", (range(2),))),))
    assert task_table(Team("one", (plain,)), {"RA.A": 1}) != []


def test_a_topic_compares_a_symbolic_variable_with_symbols(tmp_path: Path) -> None:
    folder = files(tmp_path)
    text = (folder / "RA.xml").read_text()
    topic = """<topics><topic name="t" x="if(eq(A,'dark-blue'),N,7)" y="0"/></topics>"""
    (folder / "RA.xml").write_text(text.replace("</variables>", f"</variables>{topic}"))
    team = read_team(folder)
    (read,) = team["RA"].topics
    code = team["RA"].symbol_table.index("dark-blue")
    assert read.x == Apply("if", (Apply("eq", (Name("A"), Constant(code))), Name("N"), Constant(7)))
    check_team(team)
    write_team(team, tmp_path / "again")
    assert read_team(tmp_path / "again")["RA"].topics == (read,)
