"""The site as `make docs` builds it: strictly, and readable without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robochoc.run.registry import installed_protocols
from tests.support.accessibility import axe_findings
from tests.support.browser_pages import watched_page
from tests.support.cases import cases
from tests.support.limits import HANG_S
from tests.support.program import ROOT
from tests.support.site_links import broken_links, external_hosts

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = [
    pytest.mark.more,
    pytest.mark.skipif(find_spec("material") is None, reason="the extra docs is not installed: make docs"),
]


BUILT = ROOT / "out" / "site.built"
"""Left by `make docs` when it has built `out/site`; its time is that of the start."""


def newest_source() -> float:
    """Return the time of the last change of a file that the site is built from."""
    files = (path for folder in ("benchmarks", "docs", "robochoc") for path in (ROOT / folder).rglob("*.*"))
    sources = (path for path in (*files, *ROOT.glob("*.md"), ROOT / "mkdocs.yml") if path.suffix != ".pyc")
    return max(path.stat().st_mtime for path in sources if path.is_file())


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the site. What `make docs` has built is not built again."""
    if BUILT.is_file() and newest_source() < BUILT.stat().st_mtime:
        return ROOT / "out" / "site"
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


def test_every_link_leads_to_a_file_and_an_anchor(site: Path) -> None:
    assert [*broken_links(site)] == []


def test_broken_links_are_found(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b.html").write_text("<p id=one><p id=one><a href=../c.html#two>c</a> <img src=d.png>")
    (tmp_path / "c.html").write_text("<a href=a/>a</a> <a href='a/b.html#one'>b</a> <a href=https://example.org>e</a>")
    assert [*broken_links(tmp_path)] == [
        "a/b.html: #one twice",
        "a/b.html: ../c.html#two: no such anchor",
        "a/b.html: d.png: no such file",
        "c.html: a/: no such file",
    ]
    assert external_hosts(tmp_path) == {"example.org"}


def test_no_page_scrolls_sideways_on_a_telephone(site: Path, browser: Browser) -> None:
    with watched_page(browser, viewport={"width": 360, "height": 800}) as (page, _, _), cases() as each:
        for path in site.rglob("*.html"):
            if path.name == "404.html":  # its addresses are those on a server
                continue
            with each(path.relative_to(site)):
                page.goto(path.as_uri())
                assert page.evaluate("document.documentElement.scrollWidth") <= 360


@pytest.mark.parametrize(
    "name",
    [
        "index",
        "lessons/03",
        "guides/which-protocol",
        "reference/cli",
        "reference/protocols/abt",
        "reference/results",
    ],
)
def test_axe_finds_nothing(site: Path, browser: Browser, name: str) -> None:
    # axe-core asks for the style sheets, which a browser refuses to the script of a file: a complaint.
    with watched_page(browser, may_complain=True) as (page, _, _), cases() as each:
        page.goto((site / f"{name}.html").as_uri())
        page.add_style_tag(content="* { transition: none !important; }")
        for scheme, width in product(("default", "slate"), (1280, 360)):
            with each((scheme, width)):
                page.set_viewport_size({"width": width, "height": 800})
                page.evaluate("(scheme) => document.body.setAttribute('data-md-color-scheme', scheme)", scheme)
                assert [text for _, text in axe_findings(page)] == []
