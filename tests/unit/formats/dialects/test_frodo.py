"""FRODO's XCSP 2.1 with its oddities, and XCSP 2.x without agents: small files, written for these tests."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from lxml import etree

from robochoc.formats import InvalidInputError, check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign, recognise
from robochoc.formats.dialects.xcsp21.probabilities import random_variables
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, ConstraintModel, Domain, Predicate, Relation, Semantics, Variable
from robochoc.model.expression import Type, parse
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.foreign_problems import imported, optimum, random_problem, refused, written

HEAD = '<instance xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">'


def frodo(body: str, *, maximize: bool = False, agents: str = "a b", domain: str = "1..3") -> str:
    listed = "".join(f'<agent name="{name}"/>' for name in agents.split())
    variables = "".join(f'<variable name="x{name}" domain="d" agent="{name}"/>' for name in agents.split())
    return f"""<!-- a licence -->{HEAD}
        <presentation name="?" maximize="{str(maximize).lower()}" format="XCSP 2.1_FRODO">
        <stats name="s">1</stats></presentation><agents nbAgents="7">{listed}</agents>
        <domains><domain name="d" nbValues="99">{domain}</domain></domains>
        <variables>{variables}</variables>
        {body}</instance>"""


def soft(text: str, more: str = "", scope: str = "xa xb") -> str:
    return f"""<relations><relation name="r" arity="2" nbTuples="1" semantics="soft" {more}>{text}</relation>
        </relations>
        <constraints><constraint name="c" scope="{scope}" arity="2" reference="r"/></constraints>"""


@looped(
    ("text", "more", "maximize", "best"),
    [
        ("4: 1 1 | 1 2 | 7: 2 2", 'defaultCost="9"', False, 4),
        ("4: 1 1 |\n\n 1 2 | 7 :2 2", "", False, 4),
        ("4: 1 1 | 1 2 | 2: 1 1", "", False, 2),  # the last of two equal tuples wins
        ("infinity: 1 1|2 2|3 3", 'defaultCost="0.25"', False, Fraction(1, 4)),
        ("-3.5: 1 1 | 2e-1: 1 2", "", False, Fraction(-7, 2)),
        ("-infinity: 1 1|2 2|3 3", 'defaultCost="-2"', True, -2),
        ("10: 3 3 | -1: 1 2", 'defaultCost="-infinity"', True, 10),
        ("infinity: 1 1", "", False, None),
        ("", 'defaultCost="5"', False, 5),
        ("", "", False, None),
    ],
)
def test_costs_of_relations(text: str, more: str, maximize: bool, best: object, tmp_path: Path) -> None:  # noqa: FBT001
    found = imported(frodo(soft(text, more), maximize=maximize), tmp_path)
    check_team(found.team)
    assert optimum(found.team) == best
    assert found.dialect == "frodo"


def test_costs_of_zero_and_infinity_are_satisfaction(tmp_path: Path) -> None:
    hard = imported(frodo(soft("infinity: 1 1|2 2|3 3", 'defaultCost="0"')), tmp_path).team
    assert hard.kind is ProblemKind.DISCSP
    assert imported(frodo(soft("2: 1 1", 'defaultCost="0"')), tmp_path).team.kind is ProblemKind.DISWCSP


def test_decimals_are_told_with_their_scale(tmp_path: Path) -> None:
    found = imported(frodo(soft("0.125: 1 1", 'defaultCost="3"')), tmp_path)
    assert found.team.robots[0].costs.places == 3
    assert ("scale", "costs are decimals, stored as integers in units of 0.001") in found.notes


def test_costs_from_a_number_on_forbid(tmp_path: Path) -> None:
    text = frodo(soft("10000: 1 1|1 2|1 3 | 3: 2 2 | 9999: 2 1", 'defaultCost="20000"'))
    assert optimum(imported(text, tmp_path, infinity=10000).team) == 3
    kept = imported(text.replace("3: 2 2", "10000: 2 2"), tmp_path, infinity=9999).team
    assert optimum(kept) is None


FORMULAS = """<predicates><predicate name="p"><parameters> int X int Y </parameters><expression>
    <functional> or(false, ne(X, Y)) </functional></expression></predicate></predicates>
  <functions><function name="f" return="int"><parameters>int A int B int C</parameters>
    <expression><functional>if(gt(A,B),mul(A,C),neg(B))</functional></expression></function></functions>"""


def test_a_function_is_the_cost(tmp_path: Path) -> None:
    body = f"""{FORMULAS}<constraints>
      <constraint name="p1" arity="2" scope="xa xb" reference="p"><parameters>xa xb</parameters></constraint>
      <constraint name="f1" arity="2" scope="xa xb" reference="f"><parameters>xa xb -2</parameters></constraint>
      <constraint name="f2" arity="1" scope="xa" reference="f"><parameters>xa xa 5</parameters></constraint>
      </constraints>"""
    cheapest = min((-2 * a if a > b else -b) - a for a in (1, 2, 3) for b in (1, 2, 3) if a != b)
    dearest = max((-2 * a if a > b else -b) - a for a in (1, 2, 3) for b in (1, 2, 3) if a != b)
    assert optimum(imported(frodo(body), tmp_path).team) == cheapest
    assert optimum(imported(frodo(body, maximize=True), tmp_path).team) == dearest


def test_names_of_the_wild_are_renamed_and_told(tmp_path: Path) -> None:
    text = frodo(soft("0: 1 2", 'defaultCost="infinity"')).replace("xa", "Cart-1:i#S/2").replace('"b"', '"S 2"')
    found = imported(text, tmp_path)
    check_team(found.team)
    assert found.names == {"S_2": "S 2", "Cart_1_i_S_2": "Cart-1:i#S/2"}
    assert ("renamed", "Cart-1:i#S/2 is Cart_1_i_S_2") in found.notes


def test_a_shared_variable_gets_an_owner(tmp_path: Path) -> None:
    text = frodo(soft("0: 1 2", 'defaultCost="infinity"', scope="z xb")).replace(
        "</variables>", '<variable name="z" domain="d"/></variables>'
    )
    found = imported(text, tmp_path)
    assert found.team.owner["z"] == "b"
    assert ("shared variable", "z has no owner in the file: now b") in found.notes


def test_agents_without_variables_are_left_out(tmp_path: Path) -> None:
    text = frodo(soft("0: 1 2", 'defaultCost="infinity"')).replace("<agents nbAgents", '<agents self="" nbAgents')
    found = imported(text.replace('<agent name="a"/>', '<agent name="idle"/>'), tmp_path)
    assert found.team.order == ("b", "a")
    assert ("left out", "agents without variables are left out: idle") in found.notes


def plain(variables: str = "V0 V1 V2") -> str:
    listed = "".join(f'<variable name="{name}" domain="D"/>' for name in variables.split())
    return f"""<instance><presentation name="?" format="XCSP 2.0"/><domains><domain name="D">0 2..3 1</domain></domains>
      <variables nbVariables="3">{listed}</variables><constraints>
      <constraint name="C" scope="V0 V1 V2" reference="global:allDifferent"><parameters>[ V0 V1 V2 3 ]</parameters>
      </constraint></constraints></instance>"""


def test_without_agents_each_variable_is_a_robot(tmp_path: Path) -> None:
    found = imported(plain(), tmp_path)
    assert found.team.order == ("V0", "V1", "V2")
    assert len(list(found.team.constraints())) == 6
    assert optimum(found.team) == 0
    grouped = imported(plain(), tmp_path, owner="V[01]").team
    assert grouped.order == ("V0", "V1", "V2")
    assert imported(plain(), tmp_path, owner="(V)[01]").team.owner == {"V0": "V", "V1": "V", "V2": "V2"}


def test_older_files_say_owner(tmp_path: Path) -> None:
    text = plain().replace('name="V0"', 'name="V0" owner="b"').replace('name="V1"', 'name="V1" owner="a"')
    assert imported(text, tmp_path).team.order == ("b", "a")


@pytest.mark.parametrize("knower", ["a", "b"])
def test_what_one_agent_alone_knows_is_partially_known(knower: str, tmp_path: Path) -> None:
    text = frodo(soft("infinity: 1 1", 'defaultCost="0"').replace('name="c"', f'name="c" agent="{knower}"'))
    found = imported(text, tmp_path)
    check_team(found.team)
    models = {one.model for robot in found.team.robots for one in robot.shared}
    assert models == {ConstraintModel.PKC}
    assert any(note.kind == "partially known" for note in found.notes)
    public = imported(text.replace(f'agent="{knower}" scope', 'agent="PUBLIC" scope'), tmp_path)
    assert {one.model for robot in public.team.robots for one in robot.shared} == {ConstraintModel.TKC}


def test_what_one_agent_alone_knows_of_three_is_told_to_all(tmp_path: Path) -> None:
    body = soft("0: 1 2 3", 'defaultCost="infinity"', scope="xa xb xe").replace('name="c"', 'name="c" agent="b"')
    found = imported(frodo(body, agents="a b e"), tmp_path)
    assert [note.kind for note in found.notes] == ["known to more"]


SPLIT = """<instance><presentation name="p{me}" format="XCSP 2.1_FRODO"/><agents self="{me}">
  <agent name="a"/><agent name="b"/></agents>
  <domains><domain name="d">0..1</domain></domains>
  <variables><variable name="x" domain="d" agent="a"/><variable name="y" domain="d" agent="b"/></variables>
  <relations><relation name="r" arity="2" semantics="soft" defaultCost="4">{cost}: 0 1</relation></relations>
  <constraints><constraint name="c" scope="x y" arity="2" reference="r"/></constraints></instance>"""


def test_one_file_an_agent_counts_copies_once(tmp_path: Path) -> None:
    files = [tmp_path / "a.xcsp", tmp_path / "b.xcsp"]
    for file in files:
        file.write_text(SPLIT.format(me=file.stem, cost=3))
    assert optimum(read_foreign(files, ImportOptions()).team) == 3
    with pytest.raises(InvalidInputError, match="the file of agent b, which owns y, is missing"):
        read_foreign(files[:1], ImportOptions())
    files[1].write_text(SPLIT.format(me="b", cost=2))
    with pytest.raises(InvalidInputError, match="the constraint 'c' has different costs"):
        read_foreign(files, ImportOptions())
    files[1].write_text(SPLIT.format(me="a", cost=3))
    with pytest.raises(InvalidInputError, match="is a second file of agent a; the first is"):
        read_foreign(files, ImportOptions())


LAW = '<probabilities><probability name="q" semantics="soft" arity="1">{}</probability></probabilities>'
OF_Q = '<constraints><constraint name="z" scope="xa" reference="q"/></constraints></instance>'
OF_W = '<constraints><constraint name="z" scope="w" reference="q"/></constraints>'
RANDOM = '<variable name="w" domain="d" type="random"/></variables>'


@looped(
    ("old", "new", "message"),
    [
        ("</variables>", RANDOM, "the random variable 'w' has no probabilities (add a constraint on it"),
        ("</relations>", f"</relations>{LAW.format('2: 1')}", "'2' is not a probability"),
        ("</relations>", f"</relations>{LAW.format('nan: 1')}", "'nan' is not a probability"),
        ("</relations>", f"</relations>{LAW.format('0.5: 1 2')}", "'1 2' is not an outcome"),
        ("</relations>", f"</relations>{LAW.format('0.5: 1 | 0.5: 1')}", "the outcome 1 occurs twice"),
        ("</variables>", f"{RANDOM}{LAW.format('1: 0')}{OF_W}", "the outcome 0 is not in the domain of 'w'"),
        ("</instance>", LAW.format("1: 1") + OF_Q, "are not those of one random variable"),
        ("1..3<", "1.5 2<", "the value 1.5 is not an integer (scale the values to integers)"),
        ("1..3<", "-infinity..3<", "'-infinity..3' is not an integer"),
        ("1..3<", "1..999999999<", "the domain has more than 100000 values"),
        ("1..3<", "<", "the domain of 'xa' is empty"),
        ("4: 1 1", "-infinity: 1 1", "the cost -infinity would be better than all others (write a number"),
        ("4: 1 1", "NaN: 1 1", "'NaN' is not a cost"),
        ("4: 1 1", "0.00000000001: 1 1", "has 11 decimal places"),
        ("4: 1 1", "1 1", "the tuple '1 1' has no cost"),
        ("4: 1 1", "4: 1 1 1", "has 2 values, but other tuples have 3"),
        ('reference="r"', 'reference="s"', "there is no 's' (known relations, predicates and functions: r)"),
        ('scope="xa xb"', 'scope="xa xc"', "there is no variable 'xc'"),
        ('scope="xa xb"', 'scope="xa"', "the scope has 1 variables, but tuples of 'r' have 2 values"),
        ('name="c"', 'name="c" agent="e"', "the constraint 'c' is known only to e, which owns none of its variables"),
        (
            'reference="r"',
            'reference="global:circuit"',
            "the global constraint 'circuit' is not supported (use one of allDifferent",
        ),
        ('domain="d"', 'domain="e"', "there is no domain 'e'"),
        ("<relations>", "<routes/><relations>", "<routes> is not supported in <instance>"),
        ('<agent name="b"/>', '<agent name="a"/>', "duplicate agent 'a'"),
    ],
)
def test_what_is_refused_is_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = frodo(soft("4: 1 1 | 1 2", ""))
    assert old in text
    assert message in refused(text.replace(old, new), tmp_path)


def test_rounded_probabilities_stay_positive(tmp_path: Path) -> None:
    rare = dict.fromkeys(range(6), Fraction(1, 10_000))
    (found,), is_rounded = random_variables({"w": rare | dict.fromkeys(range(6, 9), Fraction(3_333, 10_000))}, 1)
    assert (sum(found.weights), min(found.weights), is_rounded) == (10, 1, True)
    rows = " | ".join(f"0.05: {value}" for value in range(1, 21))
    text = frodo(soft("0.00000001: 1 1", scope="xa w"), domain="1..20")
    text = text.replace("</variables>", f"{RANDOM}{LAW.format(rows)}{OF_W}")
    assert "'w' has 20 outcomes, but probabilities with 1 decimal place (use fewer outcomes" in refused(text, tmp_path)


def test_expressions_in_other_forms_are_refused(tmp_path: Path) -> None:
    text = frodo(
        FORMULAS.replace("functional> or", "infix> or").replace(
            "</functional></expression></p", "</infix></expression></p"
        )
    )
    assert "'p' has only an expression in the form infix" in refused(text, tmp_path)


def test_a_unit_of_costs_divides_them(tmp_path: Path) -> None:
    text = frodo(soft("125: 1 1 | infinity: 2 2", 'defaultCost="300"'))
    stats = '<stats name="unit of costs">{}</stats></presentation>'
    found = imported(text.replace("</presentation>", stats.format("0.01")), tmp_path)
    assert optimum(found.team) == Fraction(5, 4)
    for wrong in ("0.02", "0.0", "1", "0.0000000001", "x"):
        with pytest.raises(InvalidInputError, match="the unit of costs"):
            imported(text.replace("</presentation>", stats.format(wrong)), tmp_path)


def test_an_export_has_relations_of_integers_that_all_agents_know() -> None:
    chance = Random("relations")
    for _ in range(20):
        _, team = random_problem(chance)
        (content,) = written("frodo", team).values()
        root = etree.fromstring(content)
        assert root.find("predicates") is None
        assert root.find("functions") is None
        assert all(one.get("agent") is None for one in root.iterfind("constraints/constraint"))
        relations = root.findall("relations/relation")
        costs = [word for one in relations for word in re.findall(r"([^ |:]+):", one.text or "")]
        costs += [one.get("defaultCost", "") for one in relations]
        assert all(re.fullmatch(r"-?(\d+|infinity)", cost) for cost in costs)


def test_an_export_in_intension_keeps_formulas_and_the_optimum(tmp_path: Path) -> None:
    chance = Random("intension")
    kept = 0
    for _ in range(40):
        problem, team = random_problem(chance)
        (content,) = written("frodo", team, intension=True).values()
        kept += content.count(b"<predicate ") + content.count(b"<function ")
        assert optimum(imported(content.decode(), tmp_path).team) == problem.optimum()
    assert kept


def test_a_constraint_that_is_too_large_for_a_relation_needs_intension() -> None:
    names = ("x", "y", "z")
    predicate = Predicate("p", ("X", "Y", "Z"), parse("lt(add(X,Y),Z)", ("X", "Y", "Z"), Type.BOOLEAN))
    variables = {name: [Variable(name, Domain("d", (range(101),)))] for name in names}
    team = assemble("t", variables, [Constraint("c", predicate, names, names)])
    with pytest.raises(UnsupportedError, match=r"1,030,301 combinations of values; .*--intension writes"):
        written("frodo", team)
    (content,) = written("frodo", team, intension=True).values()
    assert content.count(b"<predicate ") == 1


def test_costs_and_values_beyond_32_bits_are_refused() -> None:
    def team_of(value: int, cost: int) -> Team:
        relation = Relation("r", 1, Semantics.SOFT, ((value,),), (cost,), 0)
        variables = {"a": [Variable("x", Domain("d", (range(value, value + 1), range(value + 2, value + 3))))]}
        return assemble("t", variables, [Constraint("c", relation, ("x",), ("x",))], kind=ProblemKind.DISWCSP)

    assert written("frodo", team_of(1, 2**31 - 3))
    with pytest.raises(UnsupportedError, match="costs may add up to 2,147,483,648, but"):
        written("frodo", team_of(1, 2**31 - 1))
    with pytest.raises(UnsupportedError, match="the value 2,147,483,649 of x is too large"):
        written("frodo", team_of(2**31 - 1, 1))


PLAIN = """<instance>
<presentation name="pair"{format}/>
<domains nbDomains="1"><domain name="D" nbValues="2">1..2</domain></domains>
<variables nbVariables="2"><variable name="P" domain="D"/><variable name="Q" domain="D"/></variables>
<relations nbRelations="1"><relation name="R" arity="2" nbTuples="2" semantics="supports">1 2|2 1</relation></relations>
<constraints nbConstraints="1"><constraint name="c" arity="2" scope="P Q" reference="R"/></constraints>
</instance>"""


def test_networks_without_a_known_format_are_recognised_by_their_contents(tmp_path: Path) -> None:
    for stated in ("", ' format="1.1"', ' format="XCSP 2.0"', ' type="CSP"'):
        found = imported(PLAIN.format(format=stated), tmp_path)
        assert (found.dialect, len(found.team.variables)) == ("frodo", 2)
        assert sum(1 for _ in found.team.constraints()) == 1
    for own in (' type="DisCSP"', ' type="DisWCSP" format="1.1"'):
        path = tmp_path / "own.xml"
        path.write_text(PLAIN.format(format=own))
        assert recognise(path) is None


def test_parts_without_a_meaning_here_are_refused(tmp_path: Path) -> None:
    body = soft("2: 1 1", 'defaultCost="0"')
    for now, then, message in (
        (
            'reference="r"/>',
            'reference="r"><parameters>xb xa</parameters></constraint>',
            "<parameters> is not supported",
        ),
        ('name="c"', 'name="c" model="PKC"', "the attribute 'model' is not supported in <constraint>"),
        ('defaultCost="0"', 'defaultcost="0"', "the attribute 'defaultcost' is not supported in <relation>"),
        ('maximize="false"', 'maximise="true"', "the attribute 'maximise' is not supported in <presentation>"),
        ("2: 1 1<", "2: 1 1 <b/><", "<b> is not allowed inside <relation>"),
    ):
        whole = frodo(body)
        assert now in whole
        assert message in refused(whole.replace(now, then), tmp_path)
