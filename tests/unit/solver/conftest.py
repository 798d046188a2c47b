"""Solvers for tests of the solver."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robochoc.solver.ace import AceProcess


@pytest.fixture
def ace(warm_ace: None) -> Iterator[AceProcess]:
    """A process that is asked always, and is shared by all tests that leave it in good health."""
    del warm_ace
    with AceProcess(always=True) as solver:
        yield solver


@pytest.fixture(params=[False, True], ids=["enumerated", "by ACE"])
def solver(request: pytest.FixtureRequest, warm_ace: None) -> Iterator[AceProcess]:
    """A solver that enumerates what is small, and one that asks ACE always."""
    del warm_ace
    with AceProcess(always=request.param) as one:
        yield one
