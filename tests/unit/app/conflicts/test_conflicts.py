"""Which rules are in each other's way: against trying all values, by CPMpy and by our own solver."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from random import Random

import pytest

from robochoc.app.conflicts.process import conflict_in
from robochoc.app.conflicts.rules import candidates, minimal, rule_of
from robochoc.app.conflicts.search import Conflict, ConflictSearch, Finder, found_by
from robochoc.app.texts import say
from tests.support.cases import looped
from tests.support.rule_teams import can_hold, random_rules
from tests.support.slot_sketches import slots


@looped("way", ["assumptions", "leaving out", "own"])
def test_that_it_cannot_hold_and_each_proper_subset_can(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    use_cpmpy = way != "own"
    if use_cpmpy:
        pytest.importorskip("cpmpy")
    monkeypatch.setattr("robochoc.app.conflicts.by_cpmpy.FEW", 0 if way == "assumptions" else 8)
    sizes = set()
    for seed in range(60):
        sketch = random_rules(Random(seed))
        names = [rule.id for rule in candidates(sketch)]
        conflict = conflict_in(sketch, 60, use_cpmpy=use_cpmpy)
        assert conflict.finder is (Finder.CPMPY if use_cpmpy else Finder.OWN)
        assert (conflict.rules is None) is can_hold(sketch, names), seed
        if conflict.rules is None:
            continue
        assert set(conflict.rules) <= set(names)
        assert not can_hold(sketch, conflict.rules), seed
        for fewer in itertools.combinations(conflict.rules, len(conflict.rules) - 1):
            assert can_hold(sketch, fewer), seed
        sizes.add(len(conflict.rules))
    assert {1, 2} <= sizes


def test_that_soft_rules_and_those_that_are_off_are_in_nobodys_way() -> None:
    sketch = slots(3, 3)
    assert [rule.id for rule in candidates(sketch)] == ["R1"]


def test_that_rules_are_left_out_one_by_one() -> None:
    def holds(some: Sequence[str]) -> bool:
        return not {"b", "d"} <= {*some}

    assert minimal("abcde", holds) == ("b", "d")
    assert minimal("abc", holds) is None


def test_that_constraints_are_told_apart_by_the_longest_name() -> None:
    assert rule_of("R1.A.B", ["R1", "R1.A", "R10"]) == "R1.A"
    assert rule_of("R10", ["R1", "R10"]) == "R10"
    assert rule_of("R2", ["R1"]) is None


class TestSearch:
    def test_that_it_is_found_in_a_process_of_its_own(self) -> None:
        assert found(ConflictSearch(slots(3, 2))).rules == ("R1",)

    def test_that_one_that_was_ended_finds_nothing(self) -> None:
        search = ConflictSearch(slots(3, 2))
        search.end()
        assert search.result() is None
        assert search.pid is None
        search.end()  # its process is none of its own any more

    def test_that_a_limit_of_time_is_told(self) -> None:
        assert ConflictSearch(slots(3, 2), -60).result() == Conflict(None, late=True)

    def test_that_a_search_that_fails_says_why(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("robochoc.app.conflicts.search._PROCESS", "robochoc.no_such_module")
        conflict = found(ConflictSearch(slots(3, 2)))
        assert "no_such_module" in conflict.why
        monkeypatch.setattr("robochoc.app.conflicts.search.Command", None)
        assert found(ConflictSearch(slots(3, 2))).why == "That did not work. The team is unchanged."


def found(search: ConflictSearch) -> Conflict:
    """Return what a search has found; it was not ended."""
    conflict = search.result()
    assert conflict is not None
    return conflict


def test_what_to_install_is_said_where_cpmpy_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    install = "pip install 'robochoc[cpmpy]'"
    assert found_by(Conflict(("a",), Finder.CPMPY)) == say("decide.by-cpmpy")
    assert found_by(Conflict(("a",), Finder.OWN)) == say("decide.by-own")
    monkeypatch.setattr("robochoc.app.conflicts.search.find_spec", lambda _: None)
    assert found_by(Conflict(("a",), Finder.OWN)).endswith(install)
    assert found_by(Conflict(None, Finder.OWN, late=True)).endswith(install)
