"""The runtime across machines, in virtual time: the real master and robots. Frames arrive late or not at all."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import patch

import msgspec

from robochoc.authority.admission import InMemoryAuthority
from robochoc.authority.identity import Identity
from robochoc.communication.control import Counters, Ready, RobotFailed
from robochoc.communication.network.control_messages import CheckResult, DetailedReport, ToRobot
from robochoc.communication.network.framing import MASTER, Framing
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Inbox, Item, PresenceChanged
from robochoc.communication.network.master import Master
from robochoc.communication.network.master_connection import MasterConnection
from robochoc.communication.network.members import NetworkMembers, reach
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.quotas import NEIGHBOUR_SHARE, ROBOT_SHARE
from robochoc.communication.network.robot import CHECK_S, NetworkRobot, RunOverError
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.settings import PATIENCE_S, NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.robot_loop import IDLE_S
from robochoc.communication.search_result import RobotsLostError
from robochoc.journal.events import Observer
from robochoc.model.orders import OrderError, with_order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.findings import Findings
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.compatibility.team_rules import refuse_unfit
from robochoc.run.distributed import solve_distributed
from robochoc.run.improvement import Audience
from robochoc.run.networked.machines import Machines, claimed, registered_team
from robochoc.run.registry import protocol_or_stage
from robochoc.solver.compiled_team import CompiledRobot, ensure_compiled
from robochoc.solver.errors import TooLargeError, UnsupportedError
from tests.simulation.plan import Fault, FaultKind, Plan
from tests.simulation.virtual_system import VirtualSystem
from tests.support import traitors

LEASE_S = 10.0
"""The silence on a link after which the router reports that a robot is absent."""
GATHER_S = 10_000.0
LIES: tuple[Callable[[], traitors.Lie], ...] = (
    lambda: traitors.concluding("no-solution"),
    lambda: traitors.concluding("optimal"),
    lambda: traitors.concluding("no-solution", at=Ready),
    traitors.keeping_awake,
    traitors.alternating,
    lambda: traitors.saying_nothing_of(Counters),
    lambda: traitors.saying_nothing_of(CheckResult),
    lambda: traitors.reporting(lambda one: msgspec.structs.replace(one, assignment={})),
    lambda: traitors.reporting(lambda one: msgspec.structs.replace(one, assignment=dict.fromkeys(one.assignment, 1))),
    lambda: traitors.judging(lambda one: msgspec.structs.replace(one, allowed=True, cost=0)),
    lambda: traitors.counting(lambda count: count + 1),
    lambda: traitors.spending(checks=2**53),
    lambda: traitors.finding(Findings(bound=10**6)),
    traitors.leaving,
    lambda: traitors.leaving(at=DetailedReport),
)
"""The lies of traitors. Some have a state, so that each run needs its own."""


class VirtualNetwork:
    """The links between all participants."""

    def __init__(self, system: VirtualSystem, plan: Plan) -> None:
        self.system = system
        self.plan = plan
        self.inboxes: dict[str, Inbox] = {}
        self.robots: dict[str, VirtualMachine] = {}
        self._last_s: dict[tuple[str, str], float] = {}
        self._waiting: dict[tuple[str, str], deque[Item]] = {}
        self._cut_until: dict[str, float] = {}
        self._to_lose: dict[str, int] = {}
        self._authority = InMemoryAuthority(plan.team.order) if plan.options.filters else None
        self.revoked: set[str] = set()

    def identity(self, name: str) -> Identity:
        """Return the identity of a robot, which only filters of messages need."""
        return self._authority.identity(name) if self._authority else cast("Identity", None)

    def now(self) -> float:
        """Return the virtual time."""
        return self.system.clock.now

    def add(self, name: str) -> Inbox:
        """Add a participant, and return its inbox."""
        share = ROBOT_SHARE if name == MASTER else NEIGHBOUR_SHARE
        self.inboxes[name] = Inbox(lambda _sender: share, self.now)
        return self.inboxes[name]

    def send(self, sender: str, receiver: str, content: bytes) -> None:
        """Send a frame. It arrives after those before it, or a report of its loss does."""
        item: Item = FrameArrived(sender, content)
        if self._to_lose.get(sender, 0) > 0:
            self._to_lose[sender] -= 1
            item = FramesLost(sender, 1)
        self._deliver(sender, receiver, item)

    def _deliver(self, sender: str, receiver: str, item: Item) -> None:
        edge, system = (sender, receiver), self.system
        cut_s = max(self._cut_until.get(sender, 0.0), self._cut_until.get(receiver, 0.0))
        arrival = max(self.now() + system.chance.random() * self.plan.delay_s, cut_s, self._last_s.get(edge, 0.0))
        self._last_s[edge] = arrival
        waiting = self._waiting.setdefault(edge, deque())
        waiting.append(item)  # events at the same time happen in any order
        system.at(arrival, lambda: self._arrive(receiver, waiting.popleft()))

    def _arrive(self, receiver: str, item: Item) -> None:
        if receiver in self.inboxes:
            self.inboxes[receiver].put(item)
        if receiver in self.robots:
            self.robots[receiver].wake()

    def is_cut(self, name: str) -> bool:
        """Return whether the robot has no link."""
        return self.now() < self._cut_until.get(name, 0.0)

    def cut(self, name: str, for_s: float) -> None:
        """Cut the link of a robot for some seconds. Its absence is noticed after a lease."""
        self._cut_until[name] = self.now() + for_s
        self.absent(name, for_s)

    def absent(self, name: str, for_s: float) -> None:
        """Let the router report that a robot is absent, if it is for longer than a lease, and that it is back."""
        if for_s > LEASE_S:
            self.system.at(self.now() + LEASE_S, lambda: self._arrive(MASTER, PresenceChanged(name, there=False)))
            if for_s < math.inf:
                self.system.at(self.now() + for_s, lambda: self._return(name))

    def _return(self, name: str) -> None:
        """Let the router report that a robot is back, unless there is another reason for its absence."""
        machine = self.robots[name]
        if machine.is_alive and not (self.is_cut(name) or self.now() < machine.stopped_until):
            self._arrive(MASTER, PresenceChanged(name, there=True))

    def lose(self, name: str, frames: int) -> None:
        """Lose the next frames of a robot."""
        self._to_lose[name] = frames


class VirtualTransport:
    """The connection of one robot; see `Transport`."""

    def __init__(self, network: VirtualNetwork, name: str) -> None:
        self.name = name
        self.inbox = network.add(name)
        self._network = network

    @property
    def router(self) -> str:
        """See `Transport.router`."""
        return "" if self._network.is_cut(self.name) else "router"

    def send(self, receiver: str, content: bytes) -> None:
        """See `Transport.send`."""
        self._network.send(self.name, receiver, content)


class VirtualMachine:
    """A robot's program on its machine. It ends as `NetworkRobot.run` does, without a wait for the last order."""

    def __init__(self, network: VirtualNetwork, own: CompiledRobot) -> None:
        name = own.robot.name
        self._network = network
        self._transport = VirtualTransport(network, name)
        patience_s = network.plan.options.patience or PATIENCE_S
        self._robot = NetworkRobot(
            own,
            network.identity(name),
            cast("Transport", self._transport),
            protocol_or_stage,
            RobotSettings(patience_s=patience_s),
        )
        self.is_alive = True
        self.ended = ""
        self.stopped_until = 0.0
        self.step_s = 0.0
        self._busy_until = 0.0
        self._due: float | None = None
        network.robots[name] = self
        network.system.at(network.now() + network.system.chance.random(), self._begin)

    def _begin(self) -> None:
        if self.is_alive:
            self._do(self._robot._registration.send)  # noqa: SLF001 - as in `run`

    def wake(self) -> None:
        """Let the robot run once it can."""
        self._wake_at(self._network.now())

    def _wake_at(self, time_s: float) -> None:
        time_s = max(time_s, self._busy_until, self.stopped_until)
        if self.is_alive and (self._due is None or time_s < self._due):
            self._due = time_s
            self._network.system.at(time_s, lambda: self._run(time_s))

    def _run(self, due: float) -> None:
        if not self.is_alive or self._due != due:
            return
        self._due = None
        if self._network.now() < max(self._busy_until, self.stopped_until):
            self.wake()
            return
        items = []
        while not self._transport.inbox.empty():
            items.append(self._transport.inbox.get_nowait())
        self._do(lambda: self._robot._turn(items))  # noqa: SLF001 - as in `run`

    def _do(self, step: Callable[[], None]) -> None:
        try:
            step()
        except RunOverError as over:
            self._end(over.why)
        except UnsupportedError as refusal:
            self._fail(RobotFailed(str(refusal), unsupported=True, elsewhere=isinstance(refusal, TooLargeError)))
        except Exception as error:  # noqa: BLE001 - as in `run`
            self._fail(RobotFailed(f"{type(error).__name__}: {error}"))
        self._busy_until = self._network.now() + self.step_s
        searcher = self._robot._searcher  # noqa: SLF001 - as in `run`
        restless = searcher is not None and searcher.is_restless
        self._wake_at(self._network.now() + (IDLE_S if restless else CHECK_S))

    def _fail(self, message: RobotFailed) -> None:
        self._robot._send_to_master(message)  # noqa: SLF001 - as in `run`
        self._end(message.why)

    def _end(self, why: str) -> None:
        if self.is_alive:
            self.is_alive, self.ended = False, why
            self._network.absent(self._transport.name, math.inf)

    def arm(self, fault: Fault) -> None:
        """Let a fault happen at its time."""
        network, name = self._network, fault.robot

        def stop() -> None:
            self.stopped_until = network.now() + fault.for_s
            network.absent(name, fault.for_s)

        actions: dict[FaultKind, Callable[[], None]] = {
            FaultKind.CRASH: lambda: self._end("crash"),
            FaultKind.STOP: stop,
            FaultKind.PARTITION: lambda: network.cut(name, fault.for_s),
            FaultKind.LOSS: lambda: network.lose(name, fault.size),
            FaultKind.SLOW: lambda: setattr(self, "step_s", fault.for_s),
            FaultKind.REVOKE: lambda: network.revoked.add(name),
        }
        if fault.kind in actions:
            network.system.at(fault.at_s, actions[fault.kind])


class VirtualConnection(MasterConnection):
    """The master's connection, without a router, certificates and sniffers."""

    def __init__(self, network: VirtualNetwork, run: str, *arguments: Any) -> None:  # noqa: ANN401 - as in the base class
        self._network = network
        self._events = arguments[-1]
        self._inbox = network.add(MASTER)
        self.framing = Framing(MASTER, run)
        policy = SimpleNamespace(
            is_robot=lambda name: name not in network.revoked,
            open_ways=lambda _ways: None,
            follow=self._exclude,
            revoked=lambda names: [name for name in names if name in network.revoked],
            failure="",
        )
        self.policy = cast("Any", policy)
        self.journal_server = cast("Any", SimpleNamespace(lagging=False, publication=None))

    def _exclude(self) -> None:
        """Close the links of the robots whose names were revoked, as the router does with new rules."""
        for name in self._network.revoked:
            self._network.cut(name, math.inf)

    def open(self) -> None:
        """See `MasterConnection.open`."""

    def close(self) -> None:
        """See `MasterConnection.close`."""

    def wake(self) -> None:
        """See `MasterConnection.wake`."""

    def follow_registry(self) -> None:
        """See `MasterConnection.follow_registry`."""

    def send(self, name: str, message: ToRobot) -> None:
        """See `MasterConnection.send`."""
        self._network.send(MASTER, name, self.framing.write(name, message))

    def receive(self, patience_s: float) -> Item | None:
        """See `MasterConnection.receive`."""
        system = self._network.system
        if self._inbox.empty():
            system.run_until(system.clock.now + patience_s, lambda: not self._inbox.empty())
        return None if self._inbox.empty() else self._inbox.get_nowait()


@contextmanager
def virtual_network(plan: Plan, network: VirtualNetwork) -> Iterator[None]:
    """Let a master use the virtual network, and a traitor lie."""
    with ExitStack() as patches:
        connection = partial(VirtualConnection, network)
        patches.enter_context(patch("robochoc.communication.network.master_control.MasterConnection", connection))
        patches.enter_context(patch("robochoc.communication.network.searcher.own_memory", lambda: 0))
        for fault in plan.faults:
            if fault.kind is FaultKind.LIE:

                def put(owner: type, name: str, value: object) -> None:
                    patches.enter_context(patch.object(owner, name, value))

                traitors.install(LIES[fault.size % len(LIES)](), fault.robot, put)
        yield


def solve_on_network(plan: Plan, network: VirtualNetwork, observer: Observer, audience: Audience) -> Outcome:
    """Let the robots of the plan register with a master, search and leave, as `run_master` does. Raises its errors."""
    options = plan.options
    try:
        compiled = ensure_compiled(with_order(plan.team, options.order, options.seed))
    except OrderError as error:
        raise UnsupportedError(str(error)) from None
    team = compiled.team
    protocol = protocol_or_stage(options.protocol)
    refuse_settings(options.protocol, protocol, options.settings)
    refuse_options(options, private=plan.private)
    patience_s = options.patience or PATIENCE_S
    settings = NetworkSettings(options.filters, plan.private, patience_s, survive=options.survives_losses)
    profiles = {robot.name: profile_of(robot) for robot in team.robots}
    ways = reach(profiles, writes_to_non_neighbours=protocol.traits.writes_to_non_neighbours)
    members = NetworkMembers(team.order, order=team.order, ways=ways)
    master = Master(
        cast("Any", None),
        cast("Any", SimpleNamespace(name=MASTER)),
        "",
        members,
        settings,
        observer=observer,
        watched=True,
    )
    machines = {robot.name: VirtualMachine(network, compiled.robots[robot.name]) for robot in team.robots}
    for fault in plan.faults:
        if fault.robot in machines:
            machines[fault.robot].arm(fault)
    with master:
        outcome = _search(plan, master, observer, audience)
        master.leave("the run is over")
    return outcome


def _search(plan: Plan, master: Master, observer: Observer, audience: Audience) -> Outcome:
    options = plan.options
    if not master.gather(GATHER_S):
        raise RobotsLostError({MASTER: "the team is not complete"})
    team: Team = registered_team(master, plan.team.name)
    protocol = protocol_or_stage(options.protocol)
    refuse_unfit(team, options, protocol.traits)
    run = Machines(master, options, plan.team.name, observer, audience)
    header = Outcome(
        Verdict.UNKNOWN, team=plan.team.name, protocol=options.protocol, runtime=options.runtime, seed=options.seed
    )
    return claimed(solve_distributed(run, protocol, header))
