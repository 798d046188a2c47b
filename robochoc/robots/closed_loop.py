"""The closed loop: decisions are sent to robots, and the robots' situation changes the problem (paper, Section 4.2).

After each epoch, the loop publishes the decision and waits for reports from the robots. The first report that changes
the problem, together with further reports within `TOGETHER_S`, opens the next epoch, in which the team solves again.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from robochoc.flight.crafts import crafts_of
from robochoc.flight.layout import Point
from robochoc.flight.mission import (
    UNIT_M,
    VAST_M,
    Drone,
    Goal,
    GoalStop,
    Leg,
    Mission,
    MissionBuilder,
    all_robots,
    check_scale,
    mission_of,
)
from robochoc.flight.reports import DoneReport, Report
from robochoc.maps.ground_map import GroundMap
from robochoc.model.change import apply_possible_changes
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import Assignment, Change, Robot, ScenarioEvent, Team
from robochoc.robots.mission_publisher import MissionPublisher
from robochoc.robots.situation import BATTERY, Situation

_ANSWERED = (Verdict.SOLUTION, Verdict.OPTIMAL)
_WITHDRAWN = "withdr"
"""The part of the master's text that indicates withdrawn robots."""


TOGETHER_S = 0.5
"""The time after a report that changes the problem in which reports belong to the same event, in seconds."""


_SAME_M = 1e-3
"""Places within this distance are the same, in metres."""
_FLOWN = frozenset({Verdict.SOLUTION, Verdict.OPTIMAL})


class ReportedChanges(NamedTuple):
    """Changes that were reported during a search. Reports until `until_s` belong to the same event."""

    changes: list[Change]
    until_s: float


class Feedback(ABC):
    """A source of reports on the robots' situation: a simulated flight, or a source of messages."""

    publishers: Sequence[MissionPublisher] = ()
    """Publishers of the reports."""
    idle: Callable[[], None] = staticmethod(lambda: None)
    """Called regularly while no report arrives."""
    simulated: bool = False
    """True if this object simulates the robots, and so also publishes their reports."""

    @property
    def notes(self) -> list[str]:
        """Sentences about messages that could not be used."""
        return []

    def check(self) -> None:  # noqa: B027 - simulations need no sink
        """Raise `SourceError` if the source lacks a sink. It is called when all sinks are open."""

    @abstractmethod
    def now_ns(self) -> int:
        """Return the present time of the clock used for reports, in nanoseconds."""

    @abstractmethod
    def on_decision(self, builder: MissionBuilder, leg: Leg, left_s: float | None) -> None:
        """Handle a published decision. Reports are accepted for `left_s` seconds from now."""

    @abstractmethod
    def next(self, until_s: float | None) -> Report | None:
        """Return the next report that arrives before `until_s`; None if there is none."""

    def poll(self) -> Report | None:
        """Return a received report without waiting; None in a simulation, where time stops while the team decides."""
        return None


class ClosedLoop:
    """The environment of a run, which publishes each decision, and opens an epoch when robots report a change.

    Reports received over ROS are only recorded, not published over ROS again.

    Args:
        team: The team as defined in its files.
        publishers: Publishers of decisions and reports. The caller opens and closes their sinks.
        feedback: The source of reports and of the time; None: nothing changes the problem.
        scale: The length of a unit of the problem, in metres; None: chosen by `mission.py`.
        battery: The charge below which a drone is out of order.
        ground: A map of the ground, if there is one.

    Raises:
        ValueError: The map has walls, and `scale` differs from its scale.
        SinkError: Raised by methods: publishing failed.
        SourceError: Raised by methods: the source failed.
    """

    events: list[ScenarioEvent]
    """The events caused by the robots' situation."""
    publishers: Sequence[MissionPublisher]
    """Publishers of decisions and reports."""

    def __init__(
        self,
        team: Team,
        publishers: Sequence[MissionPublisher] = (),
        feedback: Feedback | None = None,
        *,
        scale: float | None = None,
        battery: float = BATTERY,
        ground: GroundMap | None = None,
    ) -> None:
        check_scale(scale, ground)
        self._team = team
        self._ground = ground
        self._robots = all_robots(team)
        self.feedback = feedback
        self._exact = feedback is None or not feedback.simulated
        self._scale = scale
        self._battery = battery
        self._builder: MissionBuilder | None = None
        self._situation: Situation | None = None
        self._legs: list[Leg] = []
        self._goals: dict[int, Goal] = {}
        self._assignment: Assignment = {}
        """The last published assignment."""
        self._done: list[Change] = []
        """Changes by which tasks remain done. They open no epoch, but belong to the next event."""
        self._improved: Leg | None = None
        """The last improved decision published in the current epoch."""
        self._news: ReportedChanges | None = None
        self._past_events = 0
        self._lost = True
        self.events = []
        self.publishers = publishers
        if feedback:
            feedback.check()
            feedback.publishers = [one for one in publishers if feedback.simulated or not one.live]

    def __call__(self, team: Team, epoch: EpochOutcome, left_s: float | None) -> ScenarioEvent | None:
        """Publish the decision of `epoch` for `team`; return the event that follows within `left_s` seconds."""
        self._past_events += not self._lost
        self._lost = bool(epoch.lost)
        builder = self._builder = self._builder or self._new_builder(epoch.assignment)
        leg, self._improved = self._improved, None
        if leg is None or epoch.verdict not in _FLOWN:
            leg = self._leg(builder, epoch)
            self._legs.append(leg)
            self._decide(leg)
        elif self.feedback is not None:
            self._legs.append(leg)
        if self.feedback is None:
            return None
        self.feedback.on_decision(builder, leg, left_s)
        if epoch.lost or left_s == 0:
            return None
        event = self._event_of_reports(self.feedback, self._after_known_events(team, self._past_events), builder)
        if event:
            self.events.append(event)
        return event

    def publish(self, outcome: Outcome) -> None:
        """Publish the decisions of a run that was made without this loop."""
        mission = mission_of(outcome, self._team, self._scale, self._ground, exact=self._exact)
        decisions = [epoch.assignment for epoch in outcome.epochs] or [outcome.assignment]
        for leg, values in zip(mission.legs, decisions, strict=True):
            self._legs.append(with_stops(leg, values, mission.drones, mission.scale, self._ground))
            self._decide(self._legs[-1])

    def improve(self, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        """Publish an improved decision during a search, with waypoints only for drones whose goals have changed.

        A simulation flies only the last decision of an epoch, since its time stops while the team decides.
        """
        builder = self._builder = self._builder or self._new_builder(epoch.assignment)
        leg = self._leg(builder, epoch, withdrawn)
        goals = {number: goal for number, goal in leg.goals.items() if goal != self._goals.get(number)}
        self._improved = leg
        if self.feedback is None:
            self._legs.append(leg)
        self._decide(replace(leg, goals=goals))

    def has_news(self, team: Team) -> bool:
        """Return whether a received report changes the problem of `team`, and thus opens the next epoch."""
        feedback, builder = self.feedback, self._builder
        if feedback is None or builder is None or self._improved is None:
            return False
        team = self._after_known_events(team, self._past_events + (not self._lost))
        while self._news is None and (report := feedback.poll()) is not None:
            changes = self._changes(builder, team, report)
            if changes:
                self._news = ReportedChanges([*changes], report.at_s + TOGETHER_S)
        return self._news is not None

    @property
    def team(self) -> Team:
        """The team with a scenario of all planned events and all events caused by robots' reports."""
        return replace(self._team, scenario=(*self._team.scenario, *self.events))

    @property
    def mission(self) -> Mission | None:
        """The mission so far; None before the end of the first epoch."""
        return self._builder.mission(self._team.name, self._legs) if self._builder else None

    @property
    def notes(self) -> list[str]:
        """Sentences about reports that could not be used."""
        received = self.feedback.notes if self.feedback else []
        return [*received, *(self._situation.notes if self._situation else [])]

    # Decisions

    def _leg(self, builder: MissionBuilder, epoch: EpochOutcome, withdrawn: Sequence[str] = ()) -> Leg:
        """Return the leg of `epoch`, in which robots that do tasks have several stops, unless they are simulated."""
        leg = builder.leg(epoch, withdrawn)
        self._assignment = epoch.assignment
        return with_stops(leg, epoch.assignment, builder.drones, builder.scale, self._ground) if self._exact else leg

    def _new_builder(self, assignment: Assignment) -> MissionBuilder:
        """Return a builder for all drones, whose homes are below their first places, or below possible places."""
        first = {**_values(self._robots, 0), **assignment}
        near = {**_values(self._robots, 0, VAST_M), **assignment}
        far = {**near, **_values(self._robots, -1, VAST_M)}
        others = [craft for values in (near, far) for robot in self._robots for craft in crafts_of(robot, values)]
        return MissionBuilder(
            self._robots, first, others=others, scale=self._scale, ground=self._ground, exact=self._exact
        )

    def _decide(self, leg: Leg) -> None:
        at_ns = self.feedback.now_ns() if self.feedback else time.time_ns()
        self._goals |= leg.goals
        for publisher in self.publishers:
            publisher.decide(leg, at_ns)

    # The situation

    def _after_known_events(self, team: Team, happened: int) -> Team:
        """Return `team` after all known events, the first `happened` of which have already been applied."""
        for event in self.team.scenario[happened:]:
            team, _ = apply_possible_changes(team, event.changes)
        return team

    def _event_of_reports(self, feedback: Feedback, team: Team, builder: MissionBuilder) -> ScenarioEvent | None:
        """Return the event caused by the first reports that change `team`; None if there are no such reports."""
        changes: list[Change] = []
        until_s = None
        news, self._news = self._news, None
        if news is not None:
            changes, until_s = news
            team, _ = apply_possible_changes(team, changes)
        while (report := feedback.next(until_s)) is not None:
            found = self._changes(builder, team, report)
            if found:
                changes += found
                team, _ = apply_possible_changes(team, found)
                until_s = report.at_s + TOGETHER_S if until_s is None else until_s
        if not changes:
            return None
        done, self._done = self._done, []
        return ScenarioEvent((*done, *changes))

    def _changes(self, builder: MissionBuilder, team: Team, report: Report) -> tuple[Change, ...]:
        """Return the changes that a report causes now. Those of tasks that are done are stored for the next event."""
        situation = self._situation_of(builder)
        if isinstance(report, DoneReport):
            self._done += [one for one in situation.done(team, report, self._assignment) if one not in self._done]
            return ()
        return situation.changes(team, report)

    def _situation_of(self, builder: MissionBuilder) -> Situation:
        if self._situation is None:
            self._situation = Situation(builder.drones, builder.scale, self._battery)
        return self._situation


def with_stops(leg: Leg, values: Assignment, drones: Sequence[Drone], scale: float, ground: GroundMap | None) -> Leg:
    """Return `leg` with all stops of robots that do tasks one after the other.

    Args:
        leg: The leg.
        values: The decision.
        drones: The drones, by number.
        scale: The length of a unit, in metres.
        ground: The map with the stops.
    """
    if ground is None or not ground.stops:
        return leg
    goals = dict(leg.goals)
    for number, goal in leg.goals.items():
        known = ground.stops.get(drones[number].robot)
        if known is None or goal.lands:
            continue
        stops = [GoalStop(_scaled(one.at, scale), one.variable) for one in known.of(values)]
        if stops and math.dist(stops[0].at, goal.at) <= _SAME_M:
            goals[number] = replace(goal, stops=tuple(stops))
    return replace(leg, goals=goals)


def _scaled(at: tuple[int, int, int], scale: float) -> Point:
    x, y, z = (part * scale for part in at)
    return x, y, z


def drones_of(team: Team) -> tuple[Drone, ...]:
    """Return all drones of the team and its events, whose places are unknown before the first decision."""
    robots = all_robots(team)
    return MissionBuilder(robots, _values(robots, 0)).drones


def _values(robots: Sequence[Robot], place: int, span: float | None = None) -> dict[str, int]:
    """Return the least (`place` 0) or greatest (-1) value of each variable whose domain is no wider than `span`."""
    found = {}
    for variable in (variable for robot in robots for variable in robot.variables):
        ranges, real = variable.domain.ranges, variable.domain.real
        if ranges and (span is None or ranges[-1][-1] - ranges[0][0] <= span * 10 ** (real.places if real else 0)):
            found[variable.name] = ranges[place][place]
    return found


def drones_of_robot(robot: Robot) -> tuple[Drone, ...]:
    """Return the drones of `robot` before the first decision."""
    return MissionBuilder([robot], {}).drones


def leg_of_robot(robot: Robot, why: str, assignment: Assignment, scale: float = UNIT_M) -> Leg:
    """Return the goals of one robot's drones on its own machine, where the places of other robots are unknown.

    Goals are given by the drones' numbers in `drones_of_robot`. The drones of a withdrawn robot land at their first
    places, below their cells, since a point at the edge might belong to another robot. Drones without a cell in the
    robot's file stay in place; so do all drones if there is no solution.

    Args:
        robot: The robot.
        why: The master's text about the end of the run, such as `optimal, 6 withdraw`.
        assignment: The robot's decision; empty if it has withdrawn.
        scale: The length of a unit, in metres. It must be the same for all robots.
    """
    verdict, _, others = why.partition(",")
    if verdict not in _ANSWERED or not (assignment or _WITHDRAWN in others):
        return Leg(why, Verdict.UNKNOWN, {})
    builder = MissionBuilder([robot], assignment, scale=scale, exact=True)
    known = {craft.name for craft in crafts_of(robot, assignment) if craft.cell}
    if assignment:
        goals = builder.leg(EpochOutcome(Verdict(verdict), robots=(robot.name,), assignment=dict(assignment))).goals
    else:
        goals = {number: Goal(drone.home, lands=True) for number, drone in enumerate(builder.drones)}
    return Leg(why, Verdict(verdict), {n: goal for n, goal in goals.items() if builder.drones[n].name in known})
