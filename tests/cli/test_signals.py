"""Two hundred signals, to whatever runs: nothing is left, nothing is wrongly said, and nobody waits for ever.

Each strike is drawn from a seed that its test's name begins with: `ROBOCHOC_SIGNALS=SEED` draws others, and
`-k "SEED-NUMBER-"` repeats one. Moments are events of the run (its journal, its processes), and a little later.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Self

import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import Registered, Sent
from robochoc.journal.journal import Follower, JournalEntry, read_journal
from robochoc.model.problem import Team
from tests.support.faults import PROGRAM, Run, ignores_ctrl_c, is_stopped, running
from tests.support.limits import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

SEED = int(os.environ.get("ROBOCHOC_SIGNALS", "16"))
TEAMS: dict[str, tuple[Team, str]] = {
    "processes-solvable": (random_csp(14, 8, 0.5, 0.42, 0), "solution"),
    "processes-unsolvable": (random_csp(14, 6, 0.6, 0.35, 0), "no-solution"),
    "network-solvable": (random_csp(12, 6, 0.6, 0.38, 5), "solution"),
    "network-unsolvable": (random_csp(12, 6, 0.6, 0.38, 1), "no-solution"),
    "rows": (queens3d(4, robots="rows"), "no-solution"),
    "small": (queens3d(2), "no-solution"),
}
"""Teams, and their verdicts: those of a runtime search for a second, a solver (--ace) compiles `rows`."""
KILL, STOP, CONT, TERM, INT = signal.SIGKILL, signal.SIGSTOP, signal.SIGCONT, signal.SIGTERM, signal.SIGINT
FATAL = (KILL, TERM, INT)
TARGETS = {
    "processes": ("parent", "robot", "solver", "viewer"),
    "network": ("parent", "robot", "solver", "router", "viewer"),
}
MOMENTS = {
    "parent": ("listening", "there", "registered", "searching", "staying"),
    "robot": ("there", "registered", "searching"),
    "solver": ("there", "judging"),
    "router": ("there", "registered", "searching"),
    "viewer": ("there", "registered", "searching", "staying"),
}
"""When a target can be struck. `there`: it has just been started (parent: the first of the others)."""
STAYS = "stays until Ctrl-C"
PATIENCE_S = 2
STRIKES = 200
EACH = 4
LATER_S = 0.3
STOPPED = ("its process had been stopped", "it has not been there for", "it did not report at the end")
STOPPED_S = 0.5


@dataclass(frozen=True)
class Strike:
    """One signal to `target`, `later_s` after a moment, and what comes next.

    `team` is a key of `TEAMS`. A whole `group` gets it as from a terminal. Whoever is stopped goes on after a while
    (`then` is SIGCONT), is given up (None), or stays stopped while the parent gets another signal.
    """

    number: int
    runtime: str
    target: str
    signum: signal.Signals
    moment: str
    team: str
    then: signal.Signals | None = None
    later_s: float = 0
    victim: int = 0
    watched: bool = False
    group: bool = False

    def __str__(self) -> str:
        """Its name, from which it can be found again."""
        then = f"-{self.then.name}" if self.then else ""
        return f"{SEED}-{self.number}-{self.runtime}-{self.target}-{self.signum.name}{then}-{self.moment}"

    @property
    def robot(self) -> str:
        """Whose process is struck, if a robot's is."""
        robots = TEAMS[self.team][0].robots
        return robots[self.victim % len(robots)].name

    @property
    def given_up(self) -> bool:
        """Whether its target is stopped for good."""
        return self.signum is STOP and self.then is None

    def command(self, folder: Path, home: Path) -> list[str]:
        options = ["--protocol", "abt", "--runtime", self.runtime, "--json", "--journal", str(home / "run.journal")]
        if self.team == "rows":
            options += ["--ace", "--no-cache", "--verify"]
        if self.watched:
            options.append("--sniff")
        if self.given_up:
            options += ["--timeout" if self.target == "solver" else "--patience", str(PATIENCE_S)]
        return [PROGRAM, "solve", str(folder / self.team), *options]


def drawn(seed: int, count: int = STRIKES) -> Iterator[Strike]:
    """Each target gets each signal, at `EACH` moments; then targets are stopped, and the parent gets a signal."""
    chance = random.Random(seed)
    pairs = [(runtime, target) for runtime, targets in TARGETS.items() for target in targets]
    rest: list[tuple[tuple[str, str], signal.Signals, signal.Signals | None]] = [
        (pair, signum, None) for pair in pairs for signum in (*FATAL, CONT) for _ in range(EACH)
    ]
    rest += [(pair, STOP, then) for pair in pairs for then in (CONT, CONT, None, None)]
    both = [(pair, STOP, then) for pair in pairs for then in FATAL]
    rest += chance.sample(both, count - len(rest))
    chance.shuffle(rest)
    for number, ((runtime, target), signum, then) in enumerate(rest):
        follows = CONT if signum is STOP and then is None and target in {"parent", "viewer"} else then
        moments = MOMENTS[target][1:] if follows is None and target == "router" else MOMENTS[target]
        if follows is None and runtime == "network" and signum is STOP and target == "robot":
            moments = ("searching",)  # who has not come yet is waited for, whatever the patience
        moment = chance.choice(moments)
        solving = target == "solver" or (target == "parent" and moment == "there")
        yield Strike(
            number=number,
            runtime=runtime,
            target=target,
            signum=signum,
            moment=moment,
            later_s=chance.choice([0, chance.uniform(0, LATER_S)]),
            team="rows" if solving else f"{runtime}-{chance.choice(['solvable', 'unsolvable'])}",
            victim=chance.randrange(100),
            watched=target == "viewer" or moment == "staying",
            group=target == "parent" and signum is INT and chance.random() < 0.5,
            then=follows,
        )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The teams, each in a folder of its own."""
    folder = tmp_path_factory.mktemp("teams")
    for name, (team, _) in TEAMS.items():
        write_team(team, folder / name)
    return folder


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder with a short name: what is in it has to do as the address of a socket."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


class Watched:
    """A run, and what its journal has told so far."""

    def __init__(self, strike: Strike, run: Run) -> None:
        self._strike = strike
        self.run = run
        self._journal = run.home / "run.journal"
        self._file: BinaryIO | None = None
        self._follower: Follower | None = None
        self._kinds: set[type[JournalEntry]] = set()
        self._solvers: set[int] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file:
            self._file.close()

    def wait(self) -> int | None:
        """Wait for the strike's moment; return the target's process, or None when there is none any more."""
        happened: Mapping[str, Callable[[], bool]] = {
            "listening": lambda: True,
            "there": lambda: self.target() is not None,
            "registered": lambda: self.told(Registered),
            "searching": lambda: self.told(Sent),
            "judging": self.another_solver,
            "staying": lambda: STAYS in self.run.errors(),
        }
        self.run.wait_until_listening()
        moment, began = self._strike.moment, happened[self._strike.moment]
        if self._strike.target == "parent" and moment == "there":
            began = lambda: self.run.program("solver") is not None  # noqa: E731
        wait_until(lambda: began() or self.run.is_over, f"it never came to {moment}")
        if self._strike.then is KILL:  # nobody wakes who is stopped before it could ask for that
            wait_until(lambda: self.run.is_over or self.is_ready(), "it never listened")
        time.sleep(self._strike.later_s)
        return None if self.run.is_over else self.target()

    def target(self) -> int | None:
        """The process that is to be struck, while there is one."""
        if self._strike.target == "parent":
            return self.run.pid
        if self._strike.target == "robot":
            return self.run.robot(self._strike.robot)
        return self.run.program(self._strike.target)

    def is_ready(self) -> bool:
        """Whether the target is past the start of Python: all of them ignore Ctrl-C, but the parent, who hears it."""
        target = self.target()
        return target is None or target == self.run.pid or ignores_ctrl_c(target)

    def another_solver(self) -> bool:
        """Whether there is a solver, and not the one that has compiled."""
        solver = self.run.program("solver")
        if solver is not None:
            self._solvers.add(solver)
        return len(self._solvers) > 1

    def told(self, kind: type[JournalEntry]) -> bool:
        """Whether the journal has told of such an event."""
        if self._follower is None:
            if not self._journal.exists():
                return False
            self._file = self._journal.open("rb")
            self._follower = Follower(self._file)
        self._kinds.update(type(line) for line in self._follower.read())
        return kind in self._kinds

    def leave(self) -> None:
        """Ctrl-C, once the run is over and its page only stays."""
        wait_until(lambda: STAYS in self.run.errors() or self.run.is_over, "it does not come to its end")
        if not self.run.is_over:
            self.run.strike(INT)


def struck(strike: Strike, folder: Path, home: Path) -> str:
    """Strike a run, hold what follows against all that is promised, and return how it ended."""
    with running(strike.command(folder, home), home) as run, Watched(strike, run) as watched:
        target = watched.wait()
        sockets = run.listening()
        on_parent = target is not None and (strike.target == "parent" or strike.then in FATAL)
        if target is not None:
            _send(strike, run, target)
        fatal = on_parent and (strike.signum in FATAL or strike.then in FATAL)
        if strike.watched and not fatal:
            watched.leave()
        took = run.end()
        status, errors = run.status(), run.errors()
        ended = f"{strike}: status {status} after {took:.1f} s: {errors}"
        for fault in ("Traceback", "Exception", "Fatal", "panicked"):
            assert fault not in errors, ended
        last = strike.then if strike.then in FATAL else strike.signum
        assert status in statuses(strike, last, fatal=fatal, struck=target is not None), ended
        if status > 0 and status < 128:
            assert told(strike, errors), ended
        right(strike, run, status)
        wait_until(lambda: not run.left_behind(), f"{ended}: it leaves {run.left_behind()}")
        assert not run.still_listening(sockets), ended
    _journal_is_right(strike, home, killed=fatal and last is KILL)
    return f"{status}" + ("" if target else " (too late)") + f", {took:.1f} s"


def _send(strike: Strike, run: Run, target: int) -> None:
    """The signal, and what comes after it."""
    with suppress(ProcessLookupError):  # it has ended in this moment
        run.strike(strike.signum, *([] if strike.group else [target]), group=strike.group)
    if strike.signum is not STOP or strike.then is None:
        return
    wait_until(lambda: is_stopped(target), "it cannot be stopped")
    if strike.then is CONT:
        time.sleep(STOPPED_S)  # so that the others notice, or do not; whatever they do has to be right
    if strike.then in FATAL:
        run.strike(strike.then)
    if strike.target == "parent" or strike.then is CONT:
        with suppress(ProcessLookupError):
            run.strike(CONT, target)


def statuses(strike: Strike, last: signal.Signals, *, fatal: bool, struck: bool) -> set[int]:
    """The exit statuses that may follow; 0 for whatever came too late."""
    if not struck:
        return {0, 3} if strike.given_up else {0}
    if fatal:
        own = -KILL if last is KILL else 128 + last
        return {own, 0} if last is INT or strike.moment != "staying" else {own}
    if strike.given_up:
        return {0, 3} if strike.target == "solver" else {0, 4}
    if strike.signum not in {KILL, TERM}:
        return {0}
    # Without its page a run ends by itself: Ctrl-C, which is for the page, may come in the middle of that.
    return {0, 128 + INT} if strike.target == "viewer" else {0, 4}


def told(strike: Strike, errors: str) -> bool:
    """Whether the reason why there is no answer is the strike."""
    if strike.given_up:
        whys = {
            "robot": tuple(f"{strike.robot} was lost: {why}" for why in STOPPED),
            "solver": ("the time was over",),
            "router": ("was lost: it has not been there for", "the router's process did not respond"),
        }[strike.target]
    else:
        name = strike.signum.name
        whys = {
            "robot": (f"{strike.robot} was lost: its process was killed by {name}",),
            "solver": (f"the constraint solver's process was killed by {name}",),
            "router": ("the router's process has ended",),
        }[strike.target]
    return any(why in errors for why in whys)


def right(strike: Strike, run: Run, status: int) -> None:
    """There is an answer, and it is right, where the exit status says so; otherwise there is none, or the right one."""
    team, verdict = TEAMS[strike.team]
    output = run.output()
    if not output:
        assert status != 0
        return
    said = json.loads(output)
    assert said["verdict"] == ("unknown" if status == 3 else verdict)
    if verdict == "solution" and status != 3:
        assert said["verified"]
        assert all(constraint.allows(said["assignment"]) for constraint in team.constraints())


def _journal_is_right(strike: Strike, home: Path, *, killed: bool) -> None:
    """What there is of it can be read, and holds no other verdict."""
    content = (home / "run.journal").read_bytes() if (home / "run.journal").exists() else b""
    if not content:
        return
    journal = read_journal(content)
    assert journal.damage is None or killed
    if journal.outcome:
        assert journal.outcome.verdict in {TEAMS[strike.team][1], "unknown"}


ALL = tuple(drawn(SEED))
FEW = (
    Strike(0, "network", "robot", STOP, "there", "network-solvable", KILL),
    Strike(1, "network", "router", STOP, "there", "network-solvable", KILL),
    Strike(2, "processes", "solver", STOP, "there", "rows", KILL),
    Strike(3, "processes", "parent", STOP, "listening", "small", TERM),
    Strike(4, "processes", "viewer", KILL, "registered", "small", watched=True),
    Strike(5, "processes", "parent", INT, "staying", "small", watched=True),
)


def test_each_target_gets_each_signal() -> None:
    assert len(ALL) == STRIKES
    wanted = {(runtime, target) for runtime, targets in TARGETS.items() for target in targets}
    assert {(strike.runtime, strike.target, strike.signum) for strike in ALL} == {
        (*pair, signum) for pair, signum in itertools.product(wanted, (KILL, STOP, CONT, TERM, INT))
    }


@pytest.mark.parametrize(
    "strike", [pytest.param(one, marks=() if one.team == "small" else pytest.mark.more) for one in FEW], ids=str
)
def test_a_signal_of_each_kind(strike: Strike, folder: Path, short_path: Path) -> None:
    struck(strike, folder, short_path / "run")


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("strike", ALL, ids=str)
def test_a_signal(
    strike: Strike, folder: Path, short_path: Path, record_property: Callable[[str, object], None]
) -> None:
    record_property("ended", struck(strike, folder, short_path / "run"))
