"""The mutation run itself: what it changes, and which tests should notice."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.mutation.__main__ import ROOT, commands_for, main
from tests.mutation.mutants import mutants_of

SOURCE = '''"""A docstring."""


class Word(Message, frozen=True):
    act = Act(1, 2)

    def in_words(self) -> str:
        return f"{1 + 1}"


def least(costs: list[int], limit: int | None = 3) -> int:
    """Return the least: é."""
    assert costs
    if not costs or costs[0] <= limit:
        return 0
    found = {"é": min(costs) - 1}; note("é", limit)
    return found["é"] if limit is None else False
'''
CHANGES = {
    ("limit: int | None = 3", "limit: int | None = (4)"),
    ("not costs or costs[0] <= limit", "(not costs and costs[0] <= limit)"),
    ("not costs", "(costs)"),
    ("costs[0] <= limit", "(costs[0] < limit)"),
    ("costs[0] <= limit", "(costs[0] > limit)"),
    ("costs[0]", "costs[(1)]"),
    ("return 0", "return None"),
    ("return 0", "return (1)"),
    ("min(costs) - 1", "(min(costs) + 1)"),
    ("min(costs)", "(max(costs))"),
    ("- 1", "- (2)"),
    ('note("é", limit)', "pass"),
    ('note("é", limit)', "(note(limit, 'é'))"),
    ('return found["é"] if limit is None else False', "return None"),
    ('found["é"] if limit is None else False', "(False if limit is None else found['é'])"),
    ("limit is None else", "(limit is not None) else"),
    ("else False", "else (True)"),
}


def test_each_mutant_is_the_file_with_one_change() -> None:
    mutants = mutants_of("least.py", SOURCE)
    assert {mutant.text for mutant in mutants} == {SOURCE.replace(old, new, 1) for old, new in CHANGES}
    assert [str(mutant) for mutant in mutants] == [f"least.py:{number}" for number in range(len(CHANGES))]
    assert all(mutant.diff.count("\n+") == 1 for mutant in mutants)


@pytest.mark.parametrize("path", ["robochoc/protocols/optimization/sfb.py", "robochoc/communication/host.py"])
def test_mutants_of_the_code_are_programs(path: str) -> None:
    mutants = mutants_of(path, (ROOT / path).read_text())
    assert len({mutant.text for mutant in mutants}) == len(mutants) > 100
    for mutant in mutants[::7]:
        ast.parse(mutant.text)


def test_a_mutant_meets_the_tests_of_its_file_then_those_of_all_who_use_it() -> None:
    bounding = [tests for tests, _ in commands_for("robochoc/protocols/optimization/bounding.py")]
    assert bounding[0] == ("tests/protocols/test_bounding.py",)
    assert {"tests/protocols/test_adopt.py", "tests/protocols/test_bnb_adopt.py"} <= set(bounding[1])
    assert bounding[2] == ("tests/conformance", "-k", "adopt or adopt-k or bnb-adopt or bnb-adopt-fdac")
    assert next(commands_for("robochoc/communication/host.py"))[0] == ("tests/unit/communication/test_host.py",)
    assert all(Path(ROOT, test).exists() for test in (*bounding[0], *bounding[1]))


@pytest.mark.slow
def test_a_mutant_is_killed_and_the_files_stay_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    path = "robochoc/communication/quiescence.py"
    before = (ROOT / path).read_text()
    place = before.index("if wave != self._wave")
    (mutant,) = (one for one in mutants_of(path, before) if place < one.start < place + 20)
    assert main(["--again", str(mutant)]) == 0
    assert capsys.readouterr().out == f"killed {mutant}\n1 killed, 0 hung, 0 survived\n"
    assert (ROOT / path).read_text() == before
