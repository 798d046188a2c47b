"""The application's first page: examples, files, the user's own teams."""

from __future__ import annotations

import os
import re
import zipfile
from pathlib import Path
from typing import Any

from robochoc.app.error_log import ERRORS
from robochoc.app.sketch import files
from robochoc.app.sketch.example_sketches import examples, title_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from robochoc.app.texts import say
from robochoc.system.temporary_files import temporary_folder
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, WatchedPage, app_page
from tests.support.limits import wait_until

_TEAM = re.compile(r"/team/([0-9a-f]{12})/model$")


def _made(tab: WatchedPage) -> str:
    """The id of the team whose page comes up."""
    tab.page.wait_for_url(_TEAM)
    found = _TEAM.search(tab.page.url)
    assert found
    return found[1]


def _sent(tab: WatchedPage, file: Path) -> None:
    tab.page.set_input_files("input[type=file]", str(file))


def test_an_example_becomes_a_team_of_the_users_own(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    with app_page(browser, application.url) as tab:
        tab.page.click(f"text={title_of('charging')}")
        assert teams.load(_made(tab)).now == examples()["charging"]


def test_a_team_that_was_saved_comes_back_from_its_archive(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    sketch = examples()["patrol"]
    archive = tmp_path / "patrol.zip"
    archive.write_bytes(files.zipped(sketch))
    with app_page(browser, application.url) as tab:
        with tab.page.expect_file_chooser() as asked:
            tab.page.click("text=From a file")
        asked.value.set_files(str(archive))
        assert teams.load(_made(tab)).now == sketch


def test_files_of_another_tool_are_opened_as_what_they_are(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(
        "name: pair\nobjective: min\ndomains: {d: {values: [0, 1]}}\nvariables: {x: {domain: d}, y: {domain: d}}\n"
        "constraints: {c: {type: intention, function: 1 if x == y else 0}}\nagents: [a, b]\n"
    )
    with app_page(browser, application.url) as tab:
        _sent(tab, file)
        name = _made(tab)
        tab.page.wait_for_selector("text=This team was not drawn here")
        assert f"robochoc solve {teams.import_folder(name)}" in tab.page.inner_text(".command-text")
        assert "graph.yaml" in tab.page.inner_text("main")
        tab.page.wait_for_selector("text=Its constraints")
    foreign = teams.import_folder(name)
    assert foreign is not None
    assert [robot.name for robot in teams.load(name).now.robots] == sorted(one.stem for one in foreign.glob("*.xml"))


def test_what_cannot_be_read_is_told_in_one_line(browser: Browser, application: AppServer, tmp_path: Path) -> None:
    with app_page(browser, application.url) as tab:
        for name, content, says in (
            ("<img src=x onerror=alert(1)>.xml", b"<?xml", "img"),
            ("team.zip", b"PK\x03\x04broken", "team.zip"),
            ("empty", b"", "empty"),
            ("billion.xml", b'<!DOCTYPE a [<!ENTITY b "b">]><instance>&b;</instance>', "billion.xml"),
        ):
            file = tmp_path / name
            file.write_bytes(content)
            _sent(tab, file)
            tab.page.wait_for_function(f"document.querySelector('.error').textContent.includes({says!r})")
            assert str(tmp_path) not in tab.page.inner_text(".error")
            assert tab.page.query_selector("main img") is None


def test_an_archive_that_leads_out_of_its_folder_writes_nothing_there(
    browser: Browser, application: AppServer, tmp_path: Path
) -> None:
    name, archive = f"evil-{os.getpid()}.xml", tmp_path / "out.zip"
    with zipfile.ZipFile(archive, "w") as made:
        for depth in (1, 2, 3):
            made.writestr(f"{'../' * depth}{name}", "<instance/>")
    with app_page(browser, application.url) as tab:
        _sent(tab, archive)
        tab.page.wait_for_function("document.querySelector('.error').textContent.length > 0")
    folder = temporary_folder()  # the archive is unpacked in a folder two levels below it
    places = (folder / name, folder.parent / name, *folder.glob(f"robochoc-*/{name}"))
    assert [place for place in places if place.exists()] == []


def test_a_team_is_removed_when_that_is_confirmed(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    team = teams.add(Sketch("unwanted"))
    with app_page(browser, application.url) as tab:
        tab.page.click("[aria-label='Remove unwanted']")
        tab.page.click("text=Keep it")
        tab.page.click("[aria-label='Remove unwanted']")
        assert team in teams.ids()
        tab.page.click("text=Remove it")
        tab.page.wait_for_selector("[aria-label='Remove unwanted']", state="detached")
    wait_until(lambda: team not in teams.ids(), "it is there still")


def test_text_in_place_of_a_file_is_refused_with_a_sentence(
    browser: Browser, application: AppServer, teams: TeamStore, tmp_path: Path
) -> None:
    wrong = tmp_path / "wrong.txt"
    wrong.write_text("no team")
    forms: list[dict[str, Any]] = [{"file": "text"}, {}]
    with app_page(browser, application.url) as tab:
        with tab.page.expect_response("**/upload/*") as sent:
            _sent(tab, wrong)
        assert sent.value.ok
        for form in forms:
            answer = tab.page.request.post(sent.value.url, multipart=form)
            assert (answer.status, answer.json()) == (400, {"detail": say("gallery.no-file")})
    assert not (teams.folder / ERRORS).exists() or "upload_route" not in (teams.folder / ERRORS).read_text()


def test_the_first_mistakes_of_a_file_are_told_each_in_its_line(
    browser: Browser, application: AppServer, tmp_path: Path
) -> None:
    archive = tmp_path / "trio.zip"
    with zipfile.ZipFile(archive, "w") as made:
        for number in range(5):
            made.writestr(f"R{number}.xml", "<instance")
    with app_page(browser, application.url) as tab:
        _sent(tab, archive)
        tab.page.wait_for_selector("[role=alert]:has-text('trio/R0.xml')")
        told = tab.page.locator(".mistakes").inner_text().splitlines()
        assert [line.partition(":")[0] for line in told] == [
            *(f"trio/R{number}.xml" for number in range(3)),
            "And 2 more.",
        ]
