"""Teams that were not drawn in the application: what is told of their files, and that names in them are only text."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from robochoc.app.imported import facts
from robochoc.app.imported.facts import facts_of
from robochoc.app.imported.picture import picture_sketch
from robochoc.app.imported.robot_file import read_robot_file, sentence
from robochoc.app.pages.decide.answer import headline
from robochoc.app.pages.imported.answer import epochs_html, table_html, values_in_short
from robochoc.app.pages.imported.whatif import changes_html, moved
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import Record, Run, RunState
from robochoc.app.sketch.open_from_disk import ImportedTeam, open_team
from robochoc.app.sketch.sketch import Cell
from robochoc.app.sketch.thumbnail import thumbnail
from robochoc.app.store import TeamStore
from robochoc.formats import read_team
from robochoc.model.constraint import Constraint, Predicate, Relation, Semantics
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Verdict
from tests.support.cases import looped
from tests.support.program import ROOT
from tests.support.run_results import run_epoch, run_result
from tests.support.small_teams import pair, pkc_team, triangle

RESCUE = ROOT / "docs/examples/rescue"
QUEENS = ROOT / "instances/queens3d-4"


def kept(path: Path, folder: Path) -> tuple[TeamStore, str]:
    """A store with a team that was not drawn there, and its id."""
    store, found = TeamStore(folder), open_team(path)
    assert isinstance(found, ImportedTeam)
    return store, store.add_imported(found)


def test_random_variables_are_told_and_their_costs_have_their_unit() -> None:
    folder = ROOT / "docs/examples/gusts"
    told = "Chance decides wind: 0 (0.7), 3 (0.3). Costs are expected costs. Decided after it is known: relay."
    assert facts_of(read_team(folder)).notes == (told,)
    assert "costs 0.1 · (" in read_robot_file(folder, "Camera").sentences[0]


def test_what_happens_to_a_team_is_told_and_who_joins_is_known() -> None:
    found = facts_of(read_team(RESCUE), origin="rescue")
    assert found.events[:2] == ("When it has decided: East leaves.", "When it has decided: Spare comes.")
    assert [robot.name for robot in found.robots if robot.joins] == ["Spare"]
    assert len(found.there) == 7
    assert found.flies


def test_a_team_without_places_does_not_fly_and_parts_are_counted() -> None:
    found = facts_of(pkc_team())
    assert not found.flies
    assert (found.constraints, found.partial, found.linked) == (3, 2, 2)


def test_facts_are_kept_and_found_anew_where_they_are_damaged(tmp_path: Path) -> None:
    store, name = kept(QUEENS, tmp_path)
    first = store.facts(name)
    assert first.origin == "queens3d-4"
    (store.path(name) / "foreign.json").write_bytes(b"{")
    assert store.facts(name) == msgspec.structs.replace(first, origin="")
    for file in (store.path(name) / "team").iterdir():
        file.write_text("<instance/>")
    (store.path(name) / "foreign.json").unlink()
    with pytest.raises(ValueError, match="Robot1"):
        store.facts(name)


def test_robots_are_drawn_where_their_files_say_or_else_side_by_side() -> None:
    there = picture_sketch(ImportedTeam(QUEENS, read_team(QUEENS)))
    assert {robot.name: robot.at for robot in there.robots}["Robot3.2"] == Cell(2, 1)
    assert thumbnail(there).count("<circle") == 16
    beside = picture_sketch(ImportedTeam(QUEENS, triangle()))
    assert len({robot.at for robot in beside.robots}) == 4


def test_one_robot_is_read_with_its_file_and_its_constraints_in_words(tmp_path: Path) -> None:
    store, name = kept(RESCUE, tmp_path)
    folder = store.path(name) / "team"
    spare = read_robot_file(folder, "Spare")
    assert spare.name.startswith("late")
    assert spare.text.startswith("<?xml")
    assert not spare.is_cut
    assert spare.count == len(spare.sentences) > 0


@looped(
    ("text", "says"),
    [
        ("and(ne(X,Y),ne(abs(sub(X,Y)),2))", "(a ≠ b) and (|a - b| ≠ 2)"),
        ("le(mul(2,add(X,Y)),sqr(X))", "(2 · (a + b)) ≤ a²"),
        ("not(in(X,set(1,2)))", "not: a is one of 1, 2"),
        ("ge(dist(X,Y),min(X,3))", "|a - b| ≥ min(a, 3)"),
    ],
)
def test_an_expression_reads_as_people_write_it(text: str, says: str) -> None:
    says_so = Predicate("P", ("X", "Y"), parse(text, ("X", "Y"), Type.BOOLEAN))
    constraint = Constraint("C", says_so, ("a", "b"), ("a", "b"))
    assert sentence(constraint) == says


def test_tables_are_told_with_their_costs_and_cut() -> None:
    pairs = tuple((one, other) for one in (1, 2, 3) for other in (1, 2, 3))
    soft = Relation("R", 2, Semantics.SOFT, pairs, costs=(float("inf"), *range(1, 9)), default_cost=5)
    says = sentence(Constraint("C", soft, ("a", "b"), ("a", "b")))
    assert says.startswith("a, b: (1, 1): forbidden; (1, 2): costs 1;")
    assert says.endswith("3 more; all others: costs 5")


def test_a_part_of_a_partially_known_constraint_says_so() -> None:
    part = next(one for one in pkc_team().constraints() if one.name == "C")
    assert "own part" in sentence(part)


def test_the_answer_tells_every_decision_and_names_are_only_text() -> None:
    team = pair()
    found = facts_of(team)
    result = run_result(Verdict.SOLUTION, {"A": "<b>", "B": 2})
    assert values_in_short(found, result.values) == {"RA": "<b>", "RB": "2"}
    assert "<td>&lt;b&gt;</td>" in table_html(found, result)
    epoch = run_epoch("unknown", {"A": "<u>"}, opened_by="<script>", robots=["RA"])
    told = epochs_html(found, run_result("unknown", epochs=[epoch]))
    assert "&lt;script&gt;" in told
    assert not any(tag in told for tag in ("<script>", "<u>"))


def test_a_table_of_very_many_decisions_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facts, "MOST_VARIABLES", 3)
    found = facts_of(read_team(QUEENS))
    assert sum(len(robot.decides) for robot in found.robots) == 3
    assert found.variables == 16


def test_the_headline_counts_who_is_there_at_the_end(tmp_path: Path) -> None:
    found = facts_of(read_team(RESCUE))
    epochs = [run_epoch("solution", robots=["a", "b", "c"]), run_epoch("solution", robots=["a", "b"])]
    run = Run(
        tmp_path, Record(RunOptions(), state=RunState.ENDED), picture_sketch(ImportedTeam(RESCUE, read_team(RESCUE)))
    )
    run.result = run_result(Verdict.SOLUTION, {"lead": 1}, cost=0, epochs=epochs)
    assert headline(run, found) == "All 2 decide."
    run.result = run_result(Verdict.OPTIMAL, {"lead": 1}, cost=7)
    worth = msgspec.structs.replace(found, costs=True, maximised=True)
    assert headline(run, worth) == "All 7 decide. It is worth 7: proven the best."


# Robots fail


BEFORE: dict[str, int | str] = {"A": 1, "B": 2, "C": 3, "D": 1}
AFTER: dict[str, int | str] = {"A": 1, "B": "<b>", "D": 1}


def test_who_decides_something_else_has_moved_and_who_has_gone_has_not() -> None:
    facts = facts_of(triangle(3))
    assert moved(facts, BEFORE, AFTER) == ["RB"]
    assert moved(facts, BEFORE, BEFORE) == []
    assert moved(facts, {}, {}) == []


def test_both_sides_are_told_and_names_are_only_text() -> None:
    told = changes_html(facts_of(triangle(3)), BEFORE, AFTER)
    assert told.count("<tr") == 5
    assert '<tr class="moved"><th scope="row">RB</th><td>B</td><td>2</td><td>&lt;b&gt;</td></tr>' in told
    assert '<th scope="row">RC</th><td>C</td><td>3</td><td></td>' in told
