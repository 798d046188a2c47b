"""The robots of a team while its problem does not change, and the changes that may end this."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

from robochoc.communication.host import Host, order_of
from robochoc.communication.session import Epoch
from robochoc.exploration.changes import Change, Course
from robochoc.exploration.judgement import TeamJudge
from robochoc.exploration.local_steps import LocalSteps, Step
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import AgentProblem
from robochoc.system.errors import RobochocError
from robochoc.system.termination import Terminated


class NotCreatedError(RobochocError):
    """Raised if the protocol object of a robot cannot be created."""


class Stage:
    """The robots of a team while its problem does not change: an epoch of a run.

    Args:
        course: The possible courses of the run.
        changes: The changes that have led to the epoch.
        epoch: The epoch.

    Attributes:
        parts: Each robot's part of the problem, by name, in priority order.
        protocol: The class of the protocol.
        judge: The judge of the robots' states.
        robots: The steps of each robot.
        names: The names of the robots.
        places: The place of each robot in `robots`.
        everybody: All places.
        writers: For each robot, the places of the robots that may send it a message.
        traits: The traits of the protocol.
    """

    def __init__(self, course: Course, changes: Sequence[Change], epoch: Epoch) -> None:
        self._course, self._changes, self._epoch = course, changes, epoch
        self._after: dict[Change, Stage] = {}
        self.protocol = course.phase.protocol
        self.parts = epoch.parts(self.protocol)
        self.judge = TeamJudge(epoch.compiled, course.phase)
        hosts = {name: _host(name, self.protocol, part) for name, part in self.parts.items()}
        self.robots = [LocalSteps(host) for host in hosts.values()]
        self.names = [*hosts]
        self.places = {name: place for place, name in enumerate(self.names)}
        self.everybody = {*range(len(self.names))}
        self.traits = self.protocol.traits
        self.writers = [
            {
                self.places[name]
                for name in (hosts if self.traits.writes_to_non_neighbours else host.protocol.problem.neighbours)
            }
            - {place}
            for place, host in enumerate(hosts.values())
        ]

    @classmethod
    def first_of(cls, course: Course) -> Stage:
        """Return the stage before the first change."""
        return cls(course, (), course.start)

    @cached_property
    def changes(self) -> Sequence[Change]:
        """The changes that may end this stage."""
        return [*self._epochs]

    @cached_property
    def _epochs(self) -> dict[Change, Epoch]:
        """The epochs that may follow."""
        found = {}
        for change in self._course.may_follow(self._epoch.team, self._changes):
            after = self._course.after([*self._changes, change])
            if after is not None and after.team.robots:
                found[change._replace(in_words=after.opened_by)] = after.epoch
        return found

    def after(self, change: Change) -> Stage:
        """Return the stage after `change`, always the same object."""
        known = self._after.get(change)
        if known is None:
            changes = *self._changes, change
            known = self._after[change] = Stage(self._course, changes, self._epochs[change])
        return known

    def first(self) -> list[Step]:
        """Return the states of robots that have no knowledge and are not started."""
        return [robot.first for robot in self.robots]

    def adopted(self, before: Stage, robots: Sequence[int]) -> list[Step]:
        """Return the state of each robot before its start in this stage, after the states `robots` of `before`."""
        steps = []
        for robot in self.robots:
            place = before.places.get(robot.name)
            if place is None or robot.name in self._epoch.restarted:
                steps.append(robot.first)
            else:
                steps.append(robot.changed(before.robots[place], robots[place], partial(self._change, robot.name)))
        return steps

    def _change(self, name: str, host: Host) -> None:
        """Let the robot of `host` adopt the problem of this epoch."""
        part = self.parts[name]
        host.change(part, self._epoch.invalidated, order_of(part))


def _host(name: str, protocol: type[Protocol], part: AgentProblem) -> Host:
    """Return a host that is not started. Raises `NotCreatedError`, or `UnsupportedError` as the protocol does."""
    try:
        return Host.create(protocol, part)
    except (RobochocError, Terminated):
        raise
    except (Exception, SystemExit) as error:
        raise NotCreatedError(f"{name} cannot be created: {type(error).__name__}: {error}") from error
