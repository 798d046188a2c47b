"""The page "What if": something happens, the team decides again, and the change is kept or taken back."""

from __future__ import annotations

from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, app_page, connected, watched_page
from tests.support.limits import wait_until

ROBOTS = tuple(
    SketchRobot(name, Cell(place, place % 3)) for place, name in enumerate(("North", "East", "South", "West"))
)
LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3, 4))
DIFFERENT = SketchRule("R1", "different", "level")
LITTLE = SketchRule("R2", "little", "level", (), {"step": 1})
TEAM = Sketch("team", Area(5, 4), ROBOTS, (LEVEL,), (DIFFERENT,))


def _names(teams: TeamStore, team: str) -> list[str]:
    return [robot.name for robot in teams.load(team).now.robots]


def test_one_fails_and_the_team_decides_again(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(TEAM)
    with app_page(browser, f"{application.url}team/{team}/whatif") as tab:
        page = tab.page
        page.click("[data-robot=East]")
        page.click("text=It fails")
        page.wait_for_selector("li:has-text('East fails.')")
        page.wait_for_selector("[data-robot=East]", state="detached")
        page.click("text=Decide again")
        page.wait_for_selector(".fate-left:has-text('East')")
        page.wait_for_selector("text=No robot has to change its decision.")
        page.wait_for_selector("text=No message was needed")
        assert page.locator(".whatif-bar").count() == 2
        page.reload()
        page.wait_for_selector(".fate-left:has-text('East')")
        page.click("button:has-text('Keep the changes')")
        wait_until(lambda: _names(teams, team) == ["North", "South", "West"], lambda: str(_names(teams, team)))
        page.wait_for_selector("text=Nothing yet.")
        page.click("[aria-label^='Undo']")
        wait_until(lambda: "East" in _names(teams, team), lambda: str(_names(teams, team)))


def test_by_keyboard_alone_with_costs_and_two_changes_of_which_one_is_taken_back(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(Sketch("team", Area(5, 4), ROBOTS, (LEVEL,), (DIFFERENT, LITTLE)))
    with app_page(browser, f"{application.url}team/{team}/whatif", {"width": 360, "height": 740}) as tab:
        page = tab.page
        for words in ("It fails", "A robot joins here"):
            page.focus(f"button:has-text('{words}')")
            page.keyboard.press("Enter")
        page.wait_for_selector("li:has-text('joins in column 1, row 1.')")
        page.focus("[aria-label='Take back: North fails.']")
        page.keyboard.press("Enter")
        page.wait_for_selector("li:has-text('North fails.')", state="detached")
        page.focus("button:has-text('Decide again')")
        page.keyboard.press("Enter")
        page.wait_for_selector("text=After the events there is no solution.")
        page.wait_for_selector("text=starts again after each change")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_it_happens_where_the_robot_is_by_two_clicks_or_by_keys(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(TEAM)
    with app_page(browser, f"{application.url}team/{team}/whatif", {"width": 360, "height": 740}) as tab:
        page = tab.page
        page.click("[data-robot=East]")
        page.click("[role=menu] >> text=It fails")
        page.wait_for_selector("li:has-text('East fails.')")
        page.focus("[data-robot=South]")
        page.keyboard.press("Enter")
        page.wait_for_selector("[role=menu][aria-label=South]")
        page.wait_for_function("document.activeElement.textContent === 'It fails'")
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        page.wait_for_selector("li:has-text('South has 50 % of its battery left')")
        page.focus("[data-robot=South]")
        page.keyboard.press("Enter")
        page.wait_for_selector("[role=menu]")
        page.keyboard.press("Escape")
        page.wait_for_selector("[role=menu]", state="detached")
        page.wait_for_function("document.activeElement.matches('[data-robot=South]')")
        page.focus(".board .cells")
        page.keyboard.press("Enter")
        page.wait_for_function("document.activeElement.textContent === 'The cell is blocked'")
        page.keyboard.press("Enter")
        page.wait_for_selector("li:has-text('The cell in column 1, row 4 is blocked.')")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_without_a_solution_there_are_ways_out(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(Sketch("team", Area(5, 4), ROBOTS, (LEVEL,), (DIFFERENT, LITTLE)))
    with app_page(browser, f"{application.url}team/{team}/whatif") as tab:
        page = tab.page
        page.focus("button:has-text('A robot joins here')")
        page.keyboard.press("Enter")
        page.wait_for_selector("text=This team has rules with costs, so it decides from scratch after a change.")
        page.focus("button:has-text('Decide again')")
        page.keyboard.press("Enter")
        page.wait_for_selector("text=After the events there is no solution.")
        page.click("text=Who would have to step aside?")
        page.wait_for_selector(".whatif-aside .headline:has-text('4 of 5 decide')")
        page.click("text=Which rules are in conflict")
        page.click("button:has-text('Switch off')")
        page.wait_for_selector("text=No robot has to change its decision.")
        wait_until(lambda: not teams.load(team).now.rules[0].on, lambda: str(teams.load(team).now.rules))


def test_a_team_without_decisions_is_told_what_it_lacks(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    with watched_page(browser) as tab:
        for sketch in (Sketch("empty"), Sketch("idle", robots=ROBOTS)):
            connected(tab.page, f"{application.url}team/{teams.add(sketch)}/whatif")
            tab.page.wait_for_selector("text=no decisions yet")


def test_what_cannot_happen_is_told_at_once(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(Sketch("team", Area(5, 4), ROBOTS[:1], (LEVEL,)))
    with app_page(browser, f"{application.url}team/{team}/whatif") as tab:
        tab.page.click("text=It fails")
        tab.page.wait_for_selector("[role=alert]:has-text('No robot would be left')")
        tab.page.fill("input[aria-label=Column]", "99")
        tab.page.click("text=A robot joins here")
        tab.page.wait_for_selector("[role=alert]:has-text('outside the map')")
