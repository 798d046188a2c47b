"""The sniffer's page in a browser: what is looked at stays in sight, and sentences say what is so."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robochoc.journal.journal import lines_of
from robochoc.sniffer.session import SnifferSession
from tests.support.browser_pages import Page
from tests.support.sniffer_pages import (
    ALL,
    CONTRAST,
    COUNT,
    FEED,
    JOURNAL,
    OUTCOME,
    TRACE,
    begin_again,
    choose,
    heads,
    robot,
    rows,
    text_is,
    until,
)
from tests.support.sniffer_server import sniffer_server

IN_SIGHT = """(m) => {
  const { filter, view, chart, list } = Sniffer.page;
  const row = Math.min(filter.rowOf(m), filter.length - 1);
  return row >= view.top && row + 1 <= view.top + chart.shape.rowsInWindow + 0.01
    && row + 0.01 >= list.top && row + 1 <= list.top + list.inWindow + 0.5;
}"""
"""Whether a message, or the next one that is shown, is in the window of both the lifelines and the table."""


pytestmark = pytest.mark.usefixtures("without_the_scenes_viewer")


@pytest.fixture
def page(tab: Page) -> Page:
    """The page as it begins; one for all."""
    begin_again(tab)
    return tab


def test_a_recorded_run_begins_at_its_beginning(page: Page) -> None:
    assert page.inner_text("#when").startswith(f"step 1 of {len(TRACE.steps.t)} ")
    assert "press p to play" in page.inner_text("#when")
    assert rows(page)[0] == 0
    page.click("#last")
    text = f"step {len(TRACE.steps.t)} of {len(TRACE.steps.t)} "
    until(lambda: page.inner_text("#when").startswith(text), "the last step is not the last")
    assert "press p" not in page.inner_text("#when")


def test_what_is_chosen_stays_in_sight(page: Page) -> None:
    page.focus("#grid")
    page.keyboard.press("End")
    chosen = COUNT - 1
    until(lambda: page.inner_text("#message h2").startswith(f"{chosen} "), "it is not chosen")
    page.click("#tab-filters")
    kind = page.get_by_role("checkbox", name=re.compile("^Ok"))
    counts = [0, 0]
    for at, act in enumerate((kind.uncheck, kind.check)):
        act()
        until(lambda: page.evaluate(IN_SIGHT, chosen), "lost by a filter")
        counts[at] = page.evaluate("Sniffer.page.filter.length")
    assert counts[0] < counts[1] == COUNT
    choose(page, 300)
    page.fill("#filters input[type=search] >> nth=0", "Robot1.*")
    until(lambda: page.evaluate("Sniffer.page.filter.length") < COUNT, "no filter")
    assert page.evaluate(IN_SIGHT, 300)
    page.get_by_role("button", name="Show all messages").click()
    text_is(page, "#counts", ALL)
    assert page.evaluate(IN_SIGHT, 300)
    page.click("#tab-robots")
    for button in ("Collapse groups", "Expand groups"):
        page.get_by_role("button", name=button).click()
        assert page.evaluate(IN_SIGHT, 300)
    page.fill("#robots input[type=search]", "Robot2.*")
    page.get_by_role("button", name="Only these").click()
    until(lambda: page.evaluate("Sniffer.page.filter.length") < COUNT, "no choice")
    assert page.evaluate(IN_SIGHT, 300)
    page.get_by_role("button", name="Reset").click()
    text_is(page, "#counts", ALL)
    assert page.input_value("#robots input[type=search]") == ""
    for layout in ("chart", "table", "both"):
        page.locator(f"[name=layout][value={layout}]").click(force=True)
    until(lambda: page.evaluate(IN_SIGHT, 300), "lost by a layout")


def test_lifelines_and_table_are_scrolled_together(page: Page) -> None:
    tops = "[Sniffer.page.view.top, Sniffer.page.list.top]"
    for place, wheel in (("#drawing", 4800), ("#grid", 2800), ("#drawing", -2400), ("#minimap", 1200), ("#grid", -560)):
        before = page.evaluate(tops)
        page.locator(place).hover()
        page.mouse.wheel(0, wheel)
        until(lambda: all(abs(new - old) > 9 for new, old in zip(page.evaluate(tops), before, strict=True)), place)  # noqa: B023
        until(lambda: abs(page.evaluate(f"{tops}[0] - {tops}[1]")) < 0.1, f"apart by {place}")
    page.evaluate("Sniffer.page.chart.scrollBy(1e6)")
    lowest = page.evaluate("Sniffer.page.view.top")
    until(lambda: page.evaluate(f"Math.abs({tops}[0] - {tops}[1])") < 0.1, "apart at the end")
    page.locator("#grid").hover()
    page.mouse.wheel(0, 100_000)  # the last rows of the table, which is not as tall
    until(lambda: rows(page)[-1] == COUNT - 1, "the last row cannot be reached")
    assert page.evaluate("Sniffer.page.view.top") == lowest


def test_what_stands_on_top_stays_there(page: Page) -> None:
    page.evaluate("Sniffer.page.view.set({ top: 200 })")
    of = TRACE.messages
    first = next(m for m in range(200, COUNT) if TRACE.kinds[of.kind[m]] != "Ok")
    page.click("#tab-filters")
    page.get_by_role("checkbox", name=re.compile("^Ok")).uncheck()
    until(lambda: rows(page) and rows(page)[0] == first, "the table is elsewhere")
    assert page.evaluate("Sniffer.page.filter.at(Math.floor(Sniffer.page.view.top))") == first


def test_all_lifelines_are_in_the_window_and_no_column_is_beyond_it(page: Page) -> None:
    choose(page, 100)
    said = FEED.words(100).removeprefix(f"{TRACE.robots[TRACE.messages.sender[100]]} says: ")
    assert said != FEED.words(100)
    for width in (1400, 1000):
        page.set_viewport_size({"width": width, "height": 800})
        page.locator("#display").evaluate("menu => { menu.open = true; }")
        page.click("#fit")
        until(
            lambda: page.evaluate("Sniffer.page.chart.shape.breadth <= Sniffer.page.chart.shape.width + 1"),
            "lifelines are beyond the window",
        )
        assert heads(page) == TRACE.robots
        until(lambda: 100 in rows(page), "the row is not there")
        row = page.locator("#grid .row[data-message='100']")
        until(lambda: row.locator(".says").inner_text() == said, "other words")  # noqa: B023
        edge = page.evaluate("document.getElementById('grid').getBoundingClientRect().right")
        for cell in (".from", ".to", ".type", ".says"):
            box = row.locator(cell).bounding_box()
            assert box["width"] > 20
            assert box["x"] + box["width"] <= edge


def test_enter_searches_for_what_has_just_been_typed(page: Page) -> None:
    for query in ("cannot", "from now on"):
        page.fill("#query", query)
        page.press("#query", "Enter")
        first = next(m for m in range(COUNT) if query in FEED.words(m))
        until(lambda: page.inner_text("#message h2").startswith(f"{first:,} "), "no first hit")  # noqa: B023
        until(lambda: page.inner_text("#hits").startswith("1 of "), "it is not the first one")


def test_filters_act_as_one_types(page: Page) -> None:
    page.click("#tab-filters")
    page.fill("#filters input[type=number] >> nth=0", "20")
    left = sum(t >= 20 for t in TRACE.messages.t)
    text_is(page, "#counts", f"{left} of {ALL}")
    page.fill("#filters input[type=search] >> nth=0", "Robot9.1")
    text_is(page, ".unknown:not([hidden])", "No robot is named Robot9.1; there are Robot1.1 and Robot1.2.")
    assert page.evaluate(CONTRAST) == []
    page.fill("#filters input[type=search] >> nth=0", "")
    until(lambda: not page.locator(".unknown:not([hidden])").count(), "it still says so")


def test_the_verdict_leads_to_the_step_that_decided(page: Page) -> None:
    witness = OUTCOME.witness
    assert witness is not None
    last = max(step for step, number in enumerate(TRACE.steps.robot) if TRACE.robots[number] == witness)
    page.click("#verdict")
    text_is(page, "#moment + output b", f"step {last + 1} of {len(TRACE.steps.t)}")
    until(lambda: f"{witness} received it, and concluded: no solution." in page.inner_text("#message"), "not said")
    page.hover(".head[aria-pressed=true]")
    assert page.evaluate(CONTRAST) == []
    assert page.locator(".head.party").count() == 2
    assert page.locator(".head.found").count() == 1
    assert "concluded" in page.locator(".head.found").get_attribute("aria-label")
    page.click("#tab-robot")
    until(lambda: "It concluded: no solution" in page.inner_text("#robot"), "the robot does not say so")


def test_why_there_is_no_state_is_told(page: Page) -> None:
    page.evaluate("""() => {
      const { source } = Sniffer.page;
      window.states = source.states;
      const nothing = { step: 0, value: {}, view: [], domain: [], nogoods: [], why: [] };
      source.states = async () => [{ ...nothing, more: { replay: "ends here: no `Ok`" } }];
    }""")
    page.evaluate(f"Sniffer.page.robot({robot('Robot2.2')}); Sniffer.page.time.go(91)")
    until(lambda: "Its later states are not available: no Ok" in page.inner_text("#robot"), "not said")
    assert page.inner_text("#robot .notice code") == "Ok"
    assert "its last step before this moment" in page.inner_text("#robot")
    page.evaluate("() => { Sniffer.page.source.states = window.states; }")


def test_keys_go_from_value_to_value(page: Page) -> None:
    number = robot("Robot3.3")
    changes = [step for step, _ in TRACE.decisions if TRACE.steps.robot[step] == number]
    page.evaluate(f"Sniffer.page.robot({number}); Sniffer.page.time.go({changes[0]})")
    page.focus("#grid")
    for key, step in ((".", changes[1]), (",", changes[0])):
        page.keyboard.press(key)
        until(lambda: page.input_value("#moment") == str(step), f"{key} goes elsewhere")  # noqa: B023


def test_a_live_page_waits_for_robots_and_knows_when_nobody_saw_the_end(tab: Page, tmp_path: Path) -> None:
    file = tmp_path / "run.journal"
    file.write_bytes(b"")
    with sniffer_server(SnifferSession(file, live=True)) as server:
        page = tab.context.new_page()
        page.goto(server.url)
        text_is(page, "#nothing", "Waiting for the robots")
        file.write_bytes(b"".join(list(lines_of(JOURNAL))[:600]))
        until(lambda: "The run continues." in page.inner_text("#verdict"), "it has not begun")
        until(lambda: not page.locator("#nothing").is_visible(), "it still waits")
    text_is(page, "#verdict", "The end of the run is not known.")
    page.close()


def test_nothing_stands_beside_the_window_however_wide_it_is(page: Page) -> None:
    usual = page.viewport_size
    try:
        for width in (360, 800, 1000, 1400):
            page.set_viewport_size({"width": width, "height": 700})
            until(lambda: page.evaluate("innerWidth") == width, "the window has another size")  # noqa: B023
            assert page.evaluate("document.documentElement.scrollWidth") == width
    finally:
        page.set_viewport_size(usual)
