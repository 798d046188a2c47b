"""What the browser of the tests keeps for a while is in a folder of its own."""

from __future__ import annotations

from typing import Any

from robochoc.system.temporary_files import temporary_folder
from tests.support.browser_pages import CHROMIUMS_OWN, watched_page


def test_chromium_keeps_its_temporary_files_in_a_folder_of_its_own(browser: Any) -> None:  # noqa: ANN401 - Playwright's
    with watched_page(browser) as tab:
        tab.page.set_content("here")
        kept = {file.relative_to(temporary_folder()).parts[0] for file in temporary_folder().rglob("*Chromium*")}
    assert len(kept) == 1
    assert kept.pop().startswith(CHROMIUMS_OWN)
