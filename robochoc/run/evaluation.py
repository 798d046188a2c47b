"""The evaluation of a search: the verdict, and the checked assignment.

`evaluate_search` works for any deployment, because the check of the assignment is an argument. On this machine
`check_with_files` reads the robots' files. Across machines the robots check (`run/networked/machines.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from typing import NamedTuple

from robochoc.communication.search_result import SearchResult
from robochoc.model.cost_units import Cost
from robochoc.model.costs import user_cost
from robochoc.model.outcome import (
    BEST_FOR_SAMPLES,
    Answer,
    Approximation,
    EpochOutcome,
    FrontPoint,
    Metrics,
    Optima,
    Outcome,
    Verdict,
    Violations,
)
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.team_edits import dropped_constraints
from robochoc.run.incumbent import best_known, least_violating, lower_bound, merged_values, optima, pseudo_tree
from robochoc.run.known_costs import DecidedValues
from robochoc.run.listed_optima import combined_front, combined_optima
from robochoc.run.phases import RunPhase
from robochoc.run.starts import robots_values
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.system.garbage import collection_paused
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted
from robochoc.verification.checker import (
    RefutedError,
    assignment_cost,
    needlessly_withdrawn,
    robots_without_values,
    violated_constraints,
    violations,
)

Check = Callable[[], Answer | None]
"""A function that checks the assignment of a search. Returns it with an undecided verdict, or None if it is invalid."""


class Nearest(NamedTuple):
    """The best assignment of all robots, by variable, if all violate hard constraints, and its `violations`."""

    assignment: dict[str, int]
    violations: Violations


def _nothing_known() -> None:
    """Return None: no assignment of all robots is known."""


class Search(NamedTuple):
    """A finished search: its result, and the check of its assignment.

    If no known assignment satisfies all hard constraints, `nearest` returns the best one. None: the robots never had
    values together, or it is unknown.
    """

    result: SearchResult
    check: Check
    nearest: Callable[[], Nearest | None] = _nothing_known


NOT_ON_GRIDS = "no point of the grids is a solution, and other points could not be excluded"
"""The reason why the verdict is `UNKNOWN` although the grids of real variables have no solution."""


@dataclass(frozen=True, kw_only=True)
class PhaseAnswer(Answer):
    """The answer of a phase of a run. `withdrawn` contains the robots that withdrew, without lost robots.

    `ended`: true if the protocol terminated by itself, before any limit was reached. `nearest` is the assignment to
    which `violations` refer.
    """

    epochs: tuple[EpochOutcome, ...] = ()
    ended: bool = False
    nearest: dict[str, int] = field(default_factory=dict)

    def confirmed_as(self, solvers: tuple[str, ...]) -> PhaseAnswer:
        """Return this answer, confirmed by the central `solvers`. Only they can verify `no-solution`."""
        sure = bool(solvers)
        verified = sure if self.verdict == Verdict.NO_SOLUTION else self.verified
        return replace(self, verified=verified, confirmed=sure, confirmed_by=solvers)

    def then(self, second: PhaseAnswer) -> PhaseAnswer:
        """Return the answer of two phases: the answer of the `second` phase, with the metrics of both phases."""
        return replace(
            second,
            metrics=self.metrics + second.metrics,
            witness=second.witness or self.witness,
            reason=second.reason or self.reason,
            epochs=self.epochs,
            preprocessing=self.preprocessing,
        )

    def repaired(self, second: PhaseAnswer, name: str) -> PhaseAnswer:
        """Return the answer after a repair by the protocol called `name`, whose answer is `second`."""
        violations = [one.violations for one in (second, self) if one.violations is not None]
        least = min(violations, key=lambda one: one.number) if second.violations else None
        found = replace(self.then(second), repair=name, violations=least, bound=self.bound)
        if found.bound is not None and found.cost == found.bound:
            return replace(found, verdict=Verdict.OPTIMAL, bound=None)
        return found

    def for_whole_problem(self, searched: Approximation | None) -> PhaseAnswer:
        """Return this answer without proofs that hold only for the part of the problem that was `searched`."""
        if searched is None:
            return self
        bare = replace(self, bound=None, confirmed=False, confirmed_by=())
        match self.verdict:
            case Verdict.OPTIMAL:
                found = [one._replace(verdict=Verdict.SOLUTION) for one in self.improvements]
                bare = replace(bare, verdict=Verdict.SOLUTION, improvements=tuple(found))
                return bare if searched == Approximation.GRIDS else replace(bare, reason=BEST_FOR_SAMPLES, count=None)
            case Verdict.NO_SOLUTION if searched == Approximation.SAMPLES:
                return self  # hard constraints are not sampled
            case Verdict.NO_SOLUTION:
                return replace(bare, verdict=Verdict.UNKNOWN, witness=None, verified=False, reason=NOT_ON_GRIDS)
            case _:
                return bare

    def as_epoch(self, robots: tuple[str, ...], opened_by: str = "the start", lost: Sequence[str] = ()) -> EpochOutcome:
        """Return the epoch that ended with this answer. Preprocessing is reported once, for the whole run."""
        parts = self.parts() | {"preprocessing": None}
        return EpochOutcome(**parts, robots=robots, opened_by=opened_by, lost=tuple(lost))

    def as_outcome(self, header: Outcome, lost: tuple[str, ...]) -> Outcome:
        """Return `header`, which describes the run, with this answer. The robots `lost` count as withdrawn too."""
        parts = self.parts() | {"withdrawn": (*lost, *self.withdrawn)}
        return replace(header, **parts, lost=lost, epochs=self.epochs)


def evaluate_search(
    phase: RunPhase, search: Search, kind: ProblemKind, told: Callable[[float], Cost], deadline: float | None = None
) -> PhaseAnswer:
    """Return the answer of a `search` in `phase`, for a problem of this `kind`. `told` converts a cost to user units.

    A protocol that minimises costs always has an assignment. The cost is proven to be minimal if the protocol can prove
    this and has terminated. A solution of a problem without costs needs no proof. If the `deadline` (in seconds) has
    ended the search, the best known assignment is a solution, provided that it violates no hard constraint.

    Raises:
        RefutedError: when the check refutes a claim of the protocol.
    """
    if is_spoiled(phase, search.result):
        return _evaluate_spoiled(phase, search, kind)
    result = search.result
    if keeps_start(phase, result):
        result = replace(result, verdict=Verdict.SOLUTION, witness=None)
    elif result.verdict == Verdict.NO_SOLUTION and phase.start_cost is not None:
        raise RefutedError("the protocol claims that there is no solution, but the start assignment is a solution")
    ended = result.verdict == Verdict.SOLUTION
    cut = deadline is not None and result.verdict == Verdict.UNKNOWN and result.witness is None
    tree = pseudo_tree(result.findings)
    answer = PhaseAnswer(result.verdict, metrics=result.metrics, witness=result.witness, tree=tree, ended=ended)
    if ended and not result.lost:
        answer = replace(answer, count=optima(result.findings))
    if result.lost or result.verdict == Verdict.NO_SOLUTION or not (ended or phase.traits.costs or cut):
        return answer
    bound = None if is_proven(phase, result) else _bound_of(phase, result, told)
    found = search.check()
    if found is None:
        return replace(answer, verdict=Verdict.UNKNOWN, bound=bound)
    verdict = _verdict_of(phase, result, kind, found)
    if cut and found.verified and (found.assignment or not found.withdrawn):  # of nobody it is none
        verdict, answer = Verdict.SOLUTION, replace(answer, deadline=deadline)
    if _meets_bound(result, found, told) and verdict == Verdict.SOLUTION and kind == ProblemKind.DISWCSP:
        verdict, bound = Verdict.OPTIMAL, None
        answer = replace(answer, deadline=None)
    return replace(
        answer,
        verdict=verdict,
        bound=bound,
        reason=found.reason,
        optima=found.optima,
        front=found.front,
        **found.assignment_parts(),
    )


def keeps_start(phase: RunPhase, result: SearchResult) -> bool:
    """Return whether the protocol claims that no assignment costs less than the start assignment."""
    return result.verdict == Verdict.NO_SOLUTION and phase.parameters.upper_bound is not None


def is_spoiled(phase: RunPhase, result: SearchResult) -> bool:
    """Return whether messages were lost that the protocol does not tolerate. If so, none of its claims is valid."""
    return result.metrics.lost_messages > 0 and not phase.traits.bears_loss


def why_spoiled(phase: RunPhase, metrics: Metrics) -> str:
    """Return the reason why the claims of the protocol are invalid after a spoiled search."""
    many = metrics.lost_messages
    return f"{many:,} message{'s were' if many != 1 else ' was'} lost, and {phase.name} needs every one"


def _evaluate_spoiled(phase: RunPhase, search: Search, kind: ProblemKind) -> PhaseAnswer:
    """Return the answer of a spoiled search: a solution if the assignment passes the check, else `unknown`.

    For a problem with costs, the answer also has a reason, because the assignment is the one that the robots had when
    they were interrupted, not the final result of the protocol. An auction, for example, may not have sold anything.
    """
    answer = PhaseAnswer(Verdict.UNKNOWN, metrics=search.result.metrics)
    found = search.check()
    if found is None:
        return answer
    sure = found.verified and not found.withdrawn
    had = "this is the best that the robots had, and may be what they began with"
    unfinished = f"{why_spoiled(phase, search.result.metrics)}: {had}" if kind == ProblemKind.DISWCSP else None
    return replace(
        answer,
        verdict=Verdict.SOLUTION if sure else Verdict.UNKNOWN,
        reason=unfinished if sure else found.reason,
        **found.assignment_parts(),
    )


def is_proven(phase: RunPhase, result: SearchResult) -> bool:
    """Return whether the protocol claims a proven result: a solution, or a solution of minimum cost.

    If messages were lost, an incomplete protocol terminates without knowing whether its assignment is a solution.
    """
    if is_spoiled(phase, result) or (result.metrics.lost_messages and not phase.traits.complete):
        return False
    return result.verdict == Verdict.SOLUTION and (phase.traits.complete or not phase.traits.costs)


@collection_paused()
def check_with_files(
    phase: RunPhase,
    result: SearchResult,
    team: Team,
    compiled: CompiledTeam,
    decided: DecidedValues | None = None,
    *,
    final: bool = False,
) -> Answer | None:
    """Return the assignment found by a search, checked against every constraint in every file.

    Args:
        phase: the phase of the search.
        result: the result of the search.
        team: the team in the form of its files.
        compiled: the same team in the form used by the robots: in the order of the run, with compiled domains.
        decided: the robots' decisions that observers have seen. None: there are no observers.
        final: true if, without a proof, the robots' last values are the answer.

    Returns:
        The assignment claimed by the protocol, or the best known one; None if all known assignments violate hard
        constraints.

    Raises:
        RefutedError: if the assignment violates a constraint, or a robot withdrew unnecessarily.
    """
    start = robots_values(team, phase.parameters.start) if phase.start_cost is not None else None
    if start is not None and keeps_start(phase, result):
        result = replace(result, verdict=Verdict.SOLUTION, assignments=start)
    proven = is_proven(phase, result)
    if proven:
        assignment = merged_values(result.assignments)
        if start is not None and not final and phase.traits.costs and phase.traits.complete:
            assignment = _start_or_cheaper(phase, result, compiled, start)
    else:
        seen = decided.cheapest() if decided is not None and not final else None
        best = best_known(compiled, result, phase.parameters.withdrawal_cost, start, seen, final=final)
        if best is None:
            return None
        assignment = best.assignment
    withdrawn = robots_without_values(team, assignment) if phase.withdrawal else ()
    check_assignment(team, assignment, withdrawn, maximal=proven)
    in_order = {name: assignment[name] for name in team.variables if name in assignment}
    paid = user_cost(team, assignment_cost(team, assignment), without=withdrawn)
    listed = _checked_optima(phase, result, team, compiled, paid)
    front = _checked_front(phase, result, team, compiled)
    dropped = dropped_constraints(team, withdrawn)
    return Answer(
        Verdict.UNKNOWN,
        assignment=in_order,
        cost=paid,
        withdrawn=withdrawn,
        verified=True,
        optima=listed,
        front=front,
        dropped_constraints=dropped,
    )


def _start_or_cheaper(
    phase: RunPhase, result: SearchResult, compiled: CompiledTeam, start: Mapping[str, Mapping[str, int]]
) -> dict[str, int]:
    """Return the start assignment, or the assignment that the robots claim to be optimal if it costs less.

    If the robots list optima, the answer is the first of the list.

    Raises:
        RefutedError: when the start assignment costs less.
    """
    best = best_known(compiled, result, phase.parameters.withdrawal_cost, final=True)
    if best is None or phase.start_cost is None or best.cost < phase.start_cost:
        return merged_values(result.assignments)
    if best.cost > phase.start_cost:
        raise RefutedError(f"{phase.name} claims an optimal assignment, but the start assignment costs less")
    lists = any(found.listing is not None for found in result.findings.values())
    return merged_values(result.assignments if lists else start)


@collection_paused()
def nearest_by_files(result: SearchResult, team: Team, compiled: CompiledTeam) -> Nearest | None:
    """Return the assignment of a search that violates the fewest constraints in the files; see `Search.nearest`."""
    nearest = least_violating(compiled, result)
    return None if nearest is None else Nearest(nearest, violated_constraints(team, nearest))


def _checked_optima(
    phase: RunPhase, result: SearchResult, team: Team, compiled: CompiledTeam, cost: Cost | None
) -> Optima | None:
    """Return the optima that the robots listed, each checked like the assignment; None if the robots listed no optima.

    Raises:
        RefutedError: when a listed optimum violates a constraint, or has a cost other than `cost`.
    """
    found = combined_optima(compiled, result) if is_proven(phase, result) else None
    if found is None:
        return None
    number, listed = found
    for assignment in listed:
        withdrawn = robots_without_values(team, assignment) if phase.withdrawal else ()
        check_assignment(team, assignment, withdrawn)
        if user_cost(team, assignment_cost(team, assignment), without=withdrawn) != cost:
            raise RefutedError(f"the optima that were listed for {team.name} do not cost the same")
    return Optima(number, tuple([{name: one[name] for name in team.variables if name in one} for one in listed]))


def _checked_front(phase: RunPhase, result: SearchResult, team: Team, compiled: CompiledTeam) -> tuple[FrontPoint, ...]:
    """Return the points of the Pareto front that the robots listed, each checked; empty if none was requested.

    The costs in each objective are added by the run, which has the files.

    Raises:
        RefutedError: when a point violates a constraint, or its costs are not those that the robots claim.
    """
    bases = phase.parameters.settings.get("bases", "")
    if not (bases and phase.traits.fronts and is_proven(phase, result)):
        return ()
    found = combined_front(compiled, result, tuple(map(int, bases.split(","))))
    for packed, assignment in found or ():
        check_assignment(team, assignment)
        if assignment_cost(team, assignment) != packed:
            raise RefutedError(f"a point of the front of {team.name} does not have the costs that the robots claim")
    return tuple([FrontPoint({}, {name: one[name] for name in team.variables}) for _, one in found or ()])


def check_assignment(
    team: Team, assignment: Mapping[str, int], withdrawn: Sequence[str] = (), *, maximal: bool = True
) -> None:
    """Check an assignment against every constraint in every file.

    Args:
        team: the team in the form of its files.
        assignment: the values of all robots that have not withdrawn.
        withdrawn: the robots that have withdrawn.
        maximal: true if the protocol claims that no withdrawn robot could be added.

    Raises:
        RefutedError: when the assignment violates a constraint, or the claim is wrong.
    """
    faults = [*violations(team, assignment, withdrawn)]
    if maximal:
        faults += [
            f"{name} has withdrawn and could be added" for name in needlessly_withdrawn(team, assignment, withdrawn)
        ]
    if faults:
        many = counted(len(faults), "objection")
        raise RefutedError(f"the checker refutes the answer for {team.name}: {faults[0]} ({many})")


def _verdict_of(phase: RunPhase, result: SearchResult, kind: ProblemKind, found: Answer) -> Verdict:
    """Return the verdict on the checked answer `found`."""
    if is_proven(phase, result):
        minimum = phase.traits.costs and phase.traits.complete and (found.withdrawn or kind == ProblemKind.DISWCSP)
        return Verdict.OPTIMAL if minimum else Verdict.SOLUTION
    if not found.verified:
        return Verdict.UNKNOWN
    if kind == ProblemKind.DISCSP and not phase.withdrawal:
        return Verdict.SOLUTION
    return result.verdict


def _meets_bound(result: SearchResult, found: Answer, told: Callable[[float], Cost]) -> bool:
    """Return whether `found` includes all robots and its cost equals the lower bound that the robots have proven."""
    least = lower_bound(result.findings)
    return least is not None and not found.withdrawn and found.verified and found.cost == told(least)


def _bound_of(phase: RunPhase, result: SearchResult, told: Callable[[float], Cost]) -> Cost | None:
    """Return the bound of the cost; if robots may withdraw, the lower bound of the weight of the withdrawn robots."""
    bound = lower_bound(result.findings)
    withdrawal_cost = phase.parameters.withdrawal_cost
    if bound is None:
        return None
    return told(bound) if withdrawal_cost is None else int(bound // withdrawal_cost)
