"""What is told of a flight: on which map, who flies and who stays and why, how it went, and what a run was."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robochoc.app.flights.builder import FlightBuilder, captioned
from robochoc.app.flights.flight_map import changed_to, ground_of, happened_in
from robochoc.app.flights.flight_result import FLOWN, flight_result_of, flight_words, flying_robots_words, refused
from robochoc.app.flights.report import Pages, report
from robochoc.app.pages.fly.page import run_words
from robochoc.app.runs.options import RESULT
from robochoc.app.runs.run import CHANGE, Checked, Run, RunState
from robochoc.app.sketch import edits
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch
from robochoc.formats import write_team
from robochoc.maps.ground_map import BlockedCell
from robochoc.model.outcome import Verdict
from robochoc.model.problem import RemoveAgent, ScenarioEvent
from tests.support.cases import looped
from tests.support.kept_runs import STARTED, cube, kept_run
from tests.support.run_results import run_epoch
from tests.support.small_teams import pair


def changing(run: Run, after: Sketch, **more: object) -> None:
    content = {"after": after, "happened": ["Drone2 fails."], "beside": "00002", **more}
    (run.folder / CHANGE).write_bytes(msgspec.json.encode(content))


def test_the_map_has_where_robots_stand_and_what_is_blocked_since_when(tmp_path: Path) -> None:
    before = msgspec.structs.replace(cube(), area=Area(8, 4, frozenset({Cell(7, 3), Cell(9, 9)})))
    run = kept_run(tmp_path, before)
    ground = ground_of(run)
    assert ground is not None
    assert (ground.columns, ground.rows) == (8, 4)
    assert ground.starts == {"Drone1": (1, 1), "Drone2": (2, 1), "Drone3": (3, 1)}
    assert ground.blocked == (BlockedCell(8, 4),)
    after = edits.with_robot(edits.without_robot(before, "Drone2"), Cell(4, 2), "Zoe")
    after = edits.with_cell_blocked(after, Cell(0, 3), blocked=True)
    changing(run, after)
    ground = ground_of(run)
    assert ground is not None
    assert ground.starts == {"Drone1": (1, 1), "Drone2": (2, 1), "Drone3": (3, 1), "Zoe": (5, 3)}
    assert ground.blocked == (BlockedCell(1, 4, 1), BlockedCell(8, 4))
    assert happened_in(run) == ["Drone2 fails."]


def test_what_decided_anew_or_is_damaged_changes_nothing(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    changing(run, cube(2), anew="another robot decides now")
    assert changed_to(run) is None
    (run.folder / CHANGE).write_bytes(b"[" * 100_000)
    assert (changed_to(run), happened_in(run)) == (None, [])


def test_a_team_that_was_not_drawn_has_no_map(tmp_path: Path) -> None:
    run = kept_run(tmp_path, Sketch("Foreign"))
    assert ground_of(run) is None
    assert flying_robots_words(run) == []


def test_who_flies_is_told_and_who_stays_and_why(tmp_path: Path) -> None:
    run = kept_run(tmp_path / "all", cube())
    assert flying_robots_words(run) == ["All 3 robots fly to their targets."]
    one = kept_run(tmp_path / "one", cube(1))
    assert flying_robots_words(one) == ["Drone1 flies to its target."]
    given = {"Drone1.level": 1, "Drone2.level": 2}
    aside = kept_run(tmp_path / "aside", cube(), assignment=given, withdrawn=["Drone3"])
    assert flying_robots_words(aside) == [
        "2 of 3 robots fly to their targets.",
        "Stepped aside, so that the others can keep all rules: Drone3. These robots land at the edge.",
    ]
    sketch = edits.with_robot(cube(), Cell(5, 1), "Cook")
    sketch = msgspec.structs.replace(
        sketch,
        decisions=(
            msgspec.structs.replace(sketch.decisions[0], robots=("Drone1", "Drone2", "Drone3")),
            Decision("dish", DecisionKind.CHOICE, ("soup", "cake"), ("Cook",)),
        ),
    )
    given = {f"Drone{number}.level": number for number in (1, 2, 3)}
    cook = kept_run(tmp_path / "cook", sketch, assignment={**given, "Cook.dish": "soup"})
    assert flying_robots_words(cook)[1:] == ["Decided neither a level nor a place, and stay at their positions: Cook."]
    changing(run, edits.without_robot(cube(), "Drone2"))
    assert flying_robots_words(run) == [
        "2 of 3 robots fly to their targets.",
        "Left during the flight: Drone2. These robots land at the edge.",
    ]
    nobody = kept_run(tmp_path / "nobody", cube(kind=DecisionKind.SLOT))
    assert flying_robots_words(nobody) == []


def test_how_a_flight_went_is_told(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    file = run.folder / FLOWN
    assert flight_result_of(run) is None
    for broken in (b"", b"[" * 100_000, b'{"drones": 3}'):
        file.write_bytes(broken)
        assert flight_result_of(run) is None
    file.write_bytes(refused("two are in one place."))
    flown = flight_result_of(run)
    assert flown is not None
    assert flight_words(flown) == [
        "The flight is not possible: two are in one place. The picture shows the targets of all robots."
    ]
    drones = [
        {"name": "A", "error_m": None, "at": [1, 2, 3]},
        {"name": "B", "error_m": 0.4},
        {"name": "C", "error_m": 0},
    ]
    told = {
        "as_planned": False,
        "drones": drones,
        "happenings": [{"at_s": 2.04, "drone": "A", "what": "hits the ground"}] * 9,
    }
    file.write_bytes(msgspec.json.encode(told))
    flown = flight_result_of(run)
    assert flown is not None
    assert flight_words(flown)[:3] == ["Fallen: A.", "Not at their targets: B.", "2.0 s, A: hits the ground."]
    assert len(flight_words(flown)) == 8
    near = msgspec.structs.replace(flown, drones=flown.drones[2:], happenings=())
    assert flight_words(near) == ["Two drones came closer to each other than allowed."]
    assert flight_words(msgspec.structs.replace(near, as_planned=True)) == []


@pytest.fixture
def _utc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environ, "TZ", "UTC")
    time.tzset()


@pytest.mark.usefixtures("_utc")
def test_a_run_in_a_list_says_when_what_for_and_what_came_of_it(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    same_day = datetime.fromtimestamp(STARTED + 60, UTC)
    assert run_words(run, same_day) == "22:13, Decide: the best answer, proven, costs 6"
    assert run_words(run).startswith("2023-11-14 22:13, Decide")
    assert run.result is not None
    for purpose, opened, words in (
        ("whatif", False, "What if"),
        ("whatif-anew", False, "What if, decided from scratch for comparison"),
        ("decide", True, "Opened from a file, which claims"),
        ("<b>", False, "Another run"),
    ):
        run.record.purpose, run.record.opened = purpose, opened
        assert run_words(run, same_day).startswith(f"22:13, {words}: ")
    run.record.purpose, run.record.checked = "decide", Checked.COST
    assert run_words(run, same_day).endswith("costs 6, but a check has found this wrong")
    run.record.checked, run.record.maximised = None, True
    assert run_words(run, same_day).endswith(": the best answer, proven, is worth 6")
    run.record.maximised = False
    cases: tuple[tuple[str, RunState, dict[str, Any], str], ...] = (
        (
            "solution",
            RunState.ENDED,
            {"withdrawn": ("A", "B"), "cost": 0},
            "all rules that must hold are kept, 2 stepped aside",
        ),
        ("no-solution", RunState.ENDED, {"assignment": {}, "cost": None}, "no answer is possible"),
        ("unknown", RunState.STOPPED, {"cost": 6}, "stopped, the best so far, costs 6"),
        ("unknown", RunState.ENDED, {"cost": 0}, "the best so far"),
        ("unknown", RunState.STOPPED, {"assignment": {}}, "no answer"),
    )
    for verdict, state, more, words in cases:
        run.record.state = state
        kept = run.result
        assert kept is not None
        run.result = replace(kept, verdict=Verdict(verdict), **more)
        assert run_words(run, same_day).endswith(f": {words}")
        run.result = kept
    run.result = None
    assert run_words(run, same_day).endswith(": no answer")


def _epochs(*opened: str, last: dict[str, int]) -> list[dict[str, object]]:
    assignments = {"the start": {"Drone1.level": 1}, **dict.fromkeys(opened, last)}
    return [{"verdict": "solution", "opened_by": one, "assignment": own} for one, own in assignments.items()]


def test_what_has_happened_is_said_in_words_in_the_scene(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube(), epochs=_epochs("Drone1.level without 3", last={"Drone1.level": 2}))
    assert captioned(run) is None
    changing(run, cube(2), happened=["Drone2 fails.", "The cell is blocked."])
    told = captioned(run)
    assert told is not None
    assert told.endswith(b"}\n")
    before, after = (msgspec.json.decode(one) for one in ((run.folder / RESULT).read_bytes(), told))
    assert [one["opened_by"] for one in after["epochs"]] == ["the start", "Drone2 fails. The cell is blocked"]
    before["epochs"][1]["opened_by"] = after["epochs"][1]["opened_by"]
    assert before == after
    for broken in (b"", b"[]\n", b"{}\n", b'{"epochs":[]}\n', b'{"epochs":[{},3]}\n', b'{"epochs":7}\n'):
        (run.folder / RESULT).write_bytes(broken)
        assert captioned(run) is None


def test_what_happens_to_a_team_of_files_is_said_in_words_too(tmp_path: Path) -> None:
    team = pair(ScenarioEvent((RemoveAgent("RA"),)))
    run = kept_run(tmp_path, Sketch("pair"), epochs=_epochs("-A", last={}))
    write_team(team, run.team)
    told = captioned(run)
    assert told is not None
    assert msgspec.json.decode(told)["epochs"][1]["opened_by"] == "When it has decided: RA leaves"


@pytest.mark.parametrize(("verdict", "flown"), [("solution", True), ("no-solution", False)])
def test_the_last_answer_is_flown_if_there_is_none_in_the_end(tmp_path: Path, verdict: str, *, flown: bool) -> None:
    first, last = run_epoch(verdict, {"Drone1.level": 1}), run_epoch("no-solution")
    run = kept_run(tmp_path, cube(), verdict="no-solution", assignment={}, cost=None, epochs=[first, last])
    making = FlightBuilder(run)
    assert making.has_answer is making.has_flight is flown
    page = report(run.sketch, run, Pages(), "1")
    assert (b"The flight shows the last answer before it" in page) is flown


@looped("epoch", [{}, {"assignment": 5}, {"assignment": None}, {"assignment": []}])
def test_a_result_with_an_invalid_epoch_is_not_read(tmp_path: Path, epoch: dict[str, object]) -> None:
    run = kept_run(tmp_path, cube(), assignment={}, epochs=[{**epoch}])
    assert run.result is None
    assert b"no answer" in report(run.sketch, run, Pages(), "1").lower()
