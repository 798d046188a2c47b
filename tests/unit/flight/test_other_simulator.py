"""The simulated flight, checked from outside: RotorPy's rotorcraft under the same controller fly as ours do.

RotorPy is in a Python of its own, which the environment variable names; without it there is nothing to compare with.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

import pytest

from tests.support.program import ROOT

PYTHON = "ROBOCHOC_BENCH_ROTORPY"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(PYTHON not in os.environ, reason=f"{PYTHON} names no Python with RotorPy"),
]


@pytest.fixture
def other(monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 - a module's names are known when it is there
    """The benchmark's module, which flies both."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("other_flight")


@pytest.mark.parametrize(("number", "rms_mm", "most_mm"), [(0, 0.01, 0.01), (1, 20, 50), (2, 2, 4)])
def test_rotorpy_flies_as_we_do(other: Any, number: int, rms_mm: float, most_mm: float) -> None:  # noqa: ANN401
    found = other.closed_loop(other.cases()[number])
    assert found.rms_m * 1e3 < rms_mm
    assert found.max_m * 1e3 < most_mm


def test_the_same_thrusts_lead_to_nearly_the_same_places(other: Any) -> None:  # noqa: ANN401
    found = other.open_loop(other.cases()[2], 2.0)
    assert 0 < found.max_m < 0.1
