"""pyDCOP's YAML, cfn and wcsp: what is exported and imported again has the optimum of the tables it was drawn from."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from robochoc.formats import check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import dialect_called, read_foreign, recognise
from tests.support.examples import count
from tests.support.foreign_problems import optimum, random_problem, written


@pytest.mark.parametrize("name", ["pydcop", "cfn", "wcsp"])
@count("rounds", 40, 1000)
def test_there_and_back(rounds: int, name: str, tmp_path: Path) -> None:
    chance = Random(name)
    for _ in range(rounds):
        problem, team = random_problem(chance, plain=name == "wcsp")
        file, content = next(iter(written(name, team).items()))
        path = tmp_path / file
        path.write_bytes(content)
        assert recognise(path) is dialect_called(name)
        back = read_foreign([path], ImportOptions())
        check_team(back.team)
        assert optimum(back.team) == problem.optimum()
