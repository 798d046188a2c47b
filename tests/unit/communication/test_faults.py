"""Whatever dies, whenever it dies: the run ends, says who was lost, and leaves nothing behind.

Runs of the whole program are struck at random moments (the seed of a repetition is its number). `make test` repeats
each kind of strike 5 times, `make test-slow` 50 times.
"""

from __future__ import annotations

import os
import random
import re
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from robochoc.communication.processes import pool, processes
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Lost, Sent
from robochoc.journal.journal import Ended, Follower, Header, read_journal, sorted_by_time
from tests.support.faults import PROGRAM, Run, gone_within_s, running
from tests.support.faulty_protocols import (
    TEAM,
)
from tests.support.limits import wait_until
from tests.support.program import ROOT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

LONG_RUN = queens3d(8)
"""64 robots that search for some seconds."""
NAMES = [robot.name for robot in LONG_RUN.robots]
MIDDLE_S = 0.3
"""So long after the last robot's process is there the search is well under way."""
STARTING_S = 0.7
"""In so much time the program begins, imports, reads the team, and starts most robots."""
FEW, MANY = 3, 50
OLD = b"what was here before"


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("team") / "long"
    write_team(LONG_RUN, folder)
    return folder


def solving(team: Path, *options: str, timeout_s: float = 60) -> list[str]:
    return [PROGRAM, "solve", str(team), "--timeout", str(timeout_s), *options]


def faulty(team: str, protocol: str) -> list[str]:
    return [sys.executable, str(ROOT / "tests" / "support" / "faulty_protocols.py"), team, protocol]


def observed(team: Path, home: Path, *options: str) -> list[str]:
    """A run with all its outputs, which replace something older."""
    home.mkdir()
    outputs = {"--journal": home / "run.jsonl", "--html": home / "scene.html"}
    for path in outputs.values():
        path.write_bytes(OLD)
    return solving(team, *(word for option, path in outputs.items() for word in (option, str(path))), *options)


# The strikes: each returns the names of robots that it kills


def a_robot_at_the_start(run: Run, chance: random.Random) -> list[str]:
    place = chance.randrange(len(NAMES))
    run.strike(signal.SIGKILL, run.wait_for_robots(place + 1)[place])
    return [NAMES[place]]


def a_robot_in_the_middle(run: Run, chance: random.Random) -> list[str]:
    place = chance.randrange(len(NAMES))
    robots = in_the_middle(run, chance)
    run.strike(signal.SIGKILL, robots[place])
    return [NAMES[place]]


def the_parent(run: Run, chance: random.Random) -> list[str]:
    sometime(run, chance)
    run.strike(signal.SIGKILL)
    return []


def interrupt(run: Run, chance: random.Random) -> list[str]:
    sometime(run, chance)
    run.strike(signal.SIGINT, group=chance.random() < 0.5)
    return []


def terminate(run: Run, chance: random.Random) -> list[str]:
    sometime(run, chance)
    run.strike(signal.SIGTERM)
    return []


def sometime(run: Run, chance: random.Random) -> None:
    """Half of the time while the team starts, half of the time in the middle of its search."""
    if chance.random() < 0.5:
        run.wait_until_listening()
        time.sleep(chance.uniform(0, STARTING_S))
    elif run.runs_in_processes:
        in_the_middle(run, chance)
    else:
        run.wait_until_listening()
        time.sleep(STARTING_S + chance.uniform(0, MIDDLE_S))


def in_the_middle(run: Run, chance: random.Random) -> list[int]:
    robots = run.wait_for_robots(len(NAMES))
    time.sleep(chance.uniform(0.5, 1.5) * MIDDLE_S)
    return robots


Strike = Callable[[Run, random.Random], list[str]]
STRIKES: dict[Strike, int] = {
    a_robot_at_the_start: 4,
    a_robot_in_the_middle: 4,
    the_parent: -signal.SIGKILL,
    interrupt: 128 + signal.SIGINT,
    terminate: 128 + signal.SIGTERM,
}
"""And the exit status that follows."""


def struck(strike: Strike, repetition: int, team: Path, home: Path, *options: str) -> None:
    """Strike a run, and hold what follows against all that is promised."""
    chance = random.Random(f"{strike.__name__} {repetition}")
    watched = repetition % 2 == 1
    with running(observed(team, home, *options) if watched else solving(team, *options), home) as run:
        run.runs_in_processes = "simulator" not in options
        lost = strike(run, chance)
        took = run.end()
        assert run.status() == STRIKES[strike], run.errors()
        assert took < gone_within_s()
        for name in lost:
            assert f"{name} was lost: its process was killed by SIGKILL" in run.errors()
        nothing_is_left(run)
    if watched:
        assert (home / "scene.html").read_bytes() == OLD
        the_journal_is_whole((home / "run.jsonl").read_bytes(), lost, killed=strike is the_parent)


def nothing_is_left(run: Run) -> None:
    assert "Traceback" not in run.errors()
    assert "Exception ignored" not in run.errors()
    assert len(run.errors().splitlines()) <= 2, run.errors()
    assert run.left_behind() == []


def the_journal_is_whole(content: bytes, lost: list[str], *, killed: bool) -> None:
    """It tells who was lost. That of a run just begun need not be there, that of a killed one may end anywhere."""
    if not lost and content == OLD:
        return
    journal = read_journal(content)
    assert journal.outcome is None
    assert journal.damage is None or (killed and "it ends within a block" in journal.damage)
    assert [event.robot for event in journal.events if isinstance(event, Lost)] == lost


@pytest.mark.parametrize("repetition", range(FEW))
@pytest.mark.parametrize("strike", STRIKES)
def test_a_strike_leaves_nothing(strike: Strike, repetition: int, team: Path, tmp_path: Path) -> None:
    struck(strike, repetition, team, tmp_path / "run")


@pytest.mark.slow
@pytest.mark.parametrize("repetition", range(FEW, FEW + MANY))
@pytest.mark.parametrize("strike", STRIKES)
def test_fifty_strikes_leave_nothing(strike: Strike, repetition: int, team: Path, tmp_path: Path) -> None:
    struck(strike, repetition, team, tmp_path / "run")


@pytest.mark.parametrize("repetition", range(2))
@pytest.mark.parametrize("strike", [the_parent, interrupt, terminate])
def test_strikes_in_the_simulator(strike: Strike, repetition: int, team: Path, tmp_path: Path) -> None:
    struck(strike, repetition, team, tmp_path / "run", "--runtime", "simulator")


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_program_has_begun(signum: signal.Signals, team: Path, tmp_path: Path) -> None:
    """Python's own start is not ours: what it says then is its own too, but nothing is left."""
    for repetition in range(5):
        with running(solving(team), tmp_path / str(repetition)) as run:
            time.sleep(repetition * 0.01)
            run.strike(signum)
            assert run.end() < gone_within_s()
            assert run.status() in {-signum, 128 + signum, 1}
            assert run.left_behind() == []


def test_a_signal_that_python_swallows_is_raised_again(tmp_path: Path) -> None:
    """Python drops what is raised within the callback of a weak reference, and prints it."""
    program = """
import signal, sys, time, weakref
from robochoc.cli.main import TerminationSignals

class Thing: pass

TerminationSignals().listen()
thing = Thing()
callback = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
del thing
try:
    time.sleep(30)
except KeyboardInterrupt:
    sys.exit(3)
"""
    with running([sys.executable, "-c", program], tmp_path / "run") as run:
        run.end()
        assert run.status() == 3
        assert run.errors() == ""


@pytest.mark.parametrize("pause_s", [0, 0.02, 0.2])
def test_ctrl_c_twice(pause_s: float, team: Path, tmp_path: Path) -> None:
    with running(observed(team, tmp_path / "run"), tmp_path / "run") as run:
        in_the_middle(run, random.Random(0))
        run.strike(signal.SIGINT, group=True)
        time.sleep(pause_s)
        if not run.is_over:
            run.strike(signal.SIGINT, group=True)
        assert run.end() < gone_within_s()
        assert run.status() == 128 + signal.SIGINT
        nothing_is_left(run)
    the_journal_is_whole((tmp_path / "run" / "run.jsonl").read_bytes(), [], killed=False)


@pytest.mark.parametrize("runtime", ["processes", "simulator"])
def test_the_journal_of_a_run_that_was_killed_lacks_its_last_block(runtime: str, team: Path, tmp_path: Path) -> None:
    """It can be read while the run goes on, and what was read then is in what is left."""
    path = tmp_path / "run" / "run.jsonl"
    with running(observed(team, tmp_path / "run", "--runtime", runtime), tmp_path / "run") as run:
        wait_until(lambda: path.read_bytes() != OLD, "it never began")
        with path.open("rb") as file:
            follower = Follower(file)
            followed = follower.read()
            while sum(isinstance(line, Sent) for line in followed) < 20_000:
                time.sleep(0.01)
                followed += follower.read()
            run.strike(signal.SIGKILL)
            assert run.end() < gone_within_s()
            everything = followed + follower.read()
            _, damage = follower.finish()
    journal = read_journal(path.read_bytes())
    assert journal.damage == damage
    assert damage is None or "it ends within a block" in damage
    events = [line for line in everything if not isinstance(line, Header | Ended)]
    assert journal.events == tuple(sorted_by_time(events))
    assert journal.outcome is None


def test_many_robots_killed_at_once(team: Path, tmp_path: Path) -> None:
    with running(observed(team, tmp_path / "run"), tmp_path / "run") as run:
        robots = in_the_middle(run, random.Random(0))
        run.strike(signal.SIGKILL, *robots[10:40:3])
        assert run.end() < gone_within_s()
        assert run.status() == 4
        nothing_is_left(run)
        named = re.findall(r"(\S+) was lost: its process was killed by SIGKILL", run.errors())
        assert named
        assert set(named) <= set(NAMES[10:40:3])
    journal = read_journal((tmp_path / "run" / "run.jsonl").read_bytes())
    lost = [event.robot for event in journal.events if isinstance(event, Lost)]
    assert lost[: len(named)] == named
    assert len(lost) == len(named) or f"and {len(lost) - len(named)} others were lost" in run.errors()


def test_all_robots_killed_at_once(team: Path, tmp_path: Path) -> None:
    with running(solving(team), tmp_path / "run") as run:
        run.strike(signal.SIGKILL, *in_the_middle(run, random.Random(0)))
        assert run.end() < gone_within_s()
        assert run.status() == 4
        nothing_is_left(run)


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGABRT, signal.SIGRTMIN + 3])
def test_a_robot_ended_by_another_signal(signum: int, team: Path, tmp_path: Path) -> None:
    with running(solving(team), tmp_path / "run") as run:
        robots = in_the_middle(run, random.Random(0))
        run.strike(signum, robots[20])
        assert run.end() < gone_within_s()
        assert run.status() == 4
        name = signum.name if isinstance(signum, signal.Signals) else f"signal {signum}"
        assert run.errors() == f"{team}: {NAMES[20]} was lost: its process was killed by {name}\n"
        nothing_is_left(run)


def test_a_stopped_robot_does_not_outlive_the_time_limit(team: Path, tmp_path: Path) -> None:
    for limit_s in (2, 10, 60):
        with running(solving(team, timeout_s=limit_s), tmp_path / str(limit_s)) as run:
            wait_until(lambda run=run: run.is_over or len(run.robots()) == len(NAMES), "it hangs", within_s=100)  # type: ignore[misc]
            robots = run.robots()
            if len(robots) < len(NAMES):
                continue  # the machine is so busy that the time was over before all had started
            run.strike(signal.SIGSTOP, robots[30])
            assert run.end(100) < limit_s + processes.LATE_REPORTS_S + pool.GRACE_S + gone_within_s()
            assert run.status() in {3, 4}
            nothing_is_left(run)
            return
    pytest.fail("64 robots do not start within a minute")


def test_a_stopped_robot_does_not_outlive_ctrl_c(team: Path, tmp_path: Path) -> None:
    with running(solving(team), tmp_path / "run") as run:
        run.strike(signal.SIGSTOP, in_the_middle(run, random.Random(0))[30])
        run.strike(signal.SIGINT, group=True)
        assert run.end() < gone_within_s()
        assert run.status() == 128 + signal.SIGINT
        nothing_is_left(run)


def test_a_stopped_robot_does_not_outlive_a_killed_parent(team: Path, tmp_path: Path) -> None:
    with running(solving(team), tmp_path / "run") as run:
        run.strike(signal.SIGSTOP, in_the_middle(run, random.Random(0))[30])
        run.strike(signal.SIGKILL)
        assert run.end() < gone_within_s()


def test_robots_that_compute_do_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    with running(faulty("TEAM", "Spins"), tmp_path / "run") as run:
        run.wait_for_robots(len(TEAM.robots))
        time.sleep(MIDDLE_S)
        run.strike(signal.SIGKILL)
        assert run.end() < gone_within_s()


# Limits, and outputs that nobody reads


def test_nobody_reads_the_output(tmp_path: Path) -> None:
    write_team(queens3d(4), tmp_path / "team")
    reader, writer = os.pipe()
    os.close(reader)
    try:
        with running(solving(tmp_path / "team"), tmp_path / "run", stdout=writer) as run:
            run.end()
            assert run.status() == 128 + signal.SIGPIPE
            assert run.errors() == ""
            nothing_is_left(run)
    finally:
        os.close(writer)


@pytest.mark.parametrize("open_files", [64, 100, 180])
def test_too_few_open_files(open_files: int, team: Path, tmp_path: Path) -> None:
    """At 180 the parent has more than half of the robots started, at 64 a few."""
    with running(solving(team), tmp_path / "run", open_files=open_files) as run:
        run.end()
        assert run.status() == 2
        assert re.search(r"only \d+ of 64 robots .* Too many open files .*ulimit -n", run.errors())
        assert len(run.errors().splitlines()) == 1
        nothing_is_left(run)


def test_too_few_open_files_for_robots_that_talk(tmp_path: Path) -> None:
    """The parent has enough for the processes, and then it or a robot not for the queues."""
    with running(faulty("CROWD", "TalksToAll"), tmp_path / "run", open_files=96) as run:
        run.end()
        assert run.status() == 1
        assert re.search(r"UnsupportedError: .*ulimit -n", run.errors())
        assert run.left_behind() == []


# The live scene


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_port_of_the_live_scene_is_free_again(signum: signal.Signals, tmp_path: Path) -> None:
    write_team(queens3d(2), tmp_path / "team")
    with running(solving(tmp_path / "team", "--withdraw", "--serve"), tmp_path / "run") as run:
        wait_until(lambda: "http://" in run.errors(), "it never served")
        (port,) = run.ports()
        run.strike(signum)
        assert run.end() < gone_within_s()
        assert run.status() == {signal.SIGINT: 0, signal.SIGTERM: 143, signal.SIGKILL: -9}[signum]
        nothing_is_left(run)
    with socket.create_server(("127.0.0.1", port)):
        pass


def test_a_run_opens_no_port(team: Path, tmp_path: Path) -> None:
    with running(solving(team), tmp_path / "run") as run:
        in_the_middle(run, random.Random(0))
        assert run.ports() == set()
