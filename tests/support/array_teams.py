"""Random teams and settings for the protocols that run as arrays."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from robochoc.model.problem import Team
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, random_hard_team

PROTOCOLS = ("dsa", "mgm", "mgm2", "maxsum")
MAKERS: tuple[Callable[[Random], Team], ...] = (
    random_cost_team,
    random_hard_team,
    random_complex_cost_team,
    random_complex_team,
)
COUNTS = ("messages", "bytes", "largest", "checks", "ncccs")


def random_settings(protocol: str, chance: Random) -> dict[str, str]:
    settings = {"cycles": chance.choice(("1", "2", "5", "12"))}
    if protocol == "dsa":
        settings |= {"variant": chance.choice("ABCDE"), "probability": chance.choice(("0.3", "0.7", "1.0"))}
    if protocol == "mgm2":
        settings |= {"threshold": chance.choice(("0.0", "0.3", "0.5", "0.9", "1.0"))}
    if protocol == "maxsum":
        settings |= {"damping": chance.choice(("0.0", "0.5", "0.9")), "preference": chance.choice(("0.0", "0.01", "5"))}
    return settings
