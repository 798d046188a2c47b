"""Hostile text goes through one function before anybody sees it."""

from __future__ import annotations

import re
from io import StringIO

import pytest

from robochoc.cli.commands.directory import _print_table
from robochoc.cli.reports.failures import LOST, Failure
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.system.plain_text import LONGEST, LONGEST_REASON, on_one_line
from tests.support.cases import cases

HOSTILE = {
    "\x1b[2J\x1b[H": r"\x1b[2J\x1b[H",
    "\x1b]8;;http://x\x07click\x1b]8;;\x07": r"\x1b]8;;http://x\x07click\x1b]8;;\x07",
    "\x9b31m": r"\x9b31m",
    "\u202egnp.exe": r"\u202egnp.exe",
    "\u2066a\u2069": r"\u2066a\u2069",
    "a\u200bb\ufeff": r"a\u200bb\ufeff",
    "one\r\ntwo\u2028three\x85": r"one\r\ntwo\u2028three\x85",
    "\0": r"\x00",
    "\ud800": r"\ud800",
    "[bold]loud[/bold]": "[bold]loud[/bold]",
    "<script>alert(1)</script>": "<script>alert(1)</script>",
    "Zürich, Ωmega, 機器人": "Zürich, Ωmega, 機器人",
}


def test_nothing_speaks_to_the_terminal() -> None:
    with cases() as each:
        for text, shown in HOSTILE.items():
            with each(text):
                assert on_one_line(text) == shown
                assert on_one_line(text).isprintable()
                on_one_line(text).encode()


def test_nothing_fills_the_screen() -> None:
    for char in ("x", "\x1b", "\U0010ffff"):
        shown = on_one_line(char * 2_000_000)
        assert len(shown) < 11 * LONGEST
        assert shown.endswith("... (1,990,000 more characters)")
    assert on_one_line("abc", 2) == "ab... (1 more characters)"


HUGE = "\x1b[2J" + "\u202e" * 1_000_000


def is_plain(text: str, at_most: int) -> bool:
    return text.isprintable() and len(text) <= at_most


# Where texts of others come in, and where they come out


def test_what_the_master_says_reaches_the_robots_owner_plain() -> None:
    from robochoc.communication.network.control_messages import Joined, Leave  # noqa: PLC0415 - heavy
    from tests.support.lone_robot import played  # noqa: PLC0415 - heavy

    ending, _ = played(lambda _post, word: [Leave(HUGE, failed=True)] if isinstance(word, Joined) else [])
    assert ending.why.startswith(r"\x1b[2J\u202e")
    assert is_plain(ending.why, 11 * LONGEST_REASON)


def test_what_is_refused_is_plain() -> None:
    from robochoc.communication.network.refusals import Refusals  # noqa: PLC0415 - heavy

    told: list[str] = []
    refusals = Refusals(lambda *words: told.extend(words))
    for text in (*HOSTILE, HUGE):
        refusals.note(text, text, text)
    assert all(is_plain(word, 11 * LONGEST_REASON) for word in told)


def test_failures_are_plain_line_by_line(capsys: pytest.CaptureFixture[str]) -> None:
    Failure(LOST, "a.xml:1: \x1b[2J\nb.xml:2: \u202e").show()
    assert capsys.readouterr().err == "a.xml:1: \\x1b[2J\nb.xml:2: \\u202e\n"


def test_the_directorys_table_is_plain(capsys: pytest.CaptureFixture[str]) -> None:
    services = tuple(ServiceDescription(name=text, type="topic") for text in ("\x1b[2J", "[link=http://x]y[/link]"))
    _print_table((AgentDescription("[bold]loud", services, ("abt",)),))
    shown = capsys.readouterr().out
    assert "\x1b" not in shown
    assert "[bold]loud" in shown
    assert re.search(r"\[link=", shown)


def test_progress_is_plain(monkeypatch: pytest.MonkeyPatch) -> None:
    from robochoc.cli.reports import progress  # noqa: PLC0415 - of this test alone
    from robochoc.communication.search_result import Progress  # noqa: PLC0415 - the same

    class Terminal(StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with progress.progress_line("\x1b]0;title\x07") as show:
        assert show
        show(Progress(0, 0.0, "[bold]\u202e"))
    assert r"\x1b]0;title\x07: [bold]\u202e" in terminal.getvalue()
    assert "\u202e" not in terminal.getvalue()
