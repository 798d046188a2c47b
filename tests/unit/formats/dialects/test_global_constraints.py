"""Global constraints of XCSP 2.1: what is imported allows what their definitions allow, by trying everything."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest

from robochoc.formats import check_team
from tests.support.cases import looped
from tests.support.foreign_problems import imported, refused, written

NAMES = "V0 V1 V2 V3"

Test = Callable[[int, int, int, int], bool]


def text_of(kind: str, parameters: str) -> str:
    listed = "".join(f'<variable name="{name}" domain="D"/>' for name in NAMES.split())
    return f"""<instance><presentation format="XCSP 2.1"/><domains><domain name="D">0..3</domain></domains>
      <variables>{listed}</variables><constraints><constraint name="C" arity="4" scope="{NAMES}"
      reference="global:{kind}"><parameters>{parameters}</parameters></constraint></constraints></instance>"""


def apart(x: int, y: int, dx: int, dy: int) -> bool:
    """Whether a box of 2 by 1 at (x, y) and one of dx by dy at (1, 1) do not overlap; an empty one overlaps nothing."""
    if dx == 0 or dy == 0:
        return True
    return not (x < 1 + dx and x + 2 > 1 and y < 1 + dy and y + 1 > 1)


def load(time: int, tasks: list[tuple[int, int, int]]) -> int:
    return sum(height for start, long, height in tasks if start <= time < start + long)


def peak(tasks: list[tuple[int, int, int]]) -> int:
    return max(load(time, tasks) for time in range(8))


CASES: list[tuple[str, str, Test]] = [
    ("allDifferent", "[ V0 V1 V2 V3 ]", lambda *v: len({*v}) == 4),
    ("allDifferent", " [V0 V1\n 2] ", lambda a, b, *_: len({a, b, 2}) == 3),
    ("allDifferent", "", lambda *v: len({*v}) == 4),
    ("weightedSum", "[ {1 V0} {-2 V1} {3 1} ] <le/> 2", lambda a, b, *_: a - 2 * b + 3 <= 2),
    ("weightedSum", "[ {1 V0}{1 V1}{1 V2} ]<ne/>4", lambda a, b, c, _: a + b + c != 4),
    ("weightedSum", "[{2 V0}] <gt/> V1", lambda a, b, *_: 2 * a > b),
    ("element", "V0 [ V1 V2 2 ] V3", lambda i, b, c, d: 1 <= i <= 3 and (b, c, 2)[i - 1] == d),
    ("elementFast", "V0 [ 3 0..1 V2 ] V3", lambda i, _, c, d: d in ({3}, {0, 1}, {c})[i - 1] if i >= 1 else False),
    ("element", "V0 [ 5 6 ] 9", lambda *_: False),
    (
        "cumulative",
        "[ {V0 2 1} {V1 1 2} {V2 V3 1} ] <le/> 2",
        lambda a, b, c, d: peak([(a, 2, 1), (b, 1, 2), (c, d, 1)]) <= 2,
    ),
    (
        "cumulative",
        "[ {V0 2 <nil/> 1} {V1 <nil/> V2 1} ] 1",
        lambda a, b, c, _: b <= c and peak([(a, 2, 1), (b, c - b, 1)]) <= 1,
    ),
    (
        "cumulative",
        "[ {V0 1 V1 1} {<nil/> 1 V2 1} ] 1",
        lambda a, b, c, _: b == a + 1 and (a, 0) != (c - 1, 1) and a != c - 1,
    ),
    ("diff2", "[ [{V0 V1} {2 1}] [{1 1} {V2 V3}] ]", apart),
]


@looped(("kind", "parameters", "allows"), CASES)
def test_it_allows_what_its_definition_allows(kind: str, parameters: str, allows: Test, tmp_path: Path) -> None:
    found = imported(text_of(kind, parameters), tmp_path)
    check_team(found.team)
    constraints = list(found.team.constraints())
    for values in itertools.product(range(4), repeat=4):
        chosen = dict(zip(NAMES.split(), values, strict=True))
        assert all(one.allows(chosen) for one in constraints) is bool(allows(*values)), values
    assert any(note.kind == "global" for note in found.notes)


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("weightedSum", "[ {1 V0} {-2 V1} ] <le/> 2"),
        ("element", "V0 [ V1 2 V2 ] V3"),
        ("cumulative", "[ {V0 2 1} {V1 V2 V3} ] <le/> 2"),
    ],
)
def test_what_frodo_has_too_is_exported_as_it_was(kind: str, parameters: str, tmp_path: Path) -> None:
    team = imported(text_of(kind, parameters), tmp_path).team
    (content,) = written("frodo", team, intension=True).values()
    assert f'reference="global:{kind}"' in content.decode()
    again = imported(content.decode(), tmp_path).team
    assert list(again.constraints()) == list(team.constraints())


@looped(
    ("kind", "parameters", "message"),
    [
        ("weightedSum", "[ {1 V0} ] <foo/> 3", "expected <eq/> or <ne/>"),
        ("weightedSum", "[ {1 V0 ] <eq/> 3", "expected '}', found ']'"),
        ("weightedSum", "[ {1 V9} ] <eq/> 3", "'V9' is not a variable"),
        ("element", "V0 [ 1 2", "expected a variable or an integer, found the end"),
        ("allDifferent", "[ V0 V1 ] V2", "have 'V2', expected the end"),
        ("cumulative", "[ {V0 1} ] 1", "{origin duration end height}, in which one may be <nil/>"),
        ("cumulative", "[" + "{V0 1 1}" * 101 + "] 1", "global:cumulative has 26 tasks"),
        ("allDifferent", "[" + " V0" * 501 + "]", "global:allDifferent has 501 terms"),
        ("allDifferent", "[" + " V0" * 9000 + "]", "global:allDifferent has too many parameters"),
    ],
)
def test_wrong_parameters_are_told(kind: str, parameters: str, message: str, tmp_path: Path) -> None:
    assert message in refused(text_of(kind, parameters), tmp_path)
