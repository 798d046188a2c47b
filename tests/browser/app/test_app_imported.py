"""Teams that were not drawn here: read, decided, flown, compared, and what if a robot fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.app.sketch import files
from robochoc.app.sketch.example_sketches import example
from robochoc.app.sketch.open_from_disk import ImportedTeam, open_team
from robochoc.app.store import TeamStore
from robochoc.formats import write_team
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, WatchedPage, connected, watched_page
from tests.support.program import ROOT
from tests.support.small_teams import triangle

GO = ".go button"


def _kept(teams: TeamStore, path: Path) -> str:
    found = open_team(path)
    assert isinstance(found, ImportedTeam)
    return teams.add_imported(found)


def _shown(tab: WatchedPage, application: AppServer, team: str, area: str) -> None:
    connected(tab.page, f"{application.url}team/{team}/{area}")


def test_a_team_with_a_scenario_is_read_decided_and_asked_what_if(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = _kept(teams, ROOT / "docs/examples/rescue")
    with watched_page(browser) as tab:
        _shown(tab, application, team, "model")
        tab.page.wait_for_selector("text=When it has decided: East leaves.")
        tab.page.fill(".imported-choice input", "South")
        tab.page.click(".q-item:has-text('South')")
        tab.page.wait_for_selector("h3:has-text('South.xml')")
        _shown(tab, application, team, "decide")
        tab.page.click(GO)
        tab.page.wait_for_selector(".headline:has-text('All 7 decide.')")
        assert tab.page.locator(".imported-table li").count() == 5
        _shown(tab, application, team, "whatif")
        tab.page.click("button:has-text('Let the others decide again')")
        tab.page.wait_for_selector("text=First choose the robots that fail.")
        tab.page.fill(".imported-who input", "Medic")
        tab.page.click(".q-item:has-text('Medic')")
        tab.page.keyboard.press("Escape")
        tab.page.click("button:has-text('Let the others decide again')")
        tab.page.wait_for_selector("text=Failed: Medic.")
        assert "fly?run=" in (tab.page.get_attribute("a:has-text('Watch the flight')", "href") or "")


def test_a_point_of_the_front_is_chosen_by_mouse_and_keyboard(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = _kept(teams, ROOT / "docs/examples/survey")
    with watched_page(browser, viewport={"width": 360, "height": 700}) as tab:
        _shown(tab, application, team, "decide")
        tab.page.click(GO)
        tab.page.wait_for_selector(".headline:has-text('point 1 of 8 on the Pareto front: energy 11 and risk 45')")
        tab.page.click(".front .points a[href='#p4']")
        tab.page.wait_for_selector(".headline:has-text('point 4 of 8 on the Pareto front: energy 17 and risk 26')")
        tab.page.focus(".front svg a[href='#p6']")
        tab.page.keyboard.press("Enter")
        tab.page.wait_for_selector(".headline:has-text('point 6 of 8 on the Pareto front: energy 23 and risk 14')")
        tab.page.wait_for_selector(".team-picture g:has-text('North'):has-text('2')")
        tab.page.wait_for_selector(".front svg a[href='#p6']:focus")
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360
        _shown(tab, application, team, "decide")
        tab.page.wait_for_selector(".headline:has-text('point 6 of 8')")
        _shown(tab, application, team, "play")
        tab.page.click("button:has-text('Start the game')")
        tab.page.wait_for_selector("text=there are several objectives (energy, risk)")


def test_without_a_solution_the_constraints_in_the_way_are_told_and_who_steps_aside(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    write_team(triangle(2), tmp_path / "triangle")
    team = _kept(teams, tmp_path / "triangle")
    with watched_page(browser) as tab:
        _shown(tab, application, team, "decide")
        tab.page.click(GO)
        tab.page.click(".door:has-text('Which constraints')")
        tab.page.wait_for_selector("text=These 3 constraints cannot hold together.")
        assert tab.page.locator(".found li").count() == 3
        tab.page.click(".door:has-text('Who would have to step aside?')")
        tab.page.wait_for_selector(".headline:has-text('3 of 4 decide.')")


def test_what_was_changed_by_hand_is_named(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    folder = tmp_path / "charging"
    files.save(example("charging"), folder)
    file = min(folder.glob("*.xml"))
    file.write_text(file.read_text().replace("<presentation", '<presentation weight="9"', 1))
    team = _kept(teams, folder)
    with watched_page(browser, viewport={"width": 360, "height": 700}) as tab:
        _shown(tab, application, team, "model")
        tab.page.wait_for_selector(f"text=these files were changed later: {file.name}.")
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360


@pytest.mark.slow
def test_a_team_of_files_is_compared_and_flies(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = _kept(teams, ROOT / "docs/examples/hangar")
    with watched_page(browser) as tab:
        _shown(tab, application, team, "decide")
        tab.page.click(GO)
        tab.page.wait_for_selector(".headline:has-text('All 6 decide.')")
        _shown(tab, application, team, "fly")
        tab.page.wait_for_selector("iframe[src*='flight.html']")
        _shown(tab, application, team, "compare")
        tab.page.fill("input[aria-label='Runs of each']", "1")
        tab.page.click("button:has-text('Compare')")
        tab.page.wait_for_selector(".compare-lines")
        assert tab.page.locator(".compare-lines tbody tr").count() == 2
