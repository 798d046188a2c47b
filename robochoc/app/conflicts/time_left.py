"""Whether a team has a solution, by our own central solver, until the time is over."""

from __future__ import annotations

import time

from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run.options import CENTRAL, Options
from robochoc.run.orchestrator import solve


class OutOfTimeError(Exception):
    """The time was over."""


def can_hold(team: Team, until: float) -> bool:
    """Return whether all constraints of a team can hold together. Raises `OutOfTimeError` at `until` (monotonic)."""
    left = until - time.monotonic()
    if left <= 0:
        raise OutOfTimeError
    verdict = solve(team, Options(protocol=CENTRAL, timeout=left, cache=False)).verdict
    if verdict == Verdict.UNKNOWN:
        raise OutOfTimeError
    return verdict != Verdict.NO_SOLUTION
