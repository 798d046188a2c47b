"""The page on which one chooses the next message, in a browser."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from robochoc.exploration.check import CheckOptions, checked
from robochoc.exploration.problems import small_teams
from robochoc.run import Options, Runtime
from robochoc.sniffer.orders_page import orders_page
from tests.support.accessibility import axe_findings
from tests.support.browser_pages import Browser, Page, watched_page
from tests.support.compiled import plain_python_only
from tests.support.faulty_abt import NoAnswer

pytestmark = plain_python_only


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of a team with a counterexample of four steps."""
    team = next(itertools.islice(small_teams(NoAnswer.traits, 3, 2, 0), 56, None))
    options = CheckOptions(NoAnswer, Options(protocol="abt", runtime=Runtime.SIMULATOR))
    (found,) = checked([team], options)
    page: Path = tmp_path_factory.mktemp("orders") / "page.html"
    page.write_bytes(orders_page(found, options))
    return page.as_uri()


def current(page: Page) -> str:
    """Return the chosen step."""
    return str(page.inner_text("#steps [aria-current]"))


def test_the_counterexample_is_stepped_through_and_left(browser: Browser, address: str) -> None:
    with watched_page(browser, viewport={"width": 1400, "height": 900}) as (page, _, asked):
        page.goto(address)
        assert current(page) == "Start"
        assert page.locator("#steps .later").count() == 4
        for _ in range(4):
            page.keyboard.press("ArrowRight")
        assert "receives from Robot1: V1 = 0" in current(page)
        assert "constraint C3 is broken" in page.inner_text("#end")
        assert page.locator("#choices button").count() == 0
        page.click("#back")
        page.keyboard.press("Home")
        assert page.is_hidden("#end")
        page.keyboard.press("2")
        assert page.locator("#steps li").count() == 2
        page.click("#ends button.bad")
        assert "constraint C3 is broken" in page.inner_text("#end")
        page.click("#steps li:first-child button")
        assert current(page) == "Start"
        page.click("#choices .choice >> nth=0")
        assert page.evaluate("document.activeElement.className") == "choice"
        assert page.inner_text("#said").startswith("Step 1: Robot")
        assert asked == [address]


@pytest.mark.parametrize("width", [1400, 360])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_is_accessible_and_fits(browser: Browser, address: str, width: int, scheme: str) -> None:
    with watched_page(browser, viewport={"width": width, "height": 800}, color_scheme=scheme) as (page, _, _):
        page.goto(address)
        page.keyboard.press("End")
        page.keyboard.press("ArrowLeft")
        assert axe_findings(page) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.click("#theme")
        assert page.evaluate("document.documentElement.dataset.theme") != scheme
        assert axe_findings(page) == []
