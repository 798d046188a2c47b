"""Global constraints of XCSP 2.1: what they say, held against plain Python, and how they are written."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import InvalidInputError, check_team, read_robot, read_team, robot_in, robot_xml
from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.global_constraints import read_form
from robochoc.model.constraint import GlobalPredicate
from robochoc.model.expression import Apply, Name
from robochoc.model.problem import Constraint, Domain, Robot, Team, Variable
from tests.support.broken_case import write_files
from tests.support.cases import looped
from tests.support.examples import examples

FILE = """\
<instance>
  <presentation type="DisWCSP"/>
  <domains><domain name="D">-1..3</domain><domain name="S" type="symbolic">red green blue</domain></domains>
  <variables>
    <variable name="A" domain="D"/><variable name="B" domain="D"/><variable name="C" domain="D"/>
    <variable name="R" domain="S"/><variable name="T" domain="S"/>
  </variables>
  <constraints>
    <constraint name="G" {constraint}</constraint>
  </constraints>
  <agents_neighbours/>
</instance>
"""
ABC = "A B C"


def held(constraint: str, tmp_path: Path) -> Constraint:
    (tmp_path / "RA.xml").write_text(FILE.format(constraint=constraint))
    robot = read_robot(tmp_path / "RA.xml")
    assert robot_in(robot_xml(robot), "RA") == robot
    return robot.private[0]


def stated(reference: str, parameters: str, scope: str = ABC) -> str:
    return f'reference="global:{reference}" scope="{scope}"><parameters>{parameters}</parameters>'


def peak(tasks: Sequence[tuple[int, int, int]]) -> int:
    """The largest sum of heights at any time, looked for second by second."""
    times = range(-9, 12)
    return max(sum(height for begin, end, height in tasks if begin <= now < end) for now in times)


MEANINGS: list[tuple[str, Callable[[int, int, int], bool]]] = [
    (stated("allDifferent", "[ A B C ]"), lambda a, b, c: len({a, b, c}) == 3),
    (stated("allDifferent", "[ A 2 B C ]"), lambda a, b, c: len({a, b, c, 2}) == 4),
    (f'reference="global:allDifferent" scope="{ABC}">', lambda a, b, c: len({a, b, c}) == 3),
    (stated("weightedSum", "[ {1 A} {-2 B}{3 C} ] <le/> 2"), lambda a, b, c: a - 2 * b + 3 * c <= 2),
    (stated("weightedSum", "[ {2 A} {1 B} ] <eq/> C"), lambda a, b, c: 2 * a + b == c),
    (stated("weightedSum", "[ {-1 A} {1 B} {1 4} ]\n<ne/> C"), lambda a, b, c: b - a + 4 != c),
    (stated("weightedSum", "[ {1 A} {1 B} {1 C} ] <gt/> 4"), lambda a, b, c: a + b + c > 4),
    (stated("element", "A [ B 3 B 1 ] C"), lambda a, b, c: 1 <= a <= 4 and [b, 3, b, 1][a - 1] == c),
    (stated("element", "[ A [ B C ] 2 ]"), lambda a, b, c: 1 <= a <= 2 and [b, c][a - 1] == 2),
    (
        stated("cumulative", "[ {A 2 1} {B 3 2} {C 1 1} ] 2"),
        lambda a, b, c: peak([(a, a + 2, 1), (b, b + 3, 2), (c, c + 1, 1)]) <= 2,
    ),
    (
        stated("cumulative", "[ {A B <nil/> 1} {<nil/> 2 C 1} {1 <nil/> 3 1} ] <le/> 2"),
        lambda a, b, c: b >= 0 and peak([(a, a + b, 1), (c - 2, c, 1), (1, 3, 1)]) <= 2,
    ),
    (
        stated("cumulative", "[ {A 1 B C} {0 2 2} ] 3"),
        lambda a, b, c: c >= 0 and a + 1 == b and peak([(a, b, c), (0, 2, 2)]) <= 3,
    ),
]


@looped(("constraint", "meaning"), MEANINGS)
def test_what_it_says(constraint: str, meaning: Callable[[int, int, int], bool], tmp_path: Path) -> None:
    read = held(constraint, tmp_path)
    assert isinstance(read.definition, GlobalPredicate)
    for values in itertools.product(range(-1, 4), repeat=3):
        assert read.allows(dict(zip("ABC", values, strict=True))) is meaning(*values), values


def test_it_is_written_as_it_was(tmp_path: Path) -> None:
    read = held(stated("weightedSum", "[ {1 A} {-2 B} {3 C} ] <le/> 2"), tmp_path)
    robot = Robot("RA", read_robot(tmp_path / "RA.xml").variables, private=(read,))
    assert b"<parameters>[ { 1 A } { -2 B } { 3 C } ]<le/> 2</parameters>" in robot_xml(robot)
    assert read.cost == float("inf")
    assert held('cost="0.5" ' + stated("allDifferent", "[ A B C ]"), tmp_path).cost == 5


def test_symbols_may_all_differ(tmp_path: Path) -> None:
    read = held(stated("allDifferent", "[ R T ]", "R T"), tmp_path)
    assert not read.allows({"R": 1, "T": 1})
    assert read.allows({"R": 1, "T": 2})


@looped(
    ("constraint", "told"),
    [
        (stated("allEqual", "[ A B C ]"), "unknown global constraint 'global:allEqual' (supported: global:all"),
        (stated("allDifferent", "[ A ]", "A"), "expected a list of two terms or more, found the end"),
        (stated("allDifferent", "[ A B C"), "expected a variable or an integer, found the end"),
        (stated("allDifferent", "A B C"), "expected '[', found 'X0'"),
        (stated("allDifferent", "[ A B ] C"), "expected the end, found 'X2'"),
        (stated("allDifferent", "[ A B ]"), "'C' is in the scope but not among the parameters"),
        (stated("allDifferent", "[ A B C V ]"), "the parameter 'V' is not in the scope"),
        (stated("allDifferent", "[ A B R ]", "A B R"), "global:allDifferent expects a symbol, but 'A' is"),
        (stated("allDifferent", f"[ A B C {' '.join(map(str, range(90)))} ]"), "has 93 terms (use at most 80"),
        (stated("weightedSum", "[ {1 A} {1 B} {1 C} ] 3"), "expected <eq/> or <ne/> or"),
        (stated("weightedSum", "[ {A 1} {1 B} {1 C} ] <le/> 3"), "an integer before each variable"),
        (stated("weightedSum", "[ {1 A} {1 B} {1 R} ] <le/> 3", "A B R"), "expects an integer, but 'R' is"),
        (stated("element", "A [ ] B", "A B"), "a list of one term or more"),
        (stated("element", "A [ 1.5 C ] B"), "expected a variable or an integer, found '1.5'"),
        (stated("cumulative", "[ {A B} {C 1 1} ] 2"), "in which one may be <nil/>"),
        (stated("cumulative", "[ {A <nil/> <nil/> 1} {B C 1} ] 2"), "in which one may be <nil/>"),
        (stated("cumulative", "[ {A -1 1} {B C 1} ] 2"), "durations and heights of 0 or more"),
        (stated("cumulative", "[ {A 1 1} {B C 1} ] <eq/> 2"), "expected a variable or an integer, found '<eq/>'"),
        ('reference="eq" scope="A B"><parameters>A <eq/> B</parameters>', "<eq/> is not allowed in these parameters"),
        (stated("element", "A [ B ] <or/> C"), "<or> does not belong in <parameters>"),
    ],
)
def test_what_is_none(constraint: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "RA.xml").write_text(FILE.format(constraint=constraint))
    with pytest.raises(InvalidInputError) as caught:
        read_robot(tmp_path / "RA.xml")
    assert len(caught.value.diagnostics) == 1
    assert told in str(caught.value)
    assert caught.value.diagnostics[0].line == 9


def test_over_several_robots_the_lowest_holds_it(tmp_path: Path) -> None:
    def file(own: str, parents: str = "", children: str = "") -> str:
        return (
            '<instance><presentation type="DisCSP"/><domains><domain name="D">1..3</domain></domains>'
            f'<variables><variable name="{own}" domain="D"/></variables><agents_neighbours>'
            f"<agents_parent>{parents}</agents_parent><agents_children>{children}</agents_children>"
            "</agents_neighbours></instance>"
        )

    shared = f"<constraints><constraint name='G' {stated('allDifferent', '[ A B C ]')}</constraint></constraints>"
    above = '<agent name="RA"/>'
    write_files(
        tmp_path,
        {
            "RA.xml": file("A", children='<agent name="RB"/><agent name="RC"/>'),
            "RB.xml": file("B", above, '<agent name="RC"/>'),
            "RC.xml": file("C", f'{above}<agent name="RB">{shared}</agent>'),
        },
    )
    team = read_team(tmp_path)
    assert team["RA"].children[1].variables == ("A",)
    assert not team["RC"].shared[0].allows({"A": 1, "B": 2, "C": 1})


# --- built in Python ----------------------------------------------------------------------------------------------


def one_robot(definition: GlobalPredicate, *terms: str | int) -> Team:
    own = tuple(Variable(name, Domain("D", (range(3),))) for name in ABC.split())
    return Team("t", (Robot("RA", own, private=(Constraint("G", definition, terms, terms, None),)),))


def test_a_body_that_says_something_else() -> None:
    right = read_form("global:allDifferent", "[ X0 X1 ]")
    check_team(one_robot(right, "A", "B"))
    wrong = replace(right, body=Apply("eq", (Name("X0"), Name("X1"))))
    for definition, told in (
        (wrong, "the body of global:allDifferent does not follow from its form"),
        (replace(right, form="[ X0"), "expected a variable or an integer, found the end"),
        (
            replace(right, form=7),  # type: ignore[arg-type]
            "expected '[', found the end",
        ),
        (replace(right, name="global:none"), "unknown global constraint 'global:none'"),
    ):
        with pytest.raises(InvalidInputError) as caught:
            check_team(one_robot(definition, "A", "B"))
        assert told in str(caught.value)
    with pytest.raises(InvalidInputError, match="global:allDifferent has an integer as a parameter"):
        check_team(one_robot(right, "A", 1))


@examples(40, slow=2000)
@given(st.text(alphabet="[]{} X01<le/>-nil", max_size=40), st.sampled_from(["weightedSum", "element", "cumulative"]))
def test_any_form_is_read_or_refused(form: str, kind: str) -> None:
    robot = Robot("RA", (Variable("A", Domain("D", (range(2),))),))
    try:
        definition = read_form(f"global:{kind}", form)
    except MistakeError:
        return
    own = tuple(Variable(name, robot.variables[0].domain) for name in definition.parameters)
    private = (Constraint("G", definition, definition.parameters, definition.parameters, None),)
    if own:
        team = Team("t", (replace(robot, variables=own, private=private),))
        check_team(team)
        assert robot_in(robot_xml(team.robots[0]), "RA").private[0].definition.body == definition.body  # type: ignore[union-attr]
