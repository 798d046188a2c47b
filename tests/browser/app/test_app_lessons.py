"""The lessons in a browser: one is played to its end by keyboard alone, and progress is kept."""

from __future__ import annotations

from pathlib import Path

from robochoc.app.lessons.lesson import COUNT, lesson
from tests.support.app_server import AppServer, app_server
from tests.support.browser_pages import Browser, Page, connected, watched_page

_MOST_TABS = 30


def _tab_to(page: Page, text: str) -> None:
    """Press Tab until what has the focus has this text in it."""
    for _ in range(_MOST_TABS):
        page.keyboard.press("Tab")
        if text in page.evaluate("document.activeElement.innerText"):
            return
    raise AssertionError(f"nothing with {text!r} can be reached by Tab")


def _has_focus(page: Page, text: str) -> None:
    page.wait_for_function("text => document.activeElement.innerText.trim() === text", arg=text)


def _is_told(page: Page, text: str) -> None:
    page.wait_for_function(
        "text => document.querySelector('[aria-live=polite][role=status]').innerText === text", arg=text
    )


def test_lesson_one_is_played_to_its_end_by_keyboard(browser: Browser, tmp_path: Path) -> None:
    taught = lesson(1)
    with app_server(tmp_path / "teams") as server, watched_page(browser) as tab:
        page = tab.page
        connected(page, server.url)
        page.wait_for_selector("h1")
        _tab_to(page, "Learn how robots decide")
        page.keyboard.press("Enter")
        page.wait_for_selector("h1 >> text=Learn how robots decide")
        _tab_to(page, taught.title)
        page.keyboard.press("Enter")
        for place, step in enumerate(taught.steps, 1):
            page.wait_for_selector(f"h1 >> text={step.title}")
            if place > 1:
                _has_focus(page, step.title)  # the page moves it there: not between a Tab and Enter of ours
            wrong = next(choice for choice in step.choices if not choice.right)
            _tab_to(page, wrong.shown)
            page.keyboard.press("Enter")
            _is_told(page, f"Not this one. {wrong.why}")
            _has_focus(page, f"{step.choices.index(wrong) + 1}\n{wrong.shown}")
            if place == 1:
                page.keyboard.press("Shift+Tab")
                page.keyboard.press(str(step.choices.index(step.answer) + 1))
            else:
                page.click("h1")
                _tab_to(page, step.answer.shown)
                page.keyboard.press("Space")
            _is_told(page, f"Right. {step.answer.why}")
            _has_focus(page, "To the end" if place == len(taught.steps) else "Next step")
            page.keyboard.press("Enter")
        _has_focus(page, "What you have seen")
        _is_told(page, "What you have seen")
        page.wait_for_selector(f"text={taught.end}")
        connected(page, f"{server.url}lessons")
        page.wait_for_selector("a:has-text('Done')")
        assert page.locator("a:has-text('Done')").count() == 1
    assert (tmp_path / "teams" / "lessons.json").is_file()


def test_no_lesson_needs_scrolling_to_the_side_on_a_narrow_screen(browser: Browser, application: AppServer) -> None:
    with watched_page(browser, {"width": 360, "height": 740}) as tab:
        for number in range(1, COUNT + 1):
            connected(tab.page, f"{application.url}lessons/{number}")
            tab.page.wait_for_selector(".choices")
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360


def test_a_lesson_that_there_is_not_is_told(browser: Browser, application: AppServer) -> None:
    with watched_page(browser) as tab:
        for number in ("0", "11", "one", "<b>", "99999999999999999999", "٣"):
            connected(tab.page, f"{application.url}lessons/{number}")
            tab.page.wait_for_selector("text=There is no such lesson.")
