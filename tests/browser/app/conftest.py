"""One application for all tests of its pages, with teams of their own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.leftovers import shared_by_tests


@pytest.fixture(scope="package")
def teams(tmp_path_factory: pytest.TempPathFactory) -> TeamStore:
    """The teams of the application."""
    return TeamStore(tmp_path_factory.mktemp("app") / "teams")


@pytest.fixture(scope="package")
def application(teams: TeamStore) -> Iterator[AppServer]:
    """The application. Each test adds teams of its own to `teams`."""
    with shared_by_tests(with_children=True):
        running = AppServer(teams.folder)
    try:
        yield running
    finally:
        assert running.end() == 0
