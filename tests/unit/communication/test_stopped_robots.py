"""StoppedRobots robots: told after a while, lost once patience is over; those that only compute are neither."""

from __future__ import annotations

import logging
import os
import re
import signal
import sys
from pathlib import Path
from threading import Thread

import pytest

from robochoc.communication.processes.process_status import REPORT_AFTER_S, ProcessStatus, StoppedRobots
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.search_result import RobotsLostError
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Lost
from robochoc.model.outcome import Verdict
from tests.support.faults import PROGRAM, running
from tests.support.faulty_protocols import TEAM, Spins, StopsItself
from tests.support.limits import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

COUNT = 49


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("teams") / "seven"
    write_team(queens3d(7), folder)
    return folder


def looks(stopped: StoppedRobots, *names: str, start: float, seconds: float) -> dict[str, str]:
    """Look ten times a second, while these robots are stopped."""
    lost: dict[str, str] = {}
    for tenth in range(int(seconds * 10)):
        lost |= stopped.update([name for name in names if name not in lost], start + tenth / 10)
    return lost


def test_it_is_told_once_and_again_when_it_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    stopped = StoppedRobots()
    assert looks(stopped, "R1", start=100, seconds=REPORT_AFTER_S - 1) == {}
    assert caplog.messages == []
    assert looks(stopped, "R1", start=100 + REPORT_AFTER_S - 1, seconds=20) == {}
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("R1 has been stopped (SIGSTOP) for 5 s; the others wait for it")
    assert caplog.records[0].levelno == logging.WARNING
    assert looks(stopped, start=200, seconds=1) == {}
    assert caplog.messages[1:] == ["R1 continues"]


def test_patience_is_for_each_and_begins_anew_when_it_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    stopped = StoppedRobots(2)
    assert looks(stopped, "R1", start=0, seconds=1.5) == {}
    assert looks(stopped, start=1.5, seconds=0.2) == {}
    assert looks(stopped, "R1", "R2", start=2, seconds=1.5) == {}
    lost = looks(stopped, "R1", start=3.5, seconds=1)
    assert lost == {"R1": "its process had been stopped (SIGSTOP) for 2 s"}
    assert caplog.messages == []


def test_time_in_which_nobody_looked_does_not_count() -> None:
    """A terminal's Ctrl-Z stops all, the one who looks included."""
    stopped = StoppedRobots(2)
    assert looks(stopped, "R1", start=0, seconds=0.2) == {}
    assert stopped.update(["R1"], 3600) == {}
    assert stopped.update([], 3600.1) == {}


FIRST = TEAM.robots[0].name
WHY = re.compile(r"its process had been stopped \(SIGSTOP\) for \d+ s")


def test_a_stopped_robot_is_lost_when_patience_is_over() -> None:
    lost: list[AnyEvent] = []
    with ProcessesRun(TEAM, StopsItself, patience_s=0.1, observer=lost.append) as session:
        with pytest.raises(RobotsLostError) as refused:
            session.search()
        pids = [robot.process.pid for robot in session._pool.robots.values()]  # noqa: SLF001 - nothing else knows them
    assert [*refused.value.robots] == [FIRST]
    assert WHY.fullmatch(refused.value.robots[FIRST])
    assert [event.robot for event in lost if isinstance(event, Lost)] == [FIRST]
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)


def test_the_others_go_on_without_it() -> None:
    with ProcessesRun(TEAM, StopsItself, patience_s=0.1, survive=True) as session:
        result = session.search()
        assert FIRST not in session._pool.robots  # noqa: SLF001 - nothing else knows them
    assert [*result.lost] == [FIRST]
    assert WHY.fullmatch(result.lost[FIRST])


def test_one_that_goes_on_is_not_lost() -> None:
    with ProcessesRun(TEAM, StopsItself, patience_s=300) as session:
        waker = Thread(target=wake, args=(session,))
        waker.start()
        result = session.search()
        waker.join()
    assert result.verdict is Verdict.SOLUTION
    assert result.lost == {}


def wake(session: ProcessesRun) -> None:
    """Let the first robot go on, once it is stopped."""
    robots = session._pool.robots  # noqa: SLF001 - nothing else knows them
    wait_until(lambda: FIRST in robots and robots[FIRST].status is ProcessStatus.STOPPED, "it is not stopped")
    pid = robots[FIRST].process.pid
    assert pid is not None
    os.kill(pid, signal.SIGCONT)


@pytest.mark.slow
def test_the_command_gives_a_stopped_robot_up(team: Path, tmp_path: Path) -> None:
    command = [PROGRAM, "solve", str(team), "--protocol", "abt", "--timeout", "60", "--patience", "0.5"]
    with running(command, tmp_path / "run") as run:
        run.strike(signal.SIGSTOP, run.wait_for_robots(COUNT)[20])
        run.end()
        assert run.status() == 4
        why = "Robot3.7 was lost: its process had been stopped (SIGSTOP) for "
        assert run.errors().startswith(f"{team}: {why}")
        assert run.left_behind() == []


@pytest.mark.slow
def test_one_that_goes_on_in_time_is_told_of_and_not_lost(team: Path, tmp_path: Path) -> None:
    command = [
        PROGRAM,
        "solve",
        str(team),
        "--protocol",
        "abt",
        "--timeout",
        "90",
        "--patience",
        "60",
        "--messages",
        "2000",
    ]
    with running(command, tmp_path / "run") as run:
        robot = run.wait_for_robots(COUNT)[20]
        run.strike(signal.SIGSTOP, robot)
        wait_until(lambda: "Robot3.7 has been stopped (SIGSTOP) for 5 s" in run.errors(), "nobody says so")
        run.strike(signal.SIGCONT, robot)
        run.end()
        assert run.status() in {0, 3}
        assert run.errors().splitlines()[1:2] in (["Robot3.7 continues"], [])
        assert "lost" not in run.output()


def test_one_that_computes_for_long_is_not_stopped() -> None:
    with ProcessesRun(TEAM, Spins, patience_s=0.05) as session:
        assert session.search(timeout=0.4).verdict is Verdict.UNKNOWN
