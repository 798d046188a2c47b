"""Tests with compiled modules: `python -m tests.support.compiled FOLDER...` prints the files that name one of them."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from robochoc.system.compiled_core import kind_of_core

plain_python_only = pytest.mark.skipif(
    kind_of_core() == "compiled core", reason="compiled code takes neither replaced methods nor values of other types"
)
KERNELS = "robochoc.communication.arrays"
"""The package with the compiled functions for arrays, which is no module of the core."""


def files_about_compiled(folders: Iterable[str]) -> Iterator[str]:
    """Yield the test files in `folders` that name a compiled module. Others test what is the same from any wheel."""
    settings = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))
    hooks = settings["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]
    names = (*hooks["custom"]["modules"], KERNELS)
    for folder in folders:
        for file in sorted(Path(folder).rglob("test_*.py")):
            text = file.read_text(encoding="utf-8")
            if any(name in text for name in names):
                yield str(file)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", metavar="FOLDER")
    sys.stdout.write(" ".join(files_about_compiled(parser.parse_args().folders)))
