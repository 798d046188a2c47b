"""Reports of commands: tables for people and pipes, progress, and what `robochoc master` prints."""

from __future__ import annotations

import re
from io import StringIO

import pytest

from robochoc.cli.commands.master import _EventPrinter
from robochoc.cli.reports import progress
from robochoc.cli.reports.table import table_lines
from robochoc.journal.events import DroppedOut, Registered
from robochoc.run.networked.address import Address
from tests.support.limits import wait_until

HEADINGS = ("name", "messages", "use when")
ROWS = [("abt", "1,053", "no costs: the default"), ("機器人", "7", "\x1b[31mred\n")]


def test_columns_are_aligned_and_nothing_in_them_is_obeyed() -> None:
    assert table_lines(HEADINGS, ROWS, right={"messages"}) == [
        "name    messages  use when",
        "abt        1,053  no costs: the default",
        r"機器人         7  \x1b[31mred\n",
    ]


@pytest.mark.parametrize("width", [10, 40])
def test_prose_is_wrapped_to_the_terminal(width: int) -> None:
    lines = table_lines(HEADINGS, [("dpop", "12", "word " * 12)], right={"messages"}, prose="use when", width=width)
    assert all(len(line) <= max(width, 16 + 20) for line in lines)
    assert [line[:16].split() for line in lines[1:3]] == [["dpop", "12"], []]
    assert " ".join(line[16:].strip() for line in lines[1:]) == ("word " * 12).strip()


def test_a_table_without_rows_has_headings() -> None:
    assert table_lines(HEADINGS, []) == ["name  messages  use when"]


# Progress on a terminal, also of work that reports nothing itself


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


# What `robochoc master` prints of its events


def test_that_robots_can_come_is_said_before_who_has_come(capfd: pytest.CaptureFixture[str]) -> None:
    printer = _EventPrinter(Address("127.0.0.1", 7447))
    printer.print_event(Registered(t=0.0, robot="Scout"))
    assert capfd.readouterr() == ("", "")
    printer.print_listening()
    printer.print_event(Registered(t=0.0, robot="Base"))
    assert capfd.readouterr().err.splitlines() == [
        "listening at 127.0.0.1:7447; start robots with --master 127.0.0.1:7447",
        "Scout has registered",
        "Base has registered",
    ]


def test_that_a_robot_has_dropped_out_is_said_in_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    printer = _EventPrinter(Address("127.0.0.1", 7447))
    printer.print_listening()
    printer.print_event(DroppedOut(t=0.0, robot="Scout", why="it has not been there for 10 s"))
    line = "Scout has disconnected: it has not been there for 10 s; waiting for its return"
    assert capfd.readouterr().err.splitlines()[1:] == [line]
