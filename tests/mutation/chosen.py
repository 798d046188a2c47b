"""A plugin of pytest that runs the cases of a list, in its order, and writes down the first that fails."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

FILE = "MUTATE_CASES"
"""The environment variable that names the list. The failed case is written beside it."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the cases of the list."""
    order = {case: number for number, case in enumerate(json.loads(Path(os.environ[FILE]).read_bytes()))}
    chosen = sorted((item for item in items if item.nodeid in order), key=lambda item: order[item.nodeid])
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in order])
    items[:] = chosen


def _failed(report: pytest.TestReport | pytest.CollectReport) -> None:
    if report.failed:
        error = getattr(report.longrepr, "reprcrash", None)
        text = str(error.message if error else report.longrepr)[-300:]
        Path(f"{os.environ[FILE]}.failed").write_text(json.dumps([report.nodeid, text]))


pytest_runtest_logreport = _failed
pytest_collectreport = _failed
