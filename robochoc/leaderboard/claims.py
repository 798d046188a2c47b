"""Checks that need no repeated run: proofs against the protocol's traits, curves against the answer, and counts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from robochoc.experiments.task import Status
from robochoc.leaderboard.certificates import Certificate
from robochoc.leaderboard.results import RunResult
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.traits import Traits

PROOFS = {Verdict.OPTIMAL, Verdict.NO_SOLUTION}


def claims_proof(run: RunResult) -> bool:
    """Return whether a run claims a proof: an optimum, or that there is no solution."""
    return run.verdict in PROOFS


def wrong_claims(run: RunResult, team: Team, best: Certificate, traits: Traits | None) -> Iterator[str]:
    """Yield the contradictions in a run.

    Args:
        run: The run.
        team: The team at the end of the run.
        best: The published answer.
        traits: The traits of the protocol. None: they are not known.
    """
    if traits is not None:
        yield from _proof_faults(run, traits)
    if not run.is_by_peer:
        yield from _status_faults(run)
    if not run.is_by_peer and run.verdict is not None and None in {run.messages, run.bytes, run.ncccs}:
        yield "has a verdict, but not all of messages, bytes and ncccs"
    if not best.scenario:
        yield from _curve_faults(run, best, is_maximised=any(robot.costs.maximize for robot in team.robots))
    elif run.curve:
        yield "has a curve, although the problem changes"


def _status_faults(run: RunResult) -> Iterator[str]:
    """Yield the contradictions of status, verdict and answer: only a run that is done has a verdict."""
    if (run.status == Status.DONE) != (run.verdict not in {None, Verdict.UNKNOWN}):
        yield f"has the status {run.status}, but the verdict {run.verdict or 'none'}"
    if run.status == Status.REFUSED and (run.cost is not None or run.assignment or run.messages is not None):
        yield "was refused, but has an answer or messages"


def _proof_faults(run: RunResult, traits: Traits) -> Iterator[str]:
    if run.verdict == Verdict.OPTIMAL and not traits.costs:
        yield "claims an optimum, but the protocol does not minimise costs"
    if run.verdict == Verdict.NO_SOLUTION and run.verdict not in traits.concludes:
        yield "claims no-solution, but the protocol cannot prove it"


def _curve_faults(run: RunResult, best: Certificate, *, is_maximised: bool) -> Iterator[str]:
    """Yield the faults of a curve: its costs improve until the cost of the answer, its messages never decrease."""
    if not run.curve:
        return
    sign = -1 if is_maximised else 1
    sent, costs = [messages for messages, _ in run.curve], [sign * cost for _, cost in run.curve]
    if any(later < earlier for earlier, later in pairwise(sent)):
        yield "the messages of the curve decrease"
    if sent[-1] > (run.messages or 0):
        yield f"the curve has {sent[-1]:,} messages, but the run {run.messages or 0:,}"
    if any(later >= earlier for earlier, later in pairwise(costs)):
        yield "a cost of the curve is not better than the one before"
    if best.cost is None:
        yield "has a curve, although the problem has no costs"
    elif best.is_beyond_bound(sign * min(costs), is_maximised=is_maximised):
        yield f"the curve reaches {sign * min(costs)}, but {best.provers} proved {best.bound}"
    if run.cost is not None and costs[-1] != sign * run.cost:
        yield f"the curve ends with {run.curve[-1][1]}, but the answer costs {run.cost}"
