"""The sniffer's page in a browser: a run to be shown, the page that shows it, and what can be asked of that."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent
from robochoc.journal.journal import read_journal
from robochoc.run import solve
from robochoc.run.options import Options, Runtime
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace
from tests.support.browser_pages import Browser, Page, watched_page
from tests.support.limits import wait_until
from tests.support.sniffer_server import journal_of

REFUSED = "ERR_CONNECTION_REFUSED"
"""A browser complains by itself when a server has ended."""

EVENTS: list[AnyEvent] = []
OUTCOME = solve(queens3d(4), Options(protocol="abt", runtime=Runtime.SIMULATOR, seed=1), observer=EVENTS.append)
WHOLE = journal_of(EVENTS, OUTCOME)
JOURNAL = read_journal(WHOLE)
TRACE = Trace.of(JOURNAL)
FEED = PageData(TRACE)
COUNT = len(TRACE.messages.t)
ALL = f"{COUNT} messages"


@contextmanager
def shown(browser: Browser, url: str, whole: str = ALL, **options: Any) -> Iterator[Page]:  # noqa: ANN401 - Playwright's
    """The page at `url` once it says `whole`. No script may complain, and nothing else may be asked for anything."""
    how = {"viewport": {"width": 1400, "height": 900}, "may_complain": True, **options}
    with watched_page(browser, **how) as (page, complaints, asked):
        page.goto(url)
        text_is(page, "#counts", whole)
        try:
            yield page
        finally:
            page.evaluate("localStorage.clear()")  # a theme that was chosen is another page's too
    assert not [one for one in complaints if REFUSED not in one or whole == ALL]
    origin = "/".join(url.split("#", maxsplit=1)[0].split("/")[:3])
    assert not [one for one in asked if not one.startswith((f"{origin}/", "data:", "blob:"))]


def until(true: Callable[[], object], why: str) -> None:
    wait_until(lambda: bool(true()), why)


def text_is(page: Page, selector: str, expected: str) -> None:
    until(lambda: page.inner_text(selector).strip() == expected, f"{selector} never says {expected}")
    drawn(page)


def begin_again(page: Page) -> None:
    """Take back what a test before has chosen, written and left out: that is faster than to load the page anew."""
    page.set_viewport_size({"width": 1400, "height": 900})
    page.evaluate(_BEGIN_AGAIN)
    text_is(page, "#counts", ALL)
    until(lambda: rows(page)[:1] == [0] and page.evaluate("Sniffer.page.view.top") == 0, "it does not begin again")


_BEGIN_AGAIN = """() => {
  const { page } = Sniffer;
  document.activeElement.blur();
  page.time.pause();
  page.view.set({
    selected: -1, robot: -1, moment: 0, top: 0, left: 0, rowHeight: 24, laneWidth: 0,
    layout: "both", upper: "message", colourBy: "kind", arrows: "bent", whose: "all", query: "",
  });
  page.filters.clear();
  page.again();
  page.time.touched = false;
  page.visited = page.robots.wanted = page.robots.search.value = "";
  const element = (id) => document.getElementById(id);
  for (const [id, value] of [["query", ""], ["speed", "4"], ["colour", "kind"]]) element(id).value = value;
  for (const id of ["tab-robots", "tab-message"]) element(id).click();
  return new Promise((done) => requestAnimationFrame(() => {
    page.list.top = 0; page.view.set({ top: 0 }); page.list.draw(); done();
  }));
}"""


def drawn(page: Page) -> None:
    """Wait until the page has drawn what its texts already say: each of its parts draws in the next frame."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def rows(page: Page) -> list[int]:
    """The numbers of the messages in the table's window."""
    drawn(page)
    numbers: list[int] = page.eval_on_selector_all(
        "#grid .row[data-message]",
        "rows => rows.filter((row) => !row.hidden).map((row) => Number(row.dataset.message))",
    )
    return numbers


def heads(page: Page) -> list[str]:
    """The names at the heads of the lifelines."""
    drawn(page)
    names: list[str] = page.eval_on_selector_all(
        ".head",
        "all => all.filter((head) => !head.hidden).map((head) => head.getAttribute('aria-label').split(':')[0])",
    )
    return names


def choose(page: Page, message: int) -> None:
    """Choose a message, as a link to it does."""
    page.evaluate(f"Sniffer.page.message({message})")
    until(lambda: page.inner_text("#message h2").startswith(f"{message:,} "), "the message was not opened")
    drawn(page)


def painted(page: Page) -> int:
    """How many colours the chart has: nothing drawn has one or two."""
    picture = np.asarray(Image.open(io.BytesIO(page.locator("#drawing").screenshot())).convert("RGB"))
    return len(np.unique(picture.reshape(-1, 3), axis=0))


def robot(name: str) -> int:
    return TRACE.robots.index(name)


CONTRAST = """() => {
  const parse = (text) => { const [r, g, b, a = 1] = text.match(/[\\d.]+/g).map(Number); return [r, g, b, a]; };
  const part = (c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * part(r / 255) + 0.7152 * part(g / 255) + 0.0722 * part(b / 255);
  const paper = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const colour = parse(getComputedStyle(at).backgroundColor);
      if (colour[3] === 1) return colour;
    }
    return [255, 255, 255];
  };
  const poor = [];
  for (const element of document.querySelectorAll("body *")) {
    if (![...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim())) continue;
    if (!element.checkVisibility() || element.closest(":disabled, .hide, svg, script, style")) continue;
    const [ink, back] = [light(parse(getComputedStyle(element).color)), light(paper(element))];
    const ratio = (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
    if (ratio < 4.5) poor.push(`${element.outerHTML.slice(0, 80)}: ${ratio.toFixed(2)}`);
  }
  return poor;
}"""
"""The elements whose text has too little contrast (WCAG 2.2, 1.4.3)."""

NAMELESS = """() => {
  const controls = "button, input, select, a, summary, [role=grid], [role=separator], [tabindex='0']";
  const named = (one) => one.getAttribute("aria-label") || one.getAttribute("aria-labelledby") || one.textContent.trim()
    || [...(one.labels || [])].some((label) => label.textContent.trim());
  return [...document.querySelectorAll(controls)].filter((one) => one.checkVisibility() && !named(one))
    .map((one) => one.outerHTML.slice(0, 80));
}"""
"""The controls that no screen reader could name (WCAG 2.2, 4.1.2)."""
