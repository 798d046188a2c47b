"""A plugin of pytest for a tree with marks: it writes down the functions that each case reaches, and its CPU time."""

from __future__ import annotations

import json
import os
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from tests.mutation.marks import FOLDER, share

ROOT = Path(__file__).parents[2]


def _cpu_s() -> float:
    return sum(os.times()[:4])


class Record:
    """The marks, taken off after each case."""

    def __init__(self) -> None:
        self._marks = share(str(ROOT))
        self._fixtures: dict[Any, set[int]] = {}
        worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
        self._file = (ROOT / FOLDER / f"cases-{worker}.jsonl").open("a")
        self._passed: dict[str, bool] = {}

    def _taken(self) -> set[int]:
        reached = {number for number, mark in enumerate(self._marks[:]) if mark}
        self._marks[:] = bytes(len(self._marks))
        return reached

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Run a case, and write down what it has reached."""
        self._taken()
        before = _cpu_s()
        done = yield
        used, reached = _cpu_s() - before, self._taken()
        for fixtures in getattr(item, "_fixtureinfo").name2fixturedefs.values():  # noqa: B009
            reached |= self._fixtures.get(fixtures[-1], set())
        line = {"id": item.nodeid, "cpu": round(used, 3), "passed": self._passed.pop(item.nodeid, False)}
        more = item.get_closest_marker("more") is not None
        self._file.write(json.dumps({**line, "more": more, "reached": sorted(reached)}) + "\n")
        self._file.flush()
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Generator[None, Any, Any]:
        """Set up a fixture; what a shared one reaches is reached by all who use it."""
        before = self._taken()
        done = yield
        during = self._taken()
        if fixturedef.scope != "function":
            self._fixtures[fixturedef] = during
        for number in before | during:
            self._marks[number] = 1
        return done

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note whether a case has passed in all its parts."""
        self._passed[report.nodeid] = self._passed.get(report.nodeid, True) and report.passed


def pytest_configure(config: pytest.Config) -> None:
    """Record in the processes that run cases: not in the one that gives them to workers."""
    if os.environ.get("PYTEST_XDIST_WORKER") or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Record())
