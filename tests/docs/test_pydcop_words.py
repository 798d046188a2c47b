"""The words of pyDCOP in errors are those on the page "Coming from pyDCOP", and the words of robochoc exist."""

from __future__ import annotations

import re
from pathlib import Path

from robochoc.cli.commands.solve import solve
from robochoc.cli.group import COMMANDS
from robochoc.run.registry import installed_protocol
from robochoc.system import pydcop_words

PAGE = Path("docs/guides/coming-from/pydcop.md")


def test_the_page_has_the_words_of_the_errors() -> None:
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("|")]
    for theirs, ours in {**pydcop_words.OPTIONS, **pydcop_words.COMMANDS, **pydcop_words.PROTOCOLS}.items():
        row = next((line for line in lines if re.search(rf"(?<![\w-]){theirs}(?![\w-])", line.split("|")[1])), None)
        assert row is not None, theirs
        word = ours.split()[1 if ours.startswith("robochoc") else 0].rstrip(":,")
        assert word in row, (theirs, ours)
    for theirs, ours in pydcop_words.SETTINGS.items():
        assert any(f"{theirs}:" in line and f"--set {ours}=" in line for line in lines)


def test_the_replacements_exist() -> None:
    options = {word for one in solve.params for word in (*one.opts, *one.secondary_opts)}
    assert not options & pydcop_words.OPTIONS.keys()
    for ours in pydcop_words.OPTIONS.values():
        assert {word for word in ours.split() if word.startswith("--")} <= options
    assert not pydcop_words.COMMANDS.keys() & COMMANDS.keys()
    for ours in pydcop_words.COMMANDS.values():
        assert {*re.findall(r"robochoc (\w+)", ours)} <= COMMANDS.keys()
    for ours in pydcop_words.PROTOCOLS.values():
        assert all(installed_protocol(word) for word in ours.split(" or "))
