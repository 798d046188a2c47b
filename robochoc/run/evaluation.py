"""What a search has come to: the answer that its result holds, held against every constraint of every file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from robochoc.communication.run_result import RunResult
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.traits import Traits
from robochoc.run.incumbent import absent, best_of, bound_of, joined, tree_of
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.checker import RefutedError, assignment_cost, needlessly_withdrawn, violations


def evaluate(
    epoch: EpochOutcome, team: Team, result: RunResult, traits: Traits, compiled: CompiledTeam
) -> EpochOutcome:
    """`epoch`, with the answer of a search by a protocol that has `traits`; as it is where there is none.

    `team` is what the answer is held against, as the files have it; `compiled` is what the robots have worked on.

    A protocol that minimises has one whenever it is asked; whether that is proven depends on the protocol, and on
    whether it came to its end. A solution of a team without costs needs no proof. Raises `RefutedError`.
    """
    epoch = replace(epoch, tree=tree_of(result.findings))
    ended = result.verdict is Verdict.SOLUTION
    if result.lost or result.verdict is Verdict.NO_SOLUTION or not (ended or traits.costs):
        return epoch
    if ended and (traits.complete or not traits.costs):
        return _with(epoch, team, joined(result.assignments), _best_verdict(team))
    found = best_of(compiled, result)
    epoch = replace(epoch, bound=bound_of(result.findings))
    if found is None:
        return replace(epoch, verdict=Verdict.UNKNOWN)
    return _with(epoch, team, found.assignment, Verdict.SOLUTION if team.kind is ProblemKind.DISCSP else result.verdict)


def evaluate_withdrawal(
    outcome: Outcome, team: Team, result: RunResult, compiled: CompiledTeam, aside: float | None
) -> Outcome:
    """`outcome`, with the robots that step aside as `result` has it: so that nobody could be added, or the fewest.

    `aside` is what it cost that a robot of weight 1 does so; None where nothing was minimised. Robots that were lost
    before are withdrawn as well. Raises `RefutedError`.
    """
    outcome = replace(outcome, verdict=Verdict.UNKNOWN, verified=False, confirmed=False, tree=tree_of(result.findings))
    ended = result.verdict is Verdict.SOLUTION
    assignment: Mapping[str, int] | None = joined(result.assignments) if ended else None
    if aside is not None and not ended:
        least = bound_of(result.findings)
        outcome = replace(outcome, bound=None if least is None else least // aside)
        found = best_of(compiled, result, aside)
        assignment = found.assignment if found else None
    if assignment is None:
        return outcome
    out = absent(team, assignment)
    check(team, assignment, out, maximal=ended)
    if ended:
        proven = aside is not None and (out or team.kind is ProblemKind.DISWCSP)
        outcome = replace(outcome, verdict=Verdict.OPTIMAL if proven else Verdict.SOLUTION)
    paid = assignment_cost(team, assignment)
    return replace(
        outcome, assignment=_in_order(team, assignment), withdrawn=(*outcome.withdrawn, *out), cost=paid, verified=True
    )


def check(team: Team, assignment: Mapping[str, int], withdrawn: Sequence[str] = (), *, maximal: bool = True) -> None:
    """Hold the claim against every constraint of every file: also that nobody could be added (`maximal`).

    Raises `RefutedError`.
    """
    faults = [*violations(team, assignment, withdrawn)]
    if maximal:
        faults += [
            f"{name} has stepped aside and could be added" for name in needlessly_withdrawn(team, assignment, withdrawn)
        ]
    if faults:
        raise RefutedError(f"the checker refutes the answer for {team.name}: {faults[0]} ({len(faults)} objections)")


def _best_verdict(team: Team) -> Verdict:
    """What the answer of a complete protocol is."""
    return Verdict.OPTIMAL if team.kind is ProblemKind.DISWCSP else Verdict.SOLUTION


def _in_order(team: Team, assignment: Mapping[str, int]) -> dict[str, int]:
    """`assignment` in the order of the files, whatever order the robots worked in."""
    return {name: assignment[name] for name in team.variables if name in assignment}


def _with(epoch: EpochOutcome, team: Team, assignment: dict[str, int], verdict: Verdict) -> EpochOutcome:
    check(team, assignment)
    assignment = _in_order(team, assignment)
    return replace(epoch, verdict=verdict, assignment=assignment, cost=assignment_cost(team, assignment), verified=True)
