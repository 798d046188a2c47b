"""Satisfiability of a team by robochoc's central solver, within a time limit."""

from __future__ import annotations

import time

from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run.options import CENTRAL, Options
from robochoc.run.orchestrator import solve


class OutOfTimeError(Exception):
    """The time limit was reached."""


def is_satisfiable(team: Team, until: float) -> bool:
    """Return whether a team has a solution. Raises `OutOfTimeError` at the time `until` (monotonic clock)."""
    left = until - time.monotonic()
    if left <= 0:
        raise OutOfTimeError
    verdict = solve(team, Options(protocol=CENTRAL, timeout=left, cache=False)).verdict
    if verdict == Verdict.UNKNOWN:
        raise OutOfTimeError
    return verdict != Verdict.NO_SOLUTION
