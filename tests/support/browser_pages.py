"""A browser, and a page in it that is watched: what it complains of, and what it asks for."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from robochoc.system.temporary_files import temporary_folder
from tests.support.leftovers import MARK, no_process_left, shared_by_tests
from tests.support.limits import HANG_S

if TYPE_CHECKING:
    from playwright.sync_api import Page as _Page

Browser = Any
Page = Any
"""Playwright's, which is not everywhere."""

_CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

CHROMIUMS_OWN = "chromium-"
"""The beginning of the name of a browser's folder for temporary files."""


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser; without one, or without Playwright, the test is skipped.

    Chromium makes temporary files whenever it likes (for files that are dropped, for its handler of crashes), and
    removes them when it likes. They are in a folder of its own, which no test has left behind. Nor has one its
    processes, some of which leave its family (the handlers of crashes): they have a mark of their own, and must have
    ended when it is closed.
    """
    playwright = pytest.importorskip("playwright.sync_api")
    if _CHROMIUM is None:
        pytest.skip("no Chromium on the path")
    with ExitStack() as stack:
        with shared_by_tests(with_children=True):
            place = tempfile.TemporaryDirectory(
                prefix=CHROMIUMS_OWN, dir=temporary_folder(), ignore_cleanup_errors=True
            )
            own = stack.enter_context(place)
            stack.enter_context(no_process_left(own))
            play = stack.enter_context(playwright.sync_playwright())
            browser = play.chromium.launch(
                executable_path=_CHROMIUM,
                args=["--no-sandbox"],
                timeout=HANG_S * 1000,
                env={**os.environ, "TMPDIR": own, MARK: own},
            )
        yield browser
        browser.close()


class WatchedPage(NamedTuple):
    """A page, its console and what went wrong in it, and all addresses that it asked for."""

    page: _Page
    complaints: list[str]
    asked: list[str]


QUIET = "GL Driver Message", "Blocked autofocusing", "Autofocus processing was blocked"
"""Chromium's own remarks, on photographs and on frames."""


@contextmanager
def watched_page(
    browser: Browser, viewport: dict[str, int] | None = None, *, may_complain: bool = False, **media: str
) -> Iterator[WatchedPage]:
    """A page that shows nothing yet; it is closed in the end, and must not have complained of anything.

    All pages share one context, and so one process of the browser, which starts once.

    Args:
        browser: Chromium.
        viewport: The width and height of the window.
        may_complain: It may complain.
        media: What the reader prefers: `color_scheme`, `reduced_motion`.
    """
    context = browser.contexts[0] if browser.contexts else browser.new_context()
    page = context.new_page()
    page.set_default_timeout(HANG_S * 1000)
    if viewport:
        page.set_viewport_size(viewport)
    page.emulate_media(**media)
    seen = WatchedPage(page, [], [])
    page.on("console", lambda message: seen.complaints.append(message.text))
    page.on("pageerror", lambda error: seen.complaints.append(str(error)))
    page.on("request", lambda request: seen.asked.append(request.url))
    page.on("websocket", lambda socket: seen.asked.append(socket.url.replace("ws", "http", 1)))
    try:
        yield seen
        complaints = [one for one in seen.complaints if not any(quiet in one for quiet in QUIET)]
        assert may_complain or not complaints, complaints
    finally:
        page.close()


def connected(page: Page, url: str) -> None:
    """Open a page of the application, and wait until what is clicked there reaches it in order.

    What happens before the connection stands is tried again every 10 ms, each event by itself: of two clicks the later
    one may then come first. A person is not that fast.
    """
    page.goto(url)
    page.wait_for_function("window.did_handshake")


@contextmanager
def app_page(browser: Browser, url: str, viewport: dict[str, int] | None = None, **media: str) -> Iterator[WatchedPage]:
    """A page of the application, or of a file."""
    with watched_page(browser, viewport, may_complain=False, **media) as tab:
        if url.startswith("file:"):
            tab.page.goto(url)
        else:
            connected(tab.page, url)
        yield tab
