"""Teams whose robots know few others, and who of them share constraints."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.communication.network.profile import Profile, profile_of
from robochoc.model.problem import Team
from tests.support.problems import random_constraint, team_of


def sparse_team(seed: int, size: int = 9) -> Team:
    """Binary constraints between three in ten pairs, three values each."""
    chance = Random(seed)
    domains = {f"X{number:02}": [0, 1, 2] for number in range(size)}
    pairs = [pair for pair in itertools.combinations(domains, 2) if chance.random() < 0.3]
    return team_of(domains, [random_constraint(chance, domains, pair) for pair in pairs])


def profiles_of(team: Team) -> dict[str, Profile]:
    """What all robots of `team` tell the master."""
    return {robot.name: profile_of(robot) for robot in team.robots}
