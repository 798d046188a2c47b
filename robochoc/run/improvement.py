"""Better decisions after the deadline: the team searches again while there is time, and each one that is better counts.

A search that a deadline has cut short cannot go on, as what was under way is lost. So the robots begin anew, with
another seed: local searches start elsewhere, and complete ones have all the time that is left.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from robochoc.communication.run_result import Progress
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.options import CENTRAL, Options
from robochoc.run.orchestrator import solve
from robochoc.solver.encoding import UnsupportedError
from robochoc.system.stopping import stop_requested

_SEEDS = 2**62
_FOUND = frozenset({Verdict.SOLUTION, Verdict.OPTIMAL})


def refuse_to_improve(team: Team, options: Options) -> None:
    """Raise `UnsupportedError` where a search of `team` cannot be followed by others that improve its answer."""
    if options.deadline is None:
        raise UnsupportedError("--improve goes on after --deadline SECONDS, by which the first decision is made")
    if options.withdraw is not None or options.protocol == CENTRAL or team.dynamic or options.kill:
        raise UnsupportedError(
            "--improve is for robots that stay, in problems that do not change: drop --withdraw, --kill, the scenario,"
            " and --protocol central"
        )


def improvements(
    team: Team,
    options: Options,
    first: Outcome,
    seconds: float,
    progress: Callable[[Progress], None] | None = None,
) -> Iterator[Outcome]:
    """Yield each outcome that is better than all before; the `first` is known.

    Args:
        team: The team as its files have it.
        options: How `first` was found.
        first: The answer by the deadline.
        seconds: How long to search.
        progress: Receives the number of messages of each search, now and then.
    """
    until = time.monotonic() + seconds
    best = first
    for number in itertools.count(1):
        left = until - time.monotonic()
        if left <= 0 or stop_requested() or _is_final(team, best):
            return
        seed = (options.seed + number) % _SEEDS
        found = solve(team, replace(options, seed=seed, deadline=left), progress=progress)
        if is_better(team, found, best):
            best = found
            yield found


def is_better(team: Team, found: Outcome, best: Outcome) -> bool:
    """Return whether `found` is a checked solution that costs less than `best`, or where `best` is none."""
    if found.verdict not in _FOUND or not found.verified or found.withdrawn or found.cost is None:
        return found.verdict is Verdict.NO_SOLUTION and best.verdict is Verdict.UNKNOWN
    if best.verdict not in _FOUND or best.cost is None:
        return True
    maximised = any(robot.costs.maximize for robot in team.robots)
    return found.cost > best.cost if maximised else found.cost < best.cost


def _is_final(team: Team, best: Outcome) -> bool:
    """Return whether nothing can be better."""
    if best.verdict in {Verdict.OPTIMAL, Verdict.NO_SOLUTION}:
        return True
    return team.kind is ProblemKind.DISCSP and best.verdict in _FOUND
