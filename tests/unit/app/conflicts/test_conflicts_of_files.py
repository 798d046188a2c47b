"""Which constraints of files are in each other's way: against trying all values, by CPMpy and by our own solver."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import pytest

from robochoc.app.conflicts.files import found_in_files, with_only
from robochoc.app.conflicts.found import Conflict, ConflictSearch, FilesAsked, Finder
from robochoc.formats import read_team, write_team
from robochoc.model.problem import AddValue, ScenarioEvent, Team
from tests.support.small_teams import graph_team, pair, pkc_team, triangle

TEAMS = {
    "triangle": triangle(2),
    "two": graph_team(["AB", "BC", "AC", "CD", "DE", "CE"]),
    "solvable": triangle(3),
    "partial": pkc_team(),
}


def _has_solution(team: Team, rules: Iterable[str]) -> bool:
    """Whether some constraints, by their numbers, can hold together: by trying all values."""
    every = [*team.constraints()]
    some = [every[int(rule)] for rule in rules]
    domains = [one.domain for one in team.variables.values()]
    return any(
        all(one.allows(dict(zip(team.variables, values, strict=True))) for one in some)
        for values in itertools.product(*domains)
    )


@pytest.mark.parametrize("use_cpmpy", [True, False])
@pytest.mark.parametrize("name", TEAMS)
def test_that_it_cannot_hold_and_each_proper_subset_can(tmp_path: Path, name: str, *, use_cpmpy: bool) -> None:
    if use_cpmpy:
        pytest.importorskip("cpmpy")
    write_team(TEAMS[name], tmp_path / name)
    team = read_team(tmp_path / name)
    conflict = found_in_files(tmp_path / name, 0, 60, use_cpmpy=use_cpmpy)
    every = [str(number) for number, _ in enumerate(team.constraints())]
    assert (conflict.rules is None) is _has_solution(team, every)
    if conflict.rules is None:
        return
    assert not _has_solution(team, conflict.rules)
    for fewer in itertools.combinations(conflict.rules, len(conflict.rules) - 1):
        assert _has_solution(team, fewer)
    assert len(conflict.words) == len(conflict.rules)
    assert conflict.words[0].startswith("R")


def test_that_it_is_the_team_after_what_has_happened(tmp_path: Path) -> None:
    write_team(pair(ScenarioEvent((AddValue("A", 2),))), tmp_path / "pair")
    before, after = (found_in_files(tmp_path / "pair", events, 60, use_cpmpy=False) for events in (0, 1))
    assert (before.rules, after.rules) == (("0",), None)


def test_that_only_some_constraints_are_left() -> None:
    team = pkc_team()
    every = [*team.constraints()]
    assert [*with_only(team, {0, 2}).constraints()] == [every[0], every[2]]
    assert [*with_only(team, ()).constraints()] == []


def test_that_the_process_takes_files(tmp_path: Path) -> None:
    write_team(triangle(2), tmp_path / "triangle")
    conflict = ConflictSearch(FilesAsked(tmp_path / "triangle")).result()
    assert isinstance(conflict, Conflict)
    assert len(conflict.words) == 3
    assert conflict.finder in {*Finder}
