"""The page "Compare": two protocols on a team, with progress, pictures, and a stop."""

from __future__ import annotations

from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, Page, app_page, connected, watched_page

ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate("ABCD"))
SLOT = Decision("slot", DecisionKind.SLOT, (1, 2, 3, 4))
TEAM = Sketch("team", Area(4, 1), ROBOTS, (SLOT,), (SketchRule("R1", "different", "slot"),))


def _asked(page: Page, application: AppServer, team: str) -> None:
    connected(page, f"{application.url}team/{team}/compare")
    page.wait_for_selector("text=Runs of each")


def test_two_protocols_are_compared(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(TEAM)
    with watched_page(browser, {"width": 360, "height": 740}) as tab:
        page = tab.page
        _asked(page, application, team)
        chosen = [box.inner_text() for box in page.locator(".protocol[aria-checked=true]").all()]
        assert len(chosen) == 2
        page.locator(f".protocol:has-text('{chosen[0]}')").first.press("Space")
        page.focus("button:has-text('Compare')")
        page.keyboard.press("Enter")
        page.wait_for_selector("[role=alert]:has-text('at least two protocols')")
        page.locator(f".protocol:has-text('{chosen[0]}')").first.press("Space")
        page.fill("input[aria-label='Runs of each']", "3")
        page.click("button:has-text('Compare')")
        page.wait_for_selector(".compare-lines, .error:has-text('did not work')")
        assert page.locator(".compare-lines tbody tr").count() == 2
        assert page.locator(".compare-lines td:has-text('3 of 3')").count() == 2
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        if page.locator("iframe").count():
            page.frame_locator("iframe").locator("h1:has-text('on team')").wait_for()
        else:  # without matplotlib
            page.wait_for_selector("text=There are no pictures")


def test_a_study_is_stopped(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(TEAM)
    with watched_page(browser) as tab:
        _asked(tab.page, application, team)
        tab.page.click("text=Similar problems")
        tab.page.fill("input[aria-label='Runs of each']", "100")
        tab.page.click("button:has-text('Compare')")
        tab.page.click("button:has-text('Stop')")
        tab.page.wait_for_selector("text=The study was stopped")
        tab.page.wait_for_selector("button:has-text('Compare again'):not([disabled])")


def test_what_has_to_be_mended_first_is_told(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    nowhere = SketchRule("R1", "prefers", "slot", settings={})
    team = teams.add(Sketch("team", Area(4, 1), ROBOTS, (SLOT,), (nowhere,)))
    with app_page(browser, f"{application.url}team/{team}/compare") as tab:
        tab.page.wait_for_selector(".error:has-text('This team cannot be compared yet: A value in R1')")
        tab.page.click("text=Go to Model")
        tab.page.wait_for_url("**/model")
