"""A team whose robots run on several machines and do not disclose their files. The robots themselves check the answer.

About each robot, the master has only the information that the robot's neighbours have. The outcome names the robots
whose claims no other robot could check (`claimed`).
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, assert_never

from msgspec import UNSET

from robochoc.communication.network.master import Master
from robochoc.communication.network.plausibility import doubts_about_checks, doubts_about_values, thoroughness
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.journal.events import Began, Observer
from robochoc.journal.team_events import start_fields
from robochoc.model.cost_units import Cost, common_units
from robochoc.model.outcome import ALL_ROBOTS, Answer, Approximation, Improvement, Outcome, Verdict
from robochoc.model.problem import Domain, ProblemKind, Robot, Team, Variable
from robochoc.run.distributed import Deployment
from robochoc.run.evaluation import Nearest, PhaseAnswer, Search, is_proven
from robochoc.run.improvement import Audience, Improvements, improvements_of
from robochoc.run.incumbent import merged_values
from robochoc.run.options import Options
from robochoc.run.phases import RunPhase
from robochoc.run.starts import Start
from robochoc.verification.checker import RefutedError


class TeamSnapshot(NamedTuple):
    """Snapshot number `number`: the `values` of all variables, and the `assignments` by robot."""

    number: int
    values: Mapping[str, int]
    assignments: Mapping[str, dict[str, int]]


NO_SNAPSHOT = TeamSnapshot(0, {}, {})
_NAMED = 5
"""The maximum number of robots named in a message."""


class Machines(Deployment):
    """The robots that have registered with `master`. See `Deployment`. The clock of the run starts at the creation.

    Args:
        master: A master whose team is complete.
        options: How to run.
        name: The team's name.
        observer: Receives the events of the run.
        audience: Receives each answer that is published during the search.
    """

    def __init__(
        self, master: Master, options: Options, name: str, observer: Observer | None, audience: Audience | None = None
    ) -> None:
        self.options = options
        self._master = master
        self._name = name
        self._observer = observer
        self._audience = audience
        spent = master.spent_before
        self.messages_before = spent.messages
        self._begin_time(spent.seconds if options.deadline is None else 0.0)  # as after a loss, a deadline is new
        self._lost: dict[str, str] = {}
        self._gone: list[Robot] = []
        self._values: Mapping[str, dict[str, int]] = {}
        self._improvements: Improvements | None = None
        self._snapshot = self._kept = NO_SNAPSHOT

    def _begin_time(self, spent_s: float = 0.0) -> None:
        self._began = self._master.limited_since = time.monotonic() - spent_s
        self._deadline = None if self.options.limit_s is None else self._began + self.options.limit_s

    @property
    def kind(self) -> ProblemKind:
        """See `Deployment.kind`."""
        return registered_team(self._master, self._name).kind

    def in_user_units(self, total: float) -> Cost:
        """See `Deployment.in_user_units`."""
        units = common_units(member.profile.units for member in self._master.members.robots.values())
        return units.in_user_units(-int(total) if units.maximize else int(total))

    @property
    def lost(self) -> tuple[str, ...]:
        """See `Deployment.lost`."""
        return tuple(self._lost)

    @property
    def is_empty(self) -> bool:
        """See `Deployment.is_empty`."""
        return not self._master.members.robots

    @property
    def searched(self) -> Approximation | None:
        """See `Deployment.searched`."""
        profiles = [member.profile for member in self._master.members.robots.values()]
        if any(profile.on_grid for profile in profiles):
            return Approximation.GRIDS
        return Approximation.SAMPLES if any(profile.sampled for profile in profiles) else None

    @property
    def unsettled(self) -> str:
        """See `Deployment.unsettled`."""
        return self._master.state.unfinished

    def withdrawal_cost(self) -> float:
        """See `Deployment.withdrawal_cost`."""
        return 1 + sum(member.profile.max_cost for member in self._master.members.robots.values())

    def left_s(self) -> float | None:
        """See `Deployment.left_s`."""
        return None if self._deadline is None else max(0.0, self._deadline - time.monotonic())

    def started(self, phase: RunPhase) -> RunPhase:
        """See `Deployment.started`. The cost of the start is unknown, since the master has no constraints."""
        return phase.beginning_with(Start(self.options.start)) if self.options.start else phase

    def remove(self, lost: Mapping[str, str]) -> None:
        """See `Deployment.remove`."""
        self._lost |= lost
        members = self._master.members
        self._gone += [members.robots[name].robot for name in lost if name in members.robots]
        members.remove(lost)
        if self.options.deadline is not None:  # the remaining robots get a new deadline
            self._begin_time()
            self._improvements = None

    def search(self, phase: RunPhase) -> Search:
        """See `Deployment.search`. Raises `RefutedError` if robots contradict each other."""
        if self._observer:
            minimises = True if phase.traits.costs else UNSET
            self._observer(
                Began(t=0, protocol=phase.protocol.__name__, minimises=minimises, **start_fields(phase.parameters))
            )
        left_s, checked = self.left_s(), self.options.deadline is not None
        self._master.watch = self._improvements = self._watch(phase) if checked else None
        messages = self.options.messages
        left = None if messages is None else max(0, messages - self.messages_before)
        result = self._master.search(phase.name, phase.traits, phase.parameters, left_s, left, checked=checked)
        if not result.lost:
            self._refuse_contradictions()
        return Search(result, partial(self._check, phase, result), self._nearest)

    # Answers while the robots search

    def _watch(self, phase: RunPhase) -> Improvements:
        """Return the watch that stores the best answer of a search, and publishes answers from the deadline on."""
        team = registered_team(self._master, self._name)
        options, audience = self.options, self._audience
        self._snapshot = self._kept = NO_SNAPSHOT

        def publish(answer: PhaseAnswer, improvements: tuple[Improvement, ...]) -> None:
            self._adopt(answer)
            if audience is not None and options.improve is not None:
                now = replace(answer, improvements=improvements).for_whole_problem(self.searched)
                audience.improve(team, now.as_epoch(team.order), answer.withdrawn)

        def keep(answer: PhaseAnswer) -> None:
            if answer.assignment is self._snapshot.values:
                self._kept = self._snapshot
                self._master.adopt(self._kept.number)

        return improvements_of(
            phase,
            team,
            options,
            began=self._began,
            in_user_units=self.in_user_units,
            check=partial(self._check_snapshot, phase),
            publish=publish,
            audience=audience,
            before=self._improvements,
            keep=keep,
        )

    def _check_snapshot(self, phase: RunPhase, snapshot: SearchResult) -> Answer | None:
        """Return the robots' assignment at a snapshot, checked by all robots; None if a check fails.

        Raises:
            RefutedError: when robots contradict each other.
        """
        found = self._master.snapshots
        if found is None:
            return None
        doubts = [*doubts_about_values(snapshot.assignments), *doubts_about_checks(found.checks)]
        self._refuse(doubt.why for doubt in doubts)
        without = tuple(name for name in self._master.members.order if not snapshot.assignments.get(name))
        if (without and not phase.withdrawal) or not all(check.allowed for check in found.checks.values()):
            return None
        values = merged_values(snapshot.assignments)
        self._snapshot = TeamSnapshot(found.number, values, snapshot.assignments)
        cost = sum(check.cost for check in found.checks.values())
        return Answer(
            Verdict.UNKNOWN,
            assignment=values,
            cost=self.in_user_units(cost),
            withdrawn=without,
            verified=True,
            checked=thoroughness(found.checks),
        )

    def _adopt(self, answer: PhaseAnswer) -> None:
        """Order the robots to keep `answer` as their decision until a further order."""
        withdrawn = f", {len(answer.withdrawn)} withdraw" if answer.withdrawn else ""
        number = self._kept.number if answer.assignment is self._kept.values else 0
        self._master.adopt(number, f"{answer.verdict}{withdrawn}")

    def concluded(self, phase: RunPhase, search: Search, answer: PhaseAnswer) -> PhaseAnswer:  # noqa: ARG002 - see `Deployment`
        """See `Deployment.concluded`. The best checked answer may come from a snapshot."""
        improvements = self._improvements
        if improvements is None:
            return answer
        best = improvements.concluded(answer, lost=bool(search.result.lost))
        if best.assignment is self._kept.values:
            self._values = self._kept.assignments
        return best if self.options.improve is not None else replace(best, improvements=())

    # The end

    def team_seen(self) -> Team:
        """Return the team for the outcome, with lost robots, and with the variables reported at the end."""
        robots = []
        for robot in registered_team(self._master, self._name).robots:
            known = {variable.name for variable in robot.variables}
            others = [(name, value) for name, value in self._values.get(robot.name, {}).items() if name not in known]
            shown = tuple(Variable(name, Domain(name, (range(value, value + 1),))) for name, value in others)
            robots.append(replace(robot, variables=(*robot.variables, *shown)))
        return Team(self._name, (*robots, *self._gone))

    def _check(self, phase: RunPhase, result: SearchResult) -> Answer | None:
        """Return the values that the robots have reported, after every robot has checked its own constraints.

        Raises:
            RefutedError: if a robot refutes a claim of the protocol, or robots contradict each other.
            RobotsLostError: if a robot has values and does not report them.
        """
        state, members = self._master.state, self._master.members
        if not state.assigned.keys() >= set(members.order):
            return None  # a robot has not reported in time that it has values or withdraws
        without = tuple(name for name in members.order if not state.assigned.get(name))
        if self._master.is_private:
            withdrawn = without if phase.withdrawal and result.verdict == Verdict.SOLUTION else ()
            why = "each robot knows only its own values (--private)"
            return Answer(Verdict.UNKNOWN, withdrawn=withdrawn, reason=why)
        self._values = self._reported(result.assignments)
        held, cost = self._master.checked(self._values)
        self._refuse_contradictions()
        if held and (phase.withdrawal or not without):
            values = merged_values(self._values)
            return Answer(
                Verdict.UNKNOWN,
                assignment=values,
                cost=self.in_user_units(cost),
                withdrawn=without,
                verified=True,
                checked=state.thoroughness,
            )
        if is_proven(phase, result):
            against = "; ".join(state.objections) or f"{first_names(without)} has no value"
            source = f"{result.witness} claims that" if result.witness else "no message is left, so that"
            raise RefutedError(f"{source} {phase.name} has a solution for {self._name}, but {against}")
        return None

    def _reported(self, assignments: Mapping[str, dict[str, int]]) -> dict[str, dict[str, int]]:
        """Return the reported values. Raises `RobotsLostError` if a robot has values and does not report them."""
        for name, assigned in self._master.state.assigned.items():
            if assigned and not assignments[name]:
                raise RobotsLostError({name: "it has reported that it has values, but not which"})
        return dict(assignments)

    def _nearest(self) -> Nearest | None:
        """Return the values that the robots have reported at the end, and the constraints that they found violated."""
        violations = self._master.state.violations
        return None if violations is None else Nearest(merged_values(self._values), violations)

    def _refuse_contradictions(self) -> None:
        """Raise `RefutedError` if robots contradict each other. It is unknown which robot lies."""
        self._refuse(doubt.why for doubt in self._master.state.doubts_about_verdict)

    def _refuse(self, doubts: Iterable[str]) -> None:
        """Raise `RefutedError` if there are `doubts`."""
        if why := "; ".join(doubts):
            raise RefutedError(f"the answer for {self._name} is not credible: {why}")


def registered_team(master: Master, name: str) -> Team:
    """Return the team that has registered with `master`, limited to the parts that the master sees."""
    members = master.members
    return Team(name, tuple(members.robots[robot].robot for robot in members.order))


def claimed(outcome: Outcome) -> Outcome:
    """Return `outcome` with the robots whose unchecked claims it relies on (docs/guides/security.md, "One traitor").

    `no-solution` is claimed by one robot. Optimality and unreported values are claimed by all robots.
    """
    by: str | None = None
    match outcome.verdict:
        case Verdict.NO_SOLUTION:
            by = outcome.witness
        case Verdict.OPTIMAL:
            by = ALL_ROBOTS
        case Verdict.UNKNOWN:
            by = None if outcome.bound is None else ALL_ROBOTS
        case Verdict.SOLUTION:
            by = (outcome.witness if outcome.withdrawn_alive else None) if outcome.verified else ALL_ROBOTS
        case never:
            assert_never(never)
    return replace(outcome, claimed_by=by)


def first_names(names: Sequence[str]) -> str:
    """Return the first few `names`, and the number of remaining names."""
    return ", ".join(names[:_NAMED]) + f" and {len(names) - _NAMED} others" * (len(names) > _NAMED)
