"""Every command and every piece of code on the pages is run, in a folder like the repository's."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from tests.support.cases import cases
from tests.support.ports import free_port
from tests.support.program import ROOT
from tests.support.snippets import Block, Reader, Step, agrees, blocks_of, steps_of

PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
ELSEWHERE = {"write-a-protocol.md": "tests/cli/test_own_protocol.py"}
"""Pages whose snippets another test runs."""
HERE = [page for page in PAGES if page.name not in ELSEWHERE]
WHOLE_PROGRAMS = {
    "docs/gallery.md",
    "docs/index.md",
    "docs/tutorials/fly.md",
    "docs/tutorials/two-machines.md",
    *(
        f"docs/guides/{name}.md"
        for name in (
            "experiments",
            "large-teams",
            "losses",
            "maps",
            "ros",
            "scene",
            "several-machines",
            "sniffer",
            "verify",
        )
    ),
}
"""Pages whose commands start many processes or take more than a second."""
LANGUAGES = {"sh", "console", "python", "text", "xml", "yaml", "toml", "json", "lisp", "bibtex", "make"}
BROWSER = """\
#!{python} -SE
import re, sys
from http.client import HTTPConnection
with open(sys.argv[1].removeprefix("file://")) as file:
    place, path = re.search('url=http://([^/]+)([^"]+)"', file.read()).groups()
seen = HTTPConnection(place)
seen.request("GET", path + "about")
seen.getresponse().read()
seen.close()
"""
"""A browser, as far as who waits for one can tell: it goes where it is sent, and asks what the page asks first."""
MACHINE, PORT = "192.168.1.14", "7447"


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def has(page: Path, *, slow: bool) -> bool:
    return any(("slow" in step.words) == slow for step in steps_of(page.read_text()))


@pytest.fixture
def reader_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Reader:
    """Somebody in a copy of what the pages name, with a home of their own; `make` and the web are out of reach."""
    for part in ("instances", "docs/examples", "tests/data"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "out").mkdir()  # as after `make demo`
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    browser = home / "browser"
    browser.write_text(BROWSER.format(python=sys.executable))
    browser.chmod(0o700)
    given = {
        "HOME": str(home),
        "XDG_DATA_HOME": str(home / "data"),
        "BROWSER": str(browser),
        "PATH": path,
        "COLUMNS": "120",
    }
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    return Reader(tmp_path, os.environ, {MACHINE: "127.0.0.1", PORT: str(free_port(count=2))})


def possible(step: Step) -> bool:
    """Return whether the modules that a step needs are there."""
    return all(importlib.util.find_spec(module) for module in re.findall(r"needs (\w+)", step.words))


def follow(page: Path, reader: Reader, *, slow: bool) -> None:
    try:
        for step in steps_of(page.read_text()):
            if possible(step) and (slow or "slow" not in step.words):
                reader.run(step)
        reader.finish()
    finally:
        reader.stop()


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.more if name_of(page) in WHOLE_PROGRAMS else ())
        for page in HERE
        if has(page, slow=False)
    ],
    ids=name_of,
)
def test_the_snippets_of_a_page_do_what_it_says(page: Path, reader_of: Reader) -> None:
    follow(page, reader_of, slow=False)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", [page for page in HERE if has(page, slow=True)], ids=name_of)
def test_the_snippets_of_a_page_do_what_it_says_those_that_take_long_too(page: Path, reader_of: Reader) -> None:
    follow(page, reader_of, slow=True)


def test_every_block_has_a_language_and_those_that_are_not_run_a_reason() -> None:
    with cases() as each:
        for page in PAGES:
            with each(name_of(page)):
                for block in blocks_of(page.read_text()):
                    assert block.kind in LANGUAGES, f"line {block.line}: ```{block.kind}"
                    reason = block.words.removeprefix("not run:")
                    assert len(reason.strip()) > 5 or reason == block.words, (
                        f"line {block.line}: not run, without a reason"
                    )


def test_pages_that_are_run_elsewhere_say_so() -> None:
    for page in PAGES:
        if page.name in ELSEWHERE:
            assert page.name in (ROOT / ELSEWHERE[page.name]).read_text()


# The harness itself


def test_blocks_are_found_with_their_words_and_without_their_indent() -> None:
    text = (
        "A\n\n<!-- snippet: slow -->\n```sh\nrobochoc --version\n```\n\n"
        "=== tab\n\n    ```python\n    if True:\n        x = 1\n    ```\n"
    )
    assert blocks_of(text) == [
        Block(4, "sh", "robochoc --version\n", "slow"),
        Block(10, "python", "if True:\n    x = 1\n"),
    ]


def test_a_console_block_is_a_step_for_each_command() -> None:
    text = "```console\n$ robochoc a\nout\n$ robochoc b  # exit status 3\n```\n"
    assert [(step.code, step.printed) for step in steps_of(text)] == [
        ("robochoc a", "out\n"),
        ("robochoc b  # exit status 3", None),
    ]


def test_what_is_said_is_compared_with_what_is_printed() -> None:
    with cases() as each:
        for said, printed, agree in [
            ("in 0.3 s", "in 12 s\n", True),
            ("9 s in 0.3 s (30.0 times as fast as real time)", "9 s in 9.9 s (1.1 times slower than real time)", True),
            ("3 times as fast as the others", "4 times as fast as the others", False),
            ("a\n...\nz", "a\nb\nc\nz", True),
            ("3 messages", "4 messages", False),
            ("a", "a\nb", False),
            ("# a ... b", "# a x b", True),
        ]:
            with each(said):
                assert agrees(said, printed) is agree


def test_a_page_that_is_wrong_fails(reader_of: Reader) -> None:
    step = Step(1, "sh", "robochoc --version", "robochoc 7", "")
    with pytest.raises(AssertionError, match="line 1: robochoc --version"):
        reader_of.run(step)
