"""The network runtime on one machine (`--runtime network`): a process per robot, a master, a router, mutual TLS.

It is meant for trials and tests. Robots' processes are started by a fork server, because a forked child of a process
that has used zenoh hangs. Certificates are created for this run only, and exist only in memory.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.forkserver
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from multiprocessing.connection import wait
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from multiprocessing.util import get_temp_dir
from typing import cast

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.main_guard import require_main_guard
from robochoc.communication.network import fork_server
from robochoc.communication.network.master import Master
from robochoc.communication.network.members import NetworkMembers, reach
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.robot_process import (
    START_S,
    NetworkRobotStart,
    network_robot_process,
    only_protocol,
)
from robochoc.communication.network.router import RouterError
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.processes.process_status import describe_end
from robochoc.communication.resources import require_descriptors
from robochoc.communication.search_result import Progress, SearchResult
from robochoc.communication.session import Epoch, Session
from robochoc.journal.events import Observer
from robochoc.model.problem import Team
from robochoc.model.team_edits import keep_interfaces
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.system.signals import signals_delayed

LOOPBACK = "127.0.0.1"
FAREWELL_S = 1.0
"""How long the end of the run is announced, in seconds. Stopped robots do not confirm it, and are then killed."""
GRACE_S = 2.0
"""The time for robots to end by themselves after they have confirmed the end of the run, in seconds."""
_ATTEMPTS = 5
_DESCRIPTORS, _DESCRIPTORS_PER_ROBOT = 32, 2
"""The numbers of open files: for the master's session, the router's pipes and the fork server; and for each robot."""
_PRELOAD = (fork_server.__name__, "__main__", "robochoc.communication.network.robot_process")
"""The modules that the fork server imports once for all robots, including the program's own file (`__main__`)."""
_OURS = "robochoc."
"""The prefix of modules that the fork server can import."""


class LocalNetwork(Session):
    """One team on this machine. Each robot has its own process, connected by zenoh. See `Session`, `ProcessesRun`.

    Robots are already compiled, and disclose the same variables even after other robots are lost.
    """

    starts_fresh = True

    def __init__(
        self,
        team: Team | CompiledTeam,
        protocol: type[Protocol],
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        settings: NetworkSettings = NetworkSettings(),
        parameters: RunParameters = DEFAULT_PARAMETERS,
    ) -> None:
        require_main_guard()
        super().__init__(team)
        team = self.compiled.team
        require_descriptors(_DESCRIPTORS + _DESCRIPTORS_PER_ROBOT * len(team.robots))
        self._protocol = protocol
        self._parameters = parameters
        self._context = start_fork_server(protocol)
        settings = replace(settings, scratch=get_temp_dir())
        self._settings = settings
        self._processes: dict[str, BaseProcess] = {}
        self._is_closed = False
        self._authority = InMemoryAuthority(team.order)
        self._unstarted = list(self.compiled.robots.values())
        self._master = self._open_master(partial(self._make_master, team, observer, progress))

    def _make_master(
        self,
        team: Team,
        observer: Observer | None,
        progress: Callable[[Progress], None] | None,
        endpoint: str,
    ) -> Master:
        profiles = {robot.name: profile_of(robot) for robot in team.robots}
        ways = reach(profiles, writes_to_non_neighbours=self._protocol.traits.writes_to_non_neighbours)
        return Master(
            self._authority,
            self._authority.master_identity((LOOPBACK,)),
            endpoint,
            NetworkMembers(team.order, order=team.order, ways=ways),
            self._settings,
            observer=observer,
            watched=observer is not None,
            progress=progress,
        )

    @staticmethod
    def _open_master(make: Callable[[str], Master]) -> Master:
        """Return the master, open at a free port of loopback. Try other ports if another program is faster."""
        for attempt in range(_ATTEMPTS):
            with socket.create_server((LOOPBACK, 0)) as trial:
                port = trial.getsockname()[1]
            try:
                return make(f"{LOOPBACK}:{port}").__enter__()
            except RouterError as failed:
                if attempt == _ATTEMPTS - 1:
                    raise UnsupportedError(f"the router {failed}") from failed
        raise AssertionError

    @property
    def processes(self) -> Mapping[str, BaseProcess]:
        """The robots' processes, by name."""
        return self._processes

    @property
    def master(self) -> Master:
        """The master of the run."""
        return self._master

    @property
    def lossless(self) -> bool:
        """See `Session.lossless`. Every search is independent of the previous one."""
        return True

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        """See `Session.search`. Raises `RobotsLostError` and `UnsupportedError`."""
        deadline = None if timeout is None else time.monotonic() + timeout
        self._launch()
        began = time.monotonic()
        if not self._master.members.closed:
            patience = began + START_S
            limit = patience if deadline is None else min(deadline, patience)
            if not self._master.gather(limit) and deadline != limit:
                awaited = ", ".join(sorted(self._master.members.awaited)[:5])
                raise UnsupportedError(f"robots did not register within {START_S:g} s: {awaited}")
        left = None if deadline is None else max(0.0, deadline - time.monotonic())
        self._master.watch = self.watch
        return self._master.search(self._protocol.__name__, self._protocol.traits, self._parameters, left, messages)

    def usable_team(self, team: Team) -> Team:
        """Return the robots in the team whose values still have the same meaning. See `Session.usable_team`."""
        return keep_interfaces(team, self.compiled.team)

    def change(self, epoch: Epoch) -> None:
        """Continue without the lost robots. No other change is possible."""
        self.compiled = epoch.compiled
        gone = [name for name in self._master.members.robots if name not in epoch.team]
        self._master.members.remove(gone)
        self._parameters = epoch.parameters

    def close(self) -> None:
        """End the run and all processes."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            self._master.leave("the run is over", farewell_s=FAREWELL_S)
            wait([process.sentinel for process in self._processes.values()], 0)
        finally:
            with signals_delayed():
                self._end_processes()
                self._master.__exit__(None, None, None)

    def kill(self, name: str) -> None:
        """Kill the process of the robot `name`, if it has one."""
        if name in self._processes:
            self._processes[name].kill()

    def _launch(self) -> None:
        """Start the robots' processes, and a thread that watches them."""
        unstarted, self._unstarted = self._unstarted, []
        if not unstarted:
            return
        for own in unstarted:
            name = own.robot.name
            texts = self._authority.identity(name).texts
            limits = (self._settings.patience_s, self._settings.lease_ms)
            protocols = partial(only_protocol, self._protocol)
            given = NetworkRobotStart(own, texts, self._master.endpoint, protocols, *limits)
            process = self._context.Process(target=network_robot_process, name=name, args=(given,), daemon=True)
            with signals_delayed():  # a half-started process would wait forever, and block the end of the program
                process.start()
                self._processes[name] = process
        threading.Thread(target=self._watch, args=[dict(self._processes)], daemon=True).start()

    def _watch(self, processes: dict[str, BaseProcess]) -> None:
        """Report ended processes to the master, which would notice them itself only later."""
        names = {process.sentinel: name for name, process in processes.items()}
        while names and not self._is_closed:
            for sentinel in wait(list(names), 0.2):
                name = names.pop(cast("int", sentinel))
                if not self._is_closed:
                    self._master.lose(name, describe_end(processes[name]))

    def _end_processes(self) -> None:
        """End all processes. Robots that have not confirmed the end of the run would not end by themselves."""
        until = time.monotonic() + GRACE_S
        leaving = {name for name, member in self._master.members.robots.items() if member.left}
        alive = {process.sentinel for name, process in self._processes.items() if name in leaving}
        while alive and time.monotonic() < until:
            alive.difference_update(cast("list[int]", wait(list(alive), max(0.0, until - time.monotonic()))))
        for process in self._processes.values():
            process.kill()
            process.join()
            process.close()
        self._processes = {}


def start_fork_server(protocol: type[Protocol]) -> ForkServerContext:
    """Start the fork server unless it is already running. It imports modules while the router is being opened.

    Signals are blocked during the start, so that no folder is left behind. The fork server inherits the blocked
    signals, and ignores signals to the whole group while it imports; it ends with this process.
    """
    context = multiprocessing.get_context("forkserver")
    own = [protocol.__module__] if protocol.__module__.startswith(_OURS) else []
    context.set_forkserver_preload([*_PRELOAD, *own])
    try:
        with signals_delayed():
            os.environ[fork_server.SCRATCH] = get_temp_dir()
            try:
                multiprocessing.forkserver.ensure_running()
            finally:
                del os.environ[fork_server.SCRATCH]
    except OSError as error:  # for example a temporary folder whose path is too long for a socket
        raise UnsupportedError(f"robots' processes cannot be started: {error}: check the folder TMPDIR") from error
    return context
