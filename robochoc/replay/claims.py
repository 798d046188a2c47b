"""Compares the header and the outcome of a journal with the results of its steps.

Even if all steps are equal, the header or the outcome may be from another run. Metrics are counted again from the
replayed steps. The verdict and the values must be those of the protocol objects at the end. An answer published during
the search (`--improve`) may be older: it is checked against the constraints, and must be equally good.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

import msgspec
from msgspec import UNSET

from robochoc.communication.search_result import SearchResult
from robochoc.journal.entries import STAMPED_LATE
from robochoc.journal.events import AnyEvent, Decided, Lost, Received, Sent, Settled
from robochoc.journal.journal import Header, Journal, metrics_of
from robochoc.model.costs import user_cost
from robochoc.model.outcome import BEST_FOR_SAMPLES, Answer, Metrics, Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.satisfaction.disac import DisAC
from robochoc.replay.rebuild import RebuiltRobots
from robochoc.replay.steps import RecordedRun
from robochoc.run.defaults import CENTRAL
from robochoc.run.evaluation import PhaseAnswer, Search, check_with_files, evaluate_search, is_proven
from robochoc.run.improvement import Rank
from robochoc.run.incumbent import merged_values
from robochoc.run.phases import RunPhase
from robochoc.run.registry import protocol_by_class
from robochoc.run.starts import robots_values, start_in
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.verification.checker import RefutedError, assignment_cost, violations

_COUNTS = ("messages", "bytes", "ncccs", "checks", "largest")
_COUNTS_IN_FIRST_VERSION = _COUNTS[:-1]
"""The counts in the first version of the journal format."""
ANY_DEADLINE = 0.0
"""A journal does not contain limits: the robots' values at its end may be an answer at a deadline."""


class Contradiction(msgspec.Struct, frozen=True, kw_only=True):
    """A claim in the journal (`recorded`) that differs from the replay's result (`replayed`)."""

    what: str
    recorded: object
    replayed: object


@dataclass(frozen=True)
class ReplayedRun:
    """A replayed run of `team` with its answer; the answer is None if the journal does not contain enough data.

    `any_time`: the answer may be any assignment that the robots had, because nothing is proven. `in_order`: decisions
    were reported one by one. `improved`: the answer may be any assignment that was found at a snapshot, even if it was
    not published. `limited`: the reports that prove it may have been too late. `start`: the start assignment, which is
    the answer of a search that was stopped before the robots had a better one.
    """

    run: RecordedRun
    team: Team
    answer: PhaseAnswer | None = None
    any_time: bool = False
    in_order: bool = True
    improved: bool = False
    limited: bool = False
    start: Mapping[str, int] | None = None


def with_answer(run: RecordedRun, robots: RebuiltRobots, journal: Journal) -> ReplayedRun:
    """Return a replayed run with its answer."""
    improved = journal.header.improve is not UNSET
    simulated = journal.header.runtime == "simulator"
    in_order = simulated and not journal.header.channel  # with a channel, the steps of robots overlap
    limited = journal.header.limit_s is not UNSET and not simulated
    replayed = ReplayedRun(run, robots.compiled.team, in_order=in_order, improved=improved, limited=limited)
    final = journal.header.answer == "final"
    return replayed if journal.outcome is None else _answered(replayed, robots, journal.outcome, final=final)


def contradicted_claims(journal: Journal, runs: Sequence[ReplayedRun], *, is_complete: bool) -> Iterator[Contradiction]:
    """Yield the claims in the journal that differ from the results of its steps.

    Args:
        journal: The journal.
        runs: The replayed runs in the journal.
        is_complete: True if all robots were replayed to the end. Otherwise the runs' answers are unknown.
    """
    header, outcome = journal.header, journal.outcome
    yield from _header_contradictions(header, [one.run for one in runs], outcome.placed_by if outcome else None)
    if outcome is None:
        return
    same = ["team", "protocol", "seed"]
    if header.protocol != CENTRAL:  # the central solver has no runtime
        same.append("runtime")
    yield from _differing("the outcome's ", outcome, header, same)
    events = list(chain.from_iterable(one.run.events for one in runs))
    lost = bool(outcome.lost) or any(isinstance(event, Lost) for event in events)
    if not is_complete or lost or not runs or any(one.run.given is None for one in runs):
        return  # the last messages of lost robots are missing; reports from other machines are untrusted
    if outcome.verdict != Verdict.UNKNOWN or outcome.runtime == "simulator":
        names = _COUNTS_IN_FIRST_VERSION if header.version == STAMPED_LATE else _COUNTS
        before = outcome.preprocessing.metrics if outcome.preprocessing else Metrics()
        compared = _exceeding if _may_be_incomplete(header, outcome) else _differing
        yield from compared("the outcome's ", before + outcome.metrics, metrics_of(journal.events), names)
    last = _last_runs(runs)
    for number, epoch in enumerate(outcome.epochs):
        if number in last:
            yield from _answer_contradictions(f"epoch {number}'s ", epoch, _with_repair(epoch, runs, last[number]))
    final = _with_repair(outcome, runs, runs[-1])
    yield from _answer_contradictions("the outcome's ", outcome, _on_grids(outcome, runs, final))


def _with_repair(recorded: Answer, runs: Sequence[ReplayedRun], last: ReplayedRun) -> ReplayedRun:
    """Return `last` with the answer after a repair: the bound of the search before the repair may prove it."""
    at = next(number for number, one in enumerate(runs) if one is last)
    before = runs[at - 1].answer if at and recorded.repair else None
    if before is None or last.answer is None or recorded.repair is None:
        return last
    return replace(last, answer=before.repaired(last.answer, recorded.repair))


def _may_be_incomplete(header: Header, outcome: Outcome) -> bool:
    """Return whether the counts may lack the steps of robots that were still computing at the end of the search.

    This is possible if a time limit or an event has ended the search. An outcome does not contain a deadline if its
    answer is proven, for example because it costs as little as the lower bound.
    """
    ended = outcome.epochs or outcome.improvements or outcome.deadline or header.limit_s is not UNSET
    return outcome.runtime != "simulator" and bool(ended)


def _exceeding(whose: str, recorded: Metrics, replayed: Metrics, names: Sequence[str]) -> Iterator[Contradiction]:
    """Yield the recorded counts that exceed the counts in the replayed steps."""
    for name in names:
        left, right = getattr(recorded, name), getattr(replayed, name)
        every = left if isinstance(left, dict) else {name: left}
        steps = right if isinstance(right, dict) else {name: right}
        if any(number > steps.get(kind, 0) for kind, number in every.items()):
            yield Contradiction(what=whose + name, recorded=left, replayed=right)


def _last_runs(runs: Sequence[ReplayedRun]) -> dict[int, ReplayedRun]:
    """Return the last run in each epoch, by its number. Preprocessing belongs to the epoch of the following search."""
    found: dict[int, ReplayedRun] = {}
    number = -1
    for one in runs:
        began = one.run.began
        if began is None or began.protocol == DisAC.__name__:
            number += 1
        else:
            number = began.epoch if isinstance(began.epoch, int) else 0
        found[number] = one
    return found


def _header_contradictions(
    header: Header, runs: Sequence[RecordedRun], placed_by: str | None
) -> Iterator[Contradiction]:
    """Yield contradictions between the header and the robots' parameters.

    If `placed_by` is given, the search was omitted because a robot had no solution by itself, and the first run is by
    one of these protocols. Preprocessing before the search is not a run of the protocol. If protocols search in turn,
    the header's protocol is one of them, and restarts have other seeds.
    """
    began = [run.began for run in runs if run.began and run.began.protocol != DisAC.__name__]
    in_turn = any(one.continues is True for one in began)
    # The class may also be one that is not registered under a name.
    names = [protocol_by_class(one.protocol, [header.protocol]) for one in (began if in_turn else began[:1])]
    found = [one[0] for one in names if one is not None]
    if len(found) == len(names) and found and not {header.protocol, placed_by} & {*found}:
        yield Contradiction(what="the header's protocol", recorded=header.protocol, replayed=found[0])
    for run in runs:
        given = run.given if run.began is None or run.began.continues is not True else None
        if given and given.seed != header.seed:
            yield Contradiction(what="the header's seed", recorded=header.seed, replayed=given.seed)
            return
    order = runs[0].given.order if runs and runs[0].given else None
    if order is not None and isinstance(header.order, tuple) and header.order != order:
        yield Contradiction(what="the header's order", recorded=header.order, replayed=order)


def _on_grids(outcome: Outcome, runs: Sequence[ReplayedRun], last: ReplayedRun) -> ReplayedRun:
    """Return the run on the grid of real variables that found the answer, with the verdict of the outcome.

    A grid neither proves nor disproves the verdict, which holds for all real numbers. Other problems have no grids:
    their `last` run is returned.
    """
    if not outcome.real_places or outcome.epochs:
        return last
    found = [one for one in (last, *reversed(runs)) if one.answer and one.answer.assignment == outcome.assignment]
    best = found[0] if found else last
    return replace(best, answer=best.answer and replace(best.answer, verdict=outcome.verdict))


def _answer_contradictions(whose: str, recorded: Answer, last: ReplayedRun) -> Iterator[Contradiction]:
    replayed = last.answer
    if replayed is None or recorded.verdict == Verdict.UNKNOWN:  # a journal does not contain limits
        return
    recorded = _with_combined_cost(recorded, last.team)
    began = last.run.began
    earlier = bool(recorded.improvements) or (began is not None and began.continues is True)
    has_answer = bool(recorded.assignment or recorded.withdrawn)
    is_start = last.limited and recorded.assignment == last.start
    decided = has_answer and (is_start or last.improved or (last.any_time and _was_decided(recorded, last)))
    if recorded.verdict != Verdict.NO_SOLUTION and (earlier or decided):
        yield from _published_contradictions(whose, recorded, replayed, last.team)
        return
    proves_less = last.limited or recorded.reason == BEST_FOR_SAMPLES
    is_proven_later = (recorded.verdict, replayed.verdict) == (Verdict.SOLUTION, Verdict.OPTIMAL)
    names = ("assignment", "cost") if proves_less and is_proven_later else ("verdict", "assignment", "cost")
    yield from _differing(whose, recorded, replayed, names)
    left, right = sorted(recorded.withdrawn), sorted(replayed.withdrawn)
    if left != right:
        yield Contradiction(what=whose + "withdrawn", recorded=left, replayed=right)


def _with_combined_cost(recorded: Answer, team: Team) -> Answer:
    """Return the answer with its cost in the robots' team, if its cost is that in one of several objectives.

    The journal has the robots' constraints, whose costs combine the objectives (`solver/objectives.py`).
    """
    if recorded.cost not in recorded.objectives.values():
        return recorded
    without = recorded.withdrawn
    cost = user_cost(team, assignment_cost(team, recorded.assignment), without=without)
    return replace(recorded, cost=cost)


def _published_contradictions(whose: str, recorded: Answer, replayed: Answer, team: Team) -> Iterator[Contradiction]:
    """Yield the contradictions in an answer that was published during the search, or is better than the final one."""
    withdrawn = recorded.withdrawn
    faults = [*violations(team, recorded.assignment, withdrawn)]
    if faults:
        yield Contradiction(what=whose + "assignment", recorded=recorded.assignment, replayed=faults[0])
        return
    cost = user_cost(team, assignment_cost(team, recorded.assignment), without=withdrawn)
    if recorded.cost != cost:
        yield Contradiction(what=whose + "cost", recorded=recorded.cost, replayed=cost)
    rank = Rank(team, partial(user_cost, team))
    of_recorded = rank.of(cost, withdrawn)
    found = replayed.verdict in {Verdict.SOLUTION, Verdict.OPTIMAL}
    of_replayed = rank.of(replayed.cost or 0, replayed.withdrawn)
    if found and of_replayed < of_recorded:
        yield Contradiction(what=whose + "cost", recorded=recorded.cost, replayed=replayed.cost)
    proven = replayed.verdict == Verdict.OPTIMAL and of_replayed == of_recorded
    if recorded.verdict == Verdict.OPTIMAL and not (proven or (replayed.bound == cost and not withdrawn)):
        yield Contradiction(what=whose + "verdict", recorded=recorded.verdict, replayed=replayed.verdict)


def _differing(whose: str, recorded: object, replayed: object, names: Sequence[str]) -> Iterator[Contradiction]:
    for name in names:
        left, right = getattr(recorded, name), getattr(replayed, name)
        if left != right:
            yield Contradiction(what=whose + name, recorded=left, replayed=right)


def _was_decided(recorded: Answer, replayed: ReplayedRun) -> bool:
    """Return whether the robots had the recorded assignment together at some time of the run.

    Robots in processes report their decisions in bundles, and simulated robots with a channel report them before their
    time. A journal does not contain this order. So any combination of their values may have been reported together
    (`DecidedValues`).
    """
    values = recorded.assignment
    own = {
        robot.name: {one.name: values[one.name] for one in robot.variables if one.name in values}
        for robot in replayed.team.robots
    }
    others = {name for name, given in own.items() if given}  # at first, no robot has values
    for event in replayed.run.events:
        if not isinstance(event, Decided):
            continue
        if event.assignment == own.get(event.robot):
            others.discard(event.robot)
        elif replayed.in_order:
            others.add(event.robot)
        if not others:
            return True
    return False


def _answered(replayed: ReplayedRun, robots: RebuiltRobots, outcome: Outcome, *, final: bool) -> ReplayedRun:
    """Return `replayed` with its answer, computed as by an orchestrator, if the journal suffices.

    `final`: without a proof, the last values are the answer.
    """
    run = replayed.run
    given = run.given
    if given is None or given.why or len(robots.hosts) < len(robots.compiled.team.robots):
        return replayed
    protocols = {name: host.protocol for name, host in robots.hosts.items()}
    result = SearchResult.of(
        _verdict(run.events, {str(one.verdict) for one in protocols.values() if one.verdict is not None}),
        None,
        {name: one.assignment for name, one in protocols.items()},
        [],
        0.0,
    )
    result.findings.update({name: one.findings for name, one in protocols.items()})
    team = robots.compiled.team
    withdrawal = given.aside is not None or _places(run, outcome)
    phase = RunPhase("", robots.protocol, RunParameters(withdrawal_cost=given.aside), withdrawal)
    if run.began is not None and run.began.start is not UNSET:
        phase = phase.beginning_with(start_in(team, run.began.start, given.aside))
    check = partial(check_with_files, phase, result, team, robots.compiled, final=final)
    try:
        answer = evaluate_search(phase, Search(result, check), team.kind, partial(user_cost, team), ANY_DEADLINE)
    except (RefutedError, TooManySolutionsError):
        answer = PhaseAnswer(Verdict.UNKNOWN)
    start = robots_values(team, phase.parameters.start) if phase.start_cost is not None else None
    return replace(
        replayed,
        answer=answer,
        any_time=not (final or is_proven(phase, result)),
        start=None if start is None else merged_values(start),
    )


def _places(run: RecordedRun, outcome: Outcome) -> bool:
    """Return whether `run` is the phase in which robots withdraw."""
    found = protocol_by_class(run.began.protocol, filter(None, [outcome.placed_by])) if run.began else None
    return found is not None and found[0] == outcome.placed_by


def _verdict(events: Sequence[AnyEvent], concluded: set[str]) -> Verdict:
    """Return the verdict that a robot has concluded; else `solution`, if robots began and received all messages."""
    if len(concluded) == 1:
        return Verdict(concluded.pop())
    under_way = sum(isinstance(event, Sent) - isinstance(event, Received) for event in events)
    began = any(isinstance(event, Settled) for event in events)
    return Verdict.UNKNOWN if under_way or concluded or not began else Verdict.SOLUTION
