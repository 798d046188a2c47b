"""The default runtime: one OS process per robot, joined by multiprocessing queues, one for each directed edge.

The parent is the paper's master. It starts the processes, waits for the confirmation of all, orders the start,
opens a queue when a robot wants to talk to another for the first time, finds out by four counters when all is
quiet, and stops the run. Protocol messages go from robot to robot and never through the parent.

Whatever dies is noticed: the parent watches every process's sentinel; a robot's control pipe ends with the parent.
Why fork, why queues are opened on demand, and what was measured: docs/design.md, "Processes".
"""

from __future__ import annotations

import errno
import multiprocessing
import multiprocessing.connection
import resource
import selectors
import signal
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.context import ForkContext, ForkServerContext
from multiprocessing.process import BaseProcess
from typing import Literal, assert_never

import msgspec

from robochoc.communication.control import (
    Conclusion,
    Counters,
    Events,
    Failed,
    FromParent,
    FromRobot,
    OpenQueue,
    QueueFrom,
    QueueTo,
    Ready,
    Report,
    Start,
    Stop,
    Wave,
)
from robochoc.communication.queues import QueueReader
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.robot_process import robot_process
from robochoc.communication.run_result import Progress, RunResult
from robochoc.observers.events import Lost, Observer, Registered
from robochoc.outcome import Verdict
from robochoc.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled import Unsupported, interfaces

StartMethod = Literal["fork", "forkserver"]
TICK_S = 0.2
"""Between two looks at the counters for those who watch the progress."""
LAST_WORDS_S = 5.0
"""How long the parent waits for reports after it has said stop."""
FAREWELL_S = 0.5
"""How long processes may take to end by themselves before they are killed."""
_FDS_PER_ROBOT = 4
_FDS_SPARE = 128
_DEAF_S = 10.0
_STOPPING = {signal.SIGINT, signal.SIGTERM}


class RobotsLost(Exception):  # noqa: N818 - named for what happened
    """Robots whose processes ended, or failed, before the run did: `robots` says why, by name."""

    def __init__(self, robots: Mapping[str, str]) -> None:
        super().__init__("; ".join(f"{name} was lost: {why}" for name, why in robots.items()))
        self.robots = dict(robots)


class _Robot:
    """The parent's side of one robot: its process, its control pipe, and what it reported."""

    def __init__(self, name: str, process: BaseProcess, control: socket.socket) -> None:
        self.name = name
        self.process = process
        self.control = control
        self.report: Report | None = None
        self._reader = QueueReader(control.fileno())
        self._decoder = msgspec.msgpack.Decoder(FromRobot)
        self._encoder = msgspec.msgpack.Encoder()

    def words(self) -> list[FromRobot]:
        """All that has come over the control pipe. `hung_up` tells afterwards whether its other end is closed."""
        return [self._decoder.decode(body) for body in self._reader.get_all()]

    @property
    def hung_up(self) -> bool:
        return self._reader.ended

    def tell(self, order: FromParent, fd: int | None = None) -> None:
        """Send `order`, with the end of a queue if one is given. To a robot that is gone: nothing.

        Raises `RobotsLost` when the robot does not read for `_DEAF_S` seconds.
        """
        body = self._encoder.encode(order)
        frame = len(body).to_bytes(4, "big") + body
        deadline = time.monotonic() + _DEAF_S
        while frame:
            try:
                sent = socket.send_fds(self.control, [frame], [] if fd is None else [fd])
            except (BrokenPipeError, ConnectionResetError):
                return
            except OSError as error:
                # Full, or the kernel holds as many descriptors under way as it allows: the robot has to read first.
                if error.errno not in {errno.EAGAIN, errno.ETOOMANYREFS}:
                    raise
                if time.monotonic() > deadline:
                    raise RobotsLost({self.name: "it does not answer"}) from error
                multiprocessing.connection.wait([self.process.sentinel], 0.001)
                continue
            frame, fd = frame[sent:], None

    def fate(self) -> str:
        """How the process ended, in words."""
        self.process.join(FAREWELL_S)
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"its process was killed by {signal.Signals(-code).name}"
        return f"its process ended with status {code}"


class ProcessesRun:
    """One run of one team. `run` gives the result; whatever happens, no process outlives it.

    `observer` is told of all events; with `progress`, somebody watches the count of messages.
    """

    def __init__(
        self,
        team: Team,
        protocol: type[Protocol],
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        start_method: StartMethod = "fork",
    ) -> None:
        self._team = team
        self._protocol = protocol
        self._observer = observer
        self._progress = progress
        self._context: ForkContext | ForkServerContext = multiprocessing.get_context(start_method)
        self._robots: dict[str, _Robot] = {}
        self._selector = selectors.DefaultSelector()
        self._counters = FourCounters(team.order)
        self._absent = set(team.order)
        self._lost: dict[str, str] = {}
        self._verdict: Verdict | None = None
        self._witness: str | None = None
        self._searching = False
        self._shown = 0.0
        self._began = time.monotonic()

    def run(self, timeout: float | None = None) -> RunResult:
        """Run to a verdict, or until `timeout` seconds are over (`unknown`).

        Raises `RobotsLost` when a robot's process ends or fails, and `Unsupported` when a robot's problem is
        more than this version can take.
        """
        self._began = time.monotonic()
        deadline = None if timeout is None else self._began + timeout
        try:
            self._launch()
            self._wait_until(lambda: not self._absent, deadline)
            if not self._absent:
                self._tell_all(Start(self._began))
                self._searching = True
                self._wait_until(lambda: self._verdict is not None, deadline)
                self._searching = False
            return self._finish()
        finally:
            self._end_all()

    # Beginning

    def _launch(self) -> None:
        """Start the processes. Signals wait until a robot has set its own handlers, and until all are known here."""
        _allow_descriptors(len(self._team.robots) * _FDS_PER_ROBOT + _FDS_SPARE)
        shown = interfaces(self._team)
        with _signals_held():
            for robot in self._team.robots:
                ours, theirs = socket.socketpair()
                forked = self._context.get_start_method() == "fork"
                inherited = [other.control for other in self._robots.values()] + [ours] if forked else []
                process = self._context.Process(  # type: ignore[union-attr]
                    target=robot_process,
                    name=robot.name,
                    args=(robot, self._team.order, shown, self._protocol, theirs, inherited),
                    kwargs={"observed": self._observer is not None},
                    daemon=True,
                )
                process.start()
                theirs.close()
                self._robots[robot.name] = _Robot(robot.name, process, ours)
        for known in self._robots.values():
            self._selector.register(known.control, selectors.EVENT_READ, (self._listen, known))
            self._selector.register(known.process.sentinel, selectors.EVENT_READ, (self._see_end, known))

    # The loop

    def _wait_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve the robots until `done()` or the deadline; raises `RobotsLost` as soon as one is lost."""
        while not done():
            now = time.monotonic()
            if deadline is not None and now >= deadline:
                return
            patience = None if deadline is None else deadline - now
            if self._progress:
                patience = TICK_S if patience is None else min(TICK_S, patience)
            for key, _ in self._selector.select(patience):
                serve, robot = key.data
                serve(robot)
            if self._lost:
                raise RobotsLost(self._lost)
            if self._searching:
                self._ask_around(now)

    def _listen(self, robot: _Robot) -> None:
        for word in robot.words():
            self._hear(robot, word)
        if robot.hung_up:  # its process is about to end, which its sentinel will tell
            self._selector.unregister(robot.control)

    def _see_end(self, robot: _Robot) -> None:
        """The process has ended: without last words, the robot is lost."""
        for word in robot.words():
            self._hear(robot, word)
        self._selector.unregister(robot.process.sentinel)
        if robot.control in self._selector.get_map():
            self._selector.unregister(robot.control)
        if robot.report is None and robot.name not in self._lost:
            self._lose(robot, robot.fate())

    def _hear(self, robot: _Robot, word: FromRobot) -> None:
        match word:
            case Ready():
                self._absent.discard(robot.name)
                self._observe(Registered(t=self._now(), robot=robot.name))
            case OpenQueue(receiver):
                self._open_queue(robot, receiver)
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

    def _open_queue(self, sender: _Robot, receiver: str) -> None:
        """Make the queue from `sender` to `receiver`: the one gets the write end, the other the read end."""
        other = self._robots.get(receiver)
        if other is None:
            self._lose(sender, f"it wanted to talk to {receiver!r}, which is no robot of the team")
            return
        reader, writer = self._context.Pipe(duplex=False)
        with reader, writer:
            other.tell(QueueFrom(sender.name), reader.fileno())
            sender.tell(QueueTo(receiver), writer.fileno())

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
        self._tell_all(Stop())
        deadline = time.monotonic() + LAST_WORDS_S
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
        """Hang up, give the processes a moment to end by themselves, then kill what is left."""
        with _signals_held():
            self._selector.close()
            for robot in self._robots.values():
                robot.control.close()
            deadline = time.monotonic() + FAREWELL_S
            alive = {robot.process.sentinel: robot.process for robot in self._robots.values()}
            while alive and time.monotonic() < deadline:
                ended = multiprocessing.connection.wait(list(alive), max(0.0, deadline - time.monotonic()))
                for sentinel in ended:
                    del alive[sentinel]  # type: ignore[arg-type]
            for process in alive.values():
                process.kill()
            for robot in self._robots.values():
                robot.process.join()
                robot.process.close()

    # Small things

    def _lose(self, robot: _Robot, why: str) -> None:
        self._lost[robot.name] = why
        self._observe(Lost(t=self._now(), robot=robot.name, why=why))

    def _tell_all(self, order: FromParent) -> None:
        for robot in self._robots.values():
            robot.tell(order)

    def _observe(self, event: object) -> None:
        if self._observer:
            self._observer(event)  # type: ignore[arg-type]

    def _now(self) -> float:
        return time.monotonic() - self._began


def _allow_descriptors(needed: int) -> None:
    """Raise the soft limit of open files towards the hard one where the team needs it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        limit = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


@contextmanager
def _signals_held() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait meanwhile: what is half done would be lost."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
