"""The default runtime: one OS process per robot, joined by multiprocessing queues, one for each directed edge.

The parent is the paper's master. It starts the processes, waits for the confirmation of all, orders the start,
opens a queue when a robot wants to talk to another for the first time, finds out by four counters when all is
quiet, and stops the run. Protocol messages go from robot to robot and never through the parent.

Whatever dies is noticed: the parent watches every process's sentinel; a robot's control pipe ends with the parent.
Why fork, why queues are opened on demand, and what was measured: docs/design.md, "Processes".
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import selectors
import socket
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from multiprocessing.connection import Connection
from multiprocessing.context import ForkContext, ForkServerContext
from types import MappingProxyType
from typing import Literal, assert_never, cast

from robochoc.communication.control import (
    Conclusion,
    Counters,
    Events,
    Failed,
    FromParent,
    FromRobot,
    OpenQueues,
    QueueFrom,
    QueuesTo,
    Ready,
    Report,
    Start,
    Stop,
    Wave,
)
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.robot_link import RobotLink, RobotsLost
from robochoc.communication.robot_process import robot_process
from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.system import allow_descriptors, garbage_frozen, signals_held
from robochoc.observers.events import AnyEvent, Lost, Observer, Registered
from robochoc.outcome import Verdict
from robochoc.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.encoding import Unsupported
from robochoc.solver.part import Part, parts

StartMethod = Literal["fork", "forkserver"]
_CONTEXTS: dict[StartMethod, type[ForkContext | ForkServerContext]] = {
    "fork": ForkContext,
    "forkserver": ForkServerContext,
}
TICK_S = 0.2
"""Between two looks at the counters for those who watch the progress, and at who is dying."""
LAST_WORDS_S = 5.0
"""How long the parent waits for reports after it has said stop."""
LATE_WORDS_S = 0.5
"""The same when the time was over: who still computes then is left out of the metrics."""
FAREWELL_S = 0.5
"""How long processes may take to end by themselves before they are killed."""
_FDS_PER_ROBOT = 4
_FDS_SPARE = 128


class ProcessesRun:
    """One run of one team. `run` gives the result; whatever happens, no process outlives it.

    `domains` holds the compiled domains of robots whose private constraints need a solver (`solver/compile.py`).
    `observer` is told of all events; with `progress`, somebody watches the count of messages.
    """

    def __init__(
        self,
        team: Team,
        protocol: type[Protocol],
        *,
        domains: Mapping[str, CompiledDomain] = MappingProxyType({}),
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        start_method: StartMethod = "fork",
    ) -> None:
        self._team = team
        self._protocol = protocol
        self._domains = domains
        self._observer = observer
        self._progress = progress
        self._context = _CONTEXTS[start_method]()
        self._robots: dict[str, RobotLink] = {}
        self._selector = selectors.DefaultSelector()
        self._ends = selectors.DefaultSelector()
        self._counters = FourCounters(team.order)
        self._absent = set(team.order)
        self._lost: dict[str, str] = {}
        self._verdict: Verdict | None = None
        self._witness: str | None = None
        self._searching = False
        self._stopped = False
        self._shown = self._looked = 0.0
        self._began = time.monotonic()

    def run(self, timeout: float | None = None) -> RunResult:
        """Run to a verdict, or until `timeout` seconds are over (`unknown`).

        Raises `RobotsLost` when a robot's process ends or fails, and `Unsupported` when a robot's problem is
        more than this version can take.
        """
        self._began = time.monotonic()
        deadline = None if timeout is None else self._began + timeout
        try:
            self._launch(deadline)
            self._wait_until(lambda: not self._absent, deadline)
            if not self._absent:
                self._tell_all(Start(self._began))
                self._searching = True
                self._wait_until(lambda: self._verdict is not None, deadline)
                self._searching = False
            return self._finish()
        except RobotsLost as lost:
            for name, why in lost.robots.items():
                self._observe(Lost(t=self._now(), robot=name, why=why))
            raise
        finally:
            self._end_all()

    # Beginning

    def _launch(self, deadline: float | None) -> None:
        """Start the processes, as long as there is time. Raises `Unsupported` when the system allows fewer."""
        robots = self._team.robots
        allow_descriptors(len(robots) * _FDS_PER_ROBOT + _FDS_SPARE)
        self._selector.register(self._ends.fileno(), selectors.EVENT_READ)
        traits = self._protocol.traits
        given = parts(self._team, self._domains, everywhere=traits.everywhere, tree=traits.tree)
        with garbage_frozen():
            for part in given.values():
                if _over(deadline):
                    break
                try:
                    # One by one, so that a signal waits for the start of one robot, and not of a large team.
                    with signals_held():
                        self._start(part)
                except OSError as error:
                    raise Unsupported(
                        f"the system lets only {len(self._robots)} of {len(robots)} robots have a process:"
                        f" {error.strerror} (raise its limits, see 'ulimit -n' and 'ulimit -u', or use the simulator)"
                    ) from error
                self._see_ends()

    def _start(self, part: Part) -> None:
        """Start one process. Signals are to wait until it has set its own handlers, and until it is known here."""
        ours, theirs = socket.socketpair()
        forked = self._context.get_start_method() == "fork"
        inherited = [other.control for other in self._robots.values()] + [ours] if forked else []
        process = self._context.Process(
            target=robot_process,
            name=part.robot.name,
            args=(part, self._protocol, theirs, inherited),
            kwargs={"observed": self._observer is not None},
            daemon=True,
        )
        with theirs:
            try:
                process.start()
            except BaseException:
                ours.close()
                raise
        link = self._robots[part.robot.name] = RobotLink(part.robot.name, process, ours)
        self._selector.register(link.control, selectors.EVENT_READ, link)
        self._ends.register(process.sentinel, selectors.EVENT_READ, link)

    # The loop

    def _wait_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve the robots until `done()` or the deadline; raises `RobotsLost` as soon as one is lost."""
        while not done():
            now = time.monotonic()
            if _over(deadline):
                return
            patience = TICK_S if deadline is None else min(TICK_S, deadline - now)
            for key, _ in self._selector.select(patience):
                if key.data is not None:
                    self._listen(key.data)
                self._see_ends()  # after each, as robots may have much to say, and the machine may be busy
                if _over(deadline):
                    return
            if not self._stopped and now - self._looked >= TICK_S:
                self._looked = now
                self._give_up([robot for robot in self._robots.values() if robot.is_dying])
            if self._searching:
                self._ask_around(now)

    def _listen(self, robot: RobotLink) -> None:
        for word in robot.words():
            self._hear(robot, word)
        if robot.hung_up:  # its process is about to end, which its sentinel tells: soon, or in this same round before
            self._unwatch(robot)

    def _see_ends(self) -> None:
        """Some processes have ended: without a report, a robot is lost."""
        ended: list[RobotLink] = [key.data for key, _ in self._ends.select(0)]
        for robot in ended:
            for word in robot.last_words():
                self._hear(robot, word)
            self._ends.unregister(robot.process.sentinel)
            self._unwatch(robot)
        self._give_up([robot for robot in ended if robot.report is None])

    def _give_up(self, dead: Collection[RobotLink]) -> None:
        """End the run if robots are `dead`, or have failed: raise `RobotsLost`."""
        if dead:
            # To be gone takes a turn of the processor, which a busy machine gives late; the others make room.
            for robot in self._robots.values():
                if robot not in dead:
                    robot.process.kill()
        for robot in dead:
            fate = robot.fate()
            for word in robot.last_words():
                self._hear(robot, word)
            if robot.name not in self._lost:
                self._lose(robot, fate)
        if self._lost:
            raise RobotsLost(self._lost)

    def _unwatch(self, robot: RobotLink) -> None:
        if robot.control in self._selector.get_map():
            self._selector.unregister(robot.control)

    def _hear(self, robot: RobotLink, word: FromRobot) -> None:
        match word:
            case Ready():
                self._absent.discard(robot.name)
                self._observe(Registered(t=self._now(), robot=robot.name))
            case OpenQueues(receivers):
                self._open_queues(robot, receivers)
            case Counters(wave, sent, received):
                self._counters.answer(robot.name, wave, Counts(sent, received))
            case Conclusion(verdict):
                self._verdict, self._witness = Verdict(verdict), robot.name
            case Events(events):
                for event in events:
                    self._observe(event)
            case Report():
                robot.report = word
            case Failed(why, unsupported):
                if unsupported:
                    raise Unsupported(why)
                self._lose(robot, why)
            case never:
                assert_never(never)

    def _open_queues(self, sender: RobotLink, receivers: Sequence[str]) -> None:
        """Make the queues from `sender` to `receivers`: it gets the write ends, each of them its read end."""
        strangers = [name for name in receivers if name not in self._robots]
        if strangers:
            self._lose(sender, f"it wanted to talk to {strangers[0]!r}, which is no robot of the team")
            return
        with ExitStack() as copies:
            writers = []
            for name in receivers:
                try:
                    reader, writer = self._pipe()
                except OSError as error:
                    raise Unsupported(
                        f"the system does not let {sender.name} have a queue to {name}: {error.strerror}"
                        " (raise its limits, see 'ulimit -n', or use the simulator)"
                    ) from error
                writers.append(copies.enter_context(writer))
                with reader:
                    self._robots[name].tell(QueueFrom(sender.name), [reader.fileno()])
            sender.tell(QueuesTo(list(receivers)), [writer.fileno() for writer in writers])

    def _pipe(self) -> tuple[Connection, Connection]:
        try:
            return self._context.Pipe(duplex=False)
        except OSError as error:
            raise Unsupported(
                f"a queue between two robots could not be opened: {error.strerror}"
                " (raise the limit, see 'ulimit -n', or use the simulator)"
            ) from error

    def _ask_around(self, now: float) -> None:
        """Begin a wave when it could show that all is quiet, or when somebody waits for news."""
        if self._counters.quiescent:
            self._verdict = self._verdict or Verdict.SOLUTION
        elif self._counters.due:
            self._tell_all(Wave(self._counters.begin_wave()))
        elif self._progress and now - self._shown >= TICK_S:
            self._shown = now
            self._progress(Progress(self._counters.sent, self._now()))
            if not self._counters.waving:
                self._tell_all(Wave(self._counters.begin_wave()))

    # The end

    def _finish(self) -> RunResult:
        """Say stop, and collect everybody's last words."""
        wall_s = self._now()
        self._stopped = True
        self._tell_all(Stop())
        deadline = time.monotonic() + (LAST_WORDS_S if self._verdict else LATE_WORDS_S)
        self._wait_until(lambda: not self._silent(), deadline)
        silent = self._silent()
        if silent and self._verdict is not None:
            raise RobotsLost(dict.fromkeys(silent, "it did not report at the end"))
        reports = {name: robot.report for name, robot in self._robots.items() if robot.report is not None}
        return RunResult.of(
            self._verdict or Verdict.UNKNOWN,
            self._witness,
            {name: report.assignment for name, report in reports.items()},
            [report.metrics for report in reports.values()],
            wall_s,
        )

    def _silent(self) -> list[str]:
        return [name for name, robot in self._robots.items() if robot.report is None]

    def _end_all(self) -> None:
        """Hang up; robots that have reported get a moment to end by themselves, others are killed at once.

        They lose nothing by it, and on a busy machine the turns that they would need to end by themselves take time.
        """
        with signals_held():
            self._selector.close()
            self._ends.close()
            for robot in self._robots.values():
                if robot.report is None:
                    robot.process.kill()
                robot.control.close()
            deadline = time.monotonic() + FAREWELL_S
            alive = {robot.process.sentinel for robot in self._robots.values()}
            while alive and time.monotonic() < deadline:
                ended = multiprocessing.connection.wait(list(alive), max(0.0, deadline - time.monotonic()))
                alive.difference_update(cast("list[int]", ended))
            for robot in self._robots.values():
                # Also one that seems to have ended: a sentinel is a pipe, and a process can close it and live on.
                robot.process.kill()
                robot.process.join()
                robot.process.close()

    # Small things

    def _lose(self, robot: RobotLink, why: str) -> None:
        self._lost[robot.name] = why

    def _tell_all(self, order: FromParent) -> None:
        for robot in self._robots.values():
            robot.tell(order)

    def _observe(self, event: AnyEvent) -> None:
        if self._observer:
            self._observer(event)

    def _now(self) -> float:
        return time.monotonic() - self._began


def _over(deadline: float | None) -> bool:
    return deadline is not None and time.monotonic() >= deadline
