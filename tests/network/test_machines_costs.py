"""Costs and values that people have, across machines: robots count in integers, the master tells the user's own."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest

from robochoc.formats.result import result_json
from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import (
    Constraint,
    CostUnits,
    Domain,
    Function,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)
from tests.support.deployments import Deployment, enrolled, finished, one_line, written
from tests.support.program import robochoc_within

pytestmark = pytest.mark.more

VALUES = Domain("D", (range(3),))


def team_with(definition: Relation | Function) -> Team:
    return assemble(
        "utilities",
        {"RA": [Variable("A", VALUES)], "RB": [Variable("B", VALUES)]},
        [Constraint("C", definition, ("A", "B"), ("A", "B"))],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=2, constant=-5),
    )


def test_a_utility_in_decimals_across_machines(site: Deployment) -> None:
    utility = Relation("R", 2, Semantics.SOFT, ((0, 1), (1, 2), (2, 2)), (-75, 250, 125), -1000)
    files = written(team_with(utility), site)
    master, _ = finished(site, files, "--team", files, "--protocol", "syncbb", "--json")
    told = master.object
    assert (told["verdict"], told["assignment"]) == ("optimal", {"A": 1, "B": 2})
    assert Decimal(str(told["cost"])) == Decimal("2.45")


def test_symbols_have_their_names_across_machines(site: Deployment) -> None:
    colours = Domain("colours", (range(2),), ("red", "green"))
    different = Relation("R", 2, Semantics.SUPPORTS, ((0, 1),))
    team = assemble(
        "colours",
        {"RA": [Variable("A", colours)], "RB": [Variable("B", colours)]},
        [Constraint("C", different, ("A", "B"), ("A", "B"))],
    )
    files = written(team, site)
    master, robots = finished(site, files, "--team", files, "--json")
    assert master.object["assignment"] == {"A": "red", "B": "green"}
    assert "A = red" in robots["RA"].output


def test_a_function_without_bounds_is_refused_where_domains_are_not_known(site: Deployment) -> None:
    product = Function("f", ("X", "Y"), parse("mul(X,Y)", ("X", "Y"), Type.INTEGER))
    files, tokens = enrolled(team_with(product), site)
    site.master("--team", files, "--protocol", "syncbb")
    robot = site.robot(files / "RB.xml", "--token", tokens["RB"])
    assert robot.status() == 2, robot.errors
    assert "has no bounds" in one_line(robot)
    assert "max(0, min(..., 100))" in one_line(robot)


def test_violated_constraints_are_reported_by_their_holders(site: Deployment) -> None:
    different = Relation("R", 2, Semantics.CONFLICTS, ((0, 0), (1, 1), (2, 2)))
    only = Domain("one", (range(1),))
    variables = {"RA": [Variable("A", only)], "RB": [Variable("B", only)], "RC": [Variable("C", VALUES)]}
    pairs = [("A", "B"), ("B", "C")]
    constraints = [Constraint(f"C{number}", different, pair, pair) for number, pair in enumerate(pairs)]
    files = written(assemble("impossible", variables, constraints), site)
    master, _ = finished(site, files, "--team", files, "--protocol", "dsa", "--json", status=3)
    assert master.object["violations"] == {
        "number": 1,
        "hard": 2,
        "first": [{"name": "", "robot": "RB", "variables": ["A", "B"]}],
    }
    assert master.object["reason"].endswith("the best assignment violates 1 of 2 hard constraints: one of RB over A B")


def test_robots_on_machines_begin_from_a_result(site: Deployment, tmp_path: Path) -> None:
    """They stay in the local optimum of the start: neither robot alone can improve it. The journal has it too."""
    utility = Relation("R", 2, Semantics.SOFT, ((0, 0), (1, 1)), (500, 900), 0)
    files = written(team_with(utility), site)
    result, journal = tmp_path / "result.json", tmp_path / "mgm.journal"
    known = Outcome(
        Verdict.SOLUTION, team="t", protocol="mgm", runtime="simulator", seed=0, assignment={"A": 0, "B": 0}
    )
    result.write_bytes(result_json(known))
    words = ("--team", files, "--protocol", "mgm", "--set", "cycles=4", "--json")
    master, _ = finished(site, files, *words, "--start", result, "--journal", journal)
    assert master.object["assignment"] == {"A": 0, "B": 0}
    replayed = robochoc_within("replay", journal, "--team", files, "--set", "cycles=4")
    assert replayed.returncode == 0, replayed.stderr
    assert "the same" in replayed.stdout
