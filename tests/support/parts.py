"""A fixed part of the tests, drawn from all files: `pytest -p tests.support.parts --part 3` runs a third of them.

Which ones depends on their names alone, so they are the same each time, on each machine, in any order.
"""

from __future__ import annotations

import zlib

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Make `--part` known."""
    parser.addoption("--part", type=int, default=1, metavar="N", help="run one test of N, the same ones each time")


def in_part(name: str, parts: int) -> bool:
    """Return whether the test of this name is in the part that is run."""
    return zlib.crc32(name.encode()) % parts == 0


@pytest.hookimpl(trylast=True)  # after the marks have had their say
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep one test of N."""
    parts = config.getoption("--part")
    kept = [item for item in items if in_part(item.nodeid, parts)]
    if len(kept) < len(items):
        config.hook.pytest_deselected(items=[item for item in items if not in_part(item.nodeid, parts)])
        items[:] = kept
