"""The properties that every run must have, whatever happens during it. The truth comes from trying all assignments."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from robochoc.model.change import team_after_events
from robochoc.model.outcome import Answer, Outcome, Verdict
from robochoc.model.problem import INFINITE, ProblemKind, Robot, Team
from robochoc.model.team_edits import constraints_in_force, without_robots
from robochoc.protocols.traits import Traits
from robochoc.run import Options, Runtime, Withdrawal
from robochoc.run.registry import protocol_named
from robochoc.verification.checker import assignment_cost, needlessly_withdrawn, violations
from tests.simulation.plan import FaultKind, Plan
from tests.support.cost_problems import minimum_withdrawal
from tests.support.loose_problems import minimum_cost


class Finding(NamedTuple):
    """A property that does not hold: its name, which is the same after a minimisation, and the details."""

    kind: str
    detail: str


def violated(plan: Plan, outcome: Outcome) -> Iterator[Finding]:
    """Yield the properties that `outcome` does not have."""
    if plan.options.runtime == Runtime.NETWORK:
        plan = replace(plan, team=_without_files(plan.team, outcome.lost))
    for fault in plan.faults:
        if fault.kind is FaultKind.LIE:
            yield from _in_spite_of(fault.robot, plan.team, outcome)
            return
    traits = protocol_named(outcome.protocol).traits
    limited = is_limited(plan.options) or plan.options.loss > 0
    events = 0
    for number, epoch in enumerate(outcome.epochs):
        now = _with_robots(team_after_events(plan.team, events), epoch.robots)
        if set(now.order) != set(epoch.robots):
            yield Finding("epoch", f"epoch {number} has the robots {epoch.robots}, expected {now.order}")
        interrupted = limited or bool(epoch.lost) or events < len(plan.team.scenario)
        for found in _Judge(now, plan, traits, limited=interrupted).faults(epoch):
            yield Finding(found.kind, f"epoch {number}: {found.detail}")
        events += not epoch.lost
    if plan.private and outcome.assignment:
        yield Finding("private", "the master knows values, although robots do not disclose them")
    last = team_after_events(plan.team, max(0, events - 1))
    present = outcome.epochs[-1].robots if outcome.epochs else last.order
    now = _with_robots(last, [name for name in present if name not in outcome.lost])
    yield from _Judge(now, plan, traits, limited=limited).faults(outcome)


def _in_spite_of(traitor: str, team: Team, outcome: Outcome) -> Iterator[Finding]:
    """Yield false claims that a traitor must not be able to cause: docs/guides/security.md, "One traitor"."""
    now = without_robots(team, outcome.lost)
    wrong = outcome.verdict == Verdict.NO_SOLUTION and minimum_cost(now) < INFINITE
    if (wrong or outcome.verdict == Verdict.OPTIMAL) and outcome.claimed_by is None:
        yield Finding("claimed", f"{outcome.verdict} with a traitor, and nobody is named")
    if not outcome.verified or outcome.verdict not in {Verdict.SOLUTION, Verdict.OPTIMAL}:
        return
    for constraint in constraints_in_force(now, [name for name in outcome.withdrawn if name in now]):
        owners = {now.owner[name] for name in constraint.variables}
        if traitor not in owners and not constraint.allows(outcome.assignment):
            yield Finding("checked", f"{constraint.name} over {constraint.variables} counts as checked, but is broken")


def _without_files(team: Team, lost: Collection[str]) -> Team:
    """Return `team` without the constraints in the files of `lost` robots: across machines, no other robot has them."""
    return replace(team, robots=tuple(_without_constraints(one) if one.name in lost else one for one in team.robots))


def _without_constraints(robot: Robot) -> Robot:
    parents = tuple(replace(parent, constraints=()) for parent in robot.parents)
    return replace(robot, private=(), parents=parents)


def _with_robots(team: Team, names: Collection[str]) -> Team:
    """Return `team` without the robots that are not in `names`."""
    return without_robots(team, [name for name in team.order if name not in names])


def is_limited(options: Options) -> bool:
    """Return whether a limit may end the run before it has a verdict."""
    limits = (options.messages, options.ncccs, options.cycles, options.timeout, options.deadline)
    return any(limit is not None for limit in limits)


class _Judge:
    """Compares an answer with the truth about `team`."""

    def __init__(self, team: Team, plan: Plan, traits: Traits, *, limited: bool) -> None:
        self._team = team
        self._options = plan.options
        self._is_private = plan.private
        self._traits = traits
        self._limited = limited
        self._truth = minimum_cost(team) if team.robots else 0.0
        self._has_costs = team.kind is ProblemKind.DISWCSP

    def faults(self, answer: Answer) -> Iterator[Finding]:
        """Yield the properties that `answer` does not have."""
        yield from self._of_verdict(answer)
        if answer.cost is not None or answer.assignment:
            yield from self._of_assignment(answer)
        elif (
            answer.verdict in {Verdict.SOLUTION, Verdict.OPTIMAL}
            and self._team.robots
            and not self._may_be_empty(answer)
        ):
            yield Finding("verdict", f"{answer.verdict} without an assignment")
        yield from self._of_bound(answer)
        yield from self._of_improvements(answer)

    def _may_be_empty(self, answer: Answer) -> bool:
        return bool(answer.withdrawn) or self._is_private

    def _of_verdict(self, answer: Answer) -> Iterator[Finding]:
        solvable = self._truth < INFINITE
        own = [name for name in answer.withdrawn if name in self._team]
        match answer.verdict:
            case Verdict.NO_SOLUTION if solvable:
                yield Finding("verdict", f"no-solution, but there is one with the cost {self._truth}")
            case Verdict.SOLUTION | Verdict.OPTIMAL if not solvable and not own:
                yield Finding("verdict", f"{answer.verdict}, but there is no solution")
            case Verdict.UNKNOWN if not answer.reason and isinstance(answer, Outcome):
                yield Finding("reason", "unknown without a reason")
            case Verdict.UNKNOWN if self._traits.complete and not self._limited:
                yield Finding("incomplete", f"unknown, although the protocol is complete: {answer.reason}")
            case _:
                pass
        costs = self._has_costs and not self._is_private
        if answer.verdict == Verdict.OPTIMAL and not own and costs and answer.cost != self._truth:
            yield Finding("optimum", f"optimal with the cost {answer.cost}, but the minimum is {self._truth}")
        if answer.confirmed and answer.verdict == Verdict.UNKNOWN:
            yield Finding("confirmed", "a confirmed unknown")

    def _of_assignment(self, answer: Answer) -> Iterator[Finding]:
        own = [name for name in answer.withdrawn if name in self._team]
        if not answer.verified:
            yield Finding("verified", "an assignment that was not checked")
        for broken in violations(self._team, answer.assignment, own):
            yield Finding("checked", f"an assignment counts as checked, but {broken}")
            return
        cost = assignment_cost(self._team, answer.assignment)
        if answer.cost != cost:
            yield Finding("cost", f"the cost is {cost}, and not {answer.cost}")
        if not own or self._options.withdraw is None:
            return
        if self._truth < INFINITE and not self._limited and self._traits.complete:
            yield Finding("withdrawal", f"{own} have withdrawn, but the team has a solution")
        if self._options.withdraw == Withdrawal.MINIMUM and answer.verdict == Verdict.OPTIMAL:
            weight, least = sum(self._team[name].weight for name in own), minimum_withdrawal(self._team)
            if weight != least:
                yield Finding("withdrawal", f"robots of weight {weight} have withdrawn, and {least} was enough")
        if self._options.withdraw == Withdrawal.MAXIMAL and not self._limited:
            for name in needlessly_withdrawn(self._team, answer.assignment, own):
                yield Finding("withdrawal", f"{name} has withdrawn without a need")

    def _of_bound(self, answer: Answer) -> Iterator[Finding]:
        if answer.bound is None:
            return
        if self._options.withdraw is None:
            if answer.bound > self._truth:
                yield Finding("bound", f"the lower bound is {answer.bound}, but the minimum cost {self._truth}")
        elif self._truth == INFINITE and answer.bound > minimum_withdrawal(self._team):
            yield Finding("bound", f"the bound of the withdrawn weight is {answer.bound}, which is too high")

    def _of_improvements(self, answer: Answer) -> Iterator[Finding]:
        ranks = [self._rank(one.cost, one.withdrawn) for one in answer.improvements]
        for before, after in pairwise(ranks):
            if not after < before:
                yield Finding("anytime", f"an answer of rank {before} was followed by one of rank {after}")
        times = [one.at_s for one in answer.improvements]
        if times != sorted(times):
            yield Finding("anytime", f"answers were published at {times}")
        if ranks and answer.cost is not None and self._rank(answer.cost, answer.withdrawn) > ranks[-1]:
            yield Finding("anytime", f"the answer is worse than the published one, {ranks[-1]}")

    def _rank(self, cost: object, withdrawn: tuple[str, ...]) -> tuple[float, float]:
        weight = sum(self._team[name].weight for name in withdrawn if name in self._team)
        return weight, float(str(cost or 0))
