"""The default runtime: one OS process per robot, connected by multiprocessing queues, one queue per directed edge.

The parent is the paper's master. It starts the processes, waits for the confirmation of all robots, orders the start,
opens a queue for a robot's first message to another robot, detects quiescence by four counters, and ends each epoch.
Protocol messages are sent from robot to robot, never through the parent.

Crash detection: the parent watches every process's sentinel; a robot's control pipe ends when the parent ends.
docs/explanation/design/runtimes.md, "Processes", explains why processes are forked and queues are opened on demand, and
contains measurements.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from itertools import islice
from typing import assert_never

from robochoc.communication.control import (
    Begin,
    EpochChange,
    EpochMessage,
    Events,
    FromParent,
    FromRobot,
    OpenQueues,
    Pause,
    Ready,
    RobotFailed,
    pack_change,
    prepare_changes,
)
from robochoc.communication.host import message_decoder
from robochoc.communication.master_loop import TICK_S, MasterLoop
from robochoc.communication.processes.pool import STARTED_AT_ONCE, ProcessPool, StartMethod
from robochoc.communication.processes.process_status import LONGEST_STEP_S, ProcessStatus, StoppedRobots
from robochoc.communication.processes.robot_link import RobotLink
from robochoc.communication.processes.robot_process import RobotStart, rehearse
from robochoc.communication.search_result import Progress, RobotsLostError, SearchResult
from robochoc.communication.search_state import SearchState
from robochoc.communication.session import Epoch, Session, is_past
from robochoc.journal.events import AnyEvent, Lost, Observer, Registered
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.garbage import garbage_frozen

CHECK_S = 0.001
"""The interval between checks for lost processes, in seconds per robot, so that checks take little time."""
CROWD = 100
"""The team size from which a rehearsal in the parent saves more time than it takes."""
REPORTS_S = 5.0
"""How long the parent waits for reports after the end of an epoch, in seconds."""
BUSY_REPORTS_S = 60.0
"""The same for robots that compute, or wait for the processor on a busy machine, after a verdict."""
LATE_REPORTS_S = 0.5
"""The same after the time limit. The metrics do not include robots that still compute then."""


class ProcessesRun(Session, MasterLoop):
    """Runs one team with each robot in its own process. No process outlives `close`.

    Args:
        team: The team, whether compiled or not.
        protocol: The protocol of the robots.
        observer: Receives all events.
        progress: Receives the message count from time to time.
        start_method: The start method of processes.
        survive: True if the end of a robot's process only ends the search, whose result names the lost robots.
            Otherwise it raises `RobotsLostError`.
        patience_s: The seconds after which a robot with a stopped process (SIGSTOP) is lost. None: the team waits.
        parameters: The robots' parameters besides the problem.
        bounds: True if the observer receives lower bounds, too.
    """

    def __init__(  # noqa: PLR0913 - keyword options
        self,
        team: Team | CompiledTeam,
        protocol: type[Protocol],
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        start_method: StartMethod = "fork",
        survive: bool = False,
        patience_s: float | None = None,
        parameters: RunParameters = DEFAULT_PARAMETERS,
        bounds: bool = False,
    ) -> None:
        Session.__init__(self, team)
        MasterLoop.__init__(self, progress)
        self._protocol = protocol
        self._observer = observer
        self._bounds = bounds
        self._survive = survive
        self._stopped = StoppedRobots(patience_s)
        self._pool = ProcessPool(start_method)
        self._lossless = True
        self._deadline: float | None = None
        self._unstarted = Epoch(self.compiled, parameters=parameters).parts(protocol)
        self._drops = parameters.message_loss > 0
        self._behind: set[str] = set()
        """Robots that have not yet started the current epoch: their events belong to a previous epoch."""
        self.state = self._new_state(0, self.compiled.team.order)

    @property
    def lossless(self) -> bool:
        """See `Session.lossless`."""
        return self._lossless

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        """See `Session.search`. The limit on messages is checked after each wave.

        Raises:
            RobotsLostError: if a robot's process ends or fails.
            UnsupportedError: if this version or the system does not support a robot's problem.
        """
        began = time.monotonic()
        deadline = self._deadline = None if timeout is None else began + timeout
        try:
            self._launch(deadline)
            self.state.max_messages = messages
            self._search_until(deadline)
            if self.state.ordered:
                self._lossless = self.state.counters.quiescent and not self.state.broken_off and not self._drops
            return self._finish(began, late=is_past(self._limit) or self.is_to_stop)
        except RobotsLostError as lost:
            for name, why in lost.robots.items():
                self._observe(Lost(t=self._now(), robot=name, why=why))
            raise

    def change(self, epoch: Epoch) -> None:
        """See `Session.change`. Robots that have left the team, or are restarted, are dismissed."""
        self.compiled = epoch.compiled
        before = self.state
        self._pool.reap()
        parts = epoch.parts(self._protocol)
        gone = [name for name in self._pool.robots if name not in parts or name in epoch.restarted]
        left = sorted({*gone, *epoch.restarted, *before.lost})
        for name in gone:
            self._pool.dismiss(name)
        self._behind = {name for name in self._pool.robots if not before.has_reported(name)}
        self.state = self._new_state(before.epoch + 1, epoch.team.order)
        self._unstarted = {}
        for name, part in parts.items():
            robot = self._pool.robots.get(name)
            if robot is None:
                self._unstarted[name] = part
            elif robot.ended:  # it ended after its report, so the previous epoch was not affected
                self._lose(name, robot.describe_end())
            else:
                self._send(robot, EpochChange(self.state.epoch, pack_change(part, epoch.invalidated), left))

    def _new_state(self, epoch: int, order: Sequence[str]) -> SearchState:
        """Return the state of a new search."""
        state = SearchState(epoch, order, traits=self._protocol.traits)
        state.lossy = self._drops and self._protocol.traits.bears_loss
        return state

    def kill(self, name: str) -> None:
        """Kill the process of the robot `name`, if it has one."""
        if name in self._pool.robots:
            self._pool.robots[name].process.kill()

    def close(self) -> None:
        """End all processes."""
        self._pool.end_all(self.state.has_reported)

    # The start

    def _launch(self, deadline: float | None) -> None:
        """Start the processes before the deadline. Raises `UnsupportedError` if the system allows fewer."""
        unstarted, self._unstarted = self._unstarted, {}
        if not unstarted:
            return
        robots = len(unstarted) + len(self._pool.robots)
        self._pool.make_room(robots)
        self.check_s = min(max(TICK_S, robots * CHECK_S), LONGEST_STEP_S)
        message_decoder(self._protocol.messages)  # once for all robots, before the fork
        if self.compiled.team.dynamic:
            prepare_changes()
        if robots >= CROWD:
            rehearse(self._protocol, unstarted.values())
        with garbage_frozen():
            parts = iter(unstarted.values())
            while (some := list(islice(parts, STARTED_AT_ONCE))) and not is_past(deadline):
                self._start(some)
                self._handle_ends()

    def _start(self, parts: Sequence[AgentProblem]) -> None:
        observed = self._observer is not None
        try:
            epoch, bounds = self.state.epoch, self._bounds
            self._pool.start([RobotStart(part, self._protocol, epoch, observed, bounds) for part in parts])
        except OSError as error:
            raise UnsupportedError(
                f"the system allows processes for only {len(self._pool.robots)} of {len(parts[0].order)} robots:"
                f" {error.strerror}: raise its limits, see 'ulimit -n' and 'ulimit -u', or use the simulator"
            ) from error

    def _order_start(self) -> None:
        self._send_all(Begin(self._began, self._lossless))

    # The loop

    def _serve(self, patience_s: float, deadline: float | None) -> None:
        for robot in self._pool.readable(patience_s):
            for message in self._pool.receive(robot):
                self._handle(robot, message)
            self._handle_ends()  # after each robot, because reading may take long
            if is_past(deadline):
                return
        self._handle_ends()

    def _check_robots(self, now: float) -> None:
        """Give up robots that are dying, or have been stopped for too long, unless they have reported."""
        found = self._pool.with_status(ProcessStatus.DYING, ProcessStatus.STOPPED)
        self._give_up([robot for robot in found[ProcessStatus.DYING] if not self.state.has_reported(robot.name)])
        stopped = [robot.name for robot in found[ProcessStatus.STOPPED] if not self.state.has_reported(robot.name)]
        lost = self._stopped.update(stopped, now)
        if lost and not self._survive:
            raise RobotsLostError(lost)  # `close` kills them
        for name, why in lost.items():
            self._lose(name, why)

    def _handle_ends(self) -> None:
        """Give up robots whose processes have ended without a report."""
        dead = []
        for robot, messages in self._pool.ended():
            for message in messages:
                self._handle(robot, message)
            if not self.state.has_reported(robot.name):
                dead.append(robot)
        self._give_up(dead)

    def _give_up(self, dead: Collection[RobotLink]) -> None:
        """Continue without the robots in `dead`, or end the run and raise `RobotsLostError`."""
        if not dead:
            return
        if not self._survive:
            # A killed process needs the processor to end, so on a busy machine the other robots must release it.
            for robot in self._pool.robots.values():
                if robot not in dead:
                    robot.process.kill()
        losses = {robot.name: robot.describe_end() for robot in dead}
        for robot in dead:
            for message in robot.receive_rest():
                self._handle(robot, message)
        if not self._survive:
            raise RobotsLostError(losses)
        for name, why in losses.items():
            self._lose(name, why)

    def _lose(self, name: str, why: str) -> None:
        """Continue without the robot `name`, and discard its report."""
        if name in self.state.lost:
            return
        self.state.lose(name, why)
        self._pool.dismiss(name, kill=True)
        self._observe(Lost(t=self._now(), robot=name, why=why))

    def _handle(self, robot: RobotLink, message: FromRobot) -> None:
        match message:
            case OpenQueues(epoch, receivers):
                if epoch == self.state.epoch:  # otherwise some receivers may be gone
                    self._open_queues(robot, receivers)
            case EpochMessage():
                if fault := self.state.handle(robot.name, message):
                    raise RobotsLostError({robot.name: fault})
                if isinstance(message, Ready) and message.epoch == self.state.epoch:
                    self._behind.discard(robot.name)
                    self._observe(Registered(t=self._now(), robot=robot.name))
            case Events(events):
                for event in events if robot.name not in self._behind else ():
                    self._observe(event)
            case RobotFailed(why, unsupported, elsewhere):
                refusal = TooLargeError if elsewhere else UnsupportedError
                raise refusal(why) if unsupported else RobotsLostError({robot.name: why})
            case never:
                assert_never(never)

    def _open_queues(self, sender: RobotLink, receivers: Sequence[str]) -> None:
        if sender.name not in self._pool.robots:
            return
        known = [name for name in receivers if name in self._pool.robots]
        unknown = [name for name in receivers if name not in known and name not in self.state.lost]
        if unknown:
            raise RobotsLostError(
                {sender.name: f"it sent a message to {unknown[0]!r}, which is not a robot of the team"}
            )
        self._pool.open_queues(sender, known)

    # The end of an epoch

    def _finish(self, began: float, *, late: bool) -> SearchResult:
        """End the search, collect the reports, and return the result."""
        wall_s = time.monotonic() - began
        if self.state.stuck:
            raise RobotsLostError(dict.fromkeys(self.state.order, self.state.stuck))
        self._send_all(Pause())
        self._await_reports(late=late)
        silent = self._silent()
        if silent and not late and not is_past(self._limit):
            if not self._survive:
                raise RobotsLostError(dict.fromkeys(silent, "it did not report at the end"))
            for name in silent:
                self._lose(name, "it did not report at the end")
        return self.state.result(wall_s)

    def _await_reports(self, *, late: bool) -> None:
        """Wait for reports as long as reports arrive: in a large team, many reports are waiting to be read.

        The wait for a computing robot ends at the time limit (`_limit`); with a verdict, at the latest after
        `BUSY_REPORTS_S`. The wait for a stopped robot ends after the patience. Robots are checked twice, since a robot
        that has just reported does not compute either. If the search was stopped (`late`), the wait is short.
        """
        began, limit = time.monotonic(), self._limit
        before, idle = len(self._silent()), False
        while True:
            now = time.monotonic()
            until = now + (LATE_REPORTS_S if late or idle else REPORTS_S)
            if limit is not None:
                until = min(until, max(limit, now + LATE_REPORTS_S))
            self._serve_until(lambda: not self._silent(), until)
            silent = [self._pool.robots[name] for name in self._silent()]
            if is_past(limit):
                return
            if len(silent) < before or (not late and any(robot.status is ProcessStatus.STOPPED for robot in silent)):
                before, idle = len(silent), False
                continue
            if late:
                return
            enough = self.state.verdict is not None and time.monotonic() - began > BUSY_REPORTS_S
            was_idle, idle = idle, not any(robot.is_computing for robot in silent)
            if enough or (was_idle and idle):
                return

    @property
    def _limit(self) -> float | None:
        """The time at which the wait for reports ends. After a verdict in time, they may be late, by `REPORTS_S`."""
        if self._deadline is None or self.state.verdict is None:
            return self._deadline
        return self._deadline + REPORTS_S

    def _silent(self) -> list[str]:
        """Return the robots that have a process and have not reported."""
        return [name for name in self._pool.robots if not self.state.has_reported(name)]

    # Helpers

    def _send_all(self, order: FromParent) -> None:
        for robot in list(self._pool.robots.values()):
            self._send(robot, order)

    def _send(self, robot: RobotLink, order: FromParent) -> None:
        try:
            robot.send(order)
        except RobotsLostError as unresponsive:
            if not self._survive:
                raise
            self._lose(robot.name, unresponsive.robots[robot.name])

    def _observe(self, event: AnyEvent) -> None:
        if self._observer:
            self._observer(event)

    def _now(self) -> float:
        return time.monotonic() - self._began
