"""The page "Fly" in words: one line of time, which run it is, who stays, and what went wrong."""

from __future__ import annotations

import msgspec

from robochoc.app.flights.flight_result import FLOWN, refused
from robochoc.app.runs.options import JOURNAL, RunOptions
from robochoc.app.runs.run import RECORD, Record, Run, RunState
from robochoc.app.sketch import edits
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRule
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, app_page, watched_page
from tests.support.fly_pages import FLIGHT, LINE, READY, TALK, decided
from tests.support.kept_runs import STARTED, cube, kept_run

SHOWN = "(id) => getComputedStyle(document.getElementById(id)).display !== 'none'"


def walled() -> Sketch:
    """Two robots west of a wall, whose places are east of it."""
    sketch = Sketch("Walled")
    for row in (1, 2):
        sketch = edits.with_robot(sketch, Cell(0, row))
    for row in range(sketch.area.rows):
        sketch = edits.with_cell_blocked(sketch, Cell(3, row), blocked=True)
    places = tuple(sketch.area.number(Cell(6, row)) for row in (1, 2))
    sketch = edits.with_decision(sketch, Decision("place", DecisionKind.PLACE, places))
    return edits.with_rule(sketch, SketchRule("", "different", "place"))


def test_there_is_one_line_of_time_and_the_flight_begins_on_the_map(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team, run = decided(teams, walled())
    with app_page(browser, f"{application.url}team/{team.id}/fly") as tab:
        page = tab.page
        page.wait_for_selector(READY)
        page.wait_for_selector("text=All 2 robots fly to their targets.")
        scene, talk = page.frames[1], page.frames[2]
        assert [scene.evaluate(SHOWN, one) for one in ("line", "play", "again", "clock", "speed-label")] == [False] * 5
        assert [scene.evaluate(SHOWN, one) for one in ("trail-label", "overview", "drone")] == [True] * 3
        assert not talk.evaluate("document.querySelector('body > footer').checkVisibility()")
        # The keys that play each page by itself play both, and nothing plays before.
        assert page.evaluate(f"[{FLIGHT}.time, {FLIGHT}.playing]") == [0, False]
        scene.evaluate("window.focus(); document.body.focus()")
        scene.locator("#scene").press(" ")
        page.wait_for_selector(".stage-play[aria-label=Pause]")
        talk.locator("#grid").press("p")
        page.wait_for_selector(".stage-play[aria-label=Play]")
        assert page.evaluate(f"[{FLIGHT}.playing, Boolean({TALK}.time.playing)]") == [False, False]
        # The first stop of the keyboard is the common line, before the many of the pages.
        page.focus(LINE)
        page.keyboard.press("Shift+Tab")
        assert page.evaluate("document.activeElement.className") == "stage-play"
    flight = run.artefact("flight.html")
    assert flight is not None
    assert b"blocked cell" in flight.read_bytes()
    told = msgspec.json.decode((run.folder / FLOWN).read_bytes())
    assert told["as_planned"]
    # By itself the page has its own line, and plays.
    with watched_page(browser, {"width": 900, "height": 700}, reduced_motion="reduce") as alone:
        alone.page.goto(flight.as_uri())
        alone.page.wait_for_function("globalThis.Playback")
        assert all(alone.page.evaluate(SHOWN, one) for one in ("line", "play", "clock"))


def earlier(teams: TeamStore, team: str, number: int, purpose: str, state: RunState = RunState.ENDED) -> Run:
    """Keep a copy of the first run for another purpose."""
    folder = teams.path(team) / "runs"
    place = folder / f"{number:05}"
    place.mkdir()
    for file in (folder / "00001").iterdir():
        (place / file.name).write_bytes(file.read_bytes())
    record = Record(RunOptions(), purpose=purpose, state=state, started=STARTED + number)
    (place / RECORD).write_bytes(msgspec.json.encode(record))
    return Run(place, record, cube())


def test_runs_are_named_and_one_that_is_gone_is_told(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(cube())
    (kept_run(teams.path(team), cube()).folder / JOURNAL).unlink()
    earlier(teams, team, 2, "whatif", RunState.STOPPED)
    with app_page(browser, f"{application.url}team/{team}/fly?run=00042", {"width": 360, "height": 800}) as tab:
        page = tab.page
        page.wait_for_selector("text=The run 00042 is not saved any more")
        page.wait_for_selector("[data-ready=true]")
        page.click(".fly-choice")
        options = page.locator(".q-menu .q-item")
        options.nth(1).wait_for()
        first, second = options.all_inner_texts()
        assert first.endswith(", What if: the best answer, proven, costs 6")
        assert second.endswith(", Decide: the best answer, proven, costs 6")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_a_flight_that_was_refused_says_why_and_is_tried_again(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(cube())
    run = kept_run(teams.path(team), cube())
    (run.folder / JOURNAL).unlink()
    (run.folder / "flight.html").write_text("<!doctype html><title>still</title>")
    (run.folder / FLOWN).write_bytes(refused("two are in <b>one</b> place."))
    with app_page(browser, f"{application.url}team/{team}/fly") as tab:
        page = tab.page
        page.wait_for_selector("text=The flight is not possible: two are in <b>one</b> place.")
        page.click("text=Try again")
        page.wait_for_selector(READY)
        page.locator("text=The flight is not possible").wait_for(state="detached")
        assert page.locator("text=Try again").count() == 0
        page.wait_for_function("document.querySelector('.stage-views iframe').contentWindow.Playback")
    assert msgspec.json.decode((run.folder / FLOWN).read_bytes())["as_planned"]
