"""The path of a newcomer: five drones, five slots, wishes, one fails. No formula, from the gallery to a report."""

from __future__ import annotations

from pathlib import Path

from robochoc.app.sketch.sketch import Cell, SketchRobot
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, Page, connected, watched_page
from tests.support.limits import HANG_S, wait_until

MOST_CLICKS = 60
"""Three minutes, at three seconds a click."""


class Newcomer:
    """Somebody with a mouse, who counts."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.clicks = 0

    def click(self, what: str) -> None:
        """Click what the selector finds."""
        self.clicks += 1
        self.page.locator(what).first.click()

    def press(self, name: str) -> None:
        """Click the button of that name."""
        self.clicks += 1
        self.page.get_by_role("button", name=name).first.click()

    def cell(self, x: int, y: int) -> None:
        """Click a cell of a map of 8 columns and 6 rows."""
        self.clicks += 1
        box = self.page.locator(".board .cells").bounding_box()
        self.page.mouse.click(box["x"] + (x + 0.5) * box["width"] / 8, box["y"] + (5.5 - y) * box["height"] / 6)

    def rule(self, name: str) -> None:
        """Choose a rule of the palette."""
        self.press("Add a rule")
        self.clicks += 1
        self.page.locator(".palette .card", has=self.page.get_by_text(name, exact=True)).click()
        self.page.wait_for_selector(".form")

    def wish(self, robot: str, slot: int) -> None:
        """Let a robot prefer a slot."""
        self.click(f"[data-robot={robot}]")
        self.page.wait_for_selector(f"[data-robot={robot}].chosen")
        self.rule("Prefers")
        self.clicks += 2
        self.page.get_by_role("combobox", name="Value").click()
        self.page.get_by_role("option", name=str(slot), exact=True).click()
        self.page.wait_for_selector(f"text=For {robot}, slot should be: {slot}.")
        self.press("Done")
        self.click(f"[data-robot={robot}]")
        self.page.wait_for_selector(".robot.chosen", state="detached")


def test_from_the_gallery_to_a_report(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page, newcomer = tab.page, Newcomer(tab.page)
        connected(page, application.url)
        newcomer.click("text=A new team")
        page.wait_for_selector(".board svg")
        team = page.url.split("/")[-2]
        for number in range(5):
            newcomer.cell(number, 2)
            page.wait_for_selector(f"[data-robot=Drone{number + 1}]")
        newcomer.press("Add a decision: Slot")
        newcomer.press("Add a decision: Level")
        newcomer.press("Select")
        newcomer.rule("All different")
        newcomer.press("Done")
        newcomer.wish("Drone1", 3)
        newcomer.wish("Drone2", 3)
        wait_until(lambda: len(teams.load(team).now.rules) == 3, lambda: str(teams.load(team).now.rules))

        newcomer.click("nav >> text=Decide")
        newcomer.press("Decide")
        page.wait_for_selector(".headline:has-text('All 5 decide')")

        newcomer.click("nav >> text=What if")
        newcomer.click("[data-robot=Drone1]")
        newcomer.press("It fails")
        newcomer.press("Decide again")
        page.wait_for_selector(".fate-left:has-text('Drone1')", timeout=HANG_S * 1000)
        newcomer.press("Keep the changes")
        wait_until(
            lambda: SketchRobot("Drone1", Cell(0, 2)) not in teams.load(team).now.robots,
            lambda: str(teams.load(team).now.robots),
        )

        newcomer.click("nav >> text=Decide")
        newcomer.press("Decide")
        page.wait_for_selector(".headline:has-text('All 4 decide')")
        newcomer.click("nav >> text=Fly")
        with page.expect_download() as saved:
            newcomer.click("[aria-label='Report: Save']")
        saved.value.save_as(tmp_path / "report.html")
    assert newcomer.clicks <= MOST_CLICKS
    assert "Drone5" in (tmp_path / "report.html").read_text(encoding="utf-8")
