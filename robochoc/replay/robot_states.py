"""A robot's state after each of its own steps, and the reasons for a new value or a backtrack.

Only this robot is replayed, from the messages in its journal; other robots are replayed only if the text form of a
journal has lost the content of a message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import msgspec

from robochoc.journal.events import AnyEvent, Began, Given, Sent, actor
from robochoc.journal.journal import Header, Journal
from robochoc.protocols.protocol import Protocol
from robochoc.replay.inspection import Inspector, safely
from robochoc.replay.reasons import Reasons
from robochoc.replay.rebuild import CannotReplayError, Rebuilder, RecordedTeams, ReplayOptions
from robochoc.replay.run_replay import ReplayStopsError, RunReplay
from robochoc.replay.steps import RecordedStep, runs_of, steps_of


class ValueState(msgspec.Struct, frozen=True):
    """A value of the robot, and the known reason that excludes it (None if there is none)."""

    value: str
    ruled_out_by: str | None


class RobotState(msgspec.Struct, frozen=True, kw_only=True):
    """A robot's state after its step number `step`, counted from 0 over the whole journal; texts for display.

    Attributes:
        step: The number of the step.
        value: The values of the robot's variables; empty if it has none.
        view: The known state of other robots, as pairs (robot, text).
        domain: Each value of the robot, with the reason that excludes it.
        nogoods: The stored nogoods.
        more: Everything else that the protocol stores, by name.
        why: The reasons for a changed value, a backtrack, or the conclusion of the search; otherwise empty.
    """

    step: int
    value: dict[str, int] = {}
    view: list[tuple[str, str]] = []
    domain: list[ValueState] = []
    nogoods: list[str] = []
    more: dict[str, str] = {}
    why: list[str] = []


def inspected(inspector: Inspector, protocol: Protocol, step: int = 0) -> RobotState:
    """Return the state of a robot after its step number `step`, without reasons for a change."""
    return RobotState(
        step=step,
        value=dict(protocol.assignment),
        view=safely(lambda: inspector.view(protocol), []),
        domain=[ValueState(*pair) for pair in safely(lambda: inspector.domain(protocol), [])],
        nogoods=safely(lambda: inspector.nogoods(protocol), []),
        more=inspector.more(protocol),
    )


def states_of(
    journal: Journal | Iterable[AnyEvent],
    robot: str,
    options: ReplayOptions | None = None,
    *,
    header: Header | None = None,
    since: int | Callable[[], int] = 0,
    everything: Callable[[], Iterable[AnyEvent]] | None = None,
    teams: RecordedTeams | None = None,
) -> Iterator[RobotState]:
    """Yield the states of `robot` after its complete steps.

    If the journal lacks the next messages to the robot, `more` of the last state of the run contains the reason. A
    later run may continue; then there is such a state for each step in between, so that no step number is missing.

    Args:
        journal: A journal, or events sorted as in a journal. Events of `robot` and messages to it are sufficient if
            `everything` is given.
        robot: The robot's name.
        options: Inputs besides the journal.
        header: The journal's header, if `journal` is only events.
        since: The number of the first step for which a state is yielded; or a function that returns this number, which
            may increase during the replay in order to skip states.
        everything: Returns the events of all robots; called only if they are needed.
        teams: The teams of the journal, if several robots of one journal are replayed one after the other.

    Raises:
        CannotReplayError: if there is nothing to replay, or the installed protocol is not the recorded one.
    """
    if isinstance(journal, Journal):
        header, journal = journal.header, journal.events
    events = tuple(journal)
    player = _Player(header, robot, options or ReplayOptions(), teams, since)
    try:
        yield from player.states(events, alone=True)
    except _MissingContentError:
        yield from player.states(tuple(everything()) if everything else events, alone=False)


class TeamStates:
    """The states of all robots in one journal, robot by robot: the teams are read, and the events grouped, once."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._teams = RecordedTeams(journal.header)
        self._events: dict[str, list[AnyEvent]] = {}
        self._starts: list[AnyEvent] = []
        for event in journal.events:
            if isinstance(event, Began | Given):
                for own in (self._starts, *self._events.values()):
                    own.append(event)
                continue
            for robot in {event.sender, event.receiver} if isinstance(event, Sent) else {actor(event)}:
                if robot is not None:
                    self._events.setdefault(robot, self._starts.copy()).append(event)

    def of(self, robot: str) -> Iterator[RobotState]:
        """Yield the states of `robot`, as `states_of` does. Raises `CannotReplayError`."""
        return states_of(
            self._events.get(robot, self._starts),
            robot,
            header=self._journal.header,
            everything=lambda: self._journal.events,
            teams=self._teams,
        )


_INCOMPLETE = {"replay": "ends here: the journal lacks events of this step, or of an earlier step in this run"}


class _MissingContentError(Exception):
    """A message to the robot can only be restored by replaying its sender."""


class _Player:
    """Replays the robot's steps, `alone` or with all other robots, and inspects it after those from `since` on."""

    def __init__(
        self,
        header: Header | None,
        robot: str,
        options: ReplayOptions,
        teams: RecordedTeams | None,
        since: int | Callable[[], int],
    ) -> None:
        self._header = header
        self._robot = robot
        self._options = options
        self._teams = teams
        self._since = since
        self._step = 0
        self._yielded = 0

    def _first(self) -> int:
        """Return the number of the first step whose state is still to be yielded."""
        return max(self._yielded, self._since if isinstance(self._since, int) else self._since())

    def states(self, events: Sequence[AnyEvent], *, alone: bool) -> Iterator[RobotState]:
        self._step = 0
        rebuilder = Rebuilder(self._header, self._options, {self._robot} if alone else None, self._teams)
        gone: set[str] = set()
        for run in runs_of(events):
            robots = rebuilder.robots_of(run)
            if self._robot not in robots.hosts:
                continue
            replay = RunReplay(run, robots, self._header)
            inspector = Inspector(robots.parts[self._robot])
            gone.intersection_update(robots.continuing)
            for step in steps_of(run.events):
                if alone and step.robot != self._robot:
                    continue
                if step.robot in gone:
                    self._step += step.robot == self._robot
                    continue
                try:
                    state = self._play_step(replay, inspector, step)
                except ReplayStopsError as stops:
                    if stops.needs_sender and alone:
                        raise _MissingContentError from stops
                    gone.add(step.robot)
                    state = self._last(step, str(stops))
                if state is not None:
                    yield from (
                        RobotState(step=number, more=_INCOMPLETE) for number in range(self._first(), state.step)
                    )
                    yield state
                    self._yielded = state.step + 1

    def _play_step(self, replay: RunReplay, inspector: Inspector, step: RecordedStep) -> RobotState | None:
        """Return the state after `step`; None if the step is another robot's, partial, or before `since`."""
        if step.robot != self._robot:
            replay.play(step, 0)
            return None
        number, protocol = self._step, replay.robots.hosts[self._robot].protocol
        self._step += 1
        wanted = step.is_complete and number >= self._first()
        reasons = Reasons(inspector, protocol) if wanted else None
        difference = replay.play(step, number, reasons.record_sent) if reasons else replay.play(step, number)
        if difference is not None:
            raise CannotReplayError(f"the replay of {self._robot} differs from the record: {difference.summary}")
        received = replay.received_messages
        for sent, message in received:
            inspector.record_received(sent.sender, message)
        if reasons is None:
            return None
        state = inspected(inspector, protocol, number)
        return msgspec.structs.replace(state, why=safely(lambda: reasons.lines(received, step), []))

    def _last(self, step: RecordedStep, why: str) -> RobotState | None:
        """Return a last state that contains only the reason why the replay ends."""
        if step.robot != self._robot:
            return None
        number, self._step = self._step, self._step + 1
        return RobotState(step=number, more={"replay": f"ends here: {why}"}) if number >= self._first() else None
