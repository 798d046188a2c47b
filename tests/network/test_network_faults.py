"""Faults of a run across machines: links go down, processes die or stop. Nothing is lost in silence, nothing stays."""

from __future__ import annotations

import errno
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from robochoc.authority.authority import Authority
from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.run_result import RobotsLostError, RunResult
from robochoc.journal.events import AnyEvent, Lost, Received, Sent
from robochoc.model.outcome import Verdict
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.authorities import identity_of
from tests.support.clocks import waiting
from tests.support.faults import Run, running
from tests.support.limits import wait_until
from tests.support.network_runs import NetworkRun
from tests.support.paused_abt import CHAIN, PausedABT
from tests.support.ports import free_endpoint
from tests.support.program import ROOT
from tests.support.relays import Relay

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

GONE_WITHIN_S = 10.0
WHILE_A_MASTER_STARTS_S = 60.0
"""However busy the machine is; nobody waits for it to be over."""


# Processes that die or stop


class Team:
    """CHAIN in processes, whose search is held, in a thread of its own."""

    def __init__(self, network: LocalNetwork, events: list[AnyEvent], go: Path) -> None:
        self.network = network
        self.events = events
        self.result: RunResult | None = None
        self.error: Exception | None = None
        self._go = go
        self._thread = threading.Thread(target=self._search)
        self._thread.start()

    def wait_for_progress(self) -> None:
        before = self.received
        wait_until(lambda: self.received >= before + 3 or self.error is not None, "the search does not go on")
        if self.error:
            raise self.error

    @property
    def received(self) -> int:
        return sum(isinstance(event, Received) for event in list(self.events))

    def strike(self, name: str, signum: int) -> None:
        wait_until(lambda: name in self.network.processes, f"{name} does not start")
        os.kill(self.network.processes[name].pid or 0, signum)

    def end(self) -> RunResult:
        self._thread.join(60)
        assert not self._thread.is_alive(), "the search does not end"
        if self.error:
            raise self.error
        assert self.result
        return self.result

    def let_go(self) -> RunResult:
        self._go.touch()
        return self.end()

    def _search(self) -> None:
        try:
            self.result = self.network.search(90)
        except Exception as error:  # noqa: BLE001 - the test is told
            self.error = error


@contextmanager
def held_team(folder: Path, settings: NetworkSettings = NetworkSettings()) -> Iterator[Team]:
    events: list[AnyEvent] = []
    parameters = RunParameters(settings={"file": str(folder / "go")})
    with LocalNetwork(CHAIN, PausedABT, observer=events.append, settings=settings, parameters=parameters) as network:
        team = Team(network, events, folder / "go")
        try:
            yield team
        finally:
            (folder / "go").touch()
            with suppress(RobotsLostError):
                team.end()
    assert not network.processes


def test_a_robot_killed_before_the_search(tmp_path: Path) -> None:
    """It is not waited for: nobody will start it again."""
    with waiting(40), held_team(tmp_path) as team:
        team.strike("RX2", signal.SIGKILL)
        with pytest.raises(RobotsLostError, match="RX2 was lost: its process was killed by SIGKILL"):
            team.end()


def test_a_robot_killed_in_the_search(tmp_path: Path) -> None:
    with held_team(tmp_path) as team:
        team.wait_for_progress()
        team.strike("RX2", signal.SIGKILL)
        with pytest.raises(RobotsLostError, match="RX2 was lost: its process was killed by SIGKILL"):
            team.end()
    assert [event.robot for event in team.events if isinstance(event, Lost)] == ["RX2"]


@pytest.mark.slow
def test_robots_killed_in_a_search_that_survives_it(tmp_path: Path) -> None:
    with held_team(tmp_path, NetworkSettings(survive=True)) as team:
        team.wait_for_progress()
        team.strike("RX2", signal.SIGKILL)
        result = team.end()
    assert result.verdict is Verdict.UNKNOWN
    assert result.lost == {"RX2": "its process was killed by SIGKILL"}


@pytest.mark.slow
def test_a_robot_killed_after_the_search(tmp_path: Path) -> None:
    with held_team(tmp_path) as team:
        team.wait_for_progress()
        assert team.let_go().verdict is Verdict.SOLUTION
        team.strike("RX2", signal.SIGKILL)


def test_a_robot_that_is_stopped_for_too_long(tmp_path: Path) -> None:
    with held_team(tmp_path, NetworkSettings(lease_ms=1000, patience_s=2)) as team:
        team.wait_for_progress()
        team.strike("RX2", signal.SIGSTOP)
        with pytest.raises(RobotsLostError, match="RX2 was lost: it has not been there for 2 s"):
            team.end()


@pytest.mark.parametrize("lease_ms", [10_000, pytest.param(500, marks=pytest.mark.slow)])
def test_a_robot_that_is_stopped_for_a_while(tmp_path: Path, lease_ms: int) -> None:
    """Within the lease nobody notices; after it the router hangs up, and the robot comes back."""
    with held_team(tmp_path, NetworkSettings(lease_ms=lease_ms, patience_s=20)) as team:
        team.wait_for_progress()
        team.strike("RX1", signal.SIGSTOP)
        time.sleep(1.5)
        team.strike("RX1", signal.SIGCONT)
        team.wait_for_progress()
        assert team.let_go().verdict is Verdict.SOLUTION
    nothing_was_lost(team.events)


# Links that go down


def nothing_was_lost(events: list[AnyEvent]) -> None:
    """What was sent was received, once, and in order."""
    assert not [event for event in events if isinstance(event, Lost)]
    sent = [event for event in events if isinstance(event, Sent)]
    received = [event for event in events if isinstance(event, Received)]
    pairs = {(event.sender, event.receiver) for event in sent}
    for pair in pairs:
        out = [event.type for event in sent if (event.sender, event.receiver) == pair]
        assert [event.type for event in received if (event.sender, event.receiver) == pair] == out
    numbers = sorted(event.content["number"] for event in sent if event.type == "Ping")
    assert numbers == list(range(1, len(numbers) + 1))


QUICK_S, LONG_S = 1.5, 5.0


@pytest.mark.parametrize("down_s", [QUICK_S, pytest.param(LONG_S, marks=pytest.mark.slow)])
@pytest.mark.parametrize("how", [Relay.cut, pytest.param(Relay.freeze, marks=pytest.mark.slow)])
@pytest.mark.parametrize("filters", [(), pytest.param(("signed", "sealed"), marks=pytest.mark.slow)])
def test_a_link_that_is_down(
    tmp_path: Path, how: Callable[[Relay], None], down_s: float, filters: tuple[str, ...]
) -> None:
    """All robots are behind it. Afterwards all goes on, and nothing is lost."""
    with (
        NetworkRun(tmp_path, settings=NetworkSettings(filters, patience_s=20), absent=CHAIN.order) as run,
        Relay(run.endpoint) as relay,
    ):
        for name in CHAIN.order:
            run.start(name, relay.endpoint)
        run.wait_for_progress()
        how(relay)
        time.sleep(down_s)
        relay.mend()
        run.wait_for_progress()
        assert run.let_go().verdict is Verdict.SOLUTION
        assert not run.refusals
        nothing_was_lost(run.events)
        run.wait_until(lambda: not any(t.is_alive() for t in run.threads.values()), "robots do not end")
    assert all(not ending.failed for ending in run.endings.values())


@pytest.mark.slow
def test_a_link_of_one_robot_that_does_not_come_back(tmp_path: Path) -> None:
    with (
        NetworkRun(tmp_path, settings=NetworkSettings(patience_s=3), absent=["RX3"]) as run,
        Relay(run.endpoint) as relay,
    ):
        run.start("RX3", relay.endpoint)
        run.wait_for_progress()
        relay.cut()
        with pytest.raises(RobotsLostError, match="RX3 was lost: it has not been there for 3 s"):
            run.wait_for_result()
        run.threads["RX3"].join(GONE_WITHIN_S)
        assert run.endings["RX3"].why == "the master is gone: no link to it for 3 s"


def test_a_router_that_is_opened_anew(tmp_path: Path) -> None:
    """Somebody else is enrolled in mid-run: that needs other rules, and so another router."""
    with NetworkRun(tmp_path, settings=NetworkSettings(patience_s=20)) as run:
        run.wait_for_progress()
        for number in range(2):
            before = run.router
            run.household.enrol(f"Late{number}")
            run.wait_until(lambda before=before: run.router not in {before, 0}, "it is not opened anew")  # type: ignore[misc]
            run.wait_for_progress()
        assert run.let_go().verdict is Verdict.SOLUTION
        assert not run.refusals
        nothing_was_lost(run.events)


@pytest.mark.slow
def test_a_router_that_dies(tmp_path: Path) -> None:
    with NetworkRun(tmp_path, settings=NetworkSettings(patience_s=3)) as run:
        run.wait_for_progress()
        os.kill(run.router, signal.SIGKILL)
        with pytest.raises(RobotsLostError, match="the router's process has ended"):
            run.wait_for_result()


def test_a_robot_that_joins_late(tmp_path: Path) -> None:
    with NetworkRun(tmp_path, absent=["RX0"]) as run:
        run.wait_until(lambda: len(run.master.members.robots) == 3, "the others do not come")
        assert run.master.members.awaited == {"RX0"}
        run.start("RX0")
        run.wait_for_progress()
        assert run.let_go().verdict is Verdict.SOLUTION


# Masters that die


class Elsewhere:
    """The robots of CHAIN here, and masters in processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.authority = Authority.create(folder / "authority")
        self.identities = {name: identity_of(self.authority, name, folder / name) for name in CHAIN.order}
        self.endpoint = free_endpoint()
        self.endings: dict[str, Ending] = {}
        self.threads: list[threading.Thread] = []

    @contextmanager
    def master(self) -> Iterator[subprocess.Popen[bytes]]:
        given = [str(self.folder / "authority"), self.endpoint, str(self.folder / "go")]
        command = [sys.executable, "-m", "tests.support.network_master", *given]
        process = subprocess.Popen(command, stdout=subprocess.PIPE)
        try:
            yield process
        finally:
            process.kill()
            process.communicate()

    def start(self, patience_s: float) -> None:
        for name in CHAIN.order:
            thread = threading.Thread(target=self._take_part, args=[name, patience_s])
            thread.start()
            self.threads.append(thread)

    def wait_until_free(self) -> None:
        """Wait until nobody listens at the endpoint any more."""
        host, _, port = self.endpoint.rpartition(":")

        def is_free() -> bool:
            with socket.socket() as trial:
                return trial.connect_ex((host, int(port))) == errno.ECONNREFUSED

        wait_until(is_free, "the router does not end")

    def wait(self) -> set[str]:
        """Why the robots have ended, as soon as they have."""
        for thread in self.threads:
            thread.join(2 * WHILE_A_MASTER_STARTS_S)
        assert all(self.endings[name].failed for name in CHAIN.order)
        return {ending.why for ending in self.endings.values()}

    def _take_part(self, name: str, patience_s: float) -> None:
        identity = self.identities[name]
        with Transport(self.endpoint, identity, watch=(), patience_s=30) as transport:
            robot = NetworkRobot(
                CompiledRobot(CHAIN[name]), identity, transport, lambda _: PausedABT, RobotSettings(patience_s)
            )
            self.endings[name] = robot.run()


def searching(master: subprocess.Popen[bytes]) -> bool:
    assert master.stdout
    return master.stdout.readline() == b"searching\n"


def test_a_master_that_is_killed(tmp_path: Path) -> None:
    """Its router ends with it, and the robots by themselves."""
    robots = Elsewhere(tmp_path)
    with robots.master() as master:
        robots.start(patience_s=4)
        assert searching(master)
        master.kill()
        assert robots.wait() == {"the master is gone: no link to it for 4 s"}
    host, _, port = robots.endpoint.rpartition(":")
    with socket.create_server((host, int(port))):
        pass


def test_a_master_that_is_started_anew(tmp_path: Path) -> None:
    robots = Elsewhere(tmp_path)
    with robots.master() as master:
        robots.start(WHILE_A_MASTER_STARTS_S)
        assert searching(master)
        master.kill()
    robots.wait_until_free()
    with robots.master():
        assert robots.wait() == {"the master was started anew; start this robot anew as well"}


# The parent of a team on this machine


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder with a short name: what is in it has to do as the address of a socket."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.mark.parametrize(
    "signum", [signal.SIGINT, signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_a_parent_that_is_struck_leaves_nothing(signum: signal.Signals, short_path: Path) -> None:
    program = "tests.support.network_parent"
    with running([sys.executable, "-m", program], short_path / "run") as run:
        wait_until(lambda: "searching" in run.output() or run.is_over, "it never searched")
        ports = run.ports()
        assert ports, run.errors()
        run.strike(signum, group=signum is signal.SIGINT)
        run.end()
        assert run.status() == (-signum if signum is signal.SIGKILL else 128 + signum), run.errors()
        left_nothing(run)
    for port in ports:
        with socket.create_server(("127.0.0.1", port)):
            pass


@pytest.mark.slow
@pytest.mark.parametrize("wait_s", [0.2, 0.6, 1, 1.4, 1.8, 2.2])
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_parent_that_is_struck_at_any_time_leaves_no_process(
    signum: signal.Signals, wait_s: float, short_path: Path
) -> None:
    program = "tests.support.network_parent"
    with running([sys.executable, "-m", program], short_path / "run") as run:
        time.sleep(wait_s)
        run.strike(signum)
        run.end()
        assert not run.ports()


def test_a_parent_that_is_killed_while_there_is_no_router(short_path: Path) -> None:
    """Before it is opened, and after it is closed, the fork server is all there is."""
    program = (
        "import os; from robochoc.communication.network.local import _fork_server as begun;"
        "from robochoc.protocols.abt import ABT; begun(ABT); os.kill(os.getpid(), 9)"
    )
    with running([sys.executable, "-c", program], short_path / "run") as run:
        run.end()
        assert run.status() == -signal.SIGKILL, run.errors()
        left_nothing(run)


def left_nothing(run: Run) -> None:
    assert "Traceback" not in run.errors(), run.errors()
    wait_until(lambda: not run.left_behind(), f"it leaves {run.left_behind()}")


# What a machine lacks


def test_too_few_open_files_are_one_line() -> None:
    """Zenoh aborted the process."""
    command = ["robochoc", "solve", str(ROOT / "instances" / "queens3d-4"), "--runtime", "network"]
    limited = ["sh", "-c", 'ulimit -n 20 && exec "$@"', "sh", sys.executable, "-m", *command]
    result = subprocess.run(limited, capture_output=True, text=True, check=False)
    assert result.returncode == 2, result.stderr
    assert "too few files may be open: 20, with" in result.stderr
    assert result.stderr.count("\n") == 1
