"""The page Decide, by clicks and keys: decide, watch, stop, no solution, rules clicked away; the server killed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import msgspec
import pytest

from robochoc.app.runs.runs import Runs
from robochoc.app.sketch.example_sketches import example
from robochoc.app.sketch.sketch import Decision, DecisionKind, Sketch
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer, app_server
from tests.support.browser_pages import Browser, WatchedPage, connected, watched_page
from tests.support.limits import wait_until
from tests.support.slot_sketches import slots

GO = ".go button"
HEADLINE = ".headline"


def _opened(tab: WatchedPage, application: AppServer, team: str) -> None:
    connected(tab.page, f"{application.url}team/{team}/decide")
    tab.page.wait_for_selector(GO)


def _told(tab: WatchedPage, words: str) -> None:
    tab.page.wait_for_selector(f"{HEADLINE}:has-text({words!r})")


def test_a_team_decides_and_another_tab_sees_it(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(slots(5, 5))
    with watched_page(browser, reduced_motion="reduce") as one, watched_page(browser) as other:
        _opened(one, application, team)
        _opened(other, application, team)
        one.page.focus(GO)
        one.page.keyboard.press("Enter")
        for tab in (one, other):
            _told(tab, "All 5 decide. It costs 15: proven the best.")
            assert tab.page.locator(".answer tbody tr").count() == 5
            assert sorted(tab.page.locator(".team-picture .value").all_text_contents()) == [*"12345"]
        one.page.wait_for_selector(".costs >> text=Together: 15")
        assert "robochoc solve Berths --json" in one.page.inner_text(".command pre")
        one.page.click("text=How they decide")
        one.page.wait_for_selector("text=auto chooses sfb")
        one.page.click("[aria-label^='Protocol']")
        one.page.wait_for_selector('text="adopt: finds the best answer, and proves it"', state="attached")
        one.page.keyboard.press("Escape")
        one.page.click("text=All messages, with the robots' reasons")
        one.page.wait_for_url("**/fly")


def test_a_short_conversation_is_played_slowly_and_in_steps(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(slots(5, 5))
    with watched_page(browser, reduced_motion="no-preference") as tab:
        _opened(tab, application, team)
        tab.page.click(GO)
        tab.page.wait_for_selector(".playing .said", state="attached")  # by itself
        _at(tab, 38)
        tab.page.wait_for_selector(".team-picture:not(:has(.playing)):not(:has(.unsettled))")
        assert sorted(tab.page.locator(".team-picture .value").all_text_contents()) == [*"12345"]
        tab.page.click("[aria-label='One step back']")
        _at(tab, 37)
        assert tab.page.locator(".team-picture .said").count() == 1
        tab.page.focus(".talk .q-slider [tabindex='0']")
        tab.page.keyboard.press("ArrowLeft")
        _at(tab, 36)
        tab.page.click("[aria-label='One step forward']")
        _at(tab, 37)
        tab.page.click("[aria-label='Play']")
        _at(tab, 38)
        tab.page.reload()
        tab.page.wait_for_function("window.did_handshake")
        tab.page.click("[aria-label='Play']")
        tab.page.wait_for_selector(".playing .said", state="attached")


def _at(tab: WatchedPage, message: int) -> None:
    tab.page.wait_for_selector(f".where:text-is('{message} of 38 messages')")


def test_a_long_search_is_watched_and_stopped(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(slots(14, 14))
    with watched_page(browser) as tab:
        _opened(tab, application, team)
        tab.page.click(GO)
        tab.page.wait_for_selector(".facts:has-text('The best so far costs 105')")
        tab.page.wait_for_selector(".team-picture .said", state="attached")
        tab.page.wait_for_selector(".said-list li:has-text('Here are plans of the robots before you')")
        tab.page.click(f"{GO}:has-text('Stop')")
        _told(tab, "The search was stopped; this is the best answer so far. It costs 105.")


def test_a_double_click_begins_once(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(slots(14, 14))
    with watched_page(browser) as tab:
        _opened(tab, application, team)
        tab.page.dblclick(GO)
        tab.page.wait_for_selector(".facts:has-text('The best so far costs 105')")
        tab.page.click(f"{GO}:has-text('Stop')")
        _told(tab, "The search was stopped; this is the best answer so far. It costs 105.")
        assert len(Runs(_Team(slots(14, 14), teams.path(team))).all()) == 1


def test_rules_that_are_in_the_way_are_clicked_away(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(slots(3, 2))
    with watched_page(browser, {"width": 360, "height": 740}, reduced_motion="reduce") as tab:
        _opened(tab, application, team)
        tab.page.click(GO)
        _told(tab, "There is no solution")
        tab.page.click("text=Which rules are in conflict")
        tab.page.wait_for_selector("text=This rule alone cannot hold")
        tab.page.wait_for_selector(".found .trouble >> text=there are only 2 values: robots must step aside")
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360
        tab.page.click("button:has-text('Give it a cost')")
        _told(tab, "All 3 decide. It costs 14: proven the best.")
        tab.page.click("[aria-label^='Undo']")
        tab.page.wait_for_selector("text=The team has changed since then")
        tab.page.click(f"{GO}:has-text('Decide again')")  # the answer is told before the run is over: then it says Stop
        _told(tab, "There is no solution")
        tab.page.click("text=Who would have to step aside")
        _told(tab, "2 of 3 decide.")
        assert tab.page.locator(".team-picture .aside").count() == 1
        tab.page.wait_for_selector(".costs >> text=Together: 3")


def test_places_are_shown_on_the_map(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(example("coverage"))
    with watched_page(browser, {"width": 360, "height": 740}, color_scheme="dark") as tab:
        _opened(tab, application, team)
        assert tab.page.locator(".team-picture .home").count() == 0
        tab.page.click(GO)
        _told(tab, "All 5 decide.")
        tab.page.wait_for_selector(".team-picture .way", state="attached")
        assert min(tab.page.locator(".team-picture .value").all_text_contents()) == "Base"
        assert "--html" not in tab.page.inner_text(".command pre")  # no flight is waited for: the page Fly makes it
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360


def test_hostile_values_are_text(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    hostile = "<img src=x onerror=alert(1)>"
    sketch = slots(2, 2, little=False)
    sketch = msgspec.structs.replace(sketch, decisions=(Decision("slot", DecisionKind.TASK, (hostile, "{{7*7}}'\"")),))
    team = teams.add(sketch)
    with watched_page(browser) as tab:
        _opened(tab, application, team)
        tab.page.click(GO)
        _told(tab, "All 2 decide.")
        assert hostile in tab.page.inner_text(".answer tbody")
        assert tab.page.locator("main img").count() == 0


def test_a_team_that_is_not_ready_says_so(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(Sketch("nobody"))
    with watched_page(browser) as tab:
        _opened(tab, application, team)
        tab.page.wait_for_selector("text=There is no robot yet.")
        assert tab.page.is_disabled(GO)


@pytest.mark.slow
def test_a_server_that_is_killed_leaves_no_process(browser: Browser, tmp_path: Path) -> None:
    teams = TeamStore(tmp_path)
    sketch = slots(14, 14)
    team = teams.add(sketch)
    with watched_page(browser, may_complain=True) as tab:
        application = AppServer(tmp_path)
        _opened(tab, application, team)
        tab.page.click(GO)
        tab.page.wait_for_selector(".facts:has-text('The best so far')")
        children = _children(application.process.pid)
        assert children
        assert application.end(signal.SIGKILL) == -signal.SIGKILL
        wait_until(lambda: not any(map(_is_there, children)), lambda: f"{children} are there still")
        tab.page.goto("about:blank")
        with app_server(tmp_path) as again:
            connected(tab.page, f"{again.url}team/{team}/decide")
            _told(tab, "The application ended during this run")
            tab.page.goto("about:blank")
    assert Runs(_Team(sketch, teams.path(team))).latest is not None


class _Team:
    """A team that no server has open."""

    def __init__(self, sketch: Sketch, folder: Path) -> None:
        self.sketch, self.folder = sketch, folder


def _children(pid: int) -> list[int]:
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(stat.parent.name))
    return found


def _is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True
