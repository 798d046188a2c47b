"""A field of four played Crazyflies for the team of `mavlink_teams`, and their fleet file."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.crazyflie_firmware import Crazyfly
from tests.support.crazyflies import Crazyflies
from tests.support.mavlink_teams import NAMES, fleet_file, team_folder, udp_ports
from tests.support.program import robochoc_within


@contextmanager
def crazyflie_field(folder: Path, haste: float = 20.0, **settings: object) -> Iterator[tuple[Crazyflies, Path]]:
    """Four Crazyflies below their places, which share one frame, and their fleet file."""
    ports = udp_ports(len(NAMES))
    fleet = fleet_file(folder, dict(zip(NAMES, ports, strict=True)), scheme="udp", **settings)
    with Crazyflies([Crazyfly(port, (2.0 * n, 0.0, 0.0), haste) for n, port in enumerate(ports)]) as vehicles:
        yield vehicles, fleet


def solve(folder: Path, fleet: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Solve the team of the field, in the simulator's runtime."""
    place = f"crazyflie:{fleet}"
    done = robochoc_within("solve", team_folder(folder), "--runtime", "simulator", "--ros", place, *words)
    assert "Traceback" not in done.stderr
    return done
