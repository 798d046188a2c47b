"""The page "Play": a person plays one robot by keyboard, on a narrow screen, to the end of the game."""

from __future__ import annotations

from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.store import TeamStore
from tests.support.accessibility import axe_findings
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, app_page

ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate(("North", "East", "South")))
LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3))
RULES = (SketchRule("R1", "different", "level"), SketchRule("R2", "little", "level", (), {"step": 1}))
TEAM = Sketch("team", Area(5, 4), ROBOTS, (LEVEL,), RULES)
NARROW = {"width": 360, "height": 740}


def test_a_game_by_keyboard_on_a_narrow_screen(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(TEAM)
    with app_page(browser, f"{application.url}team/{team}/play", NARROW) as tab:
        page = tab.page
        page.fill("[aria-label=Rounds]", "2")
        page.focus("button:has-text('Start the game')")
        page.keyboard.press("Enter")
        page.wait_for_selector("h2:has-text('Round 1 of 2')")
        page.wait_for_function("document.activeElement.classList.contains('seat-heading')")
        page.keyboard.press("Tab")
        page.wait_for_function("document.activeElement.getAttribute('role') === 'radio'")
        page.keyboard.press("ArrowDown")
        page.fill("[aria-label^='Say something']", "I begin <script>alert(1)</script>")
        page.keyboard.press("Enter")
        page.wait_for_selector("h2:has-text('Round 2 of 2')")
        page.wait_for_selector("li:has-text('East: ')")
        page.reload()
        page.wait_for_selector("h2:has-text('Round 2 of 2')")
        page.wait_for_selector("li:has-text('East: ')")
        assert page.evaluate("document.documentElement.scrollWidth") <= NARROW["width"]
        assert [text for impact, text in axe_findings(page) if impact in {"serious", "critical"}] == []
        page.focus("button:has-text('End my turn')")
        page.keyboard.press("Enter")
        page.wait_for_selector("h2:has-text('The game is over')")
        page.wait_for_selector("text=The best possible")
        page.click("button:has-text('Start a new game')")
        page.wait_for_selector("h2:has-text('Round 1 of 2')")


def test_a_team_without_decisions_or_solution(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(Sketch("team", Area(5, 4), ROBOTS, (), ()))
    with app_page(browser, f"{application.url}team/{team}/play") as tab:
        tab.page.wait_for_selector("text=The team has no robots or no decisions yet.")
    two = Decision("level", DecisionKind.LEVEL, (1, 2))
    team = teams.add(Sketch("team", Area(5, 4), ROBOTS, (two,), RULES[:1]))
    with app_page(browser, f"{application.url}team/{team}/play") as tab:
        tab.page.click("button:has-text('Start the game')")
        for _ in range(5):
            tab.page.click("button:has-text('End my turn'):enabled")
            tab.page.wait_for_timeout(50)
        tab.page.wait_for_selector("text=No choices keep all rules.")
