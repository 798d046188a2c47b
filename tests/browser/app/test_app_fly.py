"""The page "Fly": the flight and the conversation on one line of time, and what is handed on."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import msgspec
import pytest

from robochoc.app.sketch.sketch import DecisionKind, SketchRule
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, WatchedPage, app_page, connected, watched_page
from tests.support.fly_pages import FLIGHT, LINE, READY, TALK, decided
from tests.support.kept_runs import cube, kept_run
from tests.support.limits import wait_until

HOSTILE = "<img src=x onerror=\"document.title='broken'\">{{7*7}}"


def _numbers(tab: WatchedPage) -> tuple[float, int, float]:
    """Return where the flight is, where the conversation is, and where the line of time is."""
    time, moment, at = tab.page.evaluate(
        f"[{FLIGHT}.time, {TALK}.view.moment, Number(document.querySelector('{LINE}').value)]"
    )
    return time, moment, at


def test_from_a_finished_run_to_scene_and_conversation_in_step(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    team, run = decided(teams, cube(3, "Trio"))
    with app_page(browser, f"{application.url}team/{team.id}/fly", reduced_motion="reduce") as tab:
        page = tab.page
        page.wait_for_selector(READY)
        page.wait_for_selector("text=It costs 6.")
        assert page.locator(".stage-parts span").all_inner_texts() == ["They talk", "They fly"]
        steps = page.evaluate(f"{TALK}.model.stepCount")
        assert _numbers(tab) == (0, 0, 0)
        page.focus(LINE)
        page.keyboard.press("ArrowRight")
        assert _numbers(tab)[:2] == (0, 1)
        # The conversation is moved: the line follows, and the flight waits for them to end.
        page.evaluate(f"{TALK}.time.go({steps - 1})")
        page.wait_for_function(f"Number(document.querySelector('{LINE}').value) > 2")
        assert _numbers(tab)[0] == 0
        # The flight is moved: all has been said by then.
        page.evaluate(f"{TALK}.time.go(1)")
        page.evaluate(f"{FLIGHT}.seek({FLIGHT}.duration)")
        page.wait_for_function(f"document.querySelector('{LINE}').value === document.querySelector('{LINE}').max")
        assert _numbers(tab)[1] == steps - 1
        # It plays, from the beginning where it was at its end, both pages with it.
        page.click(".stage-play")
        page.wait_for_function(f"{TALK}.view.moment > 2 && {TALK}.view.moment < {steps - 1}")
        assert _numbers(tab)[0] == 0
        page.click(".stage-play")
        with page.expect_download() as saved:
            page.click("[aria-label='Recording: Save']")
        assert saved.value.suggested_filename == "Trio.mcap"
        saved.value.save_as(tmp_path / "flight.mcap")
        assert (tmp_path / "flight.mcap").read_bytes().startswith(b"\x89MCAP0\r\n")
        assert {one.split("/")[2] for one in tab.asked if one.startswith("http")} == {f"127.0.0.1:{application.port}"}
    assert run.artefact("flight.html")
    with app_page(
        browser,
        f"{application.url}team/{team.id}/fly?run={run.id}#t=3.5",
        {"width": 1280, "height": 800},
        reduced_motion="reduce",
    ) as tab:
        tab.page.wait_for_selector(READY)
        assert _numbers(tab)[2] == 3.5


def test_a_report_opens_by_itself_without_a_network(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    sketch = msgspec.structs.replace(cube(2, "Duo"), story=HOSTILE)
    team, _ = decided(teams, sketch)
    report = tmp_path / "report.html"
    with app_page(browser, f"{application.url}team/{team.id}/fly") as tab:
        tab.page.wait_for_selector(READY)
        with tab.page.expect_download() as saved:
            tab.page.click("[aria-label='Report: Save']")
        assert saved.value.suggested_filename == "Duo.html"
        saved.value.save_as(report)
        served = tab.page.evaluate("document.querySelector('[aria-label=\"Report: Save\"]').href")
    with watched_page(browser) as tab:  # a tab of its own is apart from the application, from which it comes
        tab.page.goto(served)
        tab.page.wait_for_selector(f"text={HOSTILE}")
        assert tab.page.evaluate("self.origin") == "null"
        plays = "Boolean(globalThis.Playback)"  # `wait_for_function` evaluates text, which the report does not allow
        wait_until(lambda: tab.page.frames[1].evaluate(plays), "the scene in it has not begun")
    with app_page(browser, report.as_uri()) as tab:
        tab.page.wait_for_selector(f"text={HOSTILE}")
        frames = tab.page.frames[1:]
        frames[0].wait_for_function("globalThis.Playback")
        tab.page.locator("iframe").nth(1).scroll_into_view_if_needed()
        frames[1].wait_for_function("globalThis.Sniffer?.page?.model.stepCount > 0")
        assert tab.page.title() == "Duo: what was decided"
        assert [one for one in tab.asked if not one.startswith(("file:", "data:", "blob:"))] == []


def test_who_decides_no_place_does_not_fly_and_is_told_why(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team, _ = decided(teams, cube(2, "Slots", DecisionKind.SLOT))
    with app_page(
        browser, f"{application.url}team/{team.id}/fly", {"width": 360, "height": 800}, color_scheme="dark"
    ) as tab:
        tab.page.wait_for_selector("text=No robot flies: this team decides neither levels nor places.")
        tab.page.wait_for_selector(READY)
        assert tab.page.locator(".stage-parts span").all_inner_texts() == ["They talk"]
        assert tab.page.locator("text=No robot flies, so there is nothing to record.").count() == 1
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360
        tab.page.click("text=Go to Model")
        tab.page.wait_for_url("**/model")


def test_where_nobody_says_a_word_no_page_is_waited_for(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    never = SketchRule("R1", "never", "level", settings={"value": 1})
    team, _ = decided(teams, msgspec.structs.replace(cube(1, "Alone", DecisionKind.SLOT), rules=(never,)))
    with app_page(browser, f"{application.url}team/{team.id}/fly") as tab:
        tab.page.wait_for_selector(READY)
        assert tab.page.locator("text=Loading the pages.").count() == 0


def test_a_flight_that_is_looked_at_stays_where_it_is_as_the_conversation_comes(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team, _ = decided(teams, cube(2, "Duo"))
    with watched_page(browser) as tab:

        def once_the_flight_is_looked_at(route: Any) -> None:  # noqa: ANN401 - Playwright's
            tab.page.wait_for_selector("output:has-text('0.3 s of flight')")
            route.continue_()

        tab.page.route("**/conversation.html*", once_the_flight_is_looked_at)
        connected(tab.page, f"{application.url}team/{team.id}/fly")
        tab.page.wait_for_selector(LINE)
        tab.page.focus(LINE)
        for _ in range(3):
            tab.page.keyboard.press("ArrowRight")
        tab.page.wait_for_selector(READY)
        assert tab.page.locator(".stage-parts span").all_inner_texts() == ["They talk", "They fly"]
        assert tab.page.locator("output").inner_text() == "0.3 s of flight"


PARTS: list[tuple[list[tuple[int | None, int]], int, list[float], float, list[tuple[str, int, int, int]]]] = [
    # runs as (epoch, first step), steps, where chapters begin, the flight's duration; kind, conversation, flight
    ([(None, 0)], 30, [1.0], 8.0, [("talk", 0, 29, 0), ("fly", 0, 8, 29)]),
    ([(None, 0)], 30, [], 0.0, [("talk", 0, 29, 0)]),
    ([], 0, [1.0], 8.0, [("fly", 0, 8, -1)]),
    (
        [(None, 0), (1, 30), (1, 35), (2, 40)],
        50,
        [1.0, 6.0, 6.0],
        8.0,
        [("talk", 0, 29, 0), ("fly", 0, 6, 29), ("talk", 30, 39, 6), ("talk", 40, 49, 6), ("fly", 6, 8, 49)],
    ),
    ([(None, 0), (1, 30)], 50, [1.0, 3.0, 5.0], 8.0, [("talk", 0, 49, 0), ("fly", 0, 8, 49)]),
]


def test_they_talk_then_fly_epoch_by_epoch(browser: Browser) -> None:
    source = (files("robochoc.app.pages.fly") / "frames.js").read_text(encoding="utf-8")
    script = source.partition("export default")[0].replace("export function", "function")
    with watched_page(browser) as tab:
        for runs, steps, begins, duration, expected in PARTS:
            given = [[{"epoch": epoch, "step": step} for epoch, step in runs], steps, [{"at": at} for at in begins]]
            parts = tab.page.evaluate(f"(given) => {{ {script}; return partsOf(...given); }}", [*given, duration])
            told = [
                (one["kind"], one["from"], one["upto"], one["time"] if one["kind"] == "talk" else one["step"])
                for one in parts
            ]
            assert told == expected
            assert [one["begins"] for one in parts[1:]] == [one["ends"] for one in parts[:-1]]


def test_what_has_not_decided_is_sent_to_decide(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    with app_page(browser, f"{application.url}team/{teams.add(cube())}/fly") as tab:
        tab.page.wait_for_selector("text=Nothing has been decided yet.")
        tab.page.click("text=Go to Decide")
        tab.page.wait_for_url("**/decide")


def test_the_state_is_opened_from_the_gallery(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    team, _ = decided(teams, cube(2, "Moved"))
    state = tmp_path / "Moved.robochoc.zip"
    with app_page(browser, f"{application.url}team/{team.id}/fly") as tab:
        with tab.page.expect_download() as saved:
            tab.page.click("[aria-label='Team and run: Save']")
        assert saved.value.suggested_filename == state.name
        saved.value.save_as(state)
        connected(tab.page, application.url)
        tab.page.set_input_files("input[type=file]", state)
        tab.page.wait_for_url("**/model")
        tab.page.click("text=Fly")
        tab.page.wait_for_selector("text=It costs 3.")
        tab.page.wait_for_selector(READY)


def test_nothing_else_is_served(application: AppServer, teams: TeamStore) -> None:
    team = teams.add(cube(2))
    kept_run(teams.path(team), cube(2))
    for path in ("00001/run.json", "00001/flight.html", "00009/report.html"):
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"{application.url}team/{team}/kept/{path}")  # noqa: S310 - our own server
    with urlopen(f"{application.url}team/{team}/kept/00001/report.html") as answer:  # noqa: S310
        policy = answer.headers["Content-Security-Policy"].split("; ")
        assert policy == ["sandbox allow-scripts allow-popups allow-downloads", "frame-ancestors 'self'"]
        assert answer.headers["X-Frame-Options"] == "SAMEORIGIN"
