"""External central solvers: they find what ACE finds, end in time, and leave nothing behind."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import msgspec
import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.expression import Name
from robochoc.model.outcome import CENTRAL_SOLVER, Verdict
from robochoc.model.problem import Constraint, Domain, Function, ProblemKind, Relation, Robot, Semantics, Team, Variable
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.options import CentralSolverName
from robochoc.solver import external_process, racing
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import ENUMERATION, CentralAnswer, CentralSolver
from robochoc.solver.cosoco_process import _parsed as parsed
from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
from robochoc.solver.external_process import ExternalProcess
from robochoc.solver.external_programs import ACE_NETWORK, COSOCO, CP_SAT, PROGRAMS, TOULBAR2, ExternalProgram
from robochoc.solver.network_task import LENGTH, TaskAnswer
from robochoc.solver.racing import RacingSolver
from robochoc.solver.solver_choice import AutoSolver, only
from robochoc.verification.checker import RefutedError
from robochoc.verification.objective import withdrawal_cost
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, random_hard_team, with_costs
from tests.support.limits import HANG_S, wait_until
from tests.support.moved_clock import MovedClock
from tests.support.program import robochoc_within

needs_ortools = pytest.mark.skipif(not CP_SAT.is_installed(), reason="the extra ortools is not installed")
CENTRAL = Options(protocol="central", central_with=CentralSolverName.ORTOOLS)
SIMULATED = Options(protocol="syncbb", runtime=Runtime.SIMULATOR, verify=True)
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 13))]
EACH = 36
LONG = random_csp(30, 8, 0.3, 0, 1, max_cost=100)
"""A problem that no solver decides within the time limits of tests."""


@pytest.fixture(params=[*PROGRAMS])
def program(request: pytest.FixtureRequest) -> ExternalProgram:
    """An external solver; tests of a missing one are skipped."""
    chosen = PROGRAMS[request.param]
    if not chosen.is_installed():
        pytest.skip(f"the extra {chosen.extra} is not installed")
    return chosen


@pytest.fixture(params=[*PROGRAMS, "ace"])
def any_program(request: pytest.FixtureRequest) -> ExternalProgram:
    """An external solver, or ACE in the process in which it runs beside one."""
    chosen = PROGRAMS.get(request.param, ACE_NETWORK)
    if not chosen.is_installed():
        pytest.skip(f"the extra {chosen.extra} is not installed")
    return chosen


@pytest.fixture
def solver(any_program: ExternalProgram) -> Iterator[RacingSolver]:
    with only(any_program) as one:
        yield one


def any_team(chance: Random) -> Team:
    return chance.choice([random_cost_team, random_complex_cost_team, random_hard_team])(chance)


def same(one: CentralAnswer, other: CentralAnswer) -> bool:
    return (one.verdict, one.cost, one.bound) == (other.verdict, other.cost, other.bound)


def process_of(solver: RacingSolver) -> ExternalProcess:
    (process,) = vars(solver)["_runners"]
    assert isinstance(process, ExternalProcess)
    return process


def is_running(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("batch", BATCHES)
def test_all_solvers_find_the_same(batch: int, solver: RacingSolver) -> None:
    with AceProcess(always=batch > 0) as ace:
        for seed in range(EACH * batch, EACH * (batch + 1)):
            team = any_team(Random(seed))
            found, expected = solver.solve(team), CentralSolver(solver=ace).solve(team)
            assert same(found, expected), seed
            if found.cost is not None:
                assert found.cost == least_cost(team), seed
            if found.verdict is Verdict.NO_SOLUTION:
                price = int(withdrawal_cost(team))
                found, expected = (
                    one.solve(team, withdrawal_cost=price) for one in (solver, CentralSolver(solver=ace))
                )
                assert same(found, expected), seed


@pytest.mark.usefixtures("shared_solvers")
def test_whole_runs_of_it_are_checked_as_those_of_ace_are(program: ExternalProgram) -> None:
    team = queens3d(4)
    options = replace(CENTRAL, central_with=CentralSolverName(program.extra))
    outcome = solve(team, options)
    assert (outcome.verdict, outcome.solved_by) == (Verdict.NO_SOLUTION, (program.name,))
    outcome = solve(team, replace(options, withdraw=Withdrawal.MINIMUM))
    by_ace = solve(team, replace(options, withdraw=Withdrawal.MINIMUM, central_with=CentralSolverName.ACE))
    assert outcome.verified
    assert len(outcome.withdrawn) == len(by_ace.withdrawn)


@pytest.mark.usefixtures("shared_solvers")
def test_decimals_that_are_maximised(program: ExternalProgram) -> None:
    domain = Domain("D", (range(4),))
    tables = Relation("R", 2, Semantics.SOFT, ((0, 1), (1, 2), (2, 3)), (25, -150, 75), 10)
    constraints = (Constraint("C", tables, ("V1", "V2"), ("V1", "V2"), model=None),)
    robot = Robot("R1", (Variable("V1", domain), Variable("V2", domain)), ProblemKind.DISWCSP, constraints)
    robot = replace(robot, costs=replace(robot.costs, maximize=True, places=2, constant=5))
    outcome = solve(Team("sum", (robot,)), replace(CENTRAL, central_with=CentralSolverName(program.extra)))
    assert (outcome.verdict, str(outcome.cost)) == (Verdict.OPTIMAL, "0.80")
    assert outcome.assignment == {"V1": 2, "V2": 3}


@pytest.mark.parametrize("seconds", [1.0, pytest.param(10.0, marks=pytest.mark.more)])
def test_a_time_limit_ends_its_process_and_returns_the_best_solution(
    program: ExternalProgram, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    """The time is over once the solver has been searching for a while."""
    pids = list[int | None]()

    def note() -> None:
        pids.append(process_of(limited).pid)

    monkeypatch.setattr(racing, "REPORT_TIME_S", HANG_S)  # a busy machine may take long to print the best solution
    limited = only(program, time.monotonic() + seconds, note)
    found = limited.solve(LONG)
    assert found.verdict is Verdict.UNKNOWN
    assert found.cost is not None or seconds < 10
    assert found.cost is None or found.cost >= (found.bound or 0)
    assert process_of(limited).pid is None
    assert all(pids)
    assert not any(is_running(pid) for pid in pids if pid)


def test_a_solver_that_reports_nothing_is_killed(any_program: ExternalProgram, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = MovedClock()
    monkeypatch.setattr(racing, "time", clock)
    monkeypatch.setattr(external_process, "time", clock)
    monkeypatch.setattr(ExternalProcess, "interrupt", lambda _: None)
    limited = only(any_program, time.monotonic() + HANG_S, clock.end)
    assert limited.solve(LONG).verdict is Verdict.UNKNOWN
    assert process_of(limited).pid is None


def test_without_time_nothing_is_started(program: ExternalProgram) -> None:
    solver = only(program, deadline=time.monotonic() - 1)
    assert solver.solve(queens3d(4)).verdict is Verdict.UNKNOWN
    assert process_of(solver).pid is None


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_no_process_survives_a_killed_parent(any_program: ExternalProgram) -> None:
    program = any_program
    code = (
        "import sys; from robochoc.generators.random_csp import random_csp;"
        "from robochoc.solver.solver_choice import only; from robochoc.solver import external_programs as programs;"
        "program = programs.PROGRAMS.get(sys.argv[1], programs.ACE_NETWORK);"
        "solver = only(program, None, lambda: print(solver._runners[0].pid, flush=True));"
        "solver.solve(random_csp(30, 8, 0.3, 0, 1, max_cost=100))"
    )
    with subprocess.Popen([sys.executable, "-c", code, program.extra], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        while program in (COSOCO, ACE_NETWORK) and len(group_of(pid)) < 2:
            time.sleep(0.01)
        assert pid in group_of(pid)
        parent.kill()
    end = time.monotonic() + HANG_S
    while group_of(pid) and time.monotonic() < end:
        time.sleep(0.01)
    assert not group_of(pid)


def group_of(leader: int) -> list[int]:
    """The running processes in the group of a process."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, group = (folder / "stat").read_text(encoding="ascii").rpartition(")")[2].split()[:3]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(group) == leader and state != "Z":
            found.append(int(folder.name))
    return found


def test_a_process_that_dies_is_lost_and_the_next_task_starts_another(
    solver: RacingSolver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(external_process, "sys", type("sys", (), {"executable": "/bin/false"}))
    with pytest.raises(SolverLostError, match="was lost"):
        solver.solve(queens3d(4))
    monkeypatch.undo()
    assert solver.solve(queens3d(4)).verdict is Verdict.NO_SOLUTION


def hostile(answer: object) -> bytes:
    body = msgspec.msgpack.encode(answer)
    return LENGTH.pack(len(body)) + body


@pytest.mark.parametrize(
    "sent",
    [
        hostile(TaskAnswer((0,), proven=True)),
        hostile(TaskAnswer((99,) * 9, proven=True)),
        hostile(TaskAnswer((-1, 0, 0, 0, 0, 0, 0, 0, 0), proven=True)),
        hostile(["TaskAnswer", "x"]),
        hostile({"codes": 3}),
        LENGTH.pack(1 << 60),
        LENGTH.pack(3) + b"\xff\xff\xff",
        hostile(TaskAnswer(None, proven=True)) + b"more",
        b"",
    ],
)
def test_invalid_answers_are_refused(sent: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hostile.py").write_text(
        "import socket, sys\n"
        "one = socket.socket(fileno=int(sys.argv[1]))\n"
        "one.recv(8)\n"
        f"one.sendall({sent!r})\n"
        "one.close()\n",
        encoding="ascii",
    )
    monkeypatch.setattr(ExternalProcess, "_command", lambda _, at: [sys.executable, str(tmp_path / "hostile.py"), at])
    with pytest.raises(SolverLostError, match=r"invalid|lost"):
        only(CP_SAT._replace(package="msgspec")).solve(LONG)


def test_without_the_extra_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ExternalProgram, "is_installed", lambda _: False)
    for extra in PROGRAMS:
        with pytest.raises(SolverMissingError, match=rf"robochoc\[{extra}\]"):
            solve(queens3d(4), replace(CENTRAL, central_with=CentralSolverName(extra)))
    outcome = solve(with_costs(queens3d(3)), SIMULATED)
    assert outcome.confirmed_by == (CENTRAL_SOLVER,)


@pytest.mark.usefixtures("shared_solvers")
@needs_ortools
def test_verify_asks_two() -> None:
    outcome = solve(with_costs(queens3d(3)), SIMULATED)
    assert outcome.confirmed
    assert outcome.confirmed_by == (CENTRAL_SOLVER, "OR-Tools")


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("team", [queens3d(4), random_csp(6, 4, 0.6, 0, 1, max_cost=9)], ids=["no-solution", "optimum"])
def test_a_central_answer_is_confirmed_by_another_solver(team: Team) -> None:
    outcome = solve(team, Options(protocol="central", verify=True))
    assert outcome.solved_by == (ENUMERATION,)
    assert outcome.confirmed
    assert len(outcome.confirmed_by) == 1
    if CP_SAT.is_installed():
        outcome = solve(team, Options(protocol="central", central_with=CentralSolverName.ORTOOLS, verify=True))
        assert (outcome.solved_by, outcome.confirmed_by) == (("OR-Tools",), (CENTRAL_SOLVER,))


@needs_ortools
def test_a_second_solver_that_disagrees_refutes(monkeypatch: pytest.MonkeyPatch) -> None:
    lie = CentralAnswer(Verdict.OPTIMAL, {}, cost=-1, bound=-1, solvers=("OR-Tools",))
    monkeypatch.setattr(RacingSolver, "solve", lambda *_, **__: lie)
    with pytest.raises(RefutedError, match="OR-Tools has found"):
        solve(with_costs(queens3d(3)), SIMULATED)


def test_costs_beyond_its_integers_are_refused() -> None:
    domain = Domain("D", (range(3),))
    huge = Relation("R", 1, Semantics.SOFT, ((0,), (1,)), (10**17, 1), 3)
    other = Function("F", ("X",), Name("X"))
    constraints = tuple(Constraint("C", one, ("V1",), ("V1",), model=None) for one in (huge, other))
    team = Team("huge", (Robot("R1", (Variable("V1", domain),), ProblemKind.DISWCSP, constraints),))
    for one in PROGRAMS.values():
        with pytest.raises(UnsupportedError):
            only(one).solve(team)


def test_large_costs_are_exact_or_refused(solver: RacingSolver) -> None:
    """The sums of these costs need more than 32 bits; cosoco refuses them."""
    domain = Domain("D", (range(3),))
    prices = Relation("R", 2, Semantics.SOFT, ((0, 0), (0, 1), (1, 0)), (2**40 + 1, 2**40, 2**40 + 3), 2**41)
    other = Relation("S", 2, Semantics.SOFT, ((0, 1),), (2**50 + 1,), 2**49 + 2)
    constraints = tuple(Constraint("C", one, ("V1", "V2"), ("V1", "V2"), model=None) for one in (prices, other))
    variables = (Variable("V1", domain), Variable("V2", domain))
    team = Team("large", (Robot("R1", variables, ProblemKind.DISWCSP, constraints),))
    if solver.name == COSOCO.name:
        with pytest.raises(UnsupportedError, match="cosoco supports at most"):
            solver.solve(team)
    else:
        assert solver.solve(team).cost == least_cost(team) == 2**49 + 2**40 + 3


class TestAuto:
    def test_a_solver_that_fails_is_replaced(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Two external solvers die, and ACE answers."""
        broken = tuple(one._replace(module="robochoc.no_such_module", package="msgspec") for one in (TOULBAR2, CP_SAT))
        monkeypatch.setattr("robochoc.solver.solver_choice.FOR_COSTS", broken)
        team = random_csp(6, 4, 0.6, 0, 1, max_cost=9)
        found = AutoSolver(without=[ENUMERATION]).solve(team)
        assert (found.verdict, found.solvers) == (Verdict.OPTIMAL, ("ACE",))
        assert found.cost == only_ace(team)

    def test_two_solvers_in_parallel(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        """The first solver does not answer, the second one starts after a while, and the first one is ended."""
        (tmp_path / "silent.py").write_text("import time\ntime.sleep(10000)\n", encoding="ascii")
        command = ExternalProcess._command  # noqa: SLF001

        def silent(process: ExternalProcess, address: str) -> list[str]:
            if process.program.package == "msgspec":
                return [sys.executable, str(tmp_path / "silent.py"), address]
            return command(process, address)

        monkeypatch.setattr(ExternalProcess, "_command", silent)
        monkeypatch.setattr(racing, "HEDGE_S", 0.0)
        monkeypatch.setattr(
            "robochoc.solver.solver_choice.FOR_COSTS", (TOULBAR2._replace(name="silent", package="msgspec"),)
        )
        found = AutoSolver(without=[ENUMERATION]).solve(random_csp(6, 4, 0.6, 0, 1, max_cost=9))
        assert (found.verdict, found.solvers) == (Verdict.OPTIMAL, ("ACE",))

    @pytest.mark.usefixtures("shared_solvers")
    @pytest.mark.parametrize("batch", BATCHES)
    def test_it_finds_what_ace_finds(self, batch: int) -> None:
        for seed in range(EACH * batch, EACH * (batch + 1)):
            team = any_team(Random(seed))
            auto = AutoSolver(without=[ENUMERATION] if seed % 2 else [])
            found, expected = auto.solve(team), CentralSolver().solve(team)
            assert same(found, expected), seed
            assert seed % 2 or found.solvers == (ENUMERATION,), seed

    def test_without_other_solvers_an_answer_of_ace_cannot_be_verified(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(ExternalProgram, "is_installed", lambda _: False)
        options = Options(protocol="central", central_with=CentralSolverName.ACE, verify=True, cache=False)
        options = replace(options, local=replace(options.local, always_ace=True))
        with pytest.raises(SolverMissingError, match="a solver other than ACE"):
            solve(queens3d(4), options)


def only_ace(team: Team) -> int | None:
    with AceProcess(always=True) as ace:
        return CentralSolver(solver=ace).solve(team).cost


@pytest.mark.usefixtures("shared_solvers")
def test_the_command_line_and_json(tmp_path_factory: pytest.TempPathFactory, program: ExternalProgram) -> None:
    folder = tmp_path_factory.mktemp("team") / "q4"
    write_team(queens3d(4), folder)
    done = robochoc_within("solve", str(folder), "--protocol", "central", "--with", program.extra, "--json")
    result = json.loads(done.stdout)
    assert (result["verdict"], result["solved_by"]) == ("no-solution", [program.name])
    refused = robochoc_within("solve", str(folder), "--with", program.extra)
    assert refused.returncode == 2
    assert "add --protocol central" in refused.stderr
    refused = robochoc_within("solve", str(folder), "--protocol", "central", "--with", program.extra, "--count")
    assert refused.returncode == 2
    assert "--count is only for ACE" in refused.stderr


def test_nothing_is_left_in_the_folder_for_temporary_files(
    any_program: ExternalProgram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert only(any_program).solve(random_csp(6, 4, 0.6, 0, 1, max_cost=9)).verdict is Verdict.OPTIMAL
    # ACE ends soon after the process that has started it, and removes its folder.
    wait_until(lambda: not any(tmp_path.iterdir()), lambda: f"{[*tmp_path.iterdir()]} are left")


def test_a_contradiction_that_cosoco_finds_while_reading_is_the_verdict() -> None:
    """It goes on without the contradiction, and prints a second verdict with values."""
    assert parsed("s UNSATISFIABLE\ns SATISFIABLE\nv 5 0\n") == ("UNSATISFIABLE", None)
    assert parsed("s SATISFIABLE\nv 5 0\n") == ("SATISFIABLE", ["5", "0"])
