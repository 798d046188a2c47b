"""axe-core finds nothing serious on any page of the application: light and dark, wide and narrow."""

from __future__ import annotations

from itertools import product

import pytest

from robochoc.app.pages.shell import AREAS
from robochoc.app.store import TeamStore
from tests.support.accessibility import axe_findings
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
    "play": "h1",
    "lessons": ".cards li",
}
"""By its page, what is there once a page is."""
LOADED = "[...document.querySelectorAll('.q-loading-bar')].every((one) => one.ariaHidden === 'true')"
"""Quasar's bar, which has no name, is shown while the page asks for something."""


@pytest.mark.parametrize("area", SHOWN, ids=lambda area: area or "gallery")
def test_nothing_serious_is_found(browser: Browser, application: AppServer, teams: TeamStore, area: str) -> None:
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
                assert [text for impact, text in axe_findings(page) if impact in SERIOUS] == []


def test_axe_finds_what_is_there(browser: Browser) -> None:
    with watched_page(browser) as tab:
        tab.page.set_content("<html lang=en><p style='color: #ccc'>pale</p><img src=''><input></html>")
        told = axe_findings(tab.page)
    assert {"color-contrast", "image-alt", "label"} <= {
        text.partition(":")[0] for impact, text in told if impact in SERIOUS
    }


def test_every_page_of_a_team_is_looked_at() -> None:
    assert {*AREAS} <= {*SHOWN}
