"""Options of runs on the simulator, drawn at random."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, ScheduleName
from tests.support.loose_problems import any_order


def random_options(team: Team, protocol: str, chance: Random) -> Options:
    """Return options for a random schedule, and an order of any kind."""
    return replace(random_schedule(chance), protocol=protocol, order=any_order(team, chance))


def random_schedule(chance: Random) -> Options:
    """Return options for a random schedule: any channel next, or time in checks with delays from none to long ones.

    Without a limit of time: on a busy machine it would end a run that is only long. One without an end is pytest's.
    """
    schedule = chance.choice(list(ScheduleName))
    return Options(
        runtime=Runtime.SIMULATOR,
        schedule=schedule,
        delay=chance.choice((0, 3, 20, 200)) if schedule is ScheduleName.CONCURRENT else 0,
        seed=chance.getrandbits(32),
    )
