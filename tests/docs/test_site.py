"""The site as `make docs` builds it: strictly, and readable without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robochoc.run.registry import installed_protocols
from tests.support.browser_pages import watched_page
from tests.support.limits import HANG_S
from tests.support.program import ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = [
    pytest.mark.more,
    pytest.mark.skipif(find_spec("material") is None, reason="the extra docs is not installed: make docs"),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    # Not --quiet: warnings that are not shown are not counted by --strict.
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    pages = [*site.rglob("*.html")]
    assert len(pages) > 50
    for page in pages:
        loaded = re.findall(r"<(?:script|link|img|iframe)\b[^>]*?(?:src|href)=\"?(https?:[^\"\s>]+)", page.read_text())
        assert not [address for address in loaded if "canonical" not in address], page.name


def test_there_is_a_page_for_each_protocol_and_for_each_command(site: Path) -> None:
    for offer in installed_protocols():
        page = (site / "reference" / "protocols" / f"{offer.name}.html").read_text()
        assert f"--protocol {offer.name}" in page
    commands = (site / "reference" / "cli.html").read_text()
    assert all(f"robochoc {name}" in commands for name in ("solve", "master", "journal export", "generate queens3d"))


def test_search_works_from_files_and_asks_for_nothing_elsewhere(site: Path, browser: Browser) -> None:
    with watched_page(browser, viewport={"width": 1280, "height": 800}) as (page, complaints, asked):
        page.goto((site / "index.html").as_uri())
        page.locator("input.md-search__input").press_sequentially("nogood")  # `fill` presses no key, as people do
        page.wait_for_selector(".md-search-result__article", timeout=HANG_S * 1000)
        assert not [address for address in asked if not address.startswith(("file:", "data:"))]
        assert not complaints


def test_the_switch_to_dark_holds_on_the_next_page(site: Path, browser: Browser) -> None:
    scheme = "document.body.getAttribute('data-md-color-scheme')"
    with watched_page(browser, viewport={"width": 1280, "height": 800}, color_scheme="light") as (page, _, _):
        page.goto((site / "index.html").as_uri())
        assert page.evaluate(scheme) == "default"
        page.click("label[title=Dark]")
        page.goto((site / "gallery.html").as_uri())
        assert page.evaluate(scheme) == "slate"


@pytest.mark.parametrize(
    "name",
    [
        "index",
        "gallery",
        "guides/coming-from/pydcop",
        "guides/which-protocol",
        "reference/cli",
        "reference/protocols/abt",
    ],
)
def test_pages_fit_a_telephone(site: Path, browser: Browser, name: str) -> None:
    with watched_page(browser, viewport={"width": 360, "height": 800}) as (page, _, _):
        page.goto((site / f"{name}.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
