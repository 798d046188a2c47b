"""The default runtime: one OS process per robot, joined by multiprocessing queues, one for each directed edge.

The parent is the paper's master. It starts the processes, waits for the confirmation of all, orders the start,
opens a queue when a robot wants to talk to another for the first time, finds out by four counters when all is
quiet, and ends each epoch. Protocol messages go from robot to robot and never through the parent.

Whatever dies is noticed: the parent watches every process's sentinel; a robot's control pipe ends with the parent.
Why fork, why queues are opened on demand, and what was measured: docs/explanation/design.md, "Processes".
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import assert_never

from robochoc.communication.control import (
    Begin,
    Change,
    Conclusion,
    Counters,
    Events,
    Failed,
    FromParent,
    FromRobot,
    OfEpoch,
    OpenQueues,
    Pause,
    Ready,
    Report,
    Wave,
    sealed,
)
from robochoc.communication.processes.pool import ProcessPool, StartMethod
from robochoc.communication.processes.robot_link import Condition, RobotLink, RobotsLostError
from robochoc.communication.processes.robot_process import Beginning
from robochoc.communication.processes.stopped import Stopped
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.resources import garbage_frozen
from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.session import Epoch, Session, over
from robochoc.journal.events import AnyEvent, Lost, Observer, Registered
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.encoding import TooLargeError, UnsupportedError

TICK_S = 0.2
"""Between two looks at the counters for those who watch the progress, and at who is dying."""
LAST_WORDS_S = 5.0
"""How long the parent waits for reports after it has said that an epoch is over."""
BUSY_WORDS_S = 60.0
"""The same for robots that compute, or wait for their turn of a busy machine, when there is a verdict."""
LATE_WORDS_S = 0.5
"""The same when the time was over: who still computes then is left out of the metrics."""


class ProcessesRun(Session):
    """One team, each robot in a process of its own; whatever happens, no process outlives `close`.

    `observer` is told of all events; with `progress`, somebody watches the count of messages. With `survive`, robots
    whose processes end break the search off, and are told of in its result; otherwise `RobotsLostError` is raised.
    A robot whose process is stopped (SIGSTOP) for `patience_s` seconds counts as lost (None: it is waited for).
    `brief` is what robots are told beside the problem.
    """

    def __init__(
        self,
        team: Team | CompiledTeam,
        protocol: type[Protocol],
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        start_method: StartMethod = "fork",
        survive: bool = False,
        patience_s: float | None = None,
        brief: RunParameters = DEFAULT_PARAMETERS,
    ) -> None:
        super().__init__(team)
        self._protocol = protocol
        self._observer = observer
        self._progress = progress
        self._survive = survive
        self._stopped = Stopped(patience_s)
        self._crew = ProcessPool(start_method)
        self._shown = self._looked = 0.0
        self._began = time.monotonic()
        self._number = 0
        self._lossless = True
        self._deadline: float | None = None
        self._waiting = Epoch(self.compiled, brief=brief).parts(protocol)
        """Robots that are still to be started."""
        self._enter_epoch(self.compiled.team.order)

    def _enter_epoch(self, order: Sequence[str]) -> None:
        self._counters = FourCounters(order)
        self._absent = set(order)
        self._lost: dict[str, str] = {}
        self._verdict: Verdict | None = None
        self._witness: str | None = None
        self._enough: int | None = None
        self._searching = False

    @property
    def lossless(self) -> bool:
        """See `Session.lossless`."""
        return self._lossless

    def search(self, timeout: float | None = None, messages: int | None = None) -> RunResult:
        """See `Session.search`. Raises `RobotsLostError` when a robot's process ends or fails.

        Raises `UnsupportedError` when a robot's problem is more than this version, or the system, can take. A limit on
        messages is looked at as often as all robots answer.
        """
        began = time.monotonic()
        deadline = self._deadline = None if timeout is None else began + timeout
        try:
            self._launch(deadline)
            self._wait_until(lambda: not self._absent or self._broken_off, deadline)
            if not self._absent and self._verdict is None and not self._broken_off:
                self._enough = messages
                self._tell_all(Begin(self._began, self._lossless))
                self._searching = True
                self._wait_until(lambda: self._verdict is not None or self._broken_off, deadline)
                self._searching, self._lossless = False, self._counters.quiescent and not self._broken_off
            return self._finish(began, late=over(deadline))
        except RobotsLostError as lost:
            for name, why in lost.robots.items():
                self._observe(Lost(t=self._now(), robot=name, why=why))
            raise

    def change(self, epoch: Epoch) -> None:
        """See `Session.change`; robots that are no longer in the team, or begin anew, are dismissed."""
        self.compiled = epoch.compiled
        self._number += 1
        self._crew.reap()
        given = epoch.parts(self._protocol)
        gone = [name for name in self._crew.robots if name not in given or name in epoch.restarted]
        left = sorted({*gone, *epoch.restarted, *self._lost})
        for name in gone:
            self._crew.dismiss(name)
        self._enter_epoch(epoch.team.order)
        self._waiting = {}
        for name, part in given.items():
            robot = self._crew.robots.get(name)
            if robot is None:
                self._waiting[name] = part
            elif robot.ended:  # after its report, so that the epoch before could do without it
                self._lose(name, robot.fate())
            else:
                robot.report = None
                self._tell(robot, Change(self._number, sealed(part, epoch.void), left))

    def close(self) -> None:
        """End all processes."""
        self._crew.end_all()

    @property
    def _broken_off(self) -> bool:
        """Whether the search has to end without a verdict: robots were lost, or there were messages enough."""
        return bool(self._lost) or (self._enough is not None and self._counters.sent >= self._enough)

    # Beginning

    def _launch(self, deadline: float | None) -> None:
        """Start the processes, as long as there is time. Raises `UnsupportedError` when the system allows fewer."""
        waiting, self._waiting = self._waiting, {}
        if not waiting:
            return
        self._crew.make_room(len(waiting) + len(self._crew.robots))
        with garbage_frozen():
            for part in waiting.values():
                if over(deadline):
                    break
                self._start(part)
                self._see_ends()

    def _start(self, part: AgentProblem) -> None:
        observed = self._observer is not None
        try:
            self._crew.start(Beginning(part, self._protocol, self._number, observed))
        except OSError as error:
            raise UnsupportedError(
                f"the system lets only {len(self._crew.robots)} of {len(part.order)} robots have a process:"
                f" {error.strerror} (raise its limits, see 'ulimit -n' and 'ulimit -u', or use the simulator)"
            ) from error

    # The loop

    def _wait_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve the robots until `done()` or the deadline; raises `RobotsLostError` as soon as one is lost for good."""
        while not done():
            now = time.monotonic()
            if over(deadline):
                return
            for robot in self._crew.speakers(TICK_S if deadline is None else min(TICK_S, deadline - now)):
                for word in self._crew.words(robot):
                    self._hear(robot, word)
                self._see_ends()  # after each, as robots may have much to say, and the machine may be busy
                if over(deadline):
                    return
            self._see_ends()
            if now - self._looked >= TICK_S:
                self._looked = now
                self._look_after(now)
            if self._searching:
                self._ask_around(now)

    def _look_after(self, now: float) -> None:
        """Robots that die, or have been stopped for too long, are given up: of those that have not reported."""
        found = self._crew.in_condition(Condition.DIES, Condition.STOPPED)
        self._give_up([robot for robot in found[Condition.DIES] if robot.report is None])
        silent = [robot.name for robot in found[Condition.STOPPED] if robot.report is None]
        lost = self._stopped.look(silent, now)
        if lost and not self._survive:
            raise RobotsLostError(lost)  # and they are killed, as all are
        for name, why in lost.items():
            self._lose(name, why)

    def _see_ends(self) -> None:
        """Some processes have ended: without a report, a robot is lost."""
        dead = []
        for robot, words in self._crew.ended():
            for word in words:
                self._hear(robot, word)
            if robot.report is None:
                dead.append(robot)
        self._give_up(dead)

    def _give_up(self, dead: Collection[RobotLink]) -> None:
        """Robots are `dead`: end the run and raise `RobotsLostError`, unless the others are to go on."""
        if not dead:
            return
        if not self._survive:
            # To be gone takes a turn of the processor, which a busy machine gives late; the others make room.
            for robot in self._crew.robots.values():
                if robot not in dead:
                    robot.process.kill()
        fates = {robot.name: robot.fate() for robot in dead}
        for robot in dead:
            for word in robot.last_words():
                self._hear(robot, word)
        if not self._survive:
            raise RobotsLostError(fates)
        for name, why in fates.items():
            self._lose(name, why)

    def _lose(self, name: str, why: str) -> None:
        """Go on without the robot; what it has claimed is void."""
        if name in self._lost:
            return
        self._lost[name] = why
        self._crew.dismiss(name, kill=True)
        self._observe(Lost(t=self._now(), robot=name, why=why))

    def _hear(self, robot: RobotLink, word: FromRobot) -> None:
        if isinstance(word, OfEpoch) and word.epoch != self._number:
            return
        match word:
            case Ready():
                self._absent.discard(robot.name)
                self._observe(Registered(t=self._now(), robot=robot.name))
            case OpenQueues(receivers):
                self._open_queues(robot, receivers)
            case Counters(_, wave, sent, received):
                self._counters.answer(robot.name, wave, Counts(sent, received))
            case Conclusion(_, verdict):
                self._conclude(robot.name, verdict)
            case Events(events):
                for event in events:
                    self._observe(event)
            case Report():
                robot.report = word
            case Failed(why, unsupported, elsewhere):
                refusal = TooLargeError if elsewhere else UnsupportedError
                raise refusal(why) if unsupported else RobotsLostError({robot.name: why})
            case never:
                assert_never(never)

    def _conclude(self, name: str, verdict: str) -> None:
        """Take in that the robot `name` alone can tell the verdict. Raises `RobotsLostError` for one that it cannot."""
        fault = self._protocol.traits.fault_of_conclusion(verdict)
        if fault:
            raise RobotsLostError({name: fault})
        self._verdict, self._witness = Verdict(verdict), name

    def _open_queues(self, sender: RobotLink, receivers: Sequence[str]) -> None:
        if sender.name not in self._crew.robots:
            return
        known = [name for name in receivers if name in self._crew.robots]
        strangers = [name for name in receivers if name not in known and name not in self._lost]
        if strangers:
            raise RobotsLostError(
                {sender.name: f"it wanted to talk to {strangers[0]!r}, which is no robot of the team"}
            )
        self._crew.open_queues(sender, known)

    def _ask_around(self, now: float) -> None:
        """Begin a wave when it could show that all is quiet, or when somebody waits for news."""
        if self._counters.quiescent:
            self._verdict = self._verdict or Verdict.SOLUTION
        elif self._counters.due or (self._enough is not None and not self._counters.waving):
            self._tell_all(Wave(self._counters.begin_wave()))
        elif self._progress and now - self._shown >= TICK_S:
            self._shown = now
            self._progress(Progress(self._counters.sent, self._now()))
            if not self._counters.waving:
                self._tell_all(Wave(self._counters.begin_wave()))

    # The end of an epoch

    def _finish(self, began: float, *, late: bool) -> RunResult:
        """Say that the search is over, and collect everybody's report."""
        wall_s = time.monotonic() - began
        self._tell_all(Pause())
        self._await_reports(late=late)
        silent = self._silent()
        if silent and not late and not (self._verdict is None and over(self._deadline)):
            if not self._survive:
                raise RobotsLostError(dict.fromkeys(silent, "it did not report at the end"))
            for name in silent:
                self._lose(name, "it did not report at the end")
        reports = {name: robot.report for name, robot in self._crew.robots.items() if robot.report is not None}
        result = RunResult.of(
            Verdict.UNKNOWN if self._lost or self._verdict is None else self._verdict,
            None if self._lost else self._witness,
            {name: report.assignment for name, report in reports.items()},
            [report.metrics for report in reports.values()],
            wall_s,
        )
        findings = {name: report.findings for name, report in reports.items()}
        return replace(result, lost=dict(self._lost), findings=findings)

    def _await_reports(self, *, late: bool) -> None:
        """Who computes while there is no verdict is only busy: it is waited for, until the time is over.

        So is who is stopped, until patience is. With a verdict nobody is waited for longer than `BUSY_WORDS_S`.
        """
        began = time.monotonic()
        while True:
            now = time.monotonic()
            patience = now + (LATE_WORDS_S if late else LAST_WORDS_S)
            if self._deadline is not None:
                patience = min(patience, max(self._deadline, now + LATE_WORDS_S))
            self._wait_until(lambda: not self._silent(), patience)
            silent = [self._crew.robots[name] for name in self._silent()]
            if late or over(self._deadline):
                return
            if any(robot.condition() is Condition.STOPPED for robot in silent):
                continue
            enough = self._verdict is not None and time.monotonic() - began > BUSY_WORDS_S
            if enough or not any(robot.is_computing for robot in silent):
                return

    def _silent(self) -> list[str]:
        return [name for name, robot in self._crew.robots.items() if robot.report is None]

    # Small things

    def _tell_all(self, order: FromParent) -> None:
        for robot in list(self._crew.robots.values()):
            self._tell(robot, order)

    def _tell(self, robot: RobotLink, order: FromParent) -> None:
        try:
            robot.tell(order)
        except RobotsLostError as deaf:
            if not self._survive:
                raise
            self._lose(robot.name, deaf.robots[robot.name])

    def _observe(self, event: AnyEvent) -> None:
        if self._observer:
            self._observer(event)

    def _now(self) -> float:
        return time.monotonic() - self._began
