"""A team whose robots run on several machines, and keep their files: the robots themselves check the answer.

The master sees of each robot what its neighbours may see. What only the robots could check is said to rest on their
word (`claimed`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import assert_never

from msgspec import UNSET

from robochoc.communication.network.master import Master
from robochoc.communication.run_result import RobotsLostError, RunResult
from robochoc.journal.events import Began, Observer
from robochoc.model.cost_units import Cost, common_units
from robochoc.model.outcome import ALL_ROBOTS, Outcome, Verdict
from robochoc.model.problem import Domain, ProblemKind, Team, Variable
from robochoc.run.distributed import Deployment
from robochoc.run.evaluation import CheckedAssignment, Search, is_proven
from robochoc.run.incumbent import merged_values
from robochoc.run.options import Options
from robochoc.run.withdrawal import Phase
from robochoc.verification.checker import RefutedError

_NAMED = 5
"""No more robots than these are named in a message."""


class Machines(Deployment):
    """The robots that have registered with `master`. See `Deployment`. Its time starts when it is made.

    Args:
        master: a master whose team is complete.
        options: how to run.
        name: the team's name.
        observer: gets the events of the run.
    """

    def __init__(self, master: Master, options: Options, name: str, observer: Observer | None) -> None:
        self.options = options
        self._master = master
        self._name = name
        self._observer = observer
        self._deadline = None if options.limit_s is None else time.monotonic() + options.limit_s
        self._lost: dict[str, str] = {}
        self._values: dict[str, dict[str, int]] = {}

    @property
    def kind(self) -> ProblemKind:
        """See `Deployment.kind`."""
        return registered_team(self._master, self._name).kind

    def told(self, total: float) -> Cost:
        """See `Deployment.told`."""
        units = common_units(member.profile.units for member in self._master.members.robots.values())
        return units.told(-int(total) if units.maximize else int(total))

    @property
    def lost(self) -> tuple[str, ...]:
        """See `Deployment.lost`."""
        return tuple(self._lost)

    @property
    def is_empty(self) -> bool:
        """See `Deployment.is_empty`."""
        return not self._master.members.robots

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

    def remove(self, lost: Mapping[str, str]) -> None:
        """See `Deployment.remove`."""
        self._lost |= lost
        self._master.members.remove(lost)

    def search(self, phase: Phase) -> Search:
        """See `Deployment.search`. Raises `RefutedError` when robots contradict each other."""
        if self._observer:
            self._observer(Began(t=0, protocol=phase.name, minimises=True if phase.traits.costs else UNSET))
        result = self._master.search(phase.name, phase.traits, phase.parameters, self.left_s(), self.options.messages)
        if not result.lost:
            self._refuse_contradictions()
        return Search(result, partial(self._check, phase, result))

    def team_seen(self) -> Team:
        """Return the team as the outcome shows it: with variables that only their robots knew before."""
        robots = []
        for robot in registered_team(self._master, self._name).robots:
            known = {variable.name for variable in robot.variables}
            others = [(name, value) for name, value in self._values.get(robot.name, {}).items() if name not in known]
            shown = tuple(Variable(name, Domain(name, (range(value, value + 1),))) for name, value in others)
            robots.append(replace(robot, variables=(*robot.variables, *shown)))
        return Team(self._name, tuple(robots))

    def _check(self, phase: Phase, result: RunResult) -> CheckedAssignment | None:
        """Return the values that robots have reported, once every robot has checked its own constraints.

        Raises:
            RefutedError: when a robot objects to what the protocol claims, or robots contradict each other.
            RobotsLostError: when a robot has values and does not report them.
        """
        state, members = self._master.state, self._master.members
        without = tuple(name for name in members.order if not state.assigned.get(name))
        if self._master.is_private:
            withdrawn = without if phase.withdrawal and result.verdict is Verdict.SOLUTION else ()
            why = "every robot knows its own values, and nobody else's (--private)"
            return CheckedAssignment({}, None, withdrawn, verified=False, reason=why)
        self._values = self._reported(result.assignments)
        held, cost = self._master.checked(self._values)
        self._refuse_contradictions()
        if held and (phase.withdrawal or not without):
            values = merged_values(self._values)
            return CheckedAssignment(values, self.told(cost), without, check_counts=state.thoroughness)
        if is_proven(phase, result):
            against = "; ".join(state.objections) or f"{first_names(without)} has no value"
            source = f"{result.witness} says that" if result.witness else "all fell quiet, so that"
            raise RefutedError(f"{source} {phase.name} has a solution for {self._name}, but {against}")
        return None

    def _reported(self, assignments: Mapping[str, dict[str, int]]) -> dict[str, dict[str, int]]:
        """Return the reported values. Raises `RobotsLostError` for a robot that has values and does not report them."""
        for name, assigned in self._master.state.assigned.items():
            if assigned and not assignments[name]:
                raise RobotsLostError({name: "it has reported that it has values, but not which"})
        return dict(assignments)

    def _refuse_contradictions(self) -> None:
        """Raise `RefutedError` if robots contradict each other. It is unknown which of them lies."""
        doubts = "; ".join(doubt.why for doubt in self._master.state.doubts_about_verdict)
        if doubts:
            raise RefutedError(f"{self._name} has no answer that can be believed: {doubts}")


def registered_team(master: Master, name: str) -> Team:
    """Return the team that has registered with `master`, as far as the master sees it."""
    members = master.members
    return Team(name, tuple(members.robots[robot].robot for robot in members.order))


def claimed(outcome: Outcome) -> Outcome:
    """Return `outcome` with the robots on whose word it rests (docs/guides/security.md, "One traitor").

    One robot says that there is no solution. That none costs less, or what was not reported, rests on all of them.
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
    """Return a few of `names`, and how many others there are."""
    return ", ".join(names[:_NAMED]) + f" and {len(names) - _NAMED} others" * (len(names) > _NAMED)
