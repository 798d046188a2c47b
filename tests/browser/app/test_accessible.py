"""axe-core finds nothing serious on any page of the application: light and dark, wide and narrow."""

from __future__ import annotations

from importlib.util import find_spec
from itertools import product
from pathlib import Path

import pytest

from robochoc.app.pages.shell import AREAS
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, Page, connected, watched_page
from tests.support.cases import cases
from tests.support.kept_runs import cube, kept_run

WIDTHS = (1280, 360)
SERIOUS = {"serious", "critical"}
SHOWN = {
    "": ".cards .drawn svg",
    "model": "svg .robot",
    "decide": ".answer tbody tr",
    "whatif": "svg .robot",
    "fly": ".tell .cards",
    "compare": "h1",
    "lessons": ".cards li",
}
"""By its page, what is there once a page is."""
LOADED = "[...document.querySelectorAll('.q-loading-bar')].every((one) => one.ariaHidden === 'true')"
"""Quasar's bar, which has no name, is shown while the page asks for something."""
FOUND = """
async () => (await axe.run(document, {resultTypes: ["violations"]})).violations.flatMap(
  ({id, impact, nodes}) => nodes.map((node) => [impact, `${id}: ${node.target} ${node.failureSummary}`]))
"""


@pytest.fixture(scope="module")
def axe() -> str:
    """axe-core."""
    spec = find_spec("axe_playwright_python")
    if spec is None or spec.origin is None:
        pytest.skip("axe-playwright-python is not installed")
    return Path(spec.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def _found(page: Page, axe: str) -> list[tuple[str, str]]:
    """How bad each thing is that axe finds, and what it is."""
    page.evaluate(axe)
    return [(impact, text) for impact, text in page.evaluate(FOUND)]


@pytest.mark.parametrize("area", SHOWN, ids=lambda area: area or "gallery")
def test_nothing_serious_is_found(
    browser: Browser, application: AppServer, teams: TeamStore, axe: str, area: str
) -> None:
    team = teams.add(cube())
    kept_run(teams.path(team), cube())
    with watched_page(browser, reduced_motion="reduce") as tab, cases() as each:
        page: Page = tab.page
        connected(page, f"{application.url}team/{team}/{area}" if area in AREAS else application.url + area)
        for scheme, width in product(("light", "dark"), WIDTHS):
            with each((scheme, width)):
                page.emulate_media(color_scheme=scheme)
                page.set_viewport_size({"width": width, "height": 800})
                page.wait_for_selector(f"body.body--{scheme}")
                page.wait_for_selector(SHOWN[area])
                page.wait_for_function(LOADED)
                assert [text for impact, text in _found(page, axe) if impact in SERIOUS] == []


def test_axe_finds_what_is_there(browser: Browser, axe: str) -> None:
    with watched_page(browser) as tab:
        tab.page.set_content("<html lang=en><p style='color: #ccc'>pale</p><img src=''><input></html>")
        told = _found(tab.page, axe)
    assert {"color-contrast", "image-alt", "label"} <= {
        text.partition(":")[0] for impact, text in told if impact in SERIOUS
    }


def test_every_page_of_a_team_is_looked_at() -> None:
    assert {*AREAS} <= {*SHOWN}
