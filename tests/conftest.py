"""What several test files begin with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from machines import Site

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d


@pytest.fixture
def four(tmp_path: Path) -> Path:
    folder = tmp_path / "queens3d-4"
    write_team(queens3d(4), folder)
    return folder


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with Site(tmp_path) as site:
        yield site


@pytest.fixture(autouse=True, scope="session")
def cache_of_their_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests neither use nor fill the cache of whoever runs them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield
