"""Fixtures of the tests of vehicles: an autopilot that is played, and the pilot that flies by it."""

from __future__ import annotations

import pytest

from tests.support.played_autopilot import Ordered, Played


@pytest.fixture
def played() -> Played:
    """An autopilot that is played."""
    return Played()


@pytest.fixture
def pilot(played: Played) -> Ordered:
    """The pilot that flies by it."""
    return Ordered(played)
