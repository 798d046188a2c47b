"""The page "Model": a team is drawn by clicks, and by keys alone."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from typing import Any

from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, Page, WatchedPage, connected, watched_page
from tests.support.limits import wait_until

HOSTILE = """<img src=x onerror="alert(1)">'"`${1}{{1}}\\"""
LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3))


def drones(count: int, columns: int = 8) -> tuple[SketchRobot, ...]:
    return tuple(
        SketchRobot(f"Drone{number + 1}", Cell(number % columns, number // columns)) for number in range(count)
    )


def opened(tab: WatchedPage, application: AppServer, team: str) -> Any:  # noqa: ANN401 - Playwright's
    connected(tab.page, f"{application.url}team/{team}/model")
    tab.page.wait_for_selector(".board svg")
    return tab.page


def becomes(teams: TeamStore, team: str, holds: Callable[[Sketch], bool]) -> Sketch:
    """Wait until what is on disk is so."""
    wait_until(lambda: holds(teams.load(team).now), lambda: f"it is {teams.load(team).now}")
    return teams.load(team).now


def click_cell(page: Page, x: int, y: int) -> None:
    """Click a cell of a map of 8 columns and 6 rows."""
    box = page.locator(".board .cells").bounding_box()
    page.mouse.click(box["x"] + (x + 0.5) * box["width"] / 8, box["y"] + (5.5 - y) * box["height"] / 6)


def pick(page: Page, rule: str) -> None:
    page.get_by_role("button", name="Add a rule").click()
    page.locator(".palette .card", has=page.get_by_text(rule, exact=True)).click()
    page.wait_for_selector(".form")


def test_five_drones_and_five_charging_slots_are_modelled_by_clicks(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(Sketch("charging"))
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page = opened(tab, application, team)
        for number in range(5):
            click_cell(page, number, 2)
            page.wait_for_selector(f"[data-robot=Drone{number + 1}]")
        page.get_by_role("button", name="Add a decision: Slot").click()
        becomes(teams, team, lambda sketch: sketch.decisions == (Decision("slot", DecisionKind.SLOT, (1, 2, 3, 4, 5)),))
        page.get_by_role("button", name="Select", exact=True).click()
        page.wait_for_selector("[data-robot=Drone5].chosen")  # since it was added: rules are for all
        pick(page, "All different")
        page.wait_for_selector(".link.lines .seen[d^=M]", state="attached")
        page.get_by_role("button", name="Done").click()
        for robot, value in (("Drone1", "3"), ("Drone2", "3")):
            page.locator(f"[data-robot={robot}]").click()
            page.wait_for_selector(f"[data-robot={robot}].chosen")
            pick(page, "Prefers")
            page.get_by_role("combobox", name="Value").click()
            page.get_by_role("option", name=value, exact=True).click()
            page.get_by_label("Cost when it is broken").and_(page.locator("input")).fill("4")
            page.wait_for_selector(f"text=For {robot}, slot should be: {value}.")
            page.get_by_role("button", name="Done").click()
            page.locator(f"[data-robot={robot}]").click()
            page.wait_for_selector(".robot.chosen", state="detached")
        made = becomes(teams, team, lambda sketch: [rule.cost for rule in sketch.rules] == [None, 4, 4])
        assert made.rules == (
            SketchRule("R1", "different", "slot"),
            SketchRule("R2", "prefers", "slot", ("Drone1",), {"value": 3}, 4),
            SketchRule("R3", "prefers", "slot", ("Drone2",), {"value": 3}, 4),
        )
        page.wait_for_function("document.querySelector('.source').textContent.includes('cost=4')")
        page.get_by_role("button", name="XML", exact=True).click()
        page.wait_for_function("document.querySelector('.source').textContent.includes('</')")
        with page.expect_download() as saved:
            page.get_by_role("button", name="Save as a team").click()
        with zipfile.ZipFile(saved.value.path()) as archive:
            assert {f"charging/Drone{number}.xml" for number in range(1, 6)} <= {*archive.namelist()}
            assert archive.testzip() is None


OLD_ROBOTS = """async () => {
    const board = getElement(Number(document.querySelector(".board").id.slice(1)));
    const press = (key) => document.querySelector("[data-robot=Drone1]").dispatchEvent(
        new KeyboardEvent("keydown", { key, bubbles: true }));
    const old = [...board.robots];
    press("ArrowUp");
    board.$.props.robots = old;
    await board.$nextTick();
    press("ArrowRight");
}"""
"""A key, then an update that was under way before it, then another key."""


def test_keys_are_not_undone_by_updates_that_were_under_way(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(Sketch("fast", robots=drones(1)))
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page = opened(tab, application, team)
        page.evaluate(OLD_ROBOTS)
        becomes(teams, team, lambda sketch: sketch.robots[0].at == Cell(1, 1))
        page.evaluate(OLD_ROBOTS)
        becomes(teams, team, lambda sketch: sketch.robots[0].at == Cell(2, 2))


def test_a_team_is_modelled_by_keys_alone(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(Sketch("keys"))
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page = opened(tab, application, team)

        def reach(selector: str) -> None:
            for _ in range(60):
                if page.evaluate("which => document.activeElement.matches(which)", selector):
                    return
                page.keyboard.press("Tab")
            raise AssertionError(f"{selector} is not reached by Tab")

        reach(".board .cells")
        for key in ("ArrowRight", "ArrowDown", "Enter", "ArrowRight", "Enter"):
            page.keyboard.press(key)
        page.wait_for_selector("[data-robot=Drone2]")
        becomes(teams, team, lambda sketch: [robot.at for robot in sketch.robots] == [Cell(1, 4), Cell(2, 4)])
        reach("[data-robot=Drone2]")
        for key in ("ArrowUp", "ArrowRight", "ArrowRight"):
            page.keyboard.press(key)
        becomes(teams, team, lambda sketch: sketch.robots[1].at == Cell(4, 5))
        reach("[aria-label='Add a decision: Level']")
        page.keyboard.press("Enter")
        page.wait_for_selector("text=Level: level")
        reach(".part > .bg-primary")
        page.keyboard.press("Enter")
        page.wait_for_selector(".palette .card")
        reach(".palette .card")
        page.keyboard.press("Enter")
        becomes(teams, team, lambda sketch: [rule.kind for rule in sketch.rules] == ["different"])
        page.keyboard.press("Control+z")
        becomes(teams, team, lambda sketch: not sketch.rules)
        page.locator("[data-robot=Drone1]").focus()
        page.keyboard.press("Delete")
        becomes(teams, team, lambda sketch: [robot.name for robot in sketch.robots] == ["Drone2"])
        page.wait_for_function("document.activeElement.matches('[data-robot=Drone2]')")


def test_robots_are_dragged_and_both_tabs_stay_in_step(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(Sketch("drag", robots=drones(2), decisions=(LEVEL,)))
    with watched_page(browser) as one, watched_page(browser) as other:
        page, there = opened(one, application, team), opened(other, application, team)
        before = there.locator("[data-robot=Drone1]").get_attribute("transform")
        page.bring_to_front()
        page.locator("[data-robot=Drone1]").scroll_into_view_if_needed()
        box = page.locator("[data-robot=Drone1] .body").bounding_box()
        cell = page.locator(".board .cells").bounding_box()["width"] / 8
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + cell, y - cell, steps=4)
        page.mouse.move(x + 3 * cell, y - 2 * cell, steps=4)
        page.mouse.up()
        becomes(teams, team, lambda sketch: sketch.robots[0].at == Cell(3, 2))
        there.wait_for_function(
            "was => document.querySelector('[data-robot=Drone1]').getAttribute('transform') !== was", arg=before
        )


def test_cells_under_links_can_be_clicked(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    corners = tuple(SketchRobot(f"At{x}{y}", Cell(x, y)) for x, y in ((0, 0), (7, 0), (0, 5), (7, 5)))
    rules = (
        SketchRule("R1", "at-most", "level", (), {"value": 1, "count": 1}),
        SketchRule("R2", "different", "level"),
    )
    team = teams.add(Sketch("under", robots=corners, decisions=(LEVEL,), rules=rules))
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page = opened(tab, application, team)
        page.wait_for_selector(".link.hull .seen[d^=M]", state="attached")
        page.get_by_role("button", name="Block cell").click()
        page.wait_for_selector(".board .tool-block")  # before, a click is for the link, as the server has not answered
        click_cell(page, 3, 0)
        becomes(teams, team, lambda sketch: sketch.area.blocked == {Cell(3, 0)})
        page.get_by_role("button", name="Add robot").click()
        click_cell(page, 3, 0)
        click_cell(page, 4, 2)
        added = becomes(teams, team, lambda sketch: len(sketch.robots) == 6)
        assert [robot.at for robot in added.robots[4:]] == [Cell(3, 0), Cell(4, 2)]
        page.wait_for_selector("[data-robot=Drone1].bad")
        page.get_by_role("button", name="Select", exact=True).click()
        page.locator(".link.lines .hit").focus()
        page.wait_for_selector(".words >> text=different")
        page.keyboard.press("Enter")
        page.wait_for_selector(".rule.opened >> text=all robots choose different values")


def test_what_is_wrong_is_told_where_it_is(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    rules = (SketchRule("R1", "apart", "level", (), {"gap": 9}), SketchRule("R2", "only", "level", ("Drone1",)))
    slot = Decision("slot", DecisionKind.SLOT, (1,), ("Ghost", "Drone1"))
    blocked = Area(8, 6, frozenset({Cell(0, 0)}))
    team = teams.add(Sketch("wrong", blocked, drones(2), (LEVEL, slot), rules))
    with watched_page(browser) as tab:
        page = opened(tab, application, team)
        page.wait_for_selector(".rule .trouble >> text=allows no values")
        page.wait_for_selector("[data-robot=Drone1].bad")
        page.wait_for_selector(".entry .trouble >> text=a robot that does not exist")
        page.locator(".rule .sentence").nth(1).click()
        page.wait_for_selector(".form")
        assert page.get_attribute("[aria-label^='Undo']", "disabled") is not None  # looking at it edits nothing
        values = page.locator("article", has_text="Level: level").get_by_label("Values")
        values.fill("1-, <b>")
        page.wait_for_selector("text=is not a number")
        values.fill("")
        page.wait_for_selector(".entry .trouble >> text=level has no values")
        name = page.locator("article", has_text="Level: level").get_by_label("Name")
        name.fill("")
        page.wait_for_selector("text='' is not a valid name")
        page.get_by_label("Columns").fill("61")
        page.wait_for_selector("text=Choose a number from 1 to 60.")
    assert teams.load(team).now.area.columns == 8


def test_hostile_words_stay_words(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    task = Decision(
        "task",
        DecisionKind.TASK,
        (HOSTILE, "```\N{LEFT-POINTING ANGLE BRACKET}", "</textarea><script>alert(1)</script>"),
    )
    rules = (
        SketchRule("R1", "never", "task", (), {"value": HOSTILE}),
        SketchRule("R2", "table", "task", ("Drone1", "Drone2"), {"rows": [[HOSTILE, HOSTILE]]}),
    )
    team = teams.add(Sketch("hostile", robots=drones(2), decisions=(task,), rules=rules))
    with watched_page(browser) as tab:
        page = opened(tab, application, team)
        page.wait_for_selector(".source >> text=onerror")
        page.locator(".rule .sentence").nth(1).click()
        page.wait_for_selector(".pairs button")
        page.locator(".pairs td button").nth(1).click()
        becomes(
            teams,
            team,
            lambda sketch: sketch.rules[1].settings == {"rows": [[HOSTILE, HOSTILE], [HOSTILE, task.values[1]]]},
        )
        page.locator(".rule .sentence").nth(0).click()
        page.locator("[data-robot=Drone1]").click()
        page.get_by_role("button", name="Done").click()
        page.locator("[data-robot=Drone2]").click()
        for field in ("Name", "Weight", "Rank"):
            found = page.locator("[aria-label=Robots]").get_by_label(field, exact=True)
            found.fill(HOSTILE) if field == "Name" else found.fill("9" * 15)
        page.wait_for_selector("text=is not a valid name")
        values = page.locator("article", has_text="Task: task").get_by_label("Values")
        values.fill(f"{HOSTILE}, <svg/onload=alert(1)>")
        becomes(teams, team, lambda sketch: len(sketch.decisions[0].values) == 2)
        assert page.evaluate("document.querySelectorAll('main img, main script, main textarea').length") == 0
    assert [robot.name for robot in teams.load(team).now.robots] == ["Drone1", "Drone2"]


def test_121_robots_on_a_large_map_are_drawn_and_dragged(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    rules = (
        SketchRule("R1", "different", "level"),
        SketchRule("R2", "neighbours-apart", "level", (), {"radius": 3, "gap": 2}),
    )
    team = teams.add(Sketch("many", Area(60, 60), drones(121, 11), (LEVEL,), rules))
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page = opened(tab, application, team)
        page.wait_for_function("document.querySelectorAll('.link .seen[d^=M]').length === 2")
        assert page.locator(".robot").count() == 121
        page.wait_for_selector("text=The sources of a large team are written on request.")
        page.locator("[data-robot=Drone121]").focus()
        page.keyboard.press("ArrowUp")
        becomes(teams, team, lambda sketch: sketch.robots[120].at == Cell(10, 11))


def test_a_large_table_is_clicked_together_by_keys(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    rules = (SketchRule("R1", "table", "level", ("Drone1", "Drone2"), {"rows": [[1, 1]]}),)
    levels = Decision("level", DecisionKind.LEVEL, tuple(range(1, 101)))
    team = teams.add(Sketch("pairs", robots=drones(2), decisions=(levels,), rules=rules))
    with watched_page(browser) as tab:
        page = opened(tab, application, team)
        page.locator(".rule .sentence").click()
        page.focus("[data-at='0:0']")
        for key in ("PageDown", "PageDown", "End", "Enter", "ArrowDown", "ArrowLeft", "Shift+Enter"):
            page.keyboard.press(key)
        square = [[one, other] for one in (33, 34) for other in (99, 100)]
        made = becomes(teams, team, lambda sketch: len(sketch.rules[0].settings["rows"]) == 5)  # type: ignore[arg-type] # a list
        assert sorted(made.rules[0].settings["rows"]) == [[1, 1], *square]  # type: ignore[arg-type] # a list
        page.wait_for_selector("text=Across: 85 to 100, of 100")
        page.keyboard.press("Home")
        page.keyboard.press("ArrowLeft")
        page.wait_for_function("document.activeElement.matches('.head')")
        page.keyboard.press("Enter")
        becomes(teams, team, lambda sketch: len(sketch.rules[0].settings["rows"]) == 103)  # type: ignore[arg-type] # a list


def test_a_range_becomes_what_its_start_became_before_the_server_has_answered(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    rules = (SketchRule("R1", "table", "level", ("Drone1", "Drone2"), {"rows": [[1, 1]]}),)
    levels = Decision("level", DecisionKind.LEVEL, tuple(range(1, 6)))
    team = teams.add(Sketch("pairs", robots=drones(2), decisions=(levels,), rules=rules))
    with watched_page(browser) as tab:
        page = opened(tab, application, team)
        page.locator(".rule .sentence").click()
        page.wait_for_selector("[data-at='2:2']")
        # In one step of the page: no answer can come in between.
        page.evaluate("""() => {
            document.querySelector("[data-at='2:2']").click();
            const shift = new MouseEvent("click", {bubbles: true, shiftKey: true});
            document.querySelector("[data-at='3:3']").dispatchEvent(shift);
        }""")
        square = [[one, other] for one in (3, 4) for other in (3, 4)]
        made = becomes(teams, team, lambda sketch: len(sketch.rules[0].settings["rows"]) == 5)  # type: ignore[arg-type] # a list
        assert sorted(made.rules[0].settings["rows"]) == [[1, 1], *square]  # type: ignore[arg-type] # a list


def test_the_last_robot_and_the_last_cell_stay_and_secrets_say_why_they_are_off(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    place = Decision("place", DecisionKind.PLACE, (40,))
    rules = (
        SketchRule("R1", "prefers", "level", ("Drone1",), {"value": 1}, 3),
        SketchRule("R2", "apart", "level", (), {"gap": 1}),
    )
    team = teams.add(Sketch("last", robots=drones(2), decisions=(place, LEVEL), rules=rules))
    with watched_page(browser, {"width": 1280, "height": 900}) as tab:
        page = opened(tab, application, team)
        page.get_by_role("button", name="Add robot").click()
        page.get_by_role("switch", name="Choose cells by clicking them").click()
        page.wait_for_selector("text=Click the cells that the robots can choose.")
        page.wait_for_selector("button[aria-pressed=true]:has-text('Select')")  # a click adds no robot now
        click_cell(page, 0, 5)
        page.wait_for_selector("[role=alert] >> text=This is the last cell for place.")
        page.locator(".rule .sentence").nth(0).click()
        page.locator("[data-robot=Drone1]").click()
        page.wait_for_selector("[role=alert] >> text=Drone1 is the last robot of this rule.")
        page.get_by_role("button", name="Everybody").click()
        becomes(teams, team, lambda sketch: sketch.rules[0].robots == ())
        page.locator(".rule .sentence").nth(1).click()
        page.wait_for_selector("text=Private is not available: R1 has a cost")
        assert page.get_by_role("switch", name="Private").get_attribute("aria-disabled") == "true"


def test_a_narrow_screen_needs_no_scrolling_to_the_side(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    rules = (
        SketchRule("R1", "apart", "level", (), {"gap": 1}, 3),
        SketchRule("R2", "table", "level", ("Drone1", "Drone2")),
    )
    levels = Decision("level", DecisionKind.LEVEL, tuple(range(30)))
    team = teams.add(Sketch("narrow", Area(60, 20), drones(9), (levels,), rules))
    with watched_page(browser, {"width": 360, "height": 740}) as tab:
        page = opened(tab, application, team)
        for number in range(2):
            page.locator(".rule .sentence").nth(number).click()
            page.wait_for_selector(".form")
            assert page.evaluate("document.documentElement.scrollWidth") <= 360
        for scheme, wanted in (("light", "rgb(255, 255, 255)"), ("dark", "rgb(13, 21, 32)")):
            page.emulate_media(color_scheme=scheme)
            page.wait_for_function(
                """wanted => [...document.querySelectorAll('.segments .q-btn[aria-pressed=true]')]
                    .every((one) => getComputedStyle(one).color === wanted)""",
                arg=wanted,
            )
