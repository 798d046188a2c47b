"""Modules, files and names of the program that pages mention are there, so that a rename is noticed."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from tests.support.cases import cases
from tests.support.program import ROOT

PAGES = sorted(path for path in (ROOT / "docs").rglob("*.md") if "examples" not in path.parts)
FILE = re.compile(r"`((?:[a-z_]+/)+[a-z_0-9]+\.(?:py|toml|xsd|md)|(?:robochoc|tests|benchmarks)/[a-z_/]+/)`")
FOLDERS = [
    ROOT,
    ROOT / "robochoc",
    *(ROOT / "docs" / "examples").iterdir(),
    *(path for path in (ROOT / "robochoc").iterdir() if path.is_dir()),
]


def outside_of_blocks(page: Path) -> str:
    """Return the text of a page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def test_files_that_a_page_names_are_there() -> None:
    with cases() as each:
        for page in PAGES:
            with each(page):
                for name in FILE.findall(outside_of_blocks(page)):
                    assert any((folder / name).exists() for folder in FOLDERS), name


def test_dotted_names_on_a_page_can_be_imported() -> None:
    with cases() as each:
        for page in PAGES:
            with each(page):
                for name in re.findall(r"(?:`|^::: )(robochoc(?:\.\w+)+)", outside_of_blocks(page), re.MULTILINE):
                    importable(name)


def importable(name: str) -> None:
    """Import a module, or get a name of one; fails if it is not there."""
    module, _, rest = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        assert hasattr(importlib.import_module(module), rest), name
