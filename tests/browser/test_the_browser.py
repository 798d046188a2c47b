"""The browser of these tests: what it starts is its own, also what leaves its family."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from tests.support.leftovers import MARK, marked


def test_no_process_of_the_browser_is_taken_for_one_that_a_test_has_left(
    browser: Any,  # noqa: ANN401 - Playwright's
) -> None:
    assert browser.is_connected()
    commands = {pid: Path(f"/proc/{pid}/cmdline").read_bytes() for pid in marked(os.environ[MARK])}
    assert not [command for command in commands.values() if b"chrom" in command and b"--" in command]
