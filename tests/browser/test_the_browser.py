"""The browser of these tests: its files and processes are its own, and none is taken for one that a test has left."""

from __future__ import annotations

import os
from pathlib import Path

from robochoc.system.temporary_files import temporary_folder
from tests.support.browser_pages import CHROMIUMS_OWN, Browser, watched_page
from tests.support.leftovers import MARK, marked


def test_chromium_keeps_its_temporary_files_in_a_folder_of_its_own(browser: Browser) -> None:
    with watched_page(browser) as tab:
        tab.page.set_content("here")
        kept = {file.relative_to(temporary_folder()).parts[0] for file in temporary_folder().rglob("*Chromium*")}
    assert len(kept) == 1
    assert kept.pop().startswith(CHROMIUMS_OWN)


def test_no_process_of_the_browser_is_taken_for_one_that_a_test_has_left(browser: Browser) -> None:
    assert browser.is_connected()
    commands = {pid: Path(f"/proc/{pid}/cmdline").read_bytes() for pid in marked(os.environ[MARK])}
    assert not [command for command in commands.values() if b"chrom" in command and b"--" in command]
