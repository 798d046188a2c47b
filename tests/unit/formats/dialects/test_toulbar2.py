"""toulbar2's cfn and wcsp: tables, bounds, shared functions, loose signs."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from robochoc.formats import check_team
from robochoc.model.assembly import assemble
from robochoc.model.constraint import INFINITE, Constraint, Domain, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.foreign_files import CFN, WCSP
from tests.support.foreign_problems import imported, optimum, refused, written


def test_a_loose_cfn(tmp_path: Path) -> None:
    found = imported(CFN, tmp_path, "a.cfn")
    check_team(found.team)
    assert optimum(found.team) == Fraction("-3.1") + 4 - Fraction("1.5")
    assert {note.kind for note in found.notes} == {"truncated", "owner"}


def test_the_last_brace_of_a_cfn_may_be_missing(tmp_path: Path) -> None:
    whole = imported(CFN, tmp_path, "a.cfn").team
    assert imported(CFN.replace("} }", "}"), tmp_path, "a.cfn").team == whole


def test_a_wcsp_shares_tables_and_forbids_from_its_bound_on(tmp_path: Path) -> None:
    team = imported(WCSP, tmp_path, "a.wcsp").team
    check_team(team)
    assert optimum(team) == 3


def test_a_maximised_cfn(tmp_path: Path) -> None:
    text = '[["up" >-5.0] [2 2] [[[0] [1.0 0.5]] [[0 1] [-1.0 0.5 -2.0 5.5]]]]'
    assert optimum(imported(text, tmp_path, "a.cfn").team) == 6


@looped(
    ("name", "text", "message"),
    [
        ("a.cfn", CFN.replace("costs: t2", "type: salldiff params: []"), "'salldiff'"),
        ("a.cfn", CFN.replace("[0 1 2 3]", "[0 1 2]"), "3 costs instead of 4"),
        ("a.cfn", CFN.replace("<20", "20"), "the bound"),
        ("a.cfn", CFN.replace("a 0 2", "q 0 2"), "the variable x has no value 'q'"),
        ("a.wcsp", WCSP.replace("2 1 2 0 -1", "2 1 2 -1 alldiff"), "'alldiff'"),
        ("a.wcsp", WCSP.replace("0 -1", "0 -2"), "the shared function 2"),
        ("a.wcsp", WCSP[:30], "found the end of the file"),
        ("a.wcsp", WCSP.replace("0 0 1", "0 7 1"), "has no value 7"),
        ("a.wcsp", WCSP.replace(" 4 5", " 3 5"), ":9: unexpected '0' after the end of the problem"),
        ("a.wcsp", WCSP + "7", ":10: unexpected '7' after the end of the problem"),
        ("a.wcsp", WCSP.replace("1 1 9", "0 0 9"), ":5: the tuple 0 0 has two different costs"),
        ("a.cfn", CFN + "{}", ":10: unexpected '{' after the end of the problem"),
        ("a.cfn", CFN.replace("} }", "}, more: { } }"), ":9: expected the end of the problem, found 'more'"),
        ("a.cfn", CFN.replace("} }", ""), "expected a function, or '}', found the end of the file"),
        ("a.cfn", CFN.replace("2 3]}", "2 3], extra: 4}"), ":8: expected the end of the function, found 'extra'"),
        ("a.cfn", CFN.replace("scope: [x 2]", "scop: [x 2]"), ":8: expected 'scope', found 'scop'"),
        ("a.cfn", CFN.replace('"<20.00"', '"<20.00", by: me'), ":2: expected the end of the problem, found 'by'"),
        ("a.cfn", CFN.replace("b 2 inf", "a 0 3"), "a tuple has two different costs"),
    ],
)
def test_what_is_refused(name: str, text: str, message: str, tmp_path: Path) -> None:
    assert message in refused(text, tmp_path, name)


def test_an_export_has_only_costs_that_every_toulbar2_reads_exactly() -> None:
    def team_of(cost: int, places: int) -> Team:
        relation = Relation("r", 1, Semantics.SOFT, ((0,), (1,)), (cost, INFINITE), 0)
        variables = {"a": [Variable("x", Domain("bit", (range(2),)))]}
        units = CostUnits(maximize=True, places=places)
        constraint = Constraint("c", relation, ("x",), ("x",))
        return assemble("t", variables, [constraint], kind=ProblemKind.DISWCSP, costs=units)

    (content,) = written("cfn", team_of(15, 1)).values()
    assert b"inf" not in content
    assert b'"mustbe": ">-2.0"' in content
    assert b'"costs": ["0", 1.5, "1", -6.0]' in content
    assert written("cfn", team_of(2**53 - 2, 0))
    with pytest.raises(UnsupportedError, match="add up to 9,007,199,254,740,992: toulbar2"):
        written("cfn", team_of(2**53 - 1, 0))
    with pytest.raises(UnsupportedError, match=r"in units of 0\.000000001"):
        written("cfn", team_of(2**53 - 1, 9))
