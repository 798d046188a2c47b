"""What is exported and imported again has the same optimum and verdict as the tables it was drawn from."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

from robochoc.formats import check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import dialect_called, read_foreign, recognise
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Relation, Semantics, Variable
from robochoc.model.problem import Team
from tests.support.examples import count
from tests.support.foreign_problems import optimum, random_problem, written


@count("rounds", 60, 1000)
def test_frodo_there_and_back(rounds: int, tmp_path: Path) -> None:
    chance = Random("frodo")
    for _ in range(rounds):
        problem, team = random_problem(chance)
        assert _there_and_back("frodo", team, tmp_path) == problem.optimum() == optimum(team)


@count("rounds", 60, 1000)
def test_xdiscsp_there_and_back(rounds: int, tmp_path: Path) -> None:
    chance = Random("xdiscsp")
    for _ in range(rounds):
        problem, team = random_problem(chance, plain=True)
        assert _there_and_back("xdiscsp", team, tmp_path) == problem.optimum() == optimum(team)


def test_names_of_values_stand_in_a_comment(tmp_path: Path) -> None:
    colours = ("red", "green", "blue--")
    domain = Domain("colours", (range(2),), colours)
    scope = ("x", "y")
    relation = Relation("differ", 2, Semantics.CONFLICTS, ((0, 0), (1, 1)))
    team = assemble("t", {name: [Variable(name, domain)] for name in scope}, [Constraint("c", relation, scope, scope)])
    (content,) = written("frodo", team).values()
    assert b"<!-- colours: 0 is red, 1 is green -->" in content
    assert b'nbDomains="1"' in content
    assert _there_and_back("frodo", team, tmp_path) == 0


def _there_and_back(name: str, team: Team, folder: Path) -> Fraction | None:
    (content,) = written(name, team).values()
    path = folder / "there.xml"
    path.write_bytes(content)
    assert recognise(path) is dialect_called(name)
    back = read_foreign([path], ImportOptions())
    check_team(back.team)
    assert back.names == {}
    return optimum(back.team)
