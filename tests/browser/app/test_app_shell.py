"""The application's shell: its bar, its address, and what is left when something dies."""

from __future__ import annotations

import signal
from http.client import HTTPConnection
from pathlib import Path

import pytest

from robochoc.app.sketch.history import History
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer, app_server
from tests.support.browser_pages import Browser, app_page, connected, watched_page
from tests.support.cases import looped
from tests.support.limits import HANG_S, wait_until

NAME = "[aria-label='Name of the team']"
UNDO, REDO = "[aria-label^='Undo']", "[aria-label^='Redo']"


def _saved(teams: TeamStore, team: str, name: str) -> None:
    wait_until(lambda: teams.load(team).now.name == name, lambda: f"it is {teams.load(team).now.name} still")


def test_a_team_is_renamed_undone_and_seen_in_both_tabs(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(Sketch("first"))
    with watched_page(browser) as one, watched_page(browser) as other:
        for tab in (one, other):
            connected(tab.page, f"{application.url}team/{team}/model")
            tab.page.wait_for_selector(NAME)
        one.page.fill(NAME, "second")
        _saved(teams, team, "second")
        other.page.wait_for_function(f'document.querySelector("{NAME}").value === "second"')
        other.page.click(UNDO)
        one.page.wait_for_function(f'document.querySelector("{NAME}").value === "first"')
        assert one.page.get_attribute(UNDO, "disabled") is not None
        one.page.focus("#content")  # a click there would add a robot
        one.page.keyboard.press("Control+Shift+Z")
        other.page.wait_for_function(f'document.querySelector("{NAME}").value === "second"')
        assert {address.split("/")[2] for address in one.asked if address.startswith("http")} == {
            f"127.0.0.1:{application.port}"
        }


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_light_or_dark_is_kept_from_page_to_page(
    browser: Browser, application: AppServer, teams: TeamStore, scheme: str
) -> None:
    team = teams.add(Sketch("first"))
    chosen = "light" if scheme == "dark" else "dark"
    with (
        watched_page(browser, color_scheme=scheme) as tab,
        watched_page(browser, color_scheme=scheme) as other,
    ):
        connected(other.page, application.url)
        connected(tab.page, application.url)
        try:
            tab.page.click("[aria-label='Light or dark']")
            for page in (tab.page, other.page):
                page.wait_for_selector(f"body.body--{chosen}")
            connected(tab.page, f"{application.url}team/{team}/decide")
            tab.page.wait_for_selector(f"body.body--{chosen}")
            tab.page.wait_for_selector("[aria-label='Light or dark']")
        finally:
            tab.page.evaluate("localStorage.clear()")


def test_what_can_be_no_name_is_told_where_it_was_typed(
    browser: Browser, application: AppServer, teams: TeamStore
) -> None:
    team = teams.add(Sketch("first"))
    with app_page(browser, f"{application.url}team/{team}/model") as tab:
        for name in (" ", "<script>alert(1)</script>", "a b", "{{7*7}}", "scenario", "ä", "1st"):
            tab.page.fill(NAME, name)
            tab.page.wait_for_selector("text=is not a valid name")
            tab.page.fill(NAME, "first")
            tab.page.wait_for_selector("text=is not a valid name", state="detached")
    assert teams.load(team).now.name == "first"


def test_a_team_that_there_is_not_is_told(browser: Browser, application: AppServer) -> None:
    with watched_page(browser) as tab:
        for path in ("team/0123456789ab/model", "team/%2e%2e/model", "team/<b>/fly"):
            connected(tab.page, f"{application.url}{path}")
            tab.page.wait_for_selector("text=There is no such team.")


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whatever_ends_the_server_an_edit_is_kept(browser: Browser, tmp_path: Path, by: int) -> None:
    teams = TeamStore(tmp_path / "teams")
    team = teams.add(Sketch("first"))
    server = AppServer(teams.folder)
    with watched_page(browser, may_complain=True) as tab:
        connected(tab.page, f"{server.url}team/{team}/model")
        tab.page.fill(NAME, "kept")
        if by == signal.SIGKILL:
            _saved(teams, team, "kept")
        else:
            tab.page.wait_for_selector(f"{UNDO}:not([disabled])")
        status = server.end(by)
    assert status == {signal.SIGINT: 0, signal.SIGTERM: 143, signal.SIGKILL: -9}[signal.Signals(by)]
    assert teams.load(team).now == Sketch("kept")


def test_a_damaged_team_does_not_keep_the_others_from_the_gallery(browser: Browser, tmp_path: Path) -> None:
    teams = TeamStore(tmp_path / "teams")
    teams.save(teams.add(Sketch()), History(Sketch("whole")))
    broken = teams.add(Sketch("broken"))
    (teams.path(broken) / "history.json").write_bytes(b"{")
    with app_server(teams.folder) as server, watched_page(browser) as tab:
        connected(tab.page, server.url)
        tab.page.wait_for_selector("text=whole")
        tab.page.wait_for_selector("text=damaged")
        connected(tab.page, f"{server.url}team/{broken}/model")
        tab.page.wait_for_selector("text=damaged")


def test_a_narrow_screen_needs_no_scrolling_to_the_side(browser: Browser, application: AppServer) -> None:
    with app_page(browser, application.url, {"width": 360, "height": 740}) as tab:
        tab.page.wait_for_selector("h1")
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 360


@looped(
    ("path", "headers", "status"),
    [
        ("{secret}", {}, 200),
        ("/", {}, 404),
        ("{secret}", {"Host": "evil.example"}, 404),
        ("{secret}", {"Origin": "http://evil.example"}, 403),
        ("{secret}_nicegui_ws/socket.io/?EIO=4&transport=websocket", {"Origin": "http://evil.example"}, 403),
        ("/_nicegui_ws/socket.io/?EIO=4&transport=websocket", {}, 403),
        ("{secret}_nicegui_ws/socket.io/?EIO=4&transport=polling", {"Origin": "null"}, 403),
    ],
)
def test_strangers_get_nothing(application: AppServer, path: str, headers: dict[str, str], status: int) -> None:
    socket = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    socket["Sec-WebSocket-Key"] = "dGhlIHNhbXBsZSBub25jZQ=="
    asked = {"Host": f"127.0.0.1:{application.port}", **(socket if "websocket" in path else {}), **headers}
    connection = HTTPConnection("127.0.0.1", application.port, timeout=HANG_S)
    try:
        connection.request("GET", path.replace("{secret}", application.path), headers=asked)
        assert connection.getresponse().status == status
    finally:
        connection.close()
