"""Random lists of tasks over every combination of keys: the guide's meaning by brute force, or one clear refusal."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import check_team
from robochoc.run import Options, Runtime, solve
from tests.support.foreign_problems import optimum
from tests.support.random_task_lists import Meaning, random_list, read_or_refused, written


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("count", [40, pytest.param(2_000, marks=pytest.mark.slow)])
def test_random_lists_have_the_meaning_of_the_guide_or_are_refused(count: int, tmp_path: Path) -> None:
    chance, solved, refused = Random(f"lists {count}"), 0, 0
    for number in range(count):
        told = random_list(chance)
        text = written(told, chance.choice(("block", "flow", "json")))
        path = tmp_path / f"list{number}.yaml"
        path.write_text(text)
        meaning = Meaning(told)
        expected = [*meaning.refusals()]
        team, error = read_or_refused(path)
        if team is None:
            assert any(one in error for one in expected), f"{error}\n{text}"
            refused += 1
            continue
        assert not [one for one in expected if one != "cannot be divided"], f"{expected}\n{text}"
        check_team(team)
        best = meaning.best()
        assert optimum(team) == best, text
        if solved % 2 == 0:
            found = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)).cost
            assert found is not None
            assert Fraction(found) == best, text
        solved += 1
    assert solved > count / 3
    assert refused > count / 20
