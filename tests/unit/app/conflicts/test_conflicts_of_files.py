"""Which constraints of files are in each other's way: against trying all values, by CPMpy and by our own solver."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import pytest

from robochoc.app.conflicts.by_cpmpy import can_be_undefined, limits_of
from robochoc.app.conflicts.process import conflict_in, conflict_in_files, team_with_only
from robochoc.app.conflicts.search import Conflict, ConflictSearch, Finder, TeamOfFiles
from robochoc.formats import read_team, write_team
from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.problem import (
    AddValue,
    Constraint,
    Domain,
    Function,
    Predicate,
    ProblemKind,
    ScenarioEvent,
    Team,
    Variable,
)
from tests.support.cases import looped
from tests.support.slot_sketches import slots
from tests.support.small_teams import graph_team, pair, pkc_team, triangle


def _costs(body: str, name: str = "F") -> Constraint:
    """Return a constraint of A and B that costs what an expression says; where that is undefined, it forbids."""
    return Constraint(name, Function(name, ("X", "Y"), parse(body, ("X", "Y"), Type.INTEGER)), ("A", "B"), ("A", "B"))


def _must(body: str, name: str = "P") -> Constraint:
    predicate = Predicate(name, ("X", "Y"), parse(body, ("X", "Y"), Type.BOOLEAN))
    return Constraint(name, predicate, ("A", "B"), ("A", "B"))


def _of_two(*constraints: Constraint, low: int = 0, high: int = 2, kind: ProblemKind = ProblemKind.DISWCSP) -> Team:
    values = Domain("D", (range(low, high + 1),))
    own = {"RA": [Variable("A", values)], "RB": [Variable("B", values)]}
    return assemble("two", own, [*constraints], kind=kind)


TEAMS = {
    "division": _of_two(_costs("div(X,Y)"), _must("eq(Y,0)")),
    "remainder": _of_two(_costs("mod(1,sub(X,Y))"), _must("eq(X,Y)"), _must("le(X,2)", "Q")),
    "only at zero": _of_two(_costs("div(1,Y)"), _must("lt(X,Y)")),
    "power": _of_two(_costs("pow(2,neg(X))"), _must("gt(X,Y)")),
    "only costs": _of_two(_costs("add(X,Y)"), _must("ne(X,X)"), kind=ProblemKind.DISWCSP),
    "negated": _of_two(_must("not(eq(div(X,Y),1))"), _must("eq(Y,0)", "Q")),
    "signs": _of_two(_must("eq(div(X,2),-1)"), _must("eq(mod(X,2),-1)", "Q"), _must("gt(X,-3)", "S"), low=-4, high=3),
    "large": _of_two(_must("eq(mul(X,461168601842738790,10),add(7,Y))"), _must("eq(X,Y)", "Q")),
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
@looped("name", TEAMS)
def test_that_it_cannot_hold_and_each_proper_subset_can(tmp_path: Path, name: str, *, use_cpmpy: bool) -> None:
    if use_cpmpy:
        pytest.importorskip("cpmpy")
    write_team(TEAMS[name], tmp_path / name)
    team = read_team(tmp_path / name)
    conflict = conflict_in_files(tmp_path / name, 0, 60, use_cpmpy=use_cpmpy)
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
    before, after = (conflict_in_files(tmp_path / "pair", events, 60, use_cpmpy=False) for events in (0, 1))
    assert (before.rules, after.rules) == (("0",), None)


def test_that_only_some_constraints_are_left() -> None:
    team = pkc_team()
    every = [*team.constraints()]
    assert [*team_with_only(team, {0, 2}).constraints()] == [every[0], every[2]]
    assert [*team_with_only(team, ()).constraints()] == []


def test_that_a_cost_without_a_value_is_told_as_such(tmp_path: Path) -> None:
    write_team(TEAMS["division"], tmp_path / "division")
    words = conflict_in_files(tmp_path / "division", 0, 60, use_cpmpy=False).words
    assert "RB: costs A / B, which is undefined for some decisions: these are forbidden" in words


class _FailsError(Exception):
    """A fault of a tool."""


def test_that_our_own_solver_looks_where_cpmpy_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object) -> None:
        raise _FailsError("model invalid")

    monkeypatch.setattr("robochoc.app.conflicts.process.minimal_of_team", fails)
    monkeypatch.setattr("robochoc.app.conflicts.process.minimal_by_cpmpy", fails)
    write_team(triangle(2), tmp_path / "triangle")
    assert conflict_in_files(tmp_path / "triangle", 0, 60).finder is Finder.OWN
    assert conflict_in(slots(3, 2), 60).finder is Finder.OWN
    assert len(caplog.records) == 2


@looped(
    ("body", "undefined"),
    [
        ("div(X,Y)", True),
        ("div(X,add(Y,1))", False),
        ("add(X,mod(X,2))", False),
        ("mod(X,sub(X,Y))", True),
        ("pow(X,2)", True),
        ("mul(X,X,X)", False),
        ("if(eq(Y,0),0,div(X,Y))", True),
    ],
)
def test_which_constraints_may_be_undefined(body: str, *, undefined: bool) -> None:
    team = _of_two(_costs(body))
    (constraint,) = team.constraints()
    assert can_be_undefined(constraint, limits_of(team)) is undefined
    assert not can_be_undefined(constraint, {})


def test_that_the_process_takes_files(tmp_path: Path) -> None:
    write_team(triangle(2), tmp_path / "triangle")
    conflict = ConflictSearch(TeamOfFiles(tmp_path / "triangle")).result()
    assert isinstance(conflict, Conflict)
    assert len(conflict.words) == 3
    assert conflict.finder in {*Finder}
