"""What is exported and imported again has the same optimum and verdict as the tables it was drawn from."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

from robochoc.formats import check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import dialect_called, read_foreign, recognise
from robochoc.model.problem import Team
from tests.support.examples import count
from tests.support.foreign_problems import optimum, random_problem


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


def _there_and_back(name: str, team: Team, folder: Path) -> Fraction | None:
    dialect = dialect_called(name)
    assert dialect
    assert dialect.write
    ((_, content),) = dialect.write(team).items()
    path = folder / "there.xml"
    path.write_bytes(content)
    assert recognise(path) is dialect
    back = read_foreign([path], ImportOptions())
    check_team(back.team)
    assert back.names == {}
    return optimum(back.team)
