"""A distributed run in one or two phases. Handles lost robots, and explains a missing verdict.

A `Deployment` is a team of robots that search on command. It has two subclasses: the one in `run/this_machine.py` has
access to the robots' files; with the one in `run/networked/machines.py`, robots do not disclose their files.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace

from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.model.cost_units import Cost
from robochoc.model.outcome import Approximation, Metrics, Outcome, SearchStage, Verdict, Violations
from robochoc.model.problem import ProblemKind
from robochoc.protocols.protocol import Protocol
from robochoc.run.evaluation import PhaseAnswer, Search, evaluate_search, why_spoiled
from robochoc.run.options import AnswerRule, Options
from robochoc.run.phases import MOST_REPAIRED, RunPhase, first_phase, repair_phase, second_phase
from robochoc.run.registry import protocol_named
from robochoc.run.starts import Start
from robochoc.solver.compile import TeamCompileTimeoutError
from robochoc.solver.errors import UnsupportedError
from robochoc.system.stopping import stop_requested

COUNTED_LIMIT = "the limit of"
"""The first words of the reason for a run that ended at a limit of messages, checks or cycles."""
GAVE_UP = "gave up, as its protocol has it"
STOPPED = "somebody has asked to stop"
NOTHING_SPENT = Metrics()
FOUND_NOTHING = "ended, and found no assignment that satisfies all hard constraints"


class Deployment(ABC):
    """A team of robots that searches on command, on this machine or on several.

    `options` are the options of the run, `searches` the number of searches in the last stage. `messages_before` is the
    number of messages under earlier masters, which count for the limit.
    """

    options: Options
    searches: int = 1
    messages_before: int = 0

    @property
    def compile_s(self) -> float:
        """Return the seconds spent on this machine on the compilation of the robots' domains."""
        return 0.0

    @property
    @abstractmethod
    def kind(self) -> ProblemKind:
        """Return the kind of the team's problem: with or without costs."""

    @abstractmethod
    def in_user_units(self, total: float) -> Cost:
        """Convert `total`, a sum of the robots' internal costs, to the user's units."""

    @property
    @abstractmethod
    def lost(self) -> tuple[str, ...]:
        """The robots that were lost and have not returned."""

    @property
    @abstractmethod
    def is_empty(self) -> bool:
        """Return whether no robot is left."""

    @property
    @abstractmethod
    def searched(self) -> Approximation | None:
        """Return the part of the problem that is searched. None: the whole problem."""

    @abstractmethod
    def withdrawal_cost(self) -> float:
        """Return the withdrawal cost of a robot of weight 1. It exceeds the sum of the costs of all constraints."""

    @abstractmethod
    def left_s(self) -> float | None:
        """Return the remaining seconds; None without a limit."""

    def search_s(self, phase: RunPhase) -> float | None:
        """Return the remaining seconds for the search of `phase`; None without a limit."""
        left = self.left_s()
        return None if left is None else max(0.0, left - phase.reserved_s)

    def begun_from(self, phase: RunPhase, answer: PhaseAnswer) -> RunPhase:  # noqa: ARG002 - an implementation needs it
        """Return `phase`, which begins with the assignment in `answer`."""
        return phase

    @abstractmethod
    def search(self, phase: RunPhase) -> Search:
        """Run one search with all present robots, from its beginning."""

    @abstractmethod
    def remove(self, lost: Mapping[str, str]) -> None:
        """Remove lost robots from the team; `lost` maps their names to the reasons."""

    def started(self, phase: RunPhase) -> RunPhase:
        """Return `phase`, which begins with the start assignment in the options, if there is one."""
        return phase

    def without_lost(self, phase: RunPhase) -> RunPhase:
        """Return `phase` after robots were lost: the cost of its start assignment does not hold for the others."""
        return phase.beginning_with(Start(phase.parameters.start))

    def confirm(self, phase: RunPhase, answer: PhaseAnswer) -> tuple[str, ...]:  # noqa: ARG002 - an implementation needs them
        """Return the central solvers that confirm `answer`. Raises `RefutedError` if a solver refutes it."""
        return ()

    @property
    def unsettled(self) -> str:
        """Return why the robots did not finish before a limit was reached; empty if the reason is unknown."""
        return ""

    def solve(self, phase: RunPhase) -> PhaseAnswer:
        """Repeat the search until no robot is lost during it. Check the result, and return it as the answer of `phase`.

        Raises:
            RobotsLostError: if all robots were lost.
            RefutedError: if the check refutes the answer.
        """
        spent = Metrics()
        while True:
            phase, search = self._search_without_losses(phase, spent)
            answer = self.evaluated(phase, search)
            if not self.needs_repair(phase, answer):
                break
            repair = repair_phase(self.options, answer.nearest)
            again = self.search(repair)
            if not again.result.lost:
                answer = answer.repaired(self.evaluated(repair, again), repair.name)
                break
            spent = answer.metrics + again.result.metrics
            phase = self._without(again.result.lost, phase)
        return replace(answer, reason=answer.reason or self.why_unknown(phase, answer))

    def evaluated(self, phase: RunPhase, search: Search) -> PhaseAnswer:
        """Return the answer of `search`. If the options require it, the central solver confirms the answer."""
        deadline = self.options.deadline if self.search_s(phase) == 0 else None
        answer = self.concluded(phase, search, evaluate_search(phase, search, self.kind, self.in_user_units, deadline))
        if self._found_nothing(phase, search, answer):
            nearest = search.nearest()
            if nearest is not None and nearest.violations.number:
                answer = replace(answer, violations=nearest.violations, nearest=nearest.assignment)
        if answer.verdict in {Verdict.NO_SOLUTION, Verdict.OPTIMAL}:
            return answer.confirmed_as(self.confirm(phase, answer))
        return answer

    def _found_nothing(self, phase: RunPhase, search: Search, answer: PhaseAnswer) -> bool:
        """Return whether the robots had values, but no known assignment satisfies all hard constraints."""
        if answer.verdict != Verdict.UNKNOWN or answer.assignment or search.result.lost or phase.withdrawal:
            return False
        return answer.ended or phase.traits.costs or self.options.deadline is not None

    def needs_repair(self, phase: RunPhase, answer: PhaseAnswer) -> bool:
        """Return whether `answer`, from the protocol of `phase`, is to be repaired: see `run/phases.py`.

        There is no repair in runs with limits on messages, checks or cycles, of final assignments (if the options ask
        for these), of large teams, of runs in stages, and of protocols with secret keys: it would disclose secrets.
        """
        options = self.options
        wanted = options.repair and options.answer == AnswerRule.BEST and not options.stages
        limited = (options.messages, options.ncccs, options.cycles) != (None, None, None)
        over = self.left_s() == 0 or stop_requested()
        found = answer.ended and 0 < len(answer.nearest) <= MOST_REPAIRED and not phase.traits.complete
        found = found and not phase.traits.secret_keys
        return wanted and found and not (limited or over) and self.can_repair(phase)

    def can_repair(self, phase: RunPhase) -> bool:
        """Return whether repairs support the constraints of the team, which the protocol of `phase` supports."""
        return not phase.traits.partially_known

    def concluded(self, phase: RunPhase, search: Search, answer: PhaseAnswer) -> PhaseAnswer:  # noqa: ARG002 - as `confirm`
        """Return `answer`, the answer of `search`, or a better one found during the search."""
        return answer

    def why_unknown(self, phase: RunPhase, answer: PhaseAnswer) -> str | None:
        """Return the reason why `answer` has no verdict, or None if it has a verdict."""
        if answer.verdict != Verdict.UNKNOWN:
            return None
        if answer.witness is not None:
            return f"{answer.witness} {GAVE_UP}"
        if answer.metrics.lost_messages and not phase.traits.bears_loss:
            return why_spoiled(phase, answer.metrics)
        far = answer.violations is not None and not stop_requested()
        nearest = f"the best assignment violates {answer.violations}" if far else ""
        if answer.ended:
            names = f"{phase.name}, then {answer.repair}," if answer.repair else phase.name
            return "; ".join(filter(None, [f"{names} {FOUND_NOTHING}", nearest]))
        return "; ".join(filter(None, [self._limit_reached(answer.metrics), nearest, self.unsettled]))

    def _limit_reached(self, spent: Metrics) -> str:
        """Return the limit that ended a search, in words."""
        options = self.options
        if stop_requested():
            return STOPPED
        if self.left_s() != 0:
            messages = self.messages_before + sum(spent.messages.values())
            if options.messages is not None and messages >= options.messages:
                return f"{COUNTED_LIMIT} messages was reached (--messages {options.messages})"
            if options.ncccs is not None and spent.ncccs >= options.ncccs:
                return f"{COUNTED_LIMIT} non-concurrent constraint checks was reached (--ncccs {options.ncccs})"
            if options.cycles is not None and spent.cycles >= options.cycles:
                return f"{COUNTED_LIMIT} cycles was reached (--cycles {options.cycles})"
        if options.deadline is not None:
            improve = "" if options.improve is None else f", --improve {options.improve:g}"
            by = f"by the deadline (--deadline {options.deadline:g}{improve})"
            return f"{by} the robots knew no assignment that satisfies all hard constraints"
        return "the time was over" if options.timeout is None else f"the time was over (--timeout {options.timeout:g})"

    def outcome(self, header: Outcome, answer: PhaseAnswer) -> Outcome:
        """Return `header`, which describes the run, completed by `answer`."""
        metrics = replace(answer.metrics, compile_s=self.compile_s)
        answer = replace(answer, metrics=metrics, count=self._count(answer))
        return answer.for_whole_problem(self.searched).as_outcome(header, self.lost)

    def _count(self, answer: PhaseAnswer) -> int | None:
        """Return the number of solutions or optima if the options require it and the number is known."""
        if not self.options.count:
            return None
        return 0 if answer.verdict == Verdict.NO_SOLUTION else answer.count

    def _search_without_losses(self, phase: RunPhase, spent: Metrics = NOTHING_SPENT) -> tuple[RunPhase, Search]:
        """Search until no robot is lost during a search. The metrics include all these searches, and those `spent`.

        Returns the last search, and `phase` as it was in this search.
        """
        while True:
            search = self.search(phase)
            result: SearchResult = search.result
            spent += result.metrics
            if not result.lost:
                return phase, search._replace(result=replace(result, metrics=spent))
            phase = self._without(result.lost, phase)

    def _without(self, lost: Mapping[str, str], phase: RunPhase) -> RunPhase:
        """Remove lost robots from the team, and return `phase` for the others.

        Raises:
            RobotsLostError: if no robot is left.
        """
        self.remove(lost)
        if self.is_empty:
            raise RobotsLostError(lost)
        return self.without_lost(phase)


def solve_distributed(deployment: Deployment, protocol: type[Protocol], header: Outcome) -> Outcome:
    """Let robots solve their problem together, and return the outcome of the run.

    Args:
        deployment: The robots, with the options.
        protocol: The chosen protocol.
        header: An outcome that describes the run, without an answer.

    Raises:
        RobotsLostError: if robots were lost, and the options do not let the run continue without them.
        RefutedError: if a check refutes the answer.
    """
    options = deployment.options
    phase = deployment.started(first_phase(options, protocol, deployment.withdrawal_cost))
    if options.stages:
        answer, stages = _solve_in_stages(deployment, options)
        header = replace(header, stages=stages)
    else:
        answer = deployment.solve(phase)
    if answer.verdict == Verdict.NO_SOLUTION and options.withdraw is not None and not phase.withdrawal:
        phase = deployment.started(second_phase(options, deployment.withdrawal_cost))
        answer = answer.then(deployment.solve(phase))
        header = replace(header, placed_by=phase.name)
    return deployment.outcome(header, answer)


def _solve_in_stages(deployment: Deployment, options: Options) -> tuple[PhaseAnswer, tuple[SearchStage, ...]]:
    """Let several protocols search in turn, each from the best assignment so far. Return the answer and the stages.

    A stage that is too large for its protocol is left out, unless it is the last one and there is no answer.
    """
    answer: PhaseAnswer | None = None
    done: list[SearchStage] = []
    for number, stage in enumerate(options.stages, start=1):
        case = replace(options, protocol=stage.protocol, settings=stage.settings)
        phase = first_phase(case, protocol_named(stage.protocol), deployment.withdrawal_cost)
        phase = replace(phase, reserved_s=_reserved_s(options, stage.until), kept=stage.kept)
        phase = deployment.started(phase) if answer is None else deployment.begun_from(phase, answer)
        if answer is not None and not answer.assignment and deployment.left_s() != 0:
            phase = replace(phase, reserved_s=0.0)  # the stages before have found nothing in their time
        if answer is not None and deployment.search_s(phase) == 0:
            continue
        began = time.monotonic()
        try:
            found = deployment.solve(phase)
        except (UnsupportedError, TeamCompileTimeoutError):
            if answer is None and number == len(options.stages):
                raise
            continue
        answer = found if answer is None else _improved(deployment, answer, found)
        done.append(SearchStage(stage.protocol, time.monotonic() - began, deployment.searches, answer.cost))
        if answer.verdict in {Verdict.OPTIMAL, Verdict.NO_SOLUTION} or stop_requested():
            break
    assert answer is not None  # noqa: S101 - for mypy: the last stage returns an answer or raises an error
    return answer, tuple(done)


def _reserved_s(options: Options, until: float) -> float:
    """Return the seconds left for later stages after this fraction of the time until the deadline."""
    return 0.0 if until >= 1 else (1 - until) * (options.deadline or 0.0) + (options.improve or 0.0)


def _improved(deployment: Deployment, before: PhaseAnswer, found: PhaseAnswer) -> PhaseAnswer:
    """Return the answer of all stages so far. `found` is that of the last one, which began from the answer `before`."""
    answer = before.then(found)
    if found.verdict == Verdict.NO_SOLUTION:
        return answer
    answer = replace(answer, reason=found.reason)
    if before.violations and not found.assignment and not _is_nearer(found, before.violations):
        answer = replace(answer, violations=before.violations, reason=before.reason)
    if before.assignment and not found.assignment:
        answer = replace(answer, verdict=before.verdict, violations=None, **before.assignment_parts())
    if found.verdict == Verdict.OPTIMAL:
        return answer
    signed = -1 if deployment.in_user_units(1) < deployment.in_user_units(0) else 1
    bounds = [one.bound for one in (before, found) if one.bound is not None]
    bound = max(bounds, key=lambda one: signed * one, default=None)
    if bound is not None and answer.cost == bound and not answer.withdrawn and answer.verified:
        return replace(answer, verdict=Verdict.OPTIMAL, bound=None, deadline=None)
    return replace(answer, bound=bound)


def _is_nearer(found: PhaseAnswer, before: Violations) -> bool:
    """Return whether the best assignment of `found` violates fewer hard constraints than one `before`."""
    return found.violations is not None and found.violations.number < before.number
