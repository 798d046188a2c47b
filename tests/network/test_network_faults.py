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
from contextlib import contextmanager
from pathlib import Path

import pytest

from robochoc.authority.authority import Authority
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.settings import LEASE_MS, NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.search_result import RobotsLostError
from robochoc.journal.events import AnyEvent, Lost, Received, Sent
from robochoc.model.outcome import Verdict
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.authorities import identity_of
from tests.support.faults import Run, running
from tests.support.held_teams import held_team
from tests.support.limits import HANG_S, wait_until
from tests.support.network_runs import NetworkRun
from tests.support.paused_abt import CHAIN, PausedABT
from tests.support.ports import free_endpoint
from tests.support.program import ROOT
from tests.support.relays import Relay

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

QUICK_S, LONG_S = 1.5, 5.0
"""How long faults last that nobody notices."""

FOR_EVER_S = 3600.0
"""A patience that is over when the test moves the clock, and not because the machine is busy."""


# Processes that die or stop


@pytest.mark.more
def test_a_robot_killed_before_the_search(tmp_path: Path) -> None:
    """It is not waited for: nobody will start it again."""
    with held_team(tmp_path) as team:
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
    with held_team(tmp_path, NetworkSettings(survive=True, patience_s=HANG_S)) as team:
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


@pytest.mark.more
def test_a_robot_that_is_stopped_for_too_long(tmp_path: Path) -> None:
    with held_team(tmp_path, NetworkSettings(lease_ms=500, patience_s=FOR_EVER_S)) as team:
        team.wait_for_progress()
        team.strike("RX2", signal.SIGSTOP)
        team.wait_until_away("RX2").away_since = time.monotonic() - 2 * FOR_EVER_S
        with pytest.raises(RobotsLostError, match="RX2 was lost: it has not been there for 3600 s"):
            team.end()


@pytest.mark.more
@pytest.mark.parametrize("lease_ms", [500, pytest.param(LEASE_MS, marks=pytest.mark.slow)])
def test_a_robot_that_is_stopped_for_a_while(tmp_path: Path, lease_ms: int) -> None:
    """Within the lease nobody notices; after it the router hangs up, and the robot comes back."""
    with held_team(tmp_path, NetworkSettings(lease_ms=lease_ms, patience_s=FOR_EVER_S)) as team:
        team.wait_for_progress()
        team.strike("RX1", signal.SIGSTOP)
        if lease_ms < LEASE_MS:
            team.wait_until_away("RX1")
        else:
            time.sleep(QUICK_S)
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


@pytest.mark.parametrize("down_s", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (QUICK_S, LONG_S))])
@pytest.mark.parametrize("how", [Relay.cut, pytest.param(Relay.freeze, marks=pytest.mark.slow)])
@pytest.mark.parametrize("filters", [(), pytest.param(("signed", "sealed"), marks=pytest.mark.slow)])
def test_a_link_that_is_down(
    tmp_path: Path, how: Callable[[Relay], None], down_s: float, filters: tuple[str, ...]
) -> None:
    """All robots are behind it. Afterwards all goes on, and nothing is lost."""
    with (
        NetworkRun(tmp_path, settings=NetworkSettings(filters, patience_s=HANG_S), absent=CHAIN.order) as run,
        Relay(run.endpoint) as relay,
    ):
        for name in CHAIN.order:
            run.start(name, relay.endpoint)
        run.wait_for_progress()
        how(relay)
        if how is Relay.cut:
            members = run.master.members.robots.values()
            run.wait_until(lambda: all(one.away_since is not None for one in members), "the cut is not noticed")
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
        run.threads["RX3"].join(HANG_S)
        assert run.endings["RX3"].why == "the master is gone: no link to it for 3 s"


@pytest.mark.more
def test_a_router_that_is_opened_anew(tmp_path: Path) -> None:
    """Somebody else is enrolled in mid-run: that needs other rules, and so another router."""
    with NetworkRun(tmp_path) as run:
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
@pytest.mark.parametrize(
    ("number", "why"), [(signal.SIGKILL, "has ended"), (signal.SIGSTOP, "did not respond for 1.5 s")]
)
def test_a_router_that_dies_or_is_stopped(number: int, why: str, tmp_path: Path) -> None:
    with NetworkRun(tmp_path, settings=NetworkSettings(patience_s=3)) as run:
        run.wait_for_progress()
        os.kill(run.router, number)
        with pytest.raises(RobotsLostError, match=f"the router's process {why}"):
            run.wait_for_result()


@pytest.mark.more
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
        self.robots: dict[str, NetworkRobot] = {}
        self.threads: dict[str, threading.Thread] = {}

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

    def start(self) -> None:
        for name in CHAIN.order:
            self.threads[name] = threading.Thread(target=self._take_part, args=[name])
            self.threads[name].start()

    def lose_patience(self, *names: str) -> None:
        """Move these robots' clocks, once they have lost their links."""
        for name in names:
            registration = self.robots[name]._registration  # noqa: SLF001
            wait_until(lambda of=registration: not of._transport.router, f"{name} keeps its link")  # type: ignore[misc]  # noqa: SLF001
            registration._connected_at -= 2 * FOR_EVER_S  # noqa: SLF001

    def wait_until_free(self) -> None:
        """Wait until nobody listens at the endpoint any more."""
        host, _, port = self.endpoint.rpartition(":")

        def is_free() -> bool:
            with socket.socket() as trial:
                return trial.connect_ex((host, int(port))) == errno.ECONNREFUSED

        wait_until(is_free, "the router does not end")

    def wait(self, *names: str) -> set[str]:
        """Why these robots have ended, as soon as they have."""
        for name in names:
            self.threads[name].join(HANG_S)
        assert all(self.endings[name].failed for name in names)
        return {self.endings[name].why for name in names}

    def _take_part(self, name: str) -> None:
        own, identity = CompiledRobot(CHAIN[name]), self.identities[name]
        with Transport(self.endpoint, identity, watch=(), patience_s=HANG_S) as transport:
            robot = NetworkRobot(own, identity, transport, lambda _: PausedABT, RobotSettings(FOR_EVER_S))
            self.robots[name] = robot
            self.endings[name] = robot.run()


def searching(master: subprocess.Popen[bytes]) -> bool:
    assert master.stdout
    return master.stdout.readline() == b"searching\n"


@pytest.mark.more
def test_a_master_that_is_killed_and_started_anew(tmp_path: Path) -> None:
    """Its router ends with it. Robots end by themselves after their patience, or when there is another master."""
    robots = Elsewhere(tmp_path)
    with robots.master() as master:
        robots.start()
        assert searching(master)
        master.kill()
    robots.wait_until_free()
    robots.lose_patience("RX2", "RX3")
    assert robots.wait("RX2", "RX3") == {"the master is gone: no link to it for 3600 s"}
    host, _, port = robots.endpoint.rpartition(":")
    with socket.create_server((host, int(port))):
        pass
    with robots.master():
        assert robots.wait("RX0", "RX1") == {"the master was restarted: restart this robot as well"}


# The parent of a team on this machine


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder with a short name: what is in it has to do as the address of a socket."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.mark.more
@pytest.mark.parametrize(
    "signum",
    [signal.SIGKILL, *(pytest.param(other, marks=pytest.mark.slow) for other in (signal.SIGINT, signal.SIGTERM))],
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


@pytest.mark.more
def test_a_parent_that_is_killed_while_there_is_no_router(short_path: Path) -> None:
    """Before it is opened, and after it is closed, the fork server is all there is."""
    program = (
        "import os; from robochoc.communication.network.local import start_fork_server as begun;"
        "from robochoc.protocols.satisfaction.abt import ABT; begun(ABT); os.kill(os.getpid(), 9)"
    )
    with running([sys.executable, "-c", program], short_path / "run") as run:
        run.end()
        assert run.status() == -signal.SIGKILL, run.errors()
        left_nothing(run)


@pytest.mark.more
@pytest.mark.parametrize(
    "request_",
    [
        "connection = socket.socket(socket.AF_UNIX); connection.connect(server._forkserver_address)",
        "server.connect_to_new_process([])",
        "os.write(server.connect_to_new_process([])[1], pickle.dumps({'a': 'b'})[:-4])",
    ],
    ids=["nothing", "no robot", "half a robot"],
)
def test_a_request_to_the_fork_server_that_ends_too_early(request_: str, short_path: Path) -> None:
    """As of a parent that is killed after it has connected: the server ends, and says nothing."""
    program = (
        "import os, pickle, socket; from multiprocessing.forkserver import _forkserver as server;"
        "from robochoc.communication.network.local import start_fork_server as begun;"
        f"from robochoc.protocols.satisfaction.abt import ABT; begun(ABT); {request_}; os.kill(os.getpid(), 9)"
    )
    with running([sys.executable, "-c", program], short_path / "run") as run:
        run.end()
        assert run.status() == -signal.SIGKILL, run.errors()
        left_nothing(run)


def left_nothing(run: Run) -> None:
    assert "Traceback" not in run.errors(), run.errors()
    wait_until(lambda: not run.left_behind(), f"it leaves {run.left_behind()}")


# What a machine lacks


@pytest.mark.more
def test_too_few_open_files_are_one_line() -> None:
    """Zenoh aborted the process."""
    command = ["robochoc", "solve", str(ROOT / "instances" / "queens3d-4"), "--runtime", "network"]
    limited = ["sh", "-c", 'ulimit -n 20 && exec "$@"', "sh", sys.executable, "-m", *command]
    result = subprocess.run(limited, capture_output=True, text=True, check=False)
    assert result.returncode == 2, result.stderr
    assert "the limit of 20 open files is too low" in result.stderr
    assert result.stderr.count("\n") == 1
