"""`robochoc demo`: all it does, what it leaves, and when it opens a browser."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from robochoc.cli.commands import demo
from tests.support.program import robochoc_within


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is opened in a browser; there is a desktop."""
    addresses: list[str] = []
    monkeypatch.setattr("webbrowser.open", addresses.append)
    monkeypatch.setattr(demo, "on_a_desktop", lambda: True)
    return addresses


def test_it_solves_says_what_it_does_and_leaves_only_the_page(tmp_path: Path, opened: list[str]) -> None:
    done = robochoc_within("demo", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    commands = [line for line in done.stdout.splitlines() if line.startswith("$ ")]
    page = tmp_path / demo.PAGE
    assert commands == [
        "$ robochoc generate queens3d --n 4 -o queens3d-4",
        "$ robochoc validate queens3d-4",
        f"$ robochoc solve queens3d-4 --withdraw minimum --html {page}",
    ]
    assert "16 robots, 16 variables, 76 constraints: ok" in done.stdout
    assert "10 of 16 fly (proven maximum)" in done.stdout
    assert "16 processes" in done.stdout
    assert [*tmp_path.iterdir()] == [page]
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert opened == [page.as_uri()]


def test_without_fork_it_uses_the_simulator_and_says_so(
    tmp_path: Path, opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "out").mkdir()
    monkeypatch.delattr("os.fork")
    done = robochoc_within("demo", "--html", "out/four.html", "--no-open", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "sfb, order dom-deg, simulator" in done.stdout
    assert "others need POSIX" in done.stdout
    assert (tmp_path / "out" / "four.html").stat().st_size > 500_000
    assert opened == []


def test_a_page_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    done = robochoc_within("demo", "--html", "none/four.html", folder=tmp_path)
    assert done.returncode == 2
    assert "create it first" in done.stderr
    assert done.stdout == ""


def test_a_browser_opens_only_where_somebody_watches_and_there_are_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for terminal, display, opens in [(True, ":0", True), (True, "", False), (False, ":0", False)]:
        monkeypatch.setattr(sys.stdout, "isatty", lambda terminal=terminal: terminal)
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        assert demo.on_a_desktop() is opens, (terminal, display)
