"""Random XCSP3 instances over all supported forms have the solutions that the specification and ACE say."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.xcsp3 import DIALECT
from tests.support import brute_force
from tests.support.xcsp3_ace import solutions_by_ace
from tests.support.xcsp3_random import random_instance

Row = tuple[int, ...]


def solutions(file: Path) -> list[Row]:
    """The solutions of the imported team."""
    team = DIALECT.read([file], ImportOptions()).team
    return [tuple(found.values()) for found in brute_force.solutions(team)]


@pytest.mark.parametrize("seeds", [range(150), pytest.param(range(150, 3000), marks=pytest.mark.slow)])
def test_the_team_has_the_solutions_of_brute_force(seeds: range, tmp_path: Path) -> None:
    file = tmp_path / "random.xml"
    for seed in seeds:
        instance = random_instance(seed)
        file.write_text(instance.xml)
        found = solutions(file)
        assert len(found) == len(instance.solutions), (seed, instance.forms)
        assert set(found) == instance.solutions, (seed, instance.forms)


@pytest.mark.parametrize(
    "seeds",
    [range(4), *(pytest.param(range(first, first + 62), marks=pytest.mark.slow) for first in range(4, 314, 62))],
)
def test_ace_counts_as_many_solutions_on_the_file_itself(seeds: range, tmp_path: Path) -> None:
    """ACE may refuse a few: not all forms that it has go together."""
    files = [tmp_path / f"{seed}.xml" for seed in seeds]
    for seed, file in zip(seeds, files, strict=True):
        file.write_text(random_instance(seed, for_ace=True).xml)
    counts = solutions_by_ace(files)
    differing = {file.name: (count, len(solutions(file))) for file, count in zip(files, counts, strict=True)}
    assert {name: pair for name, pair in differing.items() if pair[0] is not None and pair[0] != pair[1]} == {}
    assert sum(count is None for count in counts) <= len(counts) // 20
