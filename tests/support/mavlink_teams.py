"""A team of four drones, and the fleet files by which played vehicles fly them."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from random import Random

from robochoc.formats import write_team
from robochoc.model.expression import Constant, Name
from robochoc.model.problem import Team, Topic
from tests.support.ports import LOOPBACK, share_of_this_worker
from tests.support.small_teams import graph_team

NAMES = ("RA", "RB", "RC", "RD")
FENCE = "[[-1, -1, 0], [8, 8, 6]]"
_CHANCE = Random()
_FIRST, _LAST = 10_000, 32_000


def four_drones() -> Team:
    """Return four drones 2 m apart, each at a height of 1 to 3 m, none as high as the next one."""
    team = graph_team(["AB", "BC", "CD"], dict.fromkeys("ABCD", 3))
    robots = [
        replace(
            robot,
            topics=(
                Topic(f"/{robot.name}/waypoint", x=Constant(2 * n), y=Constant(0), z=Name(robot.variables[0].name)),
            ),
        )
        for n, robot in enumerate(team.robots)
    ]
    return replace(team, name="four drones", robots=tuple(robots))


def team_folder(folder: Path) -> Path:
    """Write the four drones to a new folder, and return it."""
    write_team(four_drones(), folder / "team")
    return folder / "team"


def udp_ports(count: int) -> list[int]:
    """Return ports of this machine that nobody receives at."""
    while True:
        ports = _CHANCE.sample(share_of_this_worker(range(_FIRST, _LAST)), count)
        with ExitStack() as stack:
            try:
                for port in ports:
                    stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)).bind((LOOPBACK, port))
            except OSError:
                continue
            return ports


def fleet_file(folder: Path, ports: Mapping[str, int], *, scheme: object = "udpin", **settings: object) -> Path:
    """Write a fleet file for vehicles that send to these ports, or hear there, by the drones' names."""
    entries = {"fence": FENCE, "patience": 5, "near": 0.1, "takeoff": 1.4, **settings}
    links = "".join(f"  {name}: {scheme}://{LOOPBACK}:{port}\n" for name, port in ports.items())
    path = folder / "fleet.yaml"
    path.write_text(f"vehicles:\n{links}" + "".join(f"{name}: {value}\n" for name, value in entries.items()))
    return path
