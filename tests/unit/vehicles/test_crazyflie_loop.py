"""The loop closed by Crazyflies: one falls out, the team decides anew, and the others fly on."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

pytest.importorskip("cflib")

from tests.support.crazyflie_teams import crazyflie_field, solve

WAIT_S = "1"
"""The run is over when nothing has changed for so long after all are there."""


def closed(folder: Path, fleet: Path) -> subprocess.CompletedProcess[str]:
    words = ["--protocol", "dynabt", "--situation", f"crazyflie:{fleet}", "--report-timeout", WAIT_S, "--arm"]
    return solve(folder, fleet, *words)


@pytest.mark.more
def test_whose_battery_empties_lands_and_the_others_decide_anew(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        vehicles[1].drain = 3.0
        done = closed(tmp_path, fleet)
        assert "-RB" in done.stdout
        assert f"{fleet}: 7 waypoints, 1 landing; 4 flown, 4 landed" in done.stderr
        assert done.returncode == 0
        assert all(vehicle.is_down for vehicle in vehicles)
        assert vehicles[1].log.count("land") == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trouble", "why"),
    [
        ({"refuses": {"goto"}}, "it did not fly to its place (command denied)"),
        ({"silent_above": 0.5}, "its link has been silent for 5 s"),
        ({"tumbled": True}, "it does not stand upright"),
    ],
)
def test_who_falls_out_leaves_and_the_others_decide_anew(tmp_path: Path, trouble: dict[str, object], why: str) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        for name, value in trouble.items():
            setattr(vehicles[1], name, value)
        done = closed(tmp_path, fleet)
        assert "-RB" in done.stdout
        assert f"3 landed, RB is out of order: {why}" in done.stderr
        vehicles.wait_until_safe()
