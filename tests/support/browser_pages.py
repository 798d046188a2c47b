"""A page in a browser, watched: what it complains of, and what it asks for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from playwright.sync_api import Page


class WatchedPage(NamedTuple):
    """A page, its console and what went wrong in it, and all addresses that it asked for."""

    page: Page
    complaints: list[str]
    asked: list[str]


@contextmanager
def watched_page(browser: Any, **options: Any) -> Iterator[WatchedPage]:  # noqa: ANN401 - Playwright's
    """A page that shows nothing yet; it is closed in the end."""
    context = browser.new_context(**options)
    page = context.new_page()
    page.set_default_timeout(15_000)
    seen = WatchedPage(page, [], [])
    page.on("console", lambda message: seen.complaints.append(message.text))
    page.on("pageerror", lambda error: seen.complaints.append(str(error)))
    page.on("request", lambda request: seen.asked.append(request.url))
    page.on("websocket", lambda socket: seen.asked.append(socket.url.replace("ws", "http", 1)))
    yield seen
    context.close()
