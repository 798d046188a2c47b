"""Modules, files and names of the program that pages mention are there, so that a rename is noticed."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from tests.support.program import ROOT

PAGES = sorted(path for path in (ROOT / "docs").rglob("*.md") if "examples" not in path.parts)
FOLDERS = [
    ROOT,
    ROOT / "robochoc",
    *(ROOT / "docs" / "examples").iterdir(),
    *(path for path in (ROOT / "robochoc").iterdir() if path.is_dir()),
]


def outside_of_blocks(page: Path) -> str:
    """Return the text of a page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_that_a_page_names_are_there(page: Path) -> None:
    for name in re.findall(r"`((?:[a-z_]+/)+[a-z_0-9]+\.(?:py|toml|xsd|md)|(?:robochoc|tests|benchmarks)/[a-z_/]+/)`",
                           outside_of_blocks(page)):  # fmt: skip
        assert any((folder / name).exists() for folder in FOLDERS), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_dotted_names_on_a_page_can_be_imported(page: Path) -> None:
    for name in re.findall(r"(?:`|^::: )(robochoc(?:\.\w+)+)", outside_of_blocks(page), re.MULTILINE):
        importable(name)


def importable(name: str) -> None:
    """Import a module, or get a name of one; fails if it is not there."""
    module, _, rest = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        assert hasattr(importlib.import_module(module), rest), name
