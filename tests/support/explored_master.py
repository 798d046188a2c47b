"""The master of the runtime of processes, step by step.

The code that runs is that of `ProcessesRun`, and of everything above it. Only the operating system is replaced. A step
begins when messages or the end of a process arrive, and lasts until the master waits again. The master is a loop, so
its state is rebuilt from its inputs so far; each step is computed once for each state.
"""

# ruff: noqa: SLF001 - the state of the code under test is private
from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, ClassVar, NamedTuple, cast

import msgspec

from robochoc.communication.control import FromParent, FromRobot, QueueFrom, QueuesTo
from robochoc.communication.network.control_messages import DetailedReport
from robochoc.communication.processes.process_status import ProcessStatus
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.processes.robot_process import RobotStart
from robochoc.exploration.state_key import content_key
from robochoc.model.outcome import Verdict
from robochoc.protocols.protocol import Protocol

_ROBOT = msgspec.msgpack.Decoder(FromRobot | DetailedReport)
_ATOMS = (int, str, float, bool, type(None))


class Arrived(NamedTuple):
    """Messages that the master reads at once: pairs of a process and its messages."""

    reports: tuple[tuple[str, tuple[bytes, ...]], ...]


class Ended(NamedTuple):
    """The end of a process, and its messages that were still in the pipe."""

    process: str
    rest: tuple[bytes, ...]


class Passed(NamedTuple):
    """Time in which nothing arrives."""

    seconds: float


Input = Arrived | Ended | Passed


class Output(NamedTuple):
    """An effect of a step: a message, a queue, or the start or end of a process.

    Attributes:
        kind: `spawn`, `order`, `kill` or `close` (of a control pipe), all by the master; `report`, `put` (into a queue)
            or `shut` (a queue), all by a robot.
        to: The process or the queue.
        content: The message.
        ends: The queues whose ends are attached.
    """

    kind: str
    to: str
    content: bytes = b""
    ends: tuple[str, ...] = ()


class MasterView(NamedTuple):
    """A state of the master, as far as properties and other steps depend on it.

    `order` are the robots of the search, `links` the processes to which the master listens. `is_limited`: there is a
    limit on messages. `result`: what the program has returned, if it has ended.
    """

    epoch: int = 0
    order: tuple[str, ...] = ()
    links: frozenset[str] = frozenset()
    lost: tuple[str, ...] = ()
    quiescent: bool = False
    verdict: Verdict | None = None
    witness: str | None = None
    waves: int = 0
    is_limited: bool = False
    has_ended: bool = False
    result: Any = None


class Step(NamedTuple):
    """The number of the next state, and the effects. `fault`: why the step is wrong; empty if it is not."""

    state: int
    outputs: tuple[Output, ...] = ()
    fault: str = ""


class _WaitingError(BaseException):
    """The master waits for an input that is still to be chosen. Not an `Exception`: no code under test handles it."""


class _Link:
    """Replaces `RobotLink` and its process."""

    ended = False
    is_computing = False
    status = ProcessStatus.RUNNING

    def __init__(self, script: Script, name: str, process: str) -> None:
        self._script, self.name, self.id = script, name, process
        self.process = self
        self.arrived: tuple[bytes, ...] = ()

    def send(self, order: FromParent, fds: Sequence[str] = ()) -> None:
        self._script.outputs.append(Output("order", self.id, msgspec.msgpack.encode(order), tuple(fds)))

    def receive(self) -> list[FromRobot]:
        bodies, self.arrived = self.arrived, ()
        return [_ROBOT.decode(body) for body in bodies]

    receive_rest = receive

    def kill(self) -> None:
        self._script.outputs.append(Output("kill", self.id))

    def describe_end(self) -> str:
        return "its process was killed"


_PROTOCOLS: list[type[Protocol]] = []
"""The protocols that have run in this process: classes of tests cannot be pickled."""


def start_bytes(start: RobotStart) -> bytes:
    """Return the arguments of a robot's process as bytes: equal bytes, equal robots."""
    if start.protocol not in _PROTOCOLS:
        _PROTOCOLS.append(start.protocol)
    return pickle.dumps((start.part, _PROTOCOLS.index(start.protocol), start.epoch))


def start_of(content: bytes) -> RobotStart:
    """Return the arguments in `content`, which `start_bytes` has written."""
    part, number, epoch = pickle.loads(content)  # noqa: S301 - written here
    return RobotStart(part, _PROTOCOLS[number], epoch, observed=False)


class Script:
    """The inputs of the master so far, the clock, and the effects since the last input."""

    def __init__(self, inputs: Sequence[Input]) -> None:
        self._left = iter(inputs)
        self.now = 1000.0
        self.outputs: list[Output] = []
        self.spawned: dict[str, int] = {}
        self.run: ProcessesRun | None = None
        self.is_waiting = False

    def next(self) -> Input:
        for one in self._left:
            self.outputs.clear()
            return one
        self.is_waiting = True
        raise _WaitingError


class Pool:
    """Replaces `ProcessPool`."""

    def __init__(self, script: Script) -> None:
        self._script = script
        self.robots: dict[str, _Link] = {}
        self._ended: list[_Link] = []
        self._queues: dict[str, int] = {}

    def make_room(self, robots: int) -> None:
        pass

    def reap(self) -> None:
        pass

    def start(self, starts: Sequence[RobotStart]) -> None:
        for start in starts:
            name = start.part.robot.name
            number = self._script.spawned[name] = self._script.spawned.get(name, 0) + 1
            link = self.robots[name] = _Link(self._script, name, f"{name}.{number}")
            self._script.outputs.append(Output("spawn", link.id, start_bytes(start)))

    def readable(self, _patience_s: float) -> list[_Link]:
        by_process = {link.id: link for link in self.robots.values()}
        match self._script.next():
            case Arrived(reports):
                for process, bodies in reports:
                    by_process[process].arrived = bodies
                return [by_process[process] for process, _ in reports]
            case Ended(process, rest):
                link = by_process[process]
                link.arrived, link.ended = rest, True
                self._ended.append(link)
            case Passed(seconds):
                self._script.now += seconds
        return []

    def receive(self, robot: _Link) -> list[FromRobot]:
        return robot.receive() if self.robots.get(robot.name) is robot else []

    def ended(self) -> Iterator[tuple[_Link, list[FromRobot]]]:
        ended, self._ended = self._ended, []
        for robot in ended:
            yield robot, robot.receive()

    def with_status(self, *statuses: ProcessStatus) -> dict[ProcessStatus, list[_Link]]:
        return {status: [] for status in statuses}

    def open_queues(self, sender: _Link, receivers: Sequence[str]) -> None:
        queues = []
        for name in receivers:
            pair = f"{sender.id}>{self.robots[name].id}"
            self._queues[pair] = self._queues.get(pair, 0) + 1
            queues.append(f"{pair}#{self._queues[pair]}")
            self.robots[name].send(QueueFrom(sender.name), queues[-1:])
        sender.send(QueuesTo(list(receivers)), queues)

    def dismiss(self, name: str, *, kill: bool = False) -> None:
        robot = self.robots.pop(name)
        self._ended = [one for one in self._ended if one is not robot]
        if kill:
            robot.kill()
        self._script.outputs.append(Output("close", robot.id))

    def end_all(self, _reported: Callable[[str], bool]) -> None:
        if self._script.is_waiting:  # the program has not ended: it continues when it is run again
            return
        for name in [*self.robots]:
            self.dismiss(name, kill=True)


class Run(ProcessesRun):
    """The real session, which its script can find."""

    script: ClassVar[Script]

    def __init__(self, *args: Any, **options: Any) -> None:  # noqa: ANN401 - as its base
        super().__init__(*args, **options)
        self.script.run = self


class Master:
    """The states of the real master by number. `program` runs it, from the first session to the result.

    Attributes:
        views: What is seen of each state.
    """

    def __init__(self, program: Callable[[], Any]) -> None:
        self._program = program
        self._inputs: list[tuple[Input, ...]] = []
        self._numbers: dict[bytes, int] = {}
        self._steps: dict[tuple[int, Input], Step] = {}
        self.views: list[MasterView] = []

    def start(self) -> Step:
        """Return the first step."""
        return self._computed(())

    def step(self, state: int, arrived: Input) -> Step:
        """Return the step from `state` on an input."""
        known = self._steps.get((state, arrived))
        if known is None:
            known = self._steps[state, arrived] = self._computed((*self._inputs[state], arrived))
        return known

    def _computed(self, inputs: tuple[Input, ...]) -> Step:
        script = Run.script = Script(inputs)
        where: object = "ended"
        result: object = None
        try:
            result = self._program()
        except _WaitingError as waiting:
            where = [*_frames(waiting.__traceback__)]
        except Exception as error:  # noqa: BLE001 - properties decide whether it is right
            result = error
        view, key = _master_state(script, where, result)
        number = self._numbers.setdefault(key, len(self._inputs))
        if number == len(self._inputs):
            self._inputs.append(inputs)
            self.views.append(view)
        return Step(number, tuple(script.outputs))


def _frames(trace: TracebackType | None) -> Iterator[tuple[object, ...]]:
    """Yield where each function of the program waits, with its local numbers and texts, and its object's."""
    while trace is not None:
        frame = trace.tb_frame
        local = {name: value for name, value in frame.f_locals.items() if isinstance(value, _ATOMS)}
        owner = frame.f_locals.get("self")
        own = {} if isinstance(owner, Pool | Script) or owner is None else _plain(vars(owner))
        yield frame.f_code.co_qualname, trace.tb_lasti, local, own
        trace = trace.tb_next


def _plain(attributes: dict[str, Any]) -> dict[str, object]:
    """Return the attributes that are numbers, texts, or collections of them."""
    found: dict[str, object] = {}
    for name, value in attributes.items():
        if isinstance(value, _ATOMS):
            found[name] = value
        elif isinstance(value, list | tuple | set | frozenset | dict) and all(isinstance(one, _ATOMS) for one in value):
            found[name] = sorted(value, key=repr) if isinstance(value, set | frozenset) else value
    return {name: value for name, value in found.items() if name != "compile_s"}


def _master_state(script: Script, where: object, result: object) -> tuple[MasterView, bytes]:
    """Return the view and the key of the master's state."""
    run = script.run
    if run is None:  # it was refused before any robot started
        return MasterView(has_ended=True, result=result), repr(result).encode()
    state, robots = run.state, cast("dict[str, _Link]", run._pool.robots)
    links = frozenset(link.id for link in robots.values() if not link.ended)
    content = {name: part for name, part in vars(state).items() if name != "_traits"}
    everything = (where, _plain(vars(run)), sorted(links), script.now, repr(result), content)
    view = MasterView(
        state.epoch,
        state.order,
        links,
        tuple(state.lost),
        state.counters.quiescent,
        state.verdict,
        state.witness,
        state.counters._wave,
        state.max_messages is not None,
        where == "ended",
        result,
    )
    return view, content_key(everything)
