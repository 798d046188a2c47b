"""One Chromium for all tests that look at pages, and one tab for those that look at the same page of the sniffer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.browser_pages import Browser, Page, chromium
from tests.support.leftovers import shared_by_tests

if TYPE_CHECKING:
    from tests.support.sniffer_server import SnifferServer


def pytest_ignore_collect(config: pytest.Config) -> bool | None:
    """Do not import these tests, with Playwright, numpy and Pillow, where `make test` runs none of them."""
    markers = config.getoption("markexpr")
    return True if "not slow" in markers and "not more" in markers else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of this folder that are not slow: `make test-more` runs them."""
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent) and not item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.more)


@pytest.fixture(scope="module")
def may_stay() -> str:
    """Allow sockets: the browser keeps connections to the server that tests share, and makes new ones."""
    return "descriptor socket"


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Chromium, by Playwright, for the package: tests elsewhere run event loops in the main thread, as it does."""
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="package")
def without_the_scenes_viewer() -> Iterator[None]:
    """A megabyte that each page of the sniffer would take its time to read, and nobody there looks at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("robochoc.sniffer.page.viewer_script", lambda: "")
        yield


@pytest.fixture(scope="package")
def server(without_the_scenes_viewer: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SnifferServer]:
    """A page of the journal `sniffer_pages.WHOLE`."""
    from robochoc.sniffer.session import SnifferSession  # noqa: PLC0415 - heavy
    from tests.support.sniffer_pages import WHOLE  # noqa: PLC0415 - heavy
    from tests.support.sniffer_server import sniffer_server  # noqa: PLC0415 - heavy

    del without_the_scenes_viewer  # it only has to be there before the page is made
    file = tmp_path_factory.mktemp("sniffed") / "run.journal"
    file.write_bytes(WHOLE)
    with ExitStack() as stack:
        with shared_by_tests():
            running = stack.enter_context(sniffer_server(SnifferSession(file)))
            running.get("states?robot=0&chunk=0")  # all its threads have begun
        yield running


@pytest.fixture(scope="package")
def tab(browser: Browser, server: SnifferServer) -> Iterator[Page]:
    """A tab that shows it, in whatever state a test has left it: see `sniffer_pages.begin_again`."""
    from tests.support.sniffer_pages import shown  # noqa: PLC0415 - heavy

    with shown(browser, server.url) as page:
        yield page
