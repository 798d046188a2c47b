"""XCSP3 instances: each kind means what its specification says, by evaluations that share nothing with the reader."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.formats.diagnostics import InvalidInputError
from robochoc.formats.dialects.dialect import ExportOptions, ImportOptions, ImportResult
from robochoc.formats.dialects.registry import recognise
from robochoc.formats.dialects.xcsp3 import DIALECT
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized, user_cost
from robochoc.model.problem import Team
from robochoc.model.team_edits import without_robots
from robochoc.solver.central import CentralSolver
from tests.support import brute_force
from tests.support.cases import looped
from tests.support.cost_problems import cost_of, random_cost_team
from tests.support.problems import random_team
from tests.support.xcsp3_forms import FORMS
from tests.support.xcsp3_random import KINDS, random_instance

Row = tuple[int, ...]
ABC = "<var id='a'> 0..2 </var><var id='b'> 0..2 </var><var id='c'> 0..2 </var>"
ARRAY = "<array id='x' size='[3]'> 0..2 </array>"


def imported(path: Path, body: str, kind: str = "CSP", options: ImportOptions | None = None) -> ImportResult:
    file = path / "problem.xml"
    file.write_text(f'<instance format="XCSP3" type="{kind}">{body}</instance>')
    return DIALECT.read([file], options or ImportOptions())


def csp(path: Path, constraints: str, variables: str = ARRAY) -> Team:
    body = f"<variables>{variables}</variables><constraints>{constraints}</constraints>"
    return imported(path, body).team


def solutions(team: Team) -> set[Row]:
    return {tuple(found.values()) for found in brute_force.solutions(team)}


def rows(*domains: range) -> Iterator[Row]:
    return itertools.product(*(domains or (range(3),) * 3))


@looped("form", FORMS)
def test_each_form_has_the_meaning_of_the_specification(form: str, tmp_path: Path) -> None:
    xml, truth = FORMS[form]
    assert solutions(csp(tmp_path, xml)) == {row for row in rows() if truth(*row)}


def test_terms_with_sets_are_alike_when_a_robot_is_absent(tmp_path: Path) -> None:
    """`docs/reference/absence.md`: a disjunction of alike conditions stays in force for the others."""
    at_an_end = "or(in(x[0],set(0,2)),in(x[1],set(0,2)),in(x[2],set(0,2)))"
    team = without_robots(csp(tmp_path, f"<intension> {at_an_end} </intension>"), ["x_2"])
    assert solutions(team) == {row for row in rows(range(3), range(3)) if row != (1, 1)}


def test_domains_of_arrays_holes_and_copies(tmp_path: Path) -> None:
    variables = """
      <var id="a"> -2..0 5 5 </var> <var id="b" as="a"/>
      <array id="m" size="[2][3]"><domain for="m[0][]"> 0 1 </domain><domain for="m[1][1..2]"> 7 </domain></array>
      <array id="n" size="[2][3]" as="m"/>
      <array id="o" size="[2]"><domain for="o[0]"> 1 </domain><domain for="others"> 2 3 </domain></array>"""
    found = csp(tmp_path, "<allEqual> m[][1] </allEqual>", variables)
    domains = {name: tuple(variable.domain) for name, variable in found.variables.items()}
    assert domains["a"] == domains["b"] == (-2, -1, 0, 5)
    assert [name for name in domains if name.startswith("n")] == ["n_0_0", "n_0_1", "n_0_2", "n_1_1", "n_1_2"]
    assert (domains["o_0"], domains["o_1"], domains["n_1_2"]) == ((1,), (2, 3), (7,))


def test_symbols_have_names_everywhere(tmp_path: Path) -> None:
    variables = (
        """<var id="a" type="symbolic"> red green </var><var id="b" type="symbolic"> green blue light-blue </var>"""
    )
    constraints = """<extension><list>a b</list><supports>(red,blue)(green,green)(red,light-blue)</supports></extension>
      <intension> ne(a,green) </intension><intension> in(b,set(green,blue)) </intension>"""
    team = csp(tmp_path, constraints, variables)
    (only,) = solutions(team)
    labels = [variable.domain.label(value) for variable, value in zip(team.variables.values(), only, strict=True)]
    assert labels == ["red", "blue"]
    assert len({variable.domain.symbols for variable in team.variables.values()}) == 1


OBJECTIVES: dict[str, tuple[str, Callable[..., int]]] = {
    "variable": ("<minimize> x[1] </minimize>", lambda _, y, __: y),
    "expression": ("<maximize> sub(mul(3,x[0]),add(mul(x[1],x[2]),2)) </maximize>", lambda x, y, z: 3 * x - y * z - 2),
    "sum": ("<minimize type='sum'><list> x[] </list><coeffs> 2 -3 1 </coeffs></minimize>",
            lambda x, y, z: 2 * x - 3 * y + z),
    "sum of products": ("<maximize type='sum'><list> x[0] x[1] </list><coeffs> x[1] x[2] </coeffs></maximize>",
                        lambda x, y, z: x * y + y * z),
    "maximum": ("<minimize type='maximum'> x[] </minimize>", lambda *v: max(v)),
    "minimum": ("<maximize type='minimum'><list> x[] </list></maximize>", lambda *v: min(v)),
    "product": ("<maximize type='product'> x[0] x[1] </maximize>", lambda x, y, _: x * y),
    "nValues": ("<minimize type='nValues'> x[] </minimize>", lambda *v: len(set(v))),
}  # fmt: skip


@looped("kind", OBJECTIVES)
def test_objectives_are_split_and_keep_the_optimum(kind: str, tmp_path: Path) -> None:
    xml, value = OBJECTIVES[kind]
    hard = "<intension> ne(x[0],x[1]) </intension><intension> gt(add(x[0],x[2]),1) </intension>"
    body = f"<variables>{ARRAY}</variables><constraints>{hard}</constraints><objectives>{xml}</objectives>"
    team = normalized(imported(tmp_path, body, "COP").team)
    best = (min if "minimize" in xml else max)(Fraction(value(*r)) for r in rows() if r[0] != r[1] and r[0] + r[2] > 1)
    answer = CentralSolver().solve(team)
    assert answer.cost is not None
    assert user_cost(team, answer.cost) == best


def test_a_wide_maximum_becomes_a_bound_that_is_a_variable(tmp_path: Path) -> None:
    body = """<variables><array id="x" size="[9]"> 0..3 </array></variables>
      <constraints><sum><list> x[0..2] </list><condition> (ge,7) </condition></sum></constraints>
      <objectives><minimize type="maximum"> x[] </minimize></objectives>"""
    found = imported(tmp_path, body, "COP")
    assert [note.kind for note in found.notes].count("auxiliary") == 1
    team = normalized(found.team)
    assert CentralSolver().solve(team).cost == 3


def test_the_number_of_values_of_many_variables_gets_auxiliary_variables(tmp_path: Path) -> None:
    """Whatever the constraints are, the optimum is that of brute force."""
    for seed in range(4):
        chance = Random(seed)
        apart = [pair for pair in itertools.combinations(range(7), 2) if chance.random() < 0.5]
        hard = "".join(f"<intension> ne(x[{i}],x[{j}]) </intension>" for i, j in apart)
        allowed = [row for row in itertools.product(range(4), repeat=7) if all(row[i] != row[j] for i, j in apart)]
        for direction, best in (("minimize", min), ("maximize", max)):
            body = f"""<variables><array id="x" size="[7]"> 0..3 </array></variables><constraints>{hard}</constraints>
              <objectives><{direction} type="nValues"> x[] </{direction}></objectives>"""
            found = imported(tmp_path, body, "COP")
            assert "auxiliary" in {note.kind for note in found.notes}
            assert max(len(one.variables) for one in found.team.constraints()) <= 3
            answer = CentralSolver().solve(normalized(found.team))
            truth = [len(set(row)) for row in allowed]
            assert (answer.cost is None) == (not truth), seed
            if answer.cost is not None:
                assert user_cost(normalized(found.team), answer.cost) == best(truth), (seed, direction)


def test_large_circuits_get_auxiliary_variables_that_are_determined(tmp_path: Path) -> None:
    """The solutions of the instance are those of brute force, each once, for all forms of circuits."""
    for seed in range(12):
        chance = Random(seed)
        number, start = chance.choice([(7, 0), (8, 1), (9, 0)]), chance.choice([0, 0, 2])
        nodes = range(start, start + number[0])
        domains = [sorted({*chance.sample(nodes, 2), *([node] if chance.random() < 0.4 else [])}) for node in nodes]
        domains[0] = sorted({*domains[0], *nodes[: 1 + number[1]]})
        fixed = chance.randint(3, len(nodes))
        size = chance.choice(["", f"<size> {fixed} </size>", "<size> s </size>"])
        words = "".join(
            f'<var id="x{node}"> {" ".join(map(str, domain))} </var>'
            for node, domain in zip(nodes, domains, strict=True)
        )
        variables = f'{words}<var id="s"> 2..20 </var>'
        names = " ".join(f"x{node}" for node in nodes)
        xml = f'<circuit><list startIndex="{start}"> {names} </list>{size}</circuit>'
        team = csp(tmp_path, xml, variables)
        truth = set()
        for row in itertools.product(*domains):
            length = circle([value - start for value in row])
            for last in range(2, 21):
                wanted = {"": length, "<size> s </size>": last}.get(size, fixed)
                if length > 1 and length == wanted:
                    truth.add((*row, last))
        found = [tuple(one.values())[: len(nodes) + 1] for one in brute_force.solutions(team)]
        assert len(found) == len(truth), seed
        assert set(found) == truth, seed
        assert len(team.robots) == len(nodes) + 1  # auxiliary variables belong to the robots of nodes


def circle(successors: list[int]) -> int:
    """The length of the one circle among nodes that do not follow themselves; 0 where there are several, or none."""
    moving = [node for node, after in enumerate(successors) if after != node]
    seen, node = [], moving[0] if moving else 0
    while node not in seen:
        seen.append(node)
        node = successors[node]
    return len(seen) if sorted(seen) == moving and node == seen[0] else 0


def test_owners_are_robots(tmp_path: Path) -> None:
    body = "<variables><array id='x' size='[2][2]'> 0 1 </array></variables>"
    found = imported(tmp_path, body, options=ImportOptions(owner=r"x\[(\d)\]", name="rows"))
    assert (found.team.name, found.team.order) == ("rows", ("r0", "r1"))
    assert found.names["x_0_1"] == "x[0][1]"
    for wrong in ("y", "("):
        with pytest.raises(InvalidInputError, match="--owner"):
            imported(tmp_path, body, options=ImportOptions(owner=wrong))


REFUSED = {
    "<stretch><list> x[] </list></stretch>": "<stretch> is not supported in <constraints>",
    "<intension> eq(x[0],sin(x[1])) </intension>": "'sin' is not supported",
    "<intension> neq(x[0],x[1]) </intension>": "'neq' is not supported (did you mean 'ne'?)",
    "<intension> eq(x[0],y) </intension>": "no variable 'y'",
    "<intension> eq(x[0] </intension>": "is not a valid expression",
    "<intension reifiedBy='x[0]'> eq(x[1],1) </intension>": "the attribute 'reifiedBy' is not supported in <intension>",
    "<allDifferent> x[7] </allDifferent>": "is not in the array",
    "<sum><list> x[] </list><condition> (about,3) </condition></sum>": "is not a valid condition",
    "<sum><list> x[] </list><coeffs> 1 </coeffs><condition> (le,3) </condition></sum>": "different lengths: 1 and 3",
    "<sum><list> x[] </list><coefs> 2 1 1 </coefs><condition> (le,3) </condition></sum>": "did you mean 'coeffs'?",
    "<sum><list> x[] </list><conditon> (le,3) </conditon></sum>": "write 'condition' instead of 'conditon'",
    "<sum><list> x[] </list><condition> (le,3) </condition><condition> (le,2) </condition></sum>": "a second",
    "<sum><list> x[] </list><list> x[] </list><condition> (le,3) </condition></sum>": "<sum> has a second <list>",
    "<extension><list> x[0] </list><supports> 1 </supports><conflicts> 2 </conflicts></extension>": "<conflicts> is",
    "<extension><list> x[0] x[1] </list><supports> (1 2,0) </supports></extension>": "'1 2' is not a valid integer",
    "<intension> eq(x[0],1 2) </intension>": "is not a valid expression",
    "<allDifferent><list> x[0] </list><list> x[1] x[2] </list></allDifferent>": "different lengths: 1 and 2",
    "<allDifferent><list> x[] </list><except> (1,1) </except></allDifferent>": "<except> has 2 values",
    "<ordered><list> x[] </list><lengths> 1 </lengths><operator> le </operator></ordered>": "1 lengths for 3 values",
    "<lex><list> x[0] </list><list> x[1] x[2] </list><operator> le </operator></lex>": "different lengths: 1 and 2",
    "<cumulative><origins> x[] </origins><lengths> 1 1 1 </lengths><heights> 1 1 1 </heights><ends> 1 </ends>"
    "<condition> (le,1) </condition></cumulative>": "different lengths: 3 and 3 and 3 and 1",
    "<noOverlap><origins> (x[0],1)(x[1],1) </origins><lengths> (1,1,1)(1,1,1) </lengths></noOverlap>": "2 and 3",
    "<binPacking><list> x[] </list><sizes> 1 1 1 </sizes><conditions> le,3 </conditions></binPacking>": "not a list",
    "<maximum><list/><condition> (ge,1) </condition></maximum>": "maximum is empty",
    "<maximumArg rank='best'><list> x[] </list><condition> (ge,1) </condition></maximumArg>": 'rank="best"',
    "<cardinality><list> x[] </list><values closed='yes'> 1 </values><occurs> 1 </occurs></cardinality>": "true or",
    "<channel><list> x[] </list><list> x[] </list><list> x[] </list></channel>": "<channel> has 3 lists",
    "<group><intension> eq(%0,1) </intension><args> x[0] x[1] </args></group>": "2 arguments for a template of 1",
    "<group><args> x[0] </args></group>": "an element is missing in <group>",
    "<group><stretch> %0 </stretch><args> x[0] </args></group>": "<stretch> is not supported in <group>",
    "<group><intension> eq(%0,1) </intension></group>": "<group> has no <args>",
    "<group><allEqual> %0 </allEqual><allEqual> %0 </allEqual><args> x[] </args></group>": "a second element",
    "<group><intension> eq(%0,%4) </intension><args> x[0] </args></group>": "no argument for %4",
    "<intension> eq(%0,1) </intension>": "outside <group>",
    "<extension type='hybrid-1'><list> x[] </list><supports/></extension>": "hybrid",
    "<extension><list> x[] </list><supports> (1,2) </supports></extension>": "2 values",
    "<extension><list> x[0] x[0] </list><supports> 1 2 </supports></extension>": "single values for 2 variables",
    "<extension><list> x[0] add(x[1],1) </list><supports> (1,2) </supports></extension>": "contains an expression",
    "<element><list> x[] </list><index rank='first'> x[0] </index><value> 1 </value></element>": "rank",
    "<cumulative><origins> x[] </origins><lengths> 1 1 1 </lengths><heights> 1 1 1 </heights>"
    "<condition> (ge,1) </condition></cumulative>": "<cumulative> with ge is not supported",
}


@looped("xml", REFUSED)
def test_what_has_no_counterpart_is_refused_by_name_with_its_line(xml: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError) as refused:
        csp(tmp_path, f"\n\n{xml}")
    (mistake,) = refused.value.diagnostics
    assert REFUSED[xml] in f"{mistake.message} ({mistake.hint})"
    assert mistake.line == 3


def test_unknown_parts_anywhere_in_a_constraint_are_refused(tmp_path: Path) -> None:
    """Each element of each form gets an unknown child, an unknown attribute and a text in turn."""
    drawn = [random_instance(seed) for seed in range(KINDS)]
    forms = [(xml, ARRAY) for xml, _ in FORMS.values()] + [(one.constraints[0], one.variables) for one in drawn]
    for xml, variables in forms:
        elements = [match.end() - 1 for match in re.finditer(r"<\w[^>/]*>", xml)]
        ends = [match.start() for match in re.finditer(r"</\w+>", xml)]
        changed = [f"{xml[:place]} strange='1'{xml[place:]}" for place in elements]
        changed += [f"{xml[:place]}<strange/>{xml[place:]}" for place in ends]
        changed += [f"{xml[:place]} strange {xml[place:]}" for place in ends]
        for wrong in changed:
            with pytest.raises(InvalidInputError) as refused:
                csp(tmp_path, f"\n{wrong}", variables)
            (mistake,) = refused.value.diagnostics
            assert " strange " in wrong or "strange" in f"{mistake.message} {mistake.hint}", wrong
            assert mistake.line == 2, wrong


def test_unknown_parts_outside_of_constraints_are_refused(tmp_path: Path) -> None:
    whole = """<instance format="XCSP3" type="COP" id="it" note="a remark">
      <variables note="all">
        <var id="a" type="symbolic" note="a symbol"> red blue </var><var id="b" as="a"/>
        <array id="x" size="[2]" class="main">
          <domain for="x[0]"> 0 1 </domain><domain for="others"> 0 2 </domain></array>
        <array id="y" size="[2]" as="x"/>
      </variables>
      <constraints><block class="one" note="remark">
        <group id="g"><allEqual id="c"> %... </allEqual><args> x[] </args></group>
        <slide><list offset="1" collect="2"> x[] </list><allEqual> %0 %1 </allEqual></slide></block></constraints>
      <objectives><minimize type="sum" id="o"><list> x[] </list><coeffs> 1 2 </coeffs></minimize></objectives>
      <annotations><decision anything="goes"> x[] </decision></annotations>
    </instance>"""
    file = tmp_path / "whole.xml"
    file.write_text(whole)
    assert len(DIALECT.read([file], ImportOptions()).team.variables) == 6
    advice = {"annotations", "decision"}
    heads = [match for match in re.finditer(r"<(\w+)[^>]*?(?=/?>)", whole) if match[1] not in advice]
    ends = [match for match in re.finditer(r"</(\w+)>", whole) if match[1] not in advice]
    for place, part in [
        *((match.end(), " strange='1'") for match in heads),
        *((match.start(), "<strange/>") for match in ends),
        *((match.start(), " strange ") for match in ends if match[1] != "var"),  # there, it is one more symbol
    ]:
        file.write_text(whole[:place] + part + whole[place:])
        with pytest.raises(InvalidInputError) as refused:
            DIALECT.read([file], ImportOptions())
        assert "strange" in str(refused.value), whole[place - 30 : place + 10] + part


def deep(levels: int) -> str:
    return "<block>" * levels + "</block>" * levels


def instance(variables: str = '<var id="x"> 0 1 </var>', constraints: str = "", head: str = 'type="CSP"') -> str:
    body = f"<variables>{variables}</variables><constraints>{constraints}</constraints>"
    return f'<instance format="XCSP3" {head}>{body}</instance>'


HOSTILE = {
    '<!DOCTYPE a [<!ENTITY b "c">]>' + instance("&b;"): "DOCTYPE",
    instance("&b;"): "not well-formed",
    instance(head='type="WCSP"'): 'type="WCSP"',
    instance(""): "no variables",
    instance('<array id="x" size="[99999][99999]"> 0 </array>'): "9,999,800,001 variables",
    instance('<var id="x"> 0..999999999999 </var>'): "more than 100,000 values",
    instance('<var id="x"> 0..infinity </var>'): "infinite domain",
    instance('<var id="x"/>'): "has no domain",
    instance('<var id="x" as="x"/>'): "is not an id declared above",
    instance(constraints=deep(60)): "nested deeper",
    instance(constraints=f"<intension> {'neg(' * 999}x{')' * 999} </intension>"): "nested too deeply",
    instance(
        constraints="<sum><list> 1x999999999 </list><condition> (le,1) </condition></sum>"
    ): "a list has more than",
    instance('<var id="x" as="y"/><var id="y" as="x"/>'): 'as="y" is not an id declared above',
    "<a>" * 3000: "not well-formed",
    **{
        instance('<array id="x" size="[999]"> 0 1 </array>', wide): "999 members of a list in pairs"
        for wide in (
            "<nValues><list> x[] </list><condition> (ge,2) </condition></nValues>",
            "<lex><list> x[] </list><list> x[] </list><operator> lt </operator></lex>",
            "<maximumArg><list> x[] </list><condition> (ge,2) </condition></maximumArg>",
        )
    },
    instance().replace("</instance>", "<objectives><minimize> x </minimize></objectives></instance>"): 'type="COP"',
    instance(head='type="COP"').replace("</instance>", "<objectives/></instance>"): "an element is missing",
}


@looped("text", HOSTILE)
def test_hostile_files_get_one_message(text: str, tmp_path: Path) -> None:
    file = tmp_path / "hostile.xml"
    file.write_text(text)
    with pytest.raises(InvalidInputError) as refused:
        DIALECT.read([file], ImportOptions())
    assert len(refused.value.diagnostics) == 1
    assert HOSTILE[text] in str(refused.value)


def test_other_encodings_hide_no_doctype(tmp_path: Path) -> None:
    file = tmp_path / "hidden.xml"
    file.write_bytes('<!DOCTYPE a><instance format="XCSP3" type="CSP"/>'.encode("utf-16"))
    with pytest.raises(InvalidInputError, match="not UTF-8"):
        DIALECT.read([file], ImportOptions())


@pytest.mark.parametrize("batch", [0, *(pytest.param(one, marks=pytest.mark.slow) for one in range(1, 11))])
def test_teams_written_and_read_again_have_the_same_optimum(batch: int, tmp_path: Path) -> None:
    assert DIALECT.write is not None
    for seed in range(3 * batch, 3 * batch + 3):
        team = random_cost_team(Random(seed)) if seed % 2 else random_team(Random(seed))
        ((name, document),) = DIALECT.write(team, ExportOptions()).files.items()
        file = tmp_path / name
        file.write_bytes(document)
        assert recognise(file) is DIALECT
        again = normalized(DIALECT.read([file], ImportOptions()).team)
        first, second = CentralSolver().solve(team), CentralSolver().solve(again)
        assert first.verdict is second.verdict or team.kind is not again.kind, seed
        if first.cost is not None and second.cost is not None:
            assert user_cost(again, second.cost) == first.cost == cost_of(first.assignment, list(team.constraints())), (
                seed
            )


def with_units(team: Team, chance: Random) -> Team:
    """`team` with decimals, a constant, and perhaps maximised."""
    units = CostUnits(maximize=chance.random() < 0.5, places=chance.choice((0, 2)), constant=0)
    robots = [replace(robot, costs=units) for robot in team.robots]
    robots[0] = replace(robots[0], costs=replace(units, constant=chance.randint(-30, 30)))
    return replace(team, robots=tuple(robots))


@pytest.mark.parametrize("batch", [0, *(pytest.param(one, marks=pytest.mark.slow) for one in range(1, 11))])
def test_units_directions_and_constants_are_written(batch: int, tmp_path: Path) -> None:
    assert DIALECT.write is not None
    for seed in range(3 * batch, 3 * batch + 3):
        chance = Random(seed)
        team = with_units(random_cost_team(chance), chance)
        ((name, document),) = DIALECT.write(team, ExportOptions()).files.items()
        (tmp_path / name).write_bytes(document)
        again = normalized(DIALECT.read([tmp_path / name], ImportOptions()).team)
        small = normalized(team)
        first, second = CentralSolver().solve(small), CentralSolver().solve(again)
        assert first.verdict is second.verdict, seed
        if first.cost is not None and second.cost is not None:
            scale = 10**small.user_units.places
            assert user_cost(again, second.cost) == user_cost(small, first.cost) * scale, seed
