"""What changes in a team of files when robots fail."""

from __future__ import annotations

from robochoc.app.foreign.facts import facts_of
from robochoc.app.pages.foreign.whatif import changes_html, moved
from tests.support.small_teams import triangle

FACTS = facts_of(triangle(3))
BEFORE = {"assignment": {"A": 1, "B": 2, "C": 3, "D": 1}, "robots": ["RA", "RB", "RC", "RD"]}
AFTER = {"assignment": {"A": 1, "B": "<b>", "D": 1}, "robots": ["RA", "RB", "RD"]}


def test_who_decides_something_else_has_moved_and_who_has_gone_has_not() -> None:
    assert moved(FACTS, BEFORE, AFTER) == ["RB"]
    assert moved(FACTS, BEFORE, BEFORE) == []


def test_both_sides_are_told_and_names_are_only_text() -> None:
    told = changes_html(FACTS, BEFORE, AFTER)
    assert told.count("<tr") == 5
    assert '<tr class="moved"><th scope="row">RB</th><td>B</td><td>2</td><td>&lt;b&gt;</td></tr>' in told
    assert '<th scope="row">RC</th><td>C</td><td>3</td><td></td>' in told


def test_what_is_damaged_is_told_as_nothing() -> None:
    assert moved(FACTS, {"assignment": 3}, {}) == []
