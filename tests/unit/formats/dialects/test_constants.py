"""Parts of an XCSP3 instance that depend on no variable: they count, forbid, or are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import robochoc
from robochoc.formats import InvalidInputError

XCSP3 = """<instance format="XCSP3" type="{kind}">
  <variables><var id="x"> 1..3 </var><var id="y"> 1..3 </var></variables>
  <constraints><intension> ne(x,y) </intension>{constraint}</constraints>{objective}
</instance>"""


def solved(tmp_path: Path, constraint: str = "", objective: str = "") -> tuple[str, object]:
    """Return verdict and cost of an instance with a constraint, or an objective that is minimised."""
    file = tmp_path / "constant.xml"
    written = f"<objectives><minimize> {objective} </minimize></objectives>" if objective else ""
    limited = f"<intension> {constraint} </intension>" if constraint else ""
    kind = "COP" if objective else "CSP"
    file.write_text(XCSP3.format(kind=kind, constraint=limited, objective=written))
    outcome = robochoc.load(file).solve("central")
    return outcome.verdict, outcome.cost


@pytest.mark.parametrize(
    ("objective", "cost"),
    [
        ("add(x,5)", 6),
        ("add(x,pow(2,3),y)", 11),
        ("sub(add(x,y),abs(-4))", -1),
        ("add(y,min(4,7),mul(2,3),neg(dist(1,9)))", 3),
        ("add(mul(2,x),if(gt(1,2),10,20))", 22),
    ],
)
def test_every_constant_of_an_objective_counts(objective: str, cost: int, tmp_path: Path) -> None:
    assert solved(tmp_path, objective=objective) == ("optimal", cost)


def test_an_undefined_constant_leaves_no_solution(tmp_path: Path) -> None:
    assert solved(tmp_path, objective="add(x,div(2,0))")[0] == "no-solution"
    assert solved(tmp_path, constraint="gt(div(2,0),1)")[0] == "no-solution"


@pytest.mark.parametrize("large", ["pow(9,50)", "mul(pow(9,15),pow(9,15))"])
def test_constants_beyond_64_bits_are_refused(large: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"xml:3: the constant .* is beyond the limit of 2\^63"):
        solved(tmp_path, constraint=f"lt(1,{large})")
    with pytest.raises(InvalidInputError, match="is beyond the limit"):
        solved(tmp_path, objective=f"add(x,{large})")
    with pytest.raises(InvalidInputError, match="may reach"):
        solved(tmp_path, constraint=f"lt(x,{large})")
