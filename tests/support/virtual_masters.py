"""Several masters, and robots that follow them, in virtual time: their real loops, on a network with faults.

Each master, each robot and each thread of a standby master is an `Actor`: a thread that runs only while it has the
baton, and passes the baton on whenever it waits. So a seed decides the whole run.
"""

from __future__ import annotations

import heapq
import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from queue import Empty
from random import Random
from types import SimpleNamespace
from typing import Any, NamedTuple, cast
from unittest.mock import patch

from robochoc.authority.registry import Role
from robochoc.communication.network.control_messages import StandbyAnswer, ToRobot
from robochoc.communication.network.following import follow
from robochoc.communication.network.framing import MASTER, Framing
from robochoc.communication.network.inbox import FrameArrived, Item, PresenceChanged
from robochoc.communication.network.master_connection import MasterConnection
from robochoc.communication.network.masters import Masters
from robochoc.communication.network.robot import Ending
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.robot_votes import RobotVotes
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.transport import CannotConnectError
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.run.networked.address import LOOPBACK, Address
from robochoc.run.networked.master_run import MasterPlan, run_master
from robochoc.run.networked.standby import StandbyPlan
from robochoc.run.registry import protocol_or_stage
from robochoc.solver.compiled_team import CompiledRobot, ensure_compiled
from robochoc.system.errors import RobochocError
from tests.simulation.clock import VirtualClock, virtual_time

PATIENCE_S, LOOKING_S, GATHER_S, LEASE_S = 3.0, 15.0, 20.0, 10.0
LATEST_S = 6.0
"""The latest time of a fault, in virtual seconds."""
END_S = 1000.0
"""All masters and robots have ended by then, in virtual seconds."""


class KilledError(BaseException):
    """Ends an actor whose machine was killed. Nothing may catch it."""


class Actor:
    """A thread on `machine` that runs `target` while it has the baton."""

    def __init__(self, world: World, machine: str, target: Callable[[], None]) -> None:
        self.machine = machine
        self.is_alive = True
        self.is_killed = False
        self._world = world
        self._target = target
        self._baton = threading.Semaphore(0)
        self._turn = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self.wake_at(world.now())

    def _run(self) -> None:
        self._baton.acquire()
        try:
            if not self.is_killed:
                self._target()
        except KilledError:
            pass
        except BaseException as error:  # noqa: BLE001 - the test reports it
            self._world.errors.append(error)
        self.is_alive = False
        self._world.baton.release()

    def wake_at(self, time_s: float) -> None:
        """Let the actor run at a time, unless it runs before."""
        turn = self._turn
        self._world.at(time_s, lambda: self._resume(turn))

    def _resume(self, turn: int) -> None:
        if not self.is_alive or turn != self._turn:
            return
        stopped_until = self._world.stopped.get(self.machine, 0.0)
        if self._world.now() < stopped_until and not self.is_killed:
            self.wake_at(stopped_until)
            return
        self._turn += 1
        self._world.current = self
        self._baton.release()
        self._world.baton.acquire()

    def wait(self, seconds: float) -> None:
        """Pass the baton on, until the time is over or `wake_at` is called. Raises `KilledError`."""
        self.wake_at(self._world.now() + seconds)
        self._world.baton.release()
        self._baton.acquire()
        if self.is_killed:
            raise KilledError


class VirtualInbox:
    """The received frames of an actor, which waits for them in virtual time."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._owner = world.current
        self._items: deque[Item] = deque()

    def put(self, item: Item) -> None:
        """Add an item, and wake the owner."""
        self._items.append(item)
        self._owner.wake_at(self._world.now())

    def get(self, timeout: float) -> Item:
        """Return the oldest item. Raises `Empty` if none arrives in time."""
        until = self._world.now() + timeout
        while not self._items and self._world.now() < until:
            self._owner.wait(until - self._world.now())
        return self.get_nowait()

    def get_nowait(self) -> Item:
        """Return the oldest item. Raises `Empty`."""
        if not self._items:
            raise Empty
        return self._items.popleft()


class VirtualRouter:
    """The router of a master that listens: its clients by name, with their inboxes and machines."""

    def __init__(self, machine: str) -> None:
        self.machine = machine
        self.clients: dict[str, tuple[VirtualInbox, str]] = {}
        self.last_s: dict[tuple[str, str], float] = {}
        self.waiting: dict[tuple[str, str], deque[Item]] = {}


class VirtualTransport:
    """The connection of a robot or a standby master to a router; see `Transport`."""

    def __init__(self, endpoint: str, identity: Any, *, patience_s: float, **_given: object) -> None:  # noqa: ANN401
        world = World.present
        self._world, self.name, self._machine = world, identity.name, world.current.machine
        until = world.now() + patience_s
        while not world.is_listening(endpoint):
            if world.now() >= until:
                raise CannotConnectError(f"no master at {endpoint}")
            world.current.wait(min(0.5, patience_s))
        self._router = world.routers[endpoint]
        self._endpoint = endpoint
        self.inbox = VirtualInbox(world)
        self._router.clients[self.name] = (self.inbox, self._machine)
        world.send(self._router, self.name, MASTER, PresenceChanged(self.name, there=True))

    @property
    def router(self) -> str:
        """See `Transport.router`."""
        is_up = self._world.routers.get(self._endpoint) is self._router
        return str(id(self._router)) if is_up and not self._world.is_cut(self._machine) else ""

    def send(self, receiver: str, content: bytes) -> None:
        """See `Transport.send`."""
        self._world.send(self._router, self.name, receiver, FrameArrived(self.name, content))

    def close(self) -> None:
        """See `Transport.close`."""
        if self._router.clients.get(self.name, (None,))[0] is self.inbox:
            del self._router.clients[self.name]
        self._world.send(self._router, self.name, MASTER, PresenceChanged(self.name, there=False))

    abandon = close


class VirtualConnection(MasterConnection):
    """The connection of a master, with its router."""

    def __init__(self, run: str, _identity: Any, admission: Any, endpoint: str, *arguments: Any) -> None:  # noqa: ANN401
        self._world = World.present
        self._events = arguments[-1]
        self._endpoint = endpoint
        self.framing = Framing(MASTER, run)
        self.policy = cast(
            "Any",
            SimpleNamespace(
                is_robot=lambda name: name in admission.names(Role.ROBOT),
                open_ways=lambda _ways: None,
                follow=lambda: None,
                revoked=lambda _names: [],
                failure="",
            ),
        )
        self.journal_server = cast("Any", SimpleNamespace(lagging=False, publication=None))

    def open(self) -> None:
        """See `MasterConnection.open`."""
        self._router = self._world.routers[self._endpoint] = VirtualRouter(self._world.current.machine)
        self._inbox = VirtualInbox(self._world)
        self._router.clients[MASTER] = (self._inbox, self._router.machine)

    def close(self) -> None:
        """See `MasterConnection.close`."""
        if self._world.routers.get(self._endpoint) is self._router:
            del self._world.routers[self._endpoint]

    def wake(self) -> None:
        """See `MasterConnection.wake`."""

    def follow_registry(self) -> None:
        """See `MasterConnection.follow_registry`."""

    def send(self, name: str, message: ToRobot) -> None:
        """See `MasterConnection.send`."""
        self._world.send(self._router, MASTER, name, FrameArrived(MASTER, self.framing.write(name, message)))

    def receive(self, patience_s: float) -> Item | None:
        """See `MasterConnection.receive`."""
        try:
            return self._inbox.get(patience_s)
        except Empty:
            return None


class VirtualThread:
    """A thread of the program; see `threading.Thread`."""

    def __init__(self, *, target: Callable[[], None], **_given: object) -> None:
        self._target = target

    def start(self) -> None:
        """Start an actor on the machine of the present one."""
        world = World.present
        self._actor = Actor(world, world.current.machine, self._target)
        world.actors.append(self._actor)

    def join(self) -> None:
        """Wait until the thread has ended."""
        while self._actor.is_alive:
            World.present.current.wait(0.1)


class VirtualEvent:
    """An event of the program; see `threading.Event`."""

    def __init__(self) -> None:
        self._set = False

    def set(self) -> None:
        """Set the event."""
        self._set = True

    def is_set(self) -> bool:
        """Return whether the event is set."""
        return self._set

    def wait(self, seconds: float) -> bool:
        """Wait, and return whether the event is set."""
        if not self._set:
            World.present.current.wait(seconds)
        return self._set


class MasterFault(NamedTuple):
    """At `at_s`, `kind` happens to `machine`; it is undone after `for_s` seconds."""

    at_s: float
    kind: str
    machine: str
    for_s: float


class World:
    """The machines `MASTER`, `B` and `C` and those of the robots of `team`. `folder` is for the votes of robots."""

    present: World
    current: Actor

    def __init__(self, team: Team, seed: int, folder: Path, loss: float) -> None:
        self.clock = VirtualClock(1e-5)
        self.chance = Random(f"masters {seed}")
        self.baton = threading.Semaphore(0)
        self.routers: dict[str, VirtualRouter] = {}
        self.stopped: dict[str, float] = {}
        self.cut_until: dict[str, float] = {}
        self.actors: list[Actor] = []
        self.errors: list[BaseException] = []
        self.published: dict[str, Outcome] = {}
        self.endings: dict[str, Ending] = {}
        self.reasons: dict[str, str] = {}
        self.changed: dict[str, Any] = {}
        """Changes of the masters' plans."""
        self._loss = loss
        self._folder = folder
        self._events: list[tuple[float, float, int, Callable[[], None]]] = []
        self._count = itertools.count()
        self._places = tuple(Address(LOOPBACK, port) for port in (7447, 7457, 7467))
        self._masters = dict(zip((MASTER, "B", "C"), self._places, strict=True))
        self._robots = ensure_compiled(team).robots
        self._seed = seed

    # Time and links

    def now(self) -> float:
        """Return the virtual time."""
        return self.clock.now

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Let something happen at a time."""
        heapq.heappush(self._events, (time_s, self.chance.random(), next(self._count), action))

    def is_cut(self, machine: str) -> bool:
        """Return whether a machine has no link."""
        return self.now() < self.cut_until.get(machine, 0.0)

    def is_listening(self, endpoint: str) -> bool:
        """Return whether the present actor reaches a router there."""
        router = self.routers.get(endpoint)
        return router is not None and not (self.is_cut(router.machine) or self.is_cut(self.current.machine))

    def send(self, router: VirtualRouter, sender: str, receiver: str, item: Item) -> None:
        """Send an item through a router: it arrives late, perhaps twice, or not at all."""
        delay_s = self.chance.random() * (4.0 if self.chance.random() < 0.01 else 0.05)
        edge = (sender, receiver)
        arrival = router.last_s[edge] = max(self.now() + delay_s, router.last_s.get(edge, 0.0))
        if self.chance.random() < self._loss:
            return
        for _ in range(1 + (self.chance.random() < 0.02)):
            router.waiting.setdefault(edge, deque()).append(item)  # events at the same time happen in any order
            self.at(arrival, lambda: self._arrive(router, sender, receiver))

    def _arrive(self, router: VirtualRouter, sender: str, receiver: str) -> None:
        ends = [router.clients[name][1] for name in (sender, receiver) if name in router.clients]
        held_until = max(self.cut_until.get(machine, 0.0) for machine in (router.machine, *ends))
        if self.now() < held_until:
            self.at(held_until, lambda: self._arrive(router, sender, receiver))
            return
        item = router.waiting[sender, receiver].popleft()
        if receiver in router.clients and router in self.routers.values():
            router.clients[receiver][0].put(item)

    # Machines

    def _master(self, name: str) -> None:
        rank = list(self._masters).index(name)
        roles = {str(Role.ROBOT): tuple(self._robots), str(Role.MASTER): tuple(self._masters)}
        identity = SimpleNamespace(name=name, hosts=(LOOPBACK,), folder=Path())
        standby = StandbyPlan(self._places[:rank], cast("Any", identity), StandbyAnswer(roles, ()))
        plan = MasterPlan(
            Path(),
            self._places[rank],
            names=tuple(self._robots),
            protocol="dsa",
            settings={"cycles": "40"},
            seed=3 * self._seed + rank,
            gather_s=GATHER_S,
            standby=standby,
            conditions=NetworkSettings(patience_s=PATIENCE_S, survive=self._seed % 2 == 0),
        )
        try:
            self.published[name] = run_master(replace(plan, **self.changed)).outcome
        except RobochocError as error:
            self.reasons[name] = str(error)

    def _robot(self, own: CompiledRobot) -> None:
        name = own.robot.name
        identity = cast("Any", SimpleNamespace(name=name))
        masters = Masters(
            tuple(map(str, self._places)),
            LOOKING_S,
            self.now,
            self.is_listening,
            lambda seconds: self.current.wait(seconds),  # noqa: PLW0108 - the present actor changes
        )
        votes = RobotVotes(self._folder / f"{name}.json", several=True)
        settings = RobotSettings(LOOKING_S)
        try:
            self.endings[name] = follow(own, identity, masters, votes, settings, protocol_or_stage)
        except CannotConnectError as error:
            self.reasons[name] = str(error)

    def _start(self, machine: str) -> None:
        own = self._robots.get(machine)
        target = (lambda: self._master(machine)) if own is None else lambda: self._robot(own)
        self.actors.append(Actor(self, machine, target))

    def _strike(self, fault: MasterFault) -> None:
        if fault.kind == "stop":
            self.stopped[fault.machine] = self.now() + fault.for_s
        elif fault.kind == "cut":
            self.cut_until[fault.machine] = self.now() + fault.for_s
        else:
            self._kill(fault.machine)
            if fault.machine in self._robots:
                self.at(self.now() + fault.for_s, lambda: self._start(fault.machine))

    def _kill(self, machine: str) -> None:
        for endpoint, router in list(self.routers.items()):
            if router.machine == machine:
                del self.routers[endpoint]
            for name, (_, there) in list(router.clients.items()):
                if there == machine:
                    del router.clients[name]
                    self.send(router, name, MASTER, PresenceChanged(name, there=False))
        for actor in self.actors:
            if actor.machine == machine and actor.is_alive:
                actor.is_killed = True
                actor.wake_at(self.now())

    def play(self, faults: tuple[MasterFault, ...]) -> None:
        """Play a run with faults to its end, or to `END_S`."""
        for machine in (*self._masters, *self._robots):
            self.at(self.chance.random() * 2, lambda machine=machine: self._start(machine))  # type: ignore[misc]
        for fault in faults:
            self.at(fault.at_s, lambda fault=fault: self._strike(fault))  # type: ignore[misc]
        last_s = max((fault.at_s + fault.for_s for fault in faults), default=2.0)
        while self._events and self._events[0][0] < END_S:
            if self.now() > max(last_s, 2.0) and not any(actor.is_alive for actor in self.actors):
                break
            due, _, _, action = heapq.heappop(self._events)
            self.clock.advance_to(due)
            action()
        self.alive = [actor.machine for actor in self.actors if actor.is_alive]
        for actor in self.actors:
            actor.is_killed = True
        while any(actor.is_alive for actor in self.actors):
            for actor in self.actors:
                actor.wake_at(self.now())
            while self._events:
                heapq.heappop(self._events)[3]()

    # What came of it

    @property
    def fault(self) -> str:
        """The first broken promise; empty if there is none."""
        if self.errors:
            return f"an error: {self.errors[0]!r}"
        if self.alive:
            return f"{', '.join(self.alive)} did not end"
        values = {name: outcome.assignment for name, outcome in self.published.items()}
        values |= {name: ending.assignment for name, ending in self.endings.items() if not ending.failed}
        for (one, first), (other, second) in itertools.combinations(values.items(), 2):
            if any(first[name] != second[name] for name in first.keys() & second.keys()):
                return f"two decisions: {one} {first}, {other} {second}"
        return ""


@contextmanager
def virtual_world(team: Team, seed: int, folder: Path, loss: float = 0.0) -> Iterator[World]:
    """Yield a world whose programs use its time, its threads and its links."""
    world = World(team, seed, folder, loss)
    World.present = world
    threads = SimpleNamespace(Thread=VirtualThread, Event=VirtualEvent)
    replaced: dict[str, object] = {
        "robochoc.communication.network.master_control.MasterConnection": VirtualConnection,
        "robochoc.communication.network.following.Transport": VirtualTransport,
        "robochoc.run.networked.master_run._last_values": lambda _master, _team: {},  # so that decisions differ
        "robochoc.run.networked.standby.Transport": VirtualTransport,
        "robochoc.run.networked.standby.listens": world.is_listening,
        "robochoc.run.networked.standby.threading": threads,
        "robochoc.communication.network.robot_votes._sync": lambda _path: None,
        "robochoc.communication.network.searcher.own_memory": lambda: 0,
        "time.sleep": lambda seconds: world.current.wait(seconds),  # noqa: PLW0108 - the present actor changes
    }
    with ExitStack() as patches:
        patches.enter_context(virtual_time(world.clock, seed))
        for name, stand_in in replaced.items():
            patches.enter_context(patch(name, stand_in))
        yield world


def faults_of(chance: Random, machines: tuple[str, ...]) -> tuple[MasterFault, ...]:
    """Return up to three faults, half of them of the first master."""
    return tuple(
        MasterFault(
            chance.uniform(0.5, LATEST_S),
            chance.choice(("kill", "stop", "cut")),
            chance.choice((MASTER, chance.choice(machines))),
            chance.uniform(0.5, 20.0),
        )
        for _ in range(chance.randint(1, 3))
    )
