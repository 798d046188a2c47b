"""The simulated flight, checked from outside: drones of other simulators under the same controller fly as ours do.

Each is in a Python of its own, which an environment variable names; without it there is nothing to compare with.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

import pytest

from tests.support.cases import looped
from tests.support.program import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

SIMULATORS = ["ROTORPY", "MUJOCO"]


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 - a module's names are known when it is there
    """The benchmark's module, which flies both."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("other_flight")


def simulator(flights: Any, name: str) -> Any:  # noqa: ANN401
    """The simulator of this name; the test is skipped where there is none."""
    other = getattr(flights, name)
    if other.python not in os.environ:
        pytest.skip(f"{other.python} names no Python with {other.name}")
    return other


@pytest.mark.parametrize("name", SIMULATORS)
@looped(("number", "rms_mm", "most_mm"), [(0, 0.01, 0.01), (1, 20, 50), (2, 2, 4)])
def test_others_fly_as_we_do(flights: Any, name: str, number: int, rms_mm: float, most_mm: float) -> None:  # noqa: ANN401
    found = flights.closed_loop(flights.cases()[number], simulator(flights, name))
    assert found.rms_m * 1e3 < rms_mm
    assert found.max_m * 1e3 < most_mm


@pytest.mark.parametrize("name", SIMULATORS)
def test_the_same_thrusts_lead_to_nearly_the_same_places(flights: Any, name: str) -> None:  # noqa: ANN401
    found = flights.open_loop(flights.cases()[2], 2.0, simulator(flights, name))
    assert 0 < found.max_m < 0.1
