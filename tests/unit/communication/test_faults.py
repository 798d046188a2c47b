"""Whatever dies, whenever it dies: the run ends, says who was lost, and leaves nothing behind.

Runs of the whole program, whose search never ends by itself, are struck. `make test` strikes a robot and a simulator,
`make test-more` once in each way, at events of the run; `make test-slow` 50 times in each, at random moments (the seed
of a repetition is its number).
"""

from __future__ import annotations

import errno
import os
import random
import re
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Lost, Sent
from robochoc.journal.journal import Ended, Follower, Header, read_journal, sorted_by_time
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.endless_runs import (
    CROWD,
    NAMES,
    OLD,
    TEAM,
    Moment,
    at_the_start,
    in_the_middle,
    listening_for,
    nothing_is_left,
    once_it_is_told,
    searching,
    solving,
    team_folder,
    the_journal_is_whole,
)
from tests.support.faults import Run, running
from tests.support.faulty_protocols import TEAM as FAULTY
from tests.support.faulty_protocols import Raises
from tests.support.limits import wait_until
from tests.support.program import ROOT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

MANY = 50
SPAN_S = 1.5
"""In so much time the program begins, imports, reads the team, starts its robots, and they talk."""
more, slow = pytest.mark.more, pytest.mark.slow


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return team_folder(TEAM, tmp_path_factory.mktemp("team"))


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return team_folder(CROWD, tmp_path_factory.mktemp("crowd"))


def faulty(team: str, *protocol: str) -> list[str]:
    return [sys.executable, str(ROOT / "tests" / "support" / "faulty_protocols.py"), team, *protocol]


# The strikes: each returns the names of robots that it kills


def a_robot(run: Run, chance: random.Random) -> list[str]:
    robots = run.wait_for_robots(1)
    place = chance.randrange(len(robots))
    run.strike(signal.SIGKILL, robots[place])
    return [run.names[place]]


def the_parent(run: Run, _: random.Random) -> list[str]:
    run.strike(signal.SIGKILL)
    return []


def interrupt(run: Run, chance: random.Random) -> list[str]:
    run.strike(signal.SIGINT, group=chance.random() < 0.5)
    return []


def terminate(run: Run, _: random.Random) -> list[str]:
    run.strike(signal.SIGTERM)
    return []


Strike = Callable[[Run, random.Random], list[str]]
STRIKES: dict[Strike, int] = {
    a_robot: 4,
    the_parent: -signal.SIGKILL,
    interrupt: 128 + signal.SIGINT,
    terminate: 128 + signal.SIGTERM,
}
"""And the exit status that follows."""


def struck(
    strike: Strike, moment: Moment, chance: random.Random, team: Path, home: Path, *options: str, watched: bool
) -> None:
    """Strike a run, and hold what follows against all that is promised."""
    with searching(team, home, *options, watched=watched) as run:
        moment(run)
        lost = strike(run, chance)
        run.end()
        assert run.status() == STRIKES[strike], run.errors()
        for name in lost:
            assert f"{name} was lost: its process was killed by SIGKILL" in run.errors()
        nothing_is_left(run)
    if watched:
        the_journal_is_whole((home / "run.journal").read_bytes(), lost, killed=strike is the_parent)


@pytest.mark.parametrize(
    ("strike", "moment", "watched"),
    [
        (a_robot, once_it_is_told, True),
        pytest.param(a_robot, at_the_start, False, marks=more),
        pytest.param(the_parent, at_the_start, False, marks=more),
        pytest.param(interrupt, once_it_is_told, True, marks=more),
        pytest.param(terminate, in_the_middle, False, marks=more),
    ],
)
def test_a_strike_leaves_nothing(strike: Strike, moment: Moment, *, watched: bool, team: Path, tmp_path: Path) -> None:
    struck(strike, moment, random.Random(strike.__name__), team, tmp_path / "run", watched=watched)


@pytest.mark.parametrize("strike", [interrupt, terminate, pytest.param(the_parent, marks=more)])
def test_strikes_in_the_simulator(strike: Strike, team: Path, tmp_path: Path) -> None:
    options = ("--runtime", "simulator")
    struck(strike, once_it_is_told, random.Random(1), team, tmp_path / "run", *options, watched=True)


@slow
@pytest.mark.parametrize("repetition", range(MANY))
@pytest.mark.parametrize("strike", STRIKES)
def test_fifty_strikes_leave_nothing(strike: Strike, repetition: int, crowd: Path, tmp_path: Path) -> None:
    chance = random.Random(f"{strike.__name__} {repetition}")
    moment = chance.choice([at_the_start, in_the_middle, listening_for(chance.uniform(0, SPAN_S))])
    struck(strike, moment, chance, crowd, tmp_path / "run", watched=repetition % 2 == 1)


@slow
@pytest.mark.parametrize("repetition", range(10))
@pytest.mark.parametrize("strike", [the_parent, interrupt, terminate])
def test_ten_strikes_in_the_simulator(strike: Strike, repetition: int, crowd: Path, tmp_path: Path) -> None:
    chance = random.Random(f"{strike.__name__} {repetition}")
    options = ("--runtime", "simulator")
    moment = listening_for(chance.uniform(0, SPAN_S))
    struck(strike, moment, chance, crowd, tmp_path / "run", *options, watched=repetition % 2 == 1)


@more
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("pause_s", [0, 0.02, *(pytest.param(s, marks=slow) for s in (0.01, 0.03, 0.04))])
def test_a_signal_before_the_program_has_begun(
    signum: signal.Signals, pause_s: float, team: Path, tmp_path: Path
) -> None:
    """Python's own start is not ours: what it says then is its own too, but nothing is left."""
    with searching(team, tmp_path / "run") as run:
        time.sleep(pause_s)
        run.strike(signum)
        run.end()
        assert run.status() in {-signum, 128 + signum, 1}
        assert run.left_behind() == []


IN_A_CALLBACK = """
thing = Thing()
callback = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
del thing
"""
IN_SET_NAME = """
def __set_name__(self, owner, name):
    signal.raise_signal(signal.SIGINT)
Thing.__set_name__ = __set_name__
type("Owner", (), {"thing": Thing()})
"""


@pytest.mark.parametrize("moment", [IN_A_CALLBACK, IN_SET_NAME])
def test_a_signal_whose_exception_python_swallows_or_replaces_is_raised_later(moment: str, tmp_path: Path) -> None:
    program = f"""
import signal, sys, time, weakref
from robochoc.cli.main import TerminationSignals

class Thing: pass

TerminationSignals().install()
{moment}
try:
    time.sleep(30)
except KeyboardInterrupt:
    sys.exit(3)
"""
    with running([sys.executable, "-c", program], tmp_path / "run") as run:
        run.end()
        assert run.status() == 3
        assert run.errors() == ""


@more
@pytest.mark.parametrize("pause_s", [0, *(pytest.param(s, marks=slow) for s in (0.02, 0.2))])
def test_ctrl_c_twice(pause_s: float, team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run", watched=True) as run:
        once_it_is_told(run)
        run.strike(signal.SIGINT, group=True)
        time.sleep(pause_s)
        if not run.is_over:
            run.strike(signal.SIGINT, group=True)
        run.end()
        assert run.status() == 128 + signal.SIGINT
        nothing_is_left(run)
    the_journal_is_whole((tmp_path / "run" / "run.journal").read_bytes(), [], killed=False)


@more
@pytest.mark.parametrize("runtime", ["processes", pytest.param("simulator", marks=slow)])
def test_the_journal_of_a_run_that_was_killed_lacks_its_last_block(runtime: str, team: Path, tmp_path: Path) -> None:
    """It can be read while the run goes on, and what was read then is in what is left."""
    path = tmp_path / "run" / "run.journal"
    with searching(team, tmp_path / "run", "--runtime", runtime, watched=True) as run:
        wait_until(lambda: path.read_bytes() != OLD, "it never began")
        with path.open("rb") as file:
            follower = Follower(file)
            pieces = [follower.read()]

            def several() -> bool:
                pieces.append(follower.read())
                return sum(any(isinstance(line, Sent) for line in piece) for piece in pieces) > 2

            wait_until(several, "nobody says anything")
            run.strike(signal.SIGKILL)
            run.end()
            everything = [line for piece in (*pieces, follower.read()) for line in piece]
            _, damage = follower.finish()
    journal = read_journal(path.read_bytes())
    assert journal.damage == damage
    assert damage is None or "it ends within a block" in damage
    events = [line for line in everything if not isinstance(line, Header | Ended)]
    assert journal.events == tuple(sorted_by_time(events))
    assert journal.outcome is None


@more
def test_many_robots_killed_at_once(team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run", watched=True) as run:
        once_it_is_told(run)
        with run.standing_still():
            run.strike(signal.SIGKILL, *run.robots()[1::2])
        run.end()
        assert run.status() == 4
        nothing_is_left(run)
        named = re.findall(r"(\S+) was lost: its process was killed by SIGKILL", run.errors())
        assert named
        assert set(named) <= set(NAMES[TEAM.name][1::2])
    journal = read_journal((tmp_path / "run" / "run.journal").read_bytes())
    lost = [event.robot for event in journal.events if isinstance(event, Lost)]
    assert lost[: len(named)] == named
    assert len(lost) == len(named) or f"and {len(lost) - len(named)} others were lost" in run.errors()


@more
def test_all_robots_killed_at_once(team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run") as run:
        in_the_middle(run)
        with run.standing_still():
            run.strike(signal.SIGKILL, *run.robots())
        run.end()
        assert run.status() == 4
        assert "was lost: its process was killed by SIGKILL" in run.errors()
        nothing_is_left(run)


@more
@pytest.mark.parametrize(
    "signum", [signal.SIGRTMIN + 3, *(pytest.param(s, marks=slow) for s in (signal.SIGTERM, signal.SIGABRT))]
)
def test_a_robot_ended_by_another_signal(signum: int, team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run") as run:
        in_the_middle(run)
        run.strike(signum, run.robots()[10])
        run.end()
        assert run.status() == 4
        name = signum.name if isinstance(signum, signal.Signals) else f"signal {signum}"
        assert run.errors() == f"{team}: {NAMES[TEAM.name][10]} was lost: its process was killed by {name}\n"
        nothing_is_left(run)


@more
def test_a_stopped_robot_does_not_outlive_the_time_limit(team: Path, tmp_path: Path) -> None:
    for limit_s in (1, 10, 60):
        with searching(team, tmp_path / str(limit_s), "--timeout", str(limit_s)) as run:
            wait_until(lambda run=run: run.is_over or len(run.robots()) == len(TEAM.robots), "it hangs")  # type: ignore[misc]
            robots = run.robots()
            if len(robots) < len(TEAM.robots):
                continue  # the machine is so busy that the time was over before all had started
            with suppress(ProcessLookupError):
                run.strike(signal.SIGSTOP, robots[10])
            run.end()
            assert run.status() in {3, 4}
            nothing_is_left(run)
            return
    pytest.fail("16 robots do not start within a minute")


@more
def test_a_stopped_robot_does_not_outlive_ctrl_c(team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run") as run:
        in_the_middle(run)
        run.strike(signal.SIGSTOP, run.robots()[10])
        run.strike(signal.SIGINT, group=True)
        run.end()
        assert run.status() == 128 + signal.SIGINT
        nothing_is_left(run)


@more
def test_a_stopped_robot_does_not_outlive_a_killed_parent(team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run") as run:
        in_the_middle(run)
        run.strike(signal.SIGSTOP, run.robots()[10])
        run.strike(signal.SIGKILL)
        run.end()


@more
def test_robots_that_compute_do_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    with running(faulty("TEAM", "Spins"), tmp_path / "run") as run:
        robots = run.wait_for_robots(len(FAULTY.robots))
        wait_until(lambda: any(map(computes, robots)), "nobody computes")
        run.strike(signal.SIGKILL)
        run.end()


def computes(pid: int) -> bool:
    """Whether the robot has worked for longer than its start takes: a tenth of a second of the processor."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) > os.sysconf("SC_CLK_TCK") / 10


# Limits, and outputs that nobody reads


@more
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


@looped(
    ("module", "refusal"),
    [
        ("forked_process", r"processes for only 0 of 4 robots: Too many open files.*ulimit -n"),
        ("pool", r"does not allow a queue from \S+ to \S+: Too many open files.*ulimit -n"),
    ],
)
def test_without_more_open_files_a_run_says_which_limit_to_raise(
    module: str, refusal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_pipe() -> tuple[int, int]:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    here = SimpleNamespace(**{**vars(os), "pipe": no_pipe})
    monkeypatch.setattr(f"robochoc.communication.processes.{module}.os", here)
    with ProcessesRun(FAULTY, Raises) as run, pytest.raises(UnsupportedError, match=refusal):
        run.search()


@more
@pytest.mark.parametrize("open_files", [64, *(pytest.param(count, marks=slow) for count in (90, 120))])
def test_too_few_open_files(open_files: int, crowd: Path, tmp_path: Path) -> None:
    """At 120 the parent has more than half of the robots started, at 64 a few."""
    with running(solving(crowd), tmp_path / "run", open_files=open_files) as run:
        run.end()
        assert run.status() == 2
        assert re.search(r"only \d+ of 64 robots: Too many open files.*ulimit -n", run.errors())
        assert len(run.errors().splitlines()) == 1
        nothing_is_left(run)


@more
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["HasFewFiles"], r"UnsupportedError: \S+ needs more open files .*ulimit -n"),
        (["TalksToAll", "parent-has-few-files"], r"UnsupportedError: .* does not allow a queue from .*ulimit -n"),
    ],
)
def test_too_few_open_files_for_robots_that_talk(arguments: list[str], said: str, tmp_path: Path) -> None:
    """There are enough for the processes, and then a robot, or the parent, has not enough for the queues."""
    with running(faulty("CROWD", *arguments), tmp_path / "run") as run:
        run.end()
        assert run.status() == 1
        assert re.search(said, run.errors())
        assert run.left_behind() == []


# The live scene


@more
@pytest.mark.parametrize(
    "signum", [signal.SIGINT, *(pytest.param(s, marks=slow) for s in (signal.SIGTERM, signal.SIGKILL))]
)
def test_the_port_of_the_live_scene_is_free_again(signum: signal.Signals, tmp_path: Path) -> None:
    write_team(queens3d(2), tmp_path / "team")
    with running(solving(tmp_path / "team", "--withdraw", "--serve"), tmp_path / "run") as run:
        wait_until(lambda: "http://" in run.errors(), "it never served")
        (port,) = run.ports()
        run.strike(signum)
        run.end()
        assert run.status() == {signal.SIGINT: 0, signal.SIGTERM: 143, signal.SIGKILL: -9}[signum]
        nothing_is_left(run)
    with socket.create_server(("127.0.0.1", port)):
        pass


@more
def test_a_run_opens_no_port(team: Path, tmp_path: Path) -> None:
    with searching(team, tmp_path / "run") as run:
        in_the_middle(run)
        assert run.ports() == set()
