"""What several test files begin with."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d


@pytest.fixture
def four(tmp_path: Path) -> Path:
    folder = tmp_path / "queens3d-4"
    write_team(queens3d(4), folder)
    return folder
