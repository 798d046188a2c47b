"""The bases of sinks and sources that share a commander: decisions become commands, and their ends become reports."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import ClassVar

from robochoc.flight.mission import Drone
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.inbox import MessageInbox
from robochoc.robots.sink import Fields, Sink, SinkError, Waypoint
from robochoc.robots.source import REPORTS, ReceivedMessage, Source, SourceError
from robochoc.ros.commands.commander import Commander, RobotPhase, Target
from robochoc.ros.names import TopicNames
from robochoc.system.shared import Shared

_SLICE_S = 0.2
shared: Shared[Commander] = Shared(lambda commander: commander.close())
"""The commanders of this process, by class and place."""


class CommandSink(Sink):
    """Commands the robots of decisions. Without a source in the same place, it waits until they have arrived."""

    commander: ClassVar[type[Commander]]
    """The class of commanders, set by subclasses. Its argument is the place."""
    wants_reports = False

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._key = self.commander, place
        self._commander = shared.enter(self._key, lambda: self.commander(place))  # type: ignore[call-arg]  # subclasses
        self.place = self._commander.where
        self._names: dict[int, str] = {}
        self._commanded: set[str] = set()
        self._is_closed = False

    def assign(self, drones: Sequence[Drone]) -> None:
        """Set the robots: the drones with a topic. Wait until their servers are visible."""
        names = TopicNames(drones)
        self._names = {number: drone.name for number, drone in enumerate(drones) if drone.topic is not None}
        if len({*self._names.values()}) < len(self._names):
            raise SinkError(f"{self.place}: two drones have the same name; rename one of them")
        self._commander.assign({name: names.namespace(number) for number, name in self._names.items()})

    def decide(self, waypoints: Sequence[Waypoint]) -> None:
        """Send the robots to their waypoints."""
        targets = {
            self._names[one.drone]: Target(one.at, one.lands, one.frame, one.stamp, one.stops)
            for one in waypoints
            if self._names[one.drone] in self._commander.robots
        }
        self._commanded |= {name for name, target in targets.items() if not target.lands}
        self._commander.command(targets)
        if not self._commander.observers:
            self._wait()

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Do nothing, since `decide` commands the robots."""

    def close(self) -> None:
        """Wait until all robots have arrived, then end."""
        try:
            if not self._is_closed and self._commander.observers:
                self._commander.wait_for(lambda: not self._commander.is_busy, self._commander.time_s)
        finally:
            self._leave()

    def discard(self) -> None:
        """Stop the robots at once. A failure is not reported: another error is already raised."""
        with suppress(SinkError):
            self._leave()

    def _wait(self) -> None:
        """Wait until no robot is on its way. Raises `SinkError` for a robot that is out of order."""
        commander = self._commander
        commander.wait_for(lambda: not commander.is_busy or bool(commander.out_of_order), commander.time_s)
        for robot in commander.out_of_order:
            problem = f"{robot.name} is out of order: {robot.why}"
            raise SinkError(on_one_line(f"{self.place}: {problem}; the others are stopped"))

    def _leave(self) -> None:
        if self._is_closed:
            return
        self._is_closed = True
        try:
            self._commander.end()
        finally:
            self.summary = self._result_text()
            shared.leave(self._key)

    def _result_text(self) -> str:
        """Return a summary in one line."""
        robots = [self._commander.robots[name] for name in sorted(self._commanded)]
        arrived = sum(robot.phase is RobotPhase.ARRIVED for robot in robots)
        out = [f"{robot.name} is out of order: {robot.why}" for robot in robots if robot.phase is RobotPhase.OUT]
        return on_one_line(", ".join([f"{len(robots)} sent", f"{arrived} arrived", *out]))


class CommandSource(Source):
    """Reports poses of the robots that a sink in the same place commands, and robots that are out of order."""

    commander: ClassVar[type[Commander]]
    """The class of commanders, set by subclasses."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._key = self.commander, place
        try:
            self._commander = shared.enter(self._key, lambda: self.commander(place))  # type: ignore[call-arg]
        except SinkError as error:
            raise SourceError(str(error)) from error
        self._namespaces: Mapping[str, str] = {}
        self._topics: Mapping[str, str] = {}
        self._inbox = MessageInbox()
        self._is_closed = False

    @property
    def is_busy(self) -> bool:
        """True if robots are on their way."""
        return self._commander.is_busy

    def assign(self, namespaces: Mapping[str, str]) -> None:
        """Store the drones' namespaces."""
        self._namespaces = namespaces

    def listen(self, topics: Mapping[str, str]) -> None:
        """Report on `topics` from now on."""
        self._topics = topics
        if self._put not in self._commander.observers:
            self._commander.observers.append(self._put)

    def check(self) -> None:
        """Raise `SourceError` if no sink in the same place commands robots."""
        if not self._commander.robots:
            problem = f"no robots are commanded in {self._commander.where}"
            raise SourceError(on_one_line(f"{problem}: give --ros the same text as --situation"))

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """Return the oldest report; None if none arrives within `wait_s`."""
        until = time.monotonic() + wait_s
        while True:
            try:
                self._commander.poll(0)
                found = self._inbox.get(0)
                left_s = until - time.monotonic()
                if found or left_s <= 0:
                    return found
                self._commander.poll(min(left_s, _SLICE_S))
            except SinkError as error:
                raise SourceError(str(error)) from error

    def close(self) -> None:
        """Release the robots."""
        if not self._is_closed:
            self._is_closed = True
            if self._put in self._commander.observers:
                self._commander.observers.remove(self._put)
            shared.leave(self._key)

    def _put(self, name: str, token: str, fields: Fields) -> None:
        topic = f"{self._namespaces.get(name, '')}/{token}"
        if topic in self._topics:
            self._inbox.put(ReceivedMessage(topic, REPORTS[token], fields, time.time_ns()))
