"""Swarms: drones with real positions cost less than drones on cells."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

from robochoc.formats import check_team, read_team, write_team
from robochoc.generators.swarm import swarm
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve


def test_real_positions_are_better_than_cells(tmp_path: Path) -> None:
    cells, real = swarm(agents=3, points=11), swarm(agents=3, points=5)
    check_team(cells)
    write_team(real, tmp_path / real.name)
    assert read_team(tmp_path / real.name) == real
    on_cells = solve(cells, Options(protocol="dpop", runtime=Runtime.SIMULATOR, refine=math.inf))
    found = solve(real, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert on_cells.cost is not None
    assert found.cost is not None
    assert Fraction(found.cost) < Fraction(on_cells.cost)
    assert found.bound is not None
    assert Fraction(found.cost) - Fraction(found.bound) < Fraction(1, 10)
