"""Compares what peers state about their answers with the checks of the answers, and with the published answers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.leaderboard.certificates import Certificate, published
from robochoc.leaderboard.results import RunResult
from robochoc.model.outcome import Verdict


def wrong_claims_of_peers(runs: Sequence[RunResult]) -> Iterator[str]:
    """Yield a sentence for each run of a peer whose statement about its answer is wrong."""
    for run in runs:
        if wrong := wrong_claim(run, published()[run.instance]):
            yield f"{run.protocol} on {run.instance} {wrong}"


def wrong_claim(run: RunResult, best: Certificate) -> str:
    """Return the error in what a peer states about its answer; empty if there is none."""
    if run.claimed_verdict == Verdict.NO_SOLUTION:
        return "" if best.verdict == Verdict.NO_SOLUTION else f"claims no-solution, but {best.proved_by} found one"
    if run.claimed_verdict is None:
        return ""
    cost = "" if run.claimed_cost is None else f" of cost {run.claimed_cost:g}"
    if run.verdict not in {Verdict.SOLUTION, Verdict.OPTIMAL} and run.cost is None:
        return f"claims a valid assignment{cost}, but it has none or violates hard constraints"
    if run.cost is not None and run.claimed_cost not in {None, run.cost}:
        return f"claims the cost {run.claimed_cost:g}, but its assignment costs {run.cost}"
    if run.claimed_verdict == Verdict.OPTIMAL and run.cost is not None and not best.is_reached_by(run.cost):
        return f"claims the optimum {run.cost}, but {best.known}"
    return ""
