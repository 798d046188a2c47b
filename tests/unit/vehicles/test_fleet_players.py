"""The players of a fleet file, as the guide on autopilots has them."""

from __future__ import annotations

from itertools import combinations
from math import dist
from pathlib import Path

import pytest

from robochoc.vehicles.fleet import read_fleet
from tests.support.fleet_players import players
from tests.support.mavlink_teams import NAMES, fleet_file, team_folder, udp_ports
from tests.support.mavlink_vehicles import Vehicles
from tests.support.program import robochoc_within

PORTS = dict(zip(NAMES, range(14540, 14544), strict=True))


def test_they_stand_in_the_fence_and_keep_their_distance(tmp_path: Path) -> None:
    fleet = read_fleet(fleet_file(tmp_path, PORTS))
    stand = [one.at for one in players(fleet).values()]
    assert all(fleet.fence.contains(at) for at in stand)
    assert min(dist(*two) for two in combinations(stand, 2)) > fleet.distance_m


def test_where_a_vehicle_has_its_own_origin_it_stands_as_seen_from_there(tmp_path: Path) -> None:
    fleet = fleet_file(tmp_path, {"RA": 14540})
    before = players(read_fleet(fleet))["RA"].at
    url = "udpin://127.0.0.1:14540"
    fleet.write_text(fleet.read_text().replace(url, f"{{link: '{url}', at: [1, 2, 0]}}"))
    assert players(read_fleet(fleet))["RA"].at == (before[0] - 1, before[1] - 2, before[2])


def test_what_cannot_be_played(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"RA: tcpin://127\.0\.0\.1:14540 cannot be played, only udpin"):
        players(read_fleet(fleet_file(tmp_path, PORTS, scheme="tcpin")))
    with pytest.raises(ValueError, match="RB has no room to stand in the fence"):
        players(read_fleet(fleet_file(tmp_path, PORTS, fence="[[0, 0, 0], [2, 2, 3]]")))


@pytest.mark.slow
def test_they_fly_a_decision(tmp_path: Path) -> None:
    path = fleet_file(tmp_path, dict(zip(NAMES, udp_ports(len(NAMES)), strict=True)))
    with Vehicles([*players(read_fleet(path)).values()]):
        words = "--runtime", "simulator", "--ros", f"mavlink:{path}", "--arm"
        done = robochoc_within("solve", team_folder(tmp_path), *words)
    assert "4 flown, 4 landed" in done.stderr
