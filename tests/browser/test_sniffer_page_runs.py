"""The sniffer's page in a browser: runs that go on, break off or are made by strangers, and readers of every kind."""

from __future__ import annotations

import io
import json
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from robochoc.journal.journal import lines_of
from robochoc.sniffer.export import embedded_answers
from robochoc.sniffer.page import sniffer_page as page_of
from robochoc.sniffer.session import SnifferSession
from tests.support.browser_pages import Browser, Page
from tests.support.sniffer_pages import (
    ALL,
    CONTRAST,
    FEED,
    JOURNAL,
    NAMELESS,
    OUTCOME,
    choose,
    heads,
    rows,
    shown,
    text_is,
    until,
)
from tests.support.sniffer_server import SnifferServer, journal_of, sniffer_server

HOSTILE = "</script><img src=x onerror=document.title='broken'>"


pytestmark = pytest.mark.usefixtures("without_the_scenes_viewer")


# Live, ended, broken


def test_a_run_is_followed_until_somebody_looks_elsewhere(browser: Browser, tmp_path: Path) -> None:
    lines = list(lines_of(JOURNAL))
    file = tmp_path / "run.journal"
    place = 600
    file.write_bytes(b"".join(lines[:place]))
    with sniffer_server(SnifferSession(file, live=True)) as server, file.open("ab") as writing:

        def more(end: int) -> None:
            nonlocal place
            writing.write(b"".join(lines[place:end]))
            writing.flush()
            place = end

        about = server.json("about")
        with shown(browser, server.url, f"{about['messages']} messages") as page:
            assert page.inner_text("#live") == "Following"
            more(900)
            until(lambda: int(page.inner_text("#counts").split()[0]) > about["messages"], "nothing comes")
            until(lambda: rows(page)[-1] == int(page.inner_text("#counts").split()[0]) - 1, "the newest is not shown")
            page.keyboard.press("Home")
            text_is(page, "#live", "Follow")
            more(len(lines))
            text_is(page, "#counts", ALL)
            assert rows(page)[0] == 0
            until(lambda: not page.locator("#live").is_visible(), "it is over, and the page does not know")
            assert page.inner_text("#verdict") == FEED.news()["verdict"]


def test_a_server_that_ends_is_told_and_what_is_seen_stays(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "run.journal"
    file.write_bytes(b"".join(list(lines_of(JOURNAL))[:600]))
    with ExitStack() as ends:
        server = ends.enter_context(sniffer_server(SnifferSession(file, live=True)))
        count = server.json("about")["messages"]
        with shown(browser, server.url, f"{count} messages") as page:
            ends.close()
            until(lambda: "The server of this page has ended" in page.inner_text("#notices"), "nobody says so")
            assert page.inner_text("#counts") == f"{count} messages"
            assert rows(page)


def test_damage_and_an_empty_journal_are_told(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "run.journal"
    file.write_bytes(b"".join(list(lines_of(JOURNAL))[:300]) + b"nonsense\n")
    with sniffer_server(SnifferSession(file)) as server:
        until(lambda: server.json("about")["damage"], "no damage")
        with shown(browser, server.url, f"{server.json('about')['messages']} messages") as page:
            assert "The journal is damaged" in page.inner_text("#notices")
    file.write_bytes(journal_of([], OUTCOME))
    with sniffer_server(SnifferSession(file)) as server, shown(browser, server.url, "0 messages") as page:
        until(lambda: "There are no messages" in page.inner_text("#notices"), "an empty page without a notice")


def test_names_of_strangers_are_text(browser: Browser, tmp_path: Path) -> None:
    text = b"".join(lines_of(JOURNAL)).decode().replace("queens3d-4", HOSTILE)
    lines = [json.loads(line) for line in text.splitlines()]
    for line in lines:
        for key in ("robot", "sender", "receiver"):
            if line.get(key) == "Robot1.1":
                line[key] = HOSTILE
    file = tmp_path / "run.journal"
    kept = [json.dumps(line, separators=(",", ":")) + "\n" for line in lines if line["event"] != "Given"]
    file.write_text("".join(kept))
    with sniffer_server(SnifferSession(file)) as server, shown(browser, server.url) as page:
        names = [one["name"] for one in server.json("about")["robots"]]
        page.evaluate(f"Sniffer.page.robot({names.index(HOSTILE)})")
        choose(page, 0)
        assert HOSTILE in page.inner_text("#title")
        assert any(name.startswith("</script>") for name in heads(page))
        assert page.locator("img").count() == 0
        assert "broken" not in page.title().split("onerror")[0]
        assert "states are not available" in page.inner_text("#notices")


def test_an_export_needs_no_server(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "run.html"
    file.write_bytes(page_of("embedded", embedded_answers(FEED, JOURNAL), title="A run"))
    with shown(browser, file.as_uri()) as page:
        choose(page, 100)
        text_is(page, "#message blockquote", FEED.detail(100)["words"])
        page.click("#tab-robot")
        page.wait_for_selector("#robot .knows")
        # Browsers without a window take a screenshot after the event "load".
        page.add_init_script("""if (location.protocol === "file:") addEventListener("load", () => {
          const { texts, view } = Sniffer.page;
          window.atLoad = [texts.words(100), view.selected, view.moment];
        })""")
        page.goto("about:blank")
        page.goto(f"{file.as_uri()}#selected=100")
        assert page.evaluate("atLoad") == [FEED.detail(100)["words"], 100, FEED.trace.messages.step[100]]


# For everybody


def test_it_can_be_read_in_light_and_dark(browser: Browser, server: SnifferServer) -> None:
    with shown(browser, server.url, color_scheme="light", reduced_motion="reduce") as page:
        until(lambda: corner(page) > 195, "it stays dark")
        choose(page, 250)
        page.wait_for_selector("#message pre", state="attached")
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            until(lambda: (corner(page) < 60) == (scheme == "dark"), f"it is never {scheme}")  # noqa: B023
            assert page.evaluate(CONTRAST) == []
            assert page.evaluate(NAMELESS) == []
        page.click("#tab-filters")
        page.click("#tab-robot")
        page.wait_for_selector("#robot .knows")
        for scheme in ("dark", "light"):
            page.emulate_media(color_scheme=scheme)
            until(lambda: (corner(page) < 60) == (scheme == "dark"), f"it is never {scheme}")  # noqa: B023
            assert page.evaluate(CONTRAST) == []
            assert page.evaluate(NAMELESS) == []
        for other in ("dark", "light"):
            page.click("#theme")
            until(lambda: page.evaluate("document.documentElement.dataset.theme") == other, "the theme stays")  # noqa: B023
            until(lambda: (corner(page) < 60) == (other == "dark"), f"it is never {other}")  # noqa: B023


def corner(page: Page) -> int:
    """How light the page is in its corner: 255 is white."""
    return int(np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("L"))[3, 3])


def test_a_narrow_window_has_all_in_reach_and_the_toolbar_is_one_row_in_any(
    browser: Browser, server: SnifferServer
) -> None:
    with shown(browser, server.url, viewport={"width": 360, "height": 700}) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        page.click("#grid .row[data-message='3']")
        text_is(page, "#message blockquote", FEED.detail(3)["words"])
        assert page.evaluate(NAMELESS) == []
        page.keyboard.press("Escape")
        assert not page.locator("#right").is_visible()
        for width in (360, 1280, 1920):
            page.set_viewport_size({"width": width, "height": 760})
            until(lambda: page.evaluate("innerWidth") == width, "the window has another size")  # noqa: B023
            tops = page.eval_on_selector_all("#layout, #display", "parts => parts.map((part) => part.offsetTop)")
            assert max(tops) - min(tops) < 10
            page.click("#display summary")
            box = page.locator("#display dl").bounding_box()
            assert 0 <= box["x"] <= width - box["width"]
            page.keyboard.press("Escape")
            assert page.locator("#display dl").is_hidden()
