"""Teams over the network on this machine whose search is held: something happens to their processes meanwhile."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.network.members import Member
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.journal.events import AnyEvent, Received
from robochoc.solver.agent_problem import RunParameters
from tests.support.limits import HANG_S, wait_until
from tests.support.network_runs import PATIENT
from tests.support.paused_abt import CHAIN, PausedABT


class HeldTeam:
    """CHAIN in processes, whose search is held, in a thread of its own."""

    def __init__(self, network: LocalNetwork, events: list[AnyEvent], go: Path) -> None:
        self.network = network
        self.events = events
        self.result: SearchResult | None = None
        self.error: Exception | None = None
        self._go = go
        self._thread = threading.Thread(target=self._search)
        self._thread.start()

    def wait_for_progress(self) -> None:
        """Wait until three more messages of the search have come."""
        before = self.received
        wait_until(lambda: self.received >= before + 3 or self.error is not None, "the search does not go on")
        if self.error:
            raise self.error

    @property
    def received(self) -> int:
        """Messages of the search that were received so far."""
        return sum(isinstance(event, Received) for event in list(self.events))

    def strike(self, name: str, signum: int) -> None:
        """Send a signal to the robot's process, once there is one."""
        wait_until(lambda: name in self.network.processes, f"{name} does not start")
        os.kill(self.network.processes[name].pid or 0, signum)

    def wait_until_away(self, name: str) -> Member:
        """Wait until the router has hung up on it."""
        member = self.network.master.members.robots[name]
        wait_until(lambda: member.away_since is not None, f"nobody notices that {name} is away")
        return member

    def end(self) -> SearchResult:
        """What came of the search, as soon as it is over."""
        self._thread.join(HANG_S)
        assert not self._thread.is_alive(), "the search does not end"
        if self.error:
            raise self.error
        assert self.result
        return self.result

    def let_go(self) -> SearchResult:
        """Let the team search to the end, and return what came of it."""
        self._go.touch()
        return self.end()

    def _search(self) -> None:
        try:
            self.result = self.network.search()
        except Exception as error:  # noqa: BLE001 - the test is told
            self.error = error


@contextmanager
def held_team(folder: Path, settings: NetworkSettings = PATIENT) -> Iterator[HeldTeam]:
    """Such a team; afterwards no process of it is left."""
    events: list[AnyEvent] = []
    parameters = RunParameters(settings={"file": str(folder / "go")})
    with LocalNetwork(CHAIN, PausedABT, observer=events.append, settings=settings, parameters=parameters) as network:
        team = HeldTeam(network, events, folder / "go")
        try:
            yield team
        finally:
            (folder / "go").touch()
            with suppress(RobotsLostError):
                team.end()
    assert not network.processes
