"""The runtime with processes, in virtual time: the real master (`ProcessesRun`) with virtual processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from unittest.mock import patch

import msgspec

from robochoc.communication.control import FromParent, FromRobot, QueueFrom, QueuesTo
from robochoc.communication.processes.process_status import ProcessStatus
from robochoc.communication.processes.queues import unpack
from robochoc.communication.processes.robot_process import RobotStart
from robochoc.model.problem import AddAgent, Robot, Team
from tests.simulation.plan import Fault, FaultKind, Plan
from tests.simulation.virtual_system import Pipe, VirtualControlPipe, VirtualProcess, VirtualSystem, VirtualWatch

_FROM_ROBOT = msgspec.msgpack.Decoder(FromRobot)
_MOST_BYTES = 1 << 30


class VirtualLink:
    """The master's connection to a robot; see `RobotLink`."""

    def __init__(self, system: VirtualSystem, start: RobotStart) -> None:
        self.control = VirtualControlPipe(system)
        self.process = VirtualProcess(system, start, self.control)
        self.name = self.process.name
        self.ended = False
        self._system = system
        self._buffer = bytearray()
        self.inbox = system.pipe_of(self.control.up[0])

    def receive(self) -> list[FromRobot]:
        """See `RobotLink.receive`."""
        return self._read(late=False)

    def receive_rest(self) -> list[FromRobot]:
        """See `RobotLink.receive_rest`."""
        return self._read(late=True)

    def _read(self, *, late: bool) -> list[FromRobot]:
        try:
            self._buffer += self.inbox.read(_MOST_BYTES, late=late)
        except BlockingIOError:
            return []
        return [_FROM_ROBOT.decode(body) for body in unpack(self._buffer)]

    @property
    def has_news(self) -> bool:
        """True if messages have arrived."""
        return self.inbox.is_readable and not self.hung_up

    @property
    def hung_up(self) -> bool:
        """See `RobotLink.hung_up`."""
        return self.inbox.is_at_its_end

    def send(self, order: FromParent, fds: Sequence[int] = ()) -> None:
        """See `RobotLink.send`."""
        try:
            self.control.order(order, fds)
        except (BrokenPipeError, KeyError):
            for fd in fds:
                self._system.close(fd)
        else:
            self.process.queues += fds

    @property
    def status(self) -> ProcessStatus:
        """See `RobotLink.status`."""
        if self.process.is_dying:
            return ProcessStatus.DYING
        return ProcessStatus.STOPPED if self.process.is_stopped else ProcessStatus.RUNNING

    @property
    def is_computing(self) -> bool:
        """See `RobotLink.is_computing`."""
        return self.process.is_computing

    def describe_end(self) -> str:
        """See `RobotLink.describe_end`."""
        return f"its process ended with the code {self.process.exitcode}"


class VirtualPool:
    """The processes of a team; see `ProcessPool`."""

    def __init__(self, system: VirtualSystem, plan: Plan, _start_method: str = "fork") -> None:
        self.robots: dict[str, VirtualLink] = {}
        self._system = system
        self._plan = plan
        self._queues: dict[tuple[str, str], Pipe] = {}

    def make_room(self, robots: int) -> None:
        """See `ProcessPool.make_room`."""

    def reap(self) -> None:
        """See `ProcessPool.reap`."""

    def start(self, starts: Sequence[RobotStart]) -> None:
        """See `ProcessPool.start`."""
        for start in starts:
            link = VirtualLink(self._system, start)
            self.robots[link.name] = link
            for fault in self._plan.faults:
                if fault.robot == link.name:
                    self._arm(link.process, fault)

    def _arm(self, process: VirtualProcess, fault: Fault) -> None:
        """Let a fault happen to the process at its time, or now if it is a property of the process."""
        now = self._system.clock.now

        def stop() -> None:
            process.stopped_until = self._system.clock.now + fault.for_s

        def hold() -> None:
            for edge, pipe in self._queues.items():
                if process.name in edge:
                    pipe.held_until = self._system.clock.now + fault.for_s

        match fault.kind:
            case FaultKind.SLOW:
                process.step_s = fault.for_s
            case FaultKind.GARBLE:
                process.garbled = fault.size
            case FaultKind.CRASH if fault.at_s >= now:
                self._system.at(fault.at_s, process.kill)
            case FaultKind.STOP if fault.at_s >= now:
                self._system.at(fault.at_s, stop)
            case FaultKind.PARTITION if fault.at_s >= now:
                self._system.at(fault.at_s, hold)
            case _:
                pass

    def readable(self, patience_s: float) -> list[VirtualLink]:
        """See `ProcessPool.readable`."""
        system = self._system

        def found() -> list[VirtualLink]:
            return [link for link in self.robots.values() if link.has_news]

        def done() -> bool:
            return any(link.has_news or self._has_ended(link) for link in self.robots.values())

        system.run_until(system.clock.now + patience_s, done)
        links = found()
        system.chance.shuffle(links)
        return links

    @staticmethod
    def _has_ended(link: VirtualLink) -> bool:
        return link.process.exitcode is not None and not link.ended

    def receive(self, link: VirtualLink) -> list[FromRobot]:
        """See `ProcessPool.receive`."""
        return link.receive() if self.robots.get(link.name) is link else []

    def ended(self) -> Iterator[tuple[VirtualLink, list[FromRobot]]]:
        """See `ProcessPool.ended`."""
        for link in [link for link in self.robots.values() if self._has_ended(link)]:
            link.ended = True
            yield link, link.receive_rest()

    def with_status(self, *statuses: ProcessStatus) -> dict[ProcessStatus, list[VirtualLink]]:
        """See `ProcessPool.with_status`."""
        return {status: [one for one in self.robots.values() if one.status is status] for status in statuses}

    def open_queues(self, sender: VirtualLink, receivers: Sequence[str]) -> None:
        """See `ProcessPool.open_queues`."""
        writers = []
        for name in receivers:
            reader, writer = self._system.open_pipe(self._plan.delay_s)
            self._queues[sender.name, name] = self._system.pipe_of(reader)
            self.robots[name].send(QueueFrom(sender.name), [reader])
            writers.append(writer)
        sender.send(QueuesTo([*receivers]), writers)

    def dismiss(self, name: str, *, kill: bool = False) -> None:
        """See `ProcessPool.dismiss`."""
        link = self.robots.pop(name)
        if kill:
            link.process.kill()
        self._system.close(link.control.down[1])
        self._system.close(link.control.up[0])

    def end_all(self, _reported: Callable[[str], bool]) -> None:
        """See `ProcessPool.end_all`."""
        for name in [*self.robots]:
            self.dismiss(name, kill=True)


def _read_again(team: Team, path: Path, *_arguments: object) -> Robot:
    """Return the robot whose file is at `path`: the files have not changed."""
    joining = [change.robot for event in team.scenario for change in event.changes if isinstance(change, AddAgent)]
    for robot in (*team.robots, *joining):
        if robot.name == path.name:
            return robot
    raise FileNotFoundError(path)


@contextmanager
def virtual_processes(plan: Plan, system: VirtualSystem) -> Iterator[None]:
    """Let runs with processes use virtual ones."""
    processes = "robochoc.communication.processes"
    replaced: dict[str, object] = {
        f"{processes}.queues.os": system,
        f"{processes}.robot_process.DescriptorWatch": partial(VirtualWatch, system),
        f"{processes}.robot_process.resident_memory": lambda: 0,
        f"{processes}.robot_process.own_memory": lambda: 0,
        f"{processes}.processes.ProcessPool": partial(VirtualPool, system, plan),
        "robochoc.run.scenario.read_robot_again": partial(_read_again, plan.team),
    }
    with ExitStack() as patches:
        for name, stand_in in replaced.items():
            patches.enter_context(patch(name, stand_in))
        yield
