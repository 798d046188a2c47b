"""A network in memory: all robots and their master run in one thread."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from queue import SimpleQueue
from typing import cast

from robochoc.authority.identity import Identity
from robochoc.communication.control import CounterWave, EpochMessage, Pause, RobotFailed
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import (
    CheckRequest,
    ControlMessage,
    DomainAnswer,
    DomainRequest,
    Joined,
    Leave,
    Objection,
    Register,
    StartSearch,
    ToRobot,
    Welcome,
)
from robochoc.communication.network.framing import MASTER, Framing
from robochoc.communication.network.inbox import FrameArrived, Item
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.transport import Transport
from robochoc.communication.search_result import SearchResult
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Robot, Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.compiled_team import CompiledRobot

RUN = "run"


class ScriptedTransport:
    """The transport of the robot `name`: `script` says what the master answers to each message.

    `heard` holds these words; what it sends to others stands in `sent`.
    """

    router = "here"

    def __init__(self, name: str, script: Callable[[ControlMessage], Iterable[Item]]) -> None:
        self.inbox: SimpleQueue[Item] = SimpleQueue()
        self.heard: list[ControlMessage] = []
        self.sent: list[tuple[str, bytes]] = []
        self._name = name
        self._script = script
        self._framing = {MASTER: Framing(MASTER, RUN)}

    def send(self, receiver: str, content: bytes) -> None:
        if receiver != MASTER:
            self.sent.append((receiver, content))
            return
        framing = self._framing[MASTER]
        opened = framing.read(self._name, content)
        framing.accept(self._name, opened.number)
        self.heard.append(opened.message)
        for item in self._script(opened.message):
            self.inbox.put(item)

    def frame(self, word: ControlMessage, sender: str = MASTER) -> FrameArrived:
        """The next frame of `sender` to the robot."""
        framing = self._framing.setdefault(sender, Framing(sender, RUN))
        return FrameArrived(sender, framing.write(self._name, word))

    def heard_of(self, kind: type[ControlMessage]) -> list[ControlMessage]:
        """The words of one kind."""
        return [word for word in self.heard if isinstance(word, kind)]


class InMemoryNetwork:
    """A team of robots whose frames stay in this thread, and a master who does no more than has to be."""

    def __init__(
        self,
        team: Team,
        protocol: type[Protocol],
        identities: dict[str, Identity] | None = None,
        filters: Sequence[str] = (),
        parameters: RunParameters = DEFAULT_PARAMETERS,
        traitor: str = "",
    ) -> None:
        self.traitor = traitor
        self.inboxes: dict[str, SimpleQueue[Item]] = {name: SimpleQueue() for name in (*team.order, MASTER)}
        self.members = NetworkMembers(team.order)
        self.state = AuditedSearchState()
        self.objections: list[Objection] = []
        self.failures: dict[str, RobotFailed] = {}
        self._protocol = protocol
        self._filters = tuple(filters)
        self._brief = parameters
        self._searching = False
        self._framing = Framing(MASTER, RUN)
        unproven = cast("Identity", None)
        self._robots = {
            robot.name: SteppedRobot(
                robot, (identities or {}).get(robot.name, unproven), InMemoryTransport(self, robot.name), protocol
            )
            for robot in team.robots
        }
        for one in self._robots.values():
            one.begin()
        self._settle()
        for name, variables in self.members.unseen().items():
            self.tell(name, DomainRequest(variables))
        self._settle()

    def search(self) -> SearchResult:
        """One search, until all is quiet."""
        state = self.state = AuditedSearchState(
            self.state.epoch + 1, self.members.order, None, self.members.declared(self._protocol.traits)
        )
        tasks = self.members.tasks(state.epoch, self._protocol.__name__, self._protocol.traits, self._brief)
        for name, task in tasks.items():
            self.tell(name, task)
        self._settle()
        if state.ready:
            self._tell_all(StartSearch(state.epoch))
            self._searching = state.ordered = True
            self._settle()
            while not (state.verdict or state.counters.quiescent or state.broken_off) and state.wave_due:
                self._tell_all(CounterWave(state.counters.start_wave()))
                self._settle()
            if state.counters.quiescent:
                state.verdict = state.verdict or Verdict.SOLUTION
        self._searching = False
        self._tell_all(Pause())
        self._settle()
        return state.result(0)

    def judge(self, values: dict[str, dict[str, int]]) -> tuple[bool, float]:
        """Have all check what was decided."""
        for name in self.members.order:
            self.tell(name, CheckRequest(self.state.epoch, self.members.neighbourhood(name, values)))
        self._settle()
        return self.state.held, self.state.cost

    def leave(self) -> dict[str, Ending]:
        """Send all home."""
        self._tell_all(Leave("over", failed=False))
        return {name: robot.run() for name, robot in self._robots.items()}

    def tell(self, name: str, word: ToRobot) -> None:
        """Say something to a robot."""
        self.inboxes[name].put(FrameArrived(MASTER, self._framing.write(name, word)))

    def _weigh(self, name: str, fault: str) -> None:
        """Who says what cannot be is lost; of nobody but the `traitor` that is to be expected."""
        if fault:
            assert name == self.traitor, (name, fault)
            self.state.lose(name, fault)

    def _tell_all(self, word: ToRobot) -> None:
        for name in self._robots:
            self.tell(name, word)

    def _settle(self) -> None:
        """Until nobody has anything to say, or a search has its verdict, after which robots may talk for ever."""
        while any(not inbox.empty() for inbox in self.inboxes.values()):
            if self._searching and self.state.verdict is not None:
                return
            for name, robot in self._robots.items():
                robot.step(_drained(self.inboxes[name]))
            for item in _drained(self.inboxes[MASTER]):
                if isinstance(item, FrameArrived):
                    self._hear(*item)
            if all(inbox.empty() for inbox in self.inboxes.values()):
                for robot in self._robots.values():
                    robot.step([])

    def _hear(self, name: str, content: bytes) -> None:
        opened = self._framing.read(name, content)
        self._framing.accept(name, opened.number)
        match opened.message:
            case Register(profile, incarnation):
                self.members.register(name, profile, incarnation)
                self.tell(name, Welcome(incarnation, RUN, self._filters, observed=False, private=False))
            case Joined(incarnation, card):
                self.members.robots[name].join(incarnation, card)
            case DomainAnswer(variables):
                self.members.robots[name].shown_later.update(variables)
            case Objection() as objection:
                self.objections.append(objection)
            case RobotFailed() as failed:
                self.failures[name] = failed
            case EpochMessage() as word:
                self._weigh(name, self.state.handle(name, word))
            case _:
                pass


class InMemoryTransport:
    """One robot's transport in the office."""

    router = "here"

    def __init__(self, office: InMemoryNetwork, name: str) -> None:
        self.inbox = office.inboxes[name]
        self._office = office
        self._name = name

    def send(self, receiver: str, content: bytes) -> None:
        self._office.inboxes[receiver].put(FrameArrived(self._name, content))


class SteppedRobot(NetworkRobot):
    """A robot whose loop is turned by hand."""

    def __init__(self, robot: Robot, identity: Identity, desk: InMemoryTransport, protocol: type[Protocol]) -> None:
        super().__init__(CompiledRobot(robot), identity, cast("Transport", desk), lambda _name: protocol)

    def begin(self) -> None:
        self._registration.send()

    def step(self, items: list[Item]) -> None:
        self._turn(items)


def _drained(inbox: SimpleQueue[Item]) -> list[Item]:
    return [inbox.get_nowait() for _ in range(inbox.qsize())]
