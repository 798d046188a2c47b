"""Progress on a terminal, also of work that reports nothing itself."""

from __future__ import annotations

import re
from io import StringIO

import pytest

from robochoc.cli.reports import progress
from tests.support.limits import wait_until


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def test_work_that_reports_nothing_shows_how_long_it_has_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "TICK_S", 0.001)
    monkeypatch.setattr(progress, "REFRESH_S", 0)
    monkeypatch.setenv("TERM", "xterm")
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with progress.elapsed_time("generate", "drawing"):
        wait_until(lambda: terminal.getvalue().count("generate: drawing, ") > 1, "it shows nothing")
    shown = terminal.getvalue()
    assert re.search(r"generate: drawing, [0-9.]+ s", shown)
    assert shown.endswith("\r\x1b[K")

    elsewhere = StringIO()
    monkeypatch.setattr("sys.stderr", elsewhere)
    with progress.elapsed_time("generate", "drawing"):
        pass
    assert elsewhere.getvalue() == ""
