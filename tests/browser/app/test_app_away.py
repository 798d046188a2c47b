"""The laptop sleeps, the server dies: the page comes back by itself, or says what to do, and nothing is lost."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer, app_server
from tests.support.browser_pages import Browser, Page, connected, watched_page
from tests.support.limits import wait_until

NAME = "[aria-label='Name of the team']"
AWAY, BACK = "#popup[aria-hidden=false]", "#popup[aria-hidden=true]"
SAYS = "getComputedStyle(document.getElementById('popup'), '::after').content"


def _renamed(page: Page, teams: TeamStore, team: str, name: str) -> None:
    page.fill(NAME, name)
    wait_until(lambda: teams.load(team).now.name == name, lambda: f"it is {teams.load(team).now.name} still")


def test_a_server_that_was_killed_and_begun_again_has_all_that_was_saved(browser: Browser, tmp_path: Path) -> None:
    teams = TeamStore(tmp_path / "teams")
    team = teams.add(Sketch("first"))
    first = AppServer(teams.folder)
    with watched_page(browser, may_complain=True) as old, watched_page(browser, may_complain=True) as new:
        connected(old.page, f"{first.url}team/{team}/model")
        _renamed(old.page, teams, team, "kept")
        assert first.end(signal.SIGKILL) == -signal.SIGKILL
        old.page.wait_for_selector(AWAY, state="attached")
        assert "start it again and open the address that it prints" in old.page.evaluate(SAYS)
        second = AppServer(teams.folder, first.port)
        try:
            connected(new.page, f"{second.url}team/{team}/model")
            assert new.page.input_value(NAME) == "kept"
            new.page.goto(f"{first.url}team/{team}/model")  # the address of before
            assert "Each start of robochoc app has a new address" in new.page.inner_text("body")
        finally:
            assert second.end() == 0


@pytest.mark.slow
def test_a_server_that_sleeps_for_longer_than_pages_wait_comes_back(browser: Browser, tmp_path: Path) -> None:
    teams = TeamStore(tmp_path / "teams")
    team = teams.add(Sketch("first"))
    with app_server(teams.folder) as server, watched_page(browser, may_complain=True) as tab:
        connected(tab.page, f"{server.url}team/{team}/model")
        _renamed(tab.page, teams, team, "before")
        os.kill(server.process.pid, signal.SIGSTOP)
        try:
            tab.page.wait_for_selector(AWAY, state="attached")  # it has not been heard of for 36 s
        finally:
            os.kill(server.process.pid, signal.SIGCONT)
        tab.page.wait_for_selector(BACK, state="attached")
        tab.page.wait_for_selector(NAME)
        tab.page.wait_for_function("window.did_handshake")
        assert tab.page.input_value(NAME) == "before"
        _renamed(tab.page, teams, team, "after")


@pytest.mark.slow
def test_a_browser_without_a_network_for_a_while_comes_back(browser: Browser, tmp_path: Path) -> None:
    teams = TeamStore(tmp_path / "teams")
    team = teams.add(Sketch("first"))
    context = browser.new_context()
    try:
        with app_server(teams.folder) as server:
            page = context.new_page()
            connected(page, f"{server.url}team/{team}/model")
            context.set_offline(True)
            page.evaluate("window.socket.io.engine.close()")  # as the system does; Chromium's emulation lets it be
            page.wait_for_selector(AWAY, state="attached")
            context.set_offline(False)
            page.wait_for_selector(BACK, state="attached")
            _renamed(page, teams, team, "after")
    finally:
        context.close()
