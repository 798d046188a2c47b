"""XCSP3 instances: each kind means what its specification says, by evaluations that share nothing with the reader."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.formats.diagnostics import InvalidInputError
from robochoc.formats.dialects.dialect import Imported, ImportOptions
from robochoc.formats.dialects.registry import recognise
from robochoc.formats.dialects.xcsp3 import DIALECT
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized, told_cost
from robochoc.model.problem import Team
from robochoc.solver.central import CentralSolver
from tests.support.cost_problems import cost_of, random_cost_team
from tests.support.problems import random_team

Row = tuple[int, ...]
Truth = Callable[..., bool]
ABC = "<var id='a'> 0..2 </var><var id='b'> 0..2 </var><var id='c'> 0..2 </var>"
ARRAY = "<array id='x' size='[3]'> 0..2 </array>"


def imported(path: Path, body: str, kind: str = "CSP", options: ImportOptions | None = None) -> Imported:
    file = path / "problem.xml"
    file.write_text(f'<instance format="XCSP3" type="{kind}">{body}</instance>')
    return DIALECT.read([file], options or ImportOptions())


def csp(path: Path, constraints: str, variables: str = ARRAY) -> Team:
    body = f"<variables>{variables}</variables><constraints>{constraints}</constraints>"
    return imported(path, body).team


def solutions(team: Team) -> set[Row]:
    domains = [tuple(variable.domain) for variable in team.variables.values()]
    return {
        row
        for row in itertools.product(*domains)
        if all(one.allows(dict(zip(team.variables, row, strict=True))) for one in team.constraints())
    }


def rows(*domains: range) -> Iterator[Row]:
    return itertools.product(*(domains or (range(3),) * 3))


def lists(*words: str) -> str:
    return "".join(f"<list> {word} </list>" for word in words)


KINDS: dict[str, tuple[str, Truth]] = {
    "intension": ("<intension> le(add(x[0],x[1]),x[2]) </intension>", lambda x, y, z: x + y <= z),
    "function": ("<intension><function> imp(eq(x[0],1),ne(x[1],x[2])) </function></intension>",
                 lambda x, y, z: x != 1 or y != z),
    "integers as Booleans": ("<intension> and(x[0],or(x[1],not(x[2]))) </intension>",
                             lambda x, y, z: x != 0 and (y != 0 or z == 0)),
    "Booleans as integers": ("<intension> eq(add(eq(x[0],1),gt(x[1],0)),x[2]) </intension>",
                             lambda x, y, z: (x == 1) + (y > 0) == z),
    "n-ary": ("<intension> or(eq(x[0],x[1],x[2]),xor(x[0],x[1],x[2])) </intension>",
              lambda x, y, z: x == y == z or ((x > 0) + (y > 0) + (z > 0)) % 2 == 1),
    "sets": ("<intension> and(in(x[0],set(0,2)),notin(x[1],set(1)),in(x[2],set(x[0],add(x[1],1)))) </intension>",
             lambda x, y, z: x in {0, 2} and y != 1 and z in {x, y + 1}),
    "operators": ("<intension> eq(dist(sqr(x[0]),mod(x[1],2)),if(x[2],neg(-1),div(x[0],2))) </intension>",
                  lambda x, y, z: abs(x * x - y % 2) == (1 if z else x // 2)),
    "division by zero": ("<intension> ge(div(2,x[0]),x[1]) </intension>", lambda x, y, _: x != 0 and 2 // x >= y),
    "allDifferent": ("<allDifferent> x[] </allDifferent>", lambda *v: len(set(v)) == 3),
    "allDifferent except": ("<allDifferent><list> x[] </list><except> 0 </except></allDifferent>",
                            lambda *v: len([w for w in v if w]) == len({w for w in v if w})),
    "allDifferent of expressions": ("<allDifferent> add(x[0],1) x[1] x[2] </allDifferent>",
                                    lambda x, y, z: len({x + 1, y, z}) == 3),
    "allDifferent of lists": (f"<allDifferent>{lists('x[0..1]', 'x[1..2]')}</allDifferent>",
                              lambda x, y, z: (x, y) != (y, z)),
    "allEqual": ("<allEqual> x[] </allEqual>", lambda x, y, z: x == y == z),
    "ordered": ("<ordered><list> x[] </list><lengths> 1 0 </lengths><operator> le </operator></ordered>",
                lambda x, y, z: x + 1 <= y <= z),
    "lex": (f"<lex>{lists('x[0] x[1]', 'x[1] x[2]')}<operator> lt </operator></lex>", lambda x, y, z: (x, y) < (y, z)),
    "lex le": (f"<lex>{lists('x[0] x[1]', 'x[1] x[2]')}<operator> ge </operator></lex>",
               lambda x, y, z: (x, y) >= (y, z)),
    "sum": ("<sum><list> x[] </list><coeffs> 1 -2 3 </coeffs><condition> (in,1..3) </condition></sum>",
            lambda x, y, z: 1 <= x - 2 * y + 3 * z <= 3),
    "sum of variables": ("<sum><list> x[0] x[1] </list><condition> (ne,x[2]) </condition></sum>",
                         lambda x, y, z: x + y != z),
    "many coefficients": ("<sum><list> x[] </list><coeffs> 2x3 </coeffs><condition> (eq,4) </condition></sum>",
                          lambda *v: 2 * sum(v) == 4),
    "count": ("<count><list> x[] </list><values> 0 2 </values><condition> (ge,2) </condition></count>",
              lambda *v: sum(w in {0, 2} for w in v) >= 2),
    "count a variable": ("<count><list> x[0] x[1] </list><values> x[2] </values><condition>(eq,1)</condition></count>",
                         lambda x, y, z: (x == z) + (y == z) == 1),
    "nValues": ("<nValues><list> x[] </list><condition> (eq,2) </condition></nValues>", lambda *v: len(set(v)) == 2),
    "nValues except": ("<nValues><list> x[] </list><except> 1 </except><condition> (eq,1) </condition></nValues>",
                       lambda *v: len(set(v) - {1}) == 1),
    "cardinality": (("<cardinality><list> x[] </list><values closed='true'> 0 1 </values><occurs> 0..1 2 </occurs>"
                    "</cardinality>"), lambda *v: v.count(0) <= 1 and v.count(1) == 2 and 2 not in v),
    "minimum": ("<minimum><list> x[] </list><condition> (eq,1) </condition></minimum>", lambda *v: min(v) == 1),
    "maximum": ("<maximum><list> x[0..1] </list><condition> (lt,x[2]) </condition></maximum>",
                lambda x, y, z: max(x, y) < z),
    "element": ("<element><list> 2 0 1 </list><index> x[0] </index><value> x[1] </value></element>",
                lambda x, y, _: (2, 0, 1)[x] == y),
    "element of variables": (("<element><list> x[0] x[1] </list><index> x[2] </index><condition> (ge,1) </condition>"
                             "</element>"), lambda x, y, z: z < 2 and (x, y)[z] >= 1),
    "element from 1": (("<element><list startIndex='1'> x[0] x[1] </list><index> x[2] </index><value> 1 </value>"
                       "</element>"), lambda x, y, z: z >= 1 and (x, y)[z - 1] == 1),
    "element of a matrix": (("<element><matrix> (0,1)(2,0) </matrix><index> x[0] x[1] </index><value> x[2] </value>"
                            "</element>"), lambda x, y, z: max(x, y) < 2 and ((0, 1), (2, 0))[x][y] == z),
    "member": ("<element><list> x[0] x[1] </list><value> x[2] </value></element>", lambda x, y, z: z in {x, y}),
    "channel": ("<channel> x[] </channel>", lambda *v: all(v[w] == i for i, w in enumerate(v))),
    "instantiation": ("<instantiation><list> x[0] x[2] </list><values> 1 2 </values></instantiation>",
                      lambda x, _, z: (x, z) == (1, 2)),
    "clause": ("<clause> x[0] not(x[1]) </clause>", lambda x, y, _: x != 0 or y == 0),
    "precedence": ("<precedence><list> x[] </list><values> 0 1 2 </values></precedence>",
                   lambda *v: all(w == 0 or w - 1 in v[:i] for i, w in enumerate(v))),
    "circuit": ("<circuit> x[] </circuit>",
                lambda *v: v in {(1, 2, 0), (2, 0, 1), (1, 0, 2), (2, 1, 0), (0, 2, 1)}),
    "circuit of a size": ("<circuit><list> x[] </list><size> 3 </size></circuit>",
                          lambda *v: v in {(1, 2, 0), (2, 0, 1)}),
    "regular": (("<regular><list> x[] </list><transitions> (a,0,a)(a,1,b)(b,1,b)(b,2,c) </transitions><start>a</start>"
                "<final> b c </final></regular>"),
                lambda *v: v in {(0, 0, 1), (0, 1, 1), (1, 1, 1), (0, 1, 2), (1, 1, 2)}),
    "mdd": ("<mdd><list> x[] </list><transitions> (r,0,p)(r,1,q)(p,2,s)(q,0,s)(s,1,t) </transitions></mdd>",
            lambda *v: v in {(0, 2, 1), (1, 0, 1)}),
    "knapsack": (("<knapsack><list> x[] </list><weights> 1 2 3 </weights><condition> (le,6) </condition>"
                 "<profits> 2 1 1 </profits><condition> (ge,4) </condition></knapsack>"),
                 lambda x, y, z: x + 2 * y + 3 * z <= 6 and 2 * x + y + z >= 4),
    "binPacking": ("<binPacking><list> x[] </list><sizes> 2 3 1 </sizes><condition> (le,4) </condition></binPacking>",
                   lambda *v: all(sum(s for s, w in zip((2, 3, 1), v, strict=True) if w == b) <= 4 for b in v)),
    "noOverlap": ("<noOverlap><origins> x[] </origins><lengths> 1 2 0 </lengths></noOverlap>",
                  lambda x, y, _: x + 1 <= y or y + 2 <= x),
    "cumulative": (("<cumulative><origins> x[] </origins><lengths> 2 1 2 </lengths><heights> 1 2 1 </heights>"
                   "<condition> (le,2) </condition></cumulative>"),
                   lambda *v: all(sum(h for s, n, h in zip(v, (2, 1, 2), (1, 2, 1), strict=True) if s <= t < s + n) <= 2
                                  for t in range(5))),
    "cumulative of variables": (("<cumulative><origins> 0 x[0] </origins><lengths> 2 x[1] </lengths><heights> 1 2 "
                                "</heights><condition> (le,x[2]) </condition></cumulative>"),
                                lambda x, y, z: all((t < 2) + 2 * (x <= t < x + y) <= z for t in range(5))),
    "supports": ("<extension><list> x[0] x[2] </list><supports> (0,1)(2,*) </supports></extension>",
                 lambda x, _, z: (x, z) == (0, 1) or x == 2),
    "conflicts": ("<extension><list> x[] </list><conflicts> (0,*,1)(2,2,2) </conflicts></extension>",
                  lambda x, y, z: (x, z) != (0, 1) and (x, y, z) != (2, 2, 2)),
    "unary": ("<extension><list> x[1] </list><supports> 0 2..5 </supports></extension>", lambda _, y, __: y != 1),
    "no supports": ("<extension><list> x[0] x[1] </list><supports/></extension>", lambda *_: False),
    "a variable twice": ("<extension><list> x[0] x[0] </list><supports> (0,1)(1,1) </supports></extension>",
                         lambda x, *_: x == 1),
    "group": ("<group><intension> lt(%0,%1) </intension><args> x[0] x[1] </args><args> x[1] x[2] </args></group>",
              lambda x, y, z: x < y < z),
    "group of the rest": (("<group><sum><list> %1 %... </list><condition> (eq,%0) </condition></sum><args>3 x[]</args>"
                          "</group>"), lambda *v: sum(v) == 3),
    "slide": ("<slide><list> x[] </list><intension> le(%0,%1) </intension></slide>", lambda x, y, z: x <= y <= z),
    "circular slide": ("<slide circular='true'><list> x[] </list><intension> ne(%0,%1) </intension></slide>",
                       lambda x, y, z: x != y != z != x),
    "block": (("<block class='symmetry'><allEqual> x[0] x[1] </allEqual><block><allEqual> x[1..2] </allEqual></block>"
              "</block>"), lambda x, y, z: x == y == z),
}  # fmt: skip
"""Each kind over `x[0] x[1] x[2]` with the values 0 to 2, and what it means."""


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_means_what_it_says(kind: str, tmp_path: Path) -> None:
    xml, truth = KINDS[kind]
    assert solutions(csp(tmp_path, xml)) == {row for row in rows() if truth(*row)}


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


@pytest.mark.parametrize("kind", OBJECTIVES)
def test_objectives_are_split_and_keep_the_optimum(kind: str, tmp_path: Path) -> None:
    xml, value = OBJECTIVES[kind]
    hard = "<intension> ne(x[0],x[1]) </intension><intension> gt(add(x[0],x[2]),1) </intension>"
    body = f"<variables>{ARRAY}</variables><constraints>{hard}</constraints><objectives>{xml}</objectives>"
    team = normalized(imported(tmp_path, body, "COP").team)
    best = (min if "minimize" in xml else max)(Fraction(value(*r)) for r in rows() if r[0] != r[1] and r[0] + r[2] > 1)
    answer = CentralSolver().solve(team)
    assert answer.cost is not None
    assert told_cost(team, answer.cost) == best


def test_a_wide_maximum_becomes_a_bound_that_is_a_variable(tmp_path: Path) -> None:
    body = """<variables><array id="x" size="[9]"> 0..3 </array></variables>
      <constraints><sum><list> x[0..2] </list><condition> (ge,7) </condition></sum></constraints>
      <objectives><minimize type="maximum"> x[] </minimize></objectives>"""
    found = imported(tmp_path, body, "COP")
    assert [note.kind for note in found.notes].count("auxiliary") == 1
    team = normalized(found.team)
    assert CentralSolver().solve(team).cost == 3


def test_owners_are_robots(tmp_path: Path) -> None:
    body = "<variables><array id='x' size='[2][2]'> 0 1 </array></variables>"
    found = imported(tmp_path, body, options=ImportOptions(owner=r"x\[(\d)\]", name="rows"))
    assert (found.team.name, found.team.order) == ("rows", ("r0", "r1"))
    assert found.names["x_0_1"] == "x[0][1]"
    for wrong in ("y", "("):
        with pytest.raises(InvalidInputError, match="--owner"):
            imported(tmp_path, body, options=ImportOptions(owner=wrong))


REFUSED = {
    "<stretch><list> x[] </list></stretch>": "<stretch> has no counterpart",
    "<intension> eq(x[0],sin(x[1])) </intension>": "'sin' has no counterpart",
    "<intension> neq(x[0],x[1]) </intension>": "'neq' has no counterpart (did you mean 'ne'?)",
    "<intension> eq(x[0],y) </intension>": "no variable 'y'",
    "<intension> eq(x[0] </intension>": "is no expression",
    "<intension reifiedBy='x[0]'> eq(x[1],1) </intension>": "reifiedBy has no counterpart",
    "<allDifferent> x[7] </allDifferent>": "is not in the array",
    "<sum><list> x[] </list><condition> (about,3) </condition></sum>": "is no condition",
    "<sum><list> x[] </list><coeffs> 1 </coeffs><condition> (le,3) </condition></sum>": "3 terms, but 1",
    "<group><intension> eq(%0,%4) </intension><args> x[0] </args></group>": "%4 of only 1",
    "<intension> eq(%0,1) </intension>": "outside <group>",
    "<extension type='hybrid-1'><list> x[] </list><supports/></extension>": "hybrid",
    "<extension><list> x[] </list><supports> (1,2) </supports></extension>": "of 2",
    "<extension><list> x[0] x[0] </list><supports> 1 2 </supports></extension>": "single values for 2 variables",
    "<extension><list> x[0] add(x[1],1) </list><supports> (1,2) </supports></extension>": "an expression in the scope",
    "<element><list> x[] </list><index rank='first'> x[0] </index><value> 1 </value></element>": "rank",
    "<cumulative><origins> x[] </origins><lengths> 1 1 1 </lengths><heights> 1 1 1 </heights>"
    "<condition> (ge,1) </condition></cumulative>": "ge has no counterpart",
}


@pytest.mark.parametrize("xml", REFUSED)
def test_what_has_no_counterpart_is_refused_by_name_with_its_line(xml: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError) as refused:
        csp(tmp_path, f"\n\n{xml}")
    (mistake,) = refused.value.diagnostics
    assert REFUSED[xml] in f"{mistake.message} ({mistake.hint})"
    assert mistake.line == 3


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
    instance('<var id="x"> 0..infinity </var>'): "no integer",
    instance('<var id="x"/>'): "without a domain",
    instance('<var id="x" as="x"/>'): "names nothing",
    instance(constraints=deep(60)): "nested deeper",
    instance(constraints=f"<intension> {'neg(' * 999}x{')' * 999} </intension>"): "nested too deeply",
    instance(constraints="<sum><list> 1x999999999 </list><condition> (le,1) </condition></sum>"): "a list of more than",
    instance('<array id="x" size="[20]"> 0..9 </array>', "<circuit> x[] </circuit>"): "combinations of values",
}


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
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
        ((name, document),) = DIALECT.write(team).items()
        file = tmp_path / name
        file.write_bytes(document)
        assert recognise(file) is DIALECT
        again = normalized(DIALECT.read([file], ImportOptions()).team)
        first, second = CentralSolver().solve(team), CentralSolver().solve(again)
        assert first.verdict is second.verdict or team.kind is not again.kind, seed
        if first.cost is not None and second.cost is not None:
            assert told_cost(again, second.cost) == first.cost == cost_of(first.assignment, list(team.constraints())), (
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
        ((name, document),) = DIALECT.write(team).items()
        (tmp_path / name).write_bytes(document)
        again = normalized(DIALECT.read([tmp_path / name], ImportOptions()).team)
        small = normalized(team)
        first, second = CentralSolver().solve(small), CentralSolver().solve(again)
        assert first.verdict is second.verdict, seed
        if first.cost is not None and second.cost is not None:
            scale = 10**small.told_in.places
            assert told_cost(again, second.cost) == told_cost(small, first.cost) * scale, seed
