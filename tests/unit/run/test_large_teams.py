"""Large teams in the simulator: work and memory grow as the team does, and ten thousand robots find an answer."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats import check_team, read_team, write_team
from robochoc.generators.coloring import coloring, coloring_of
from robochoc.generators.graphs import small_world, tree
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Expression, Name, compile_expression
from robochoc.model.expression.closures import Closure
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Domain, Predicate, Team, Variable
from robochoc.run import Options, Runtime, solve
from robochoc.run.registry import protocol_named
from robochoc.solver import encoding
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compile import TeamCompileTimeoutError
from robochoc.verification.checker import violations
from tests.support.growth import kept_bytes, operations
from tests.support.limits import HANG_S

SMALL = 40
TWICE = 2.6
"""More than twice as much work for twice as many robots, and far less than four times."""


def ring(agents: int) -> Team:
    return coloring_of(small_world(agents, 2, 0), 3)


def simulated(protocol: str, **settings: str) -> Options:
    return Options(runtime=Runtime.SIMULATOR, protocol=protocol, settings=settings)


def in_files(team: Team, folder: Path) -> Path:
    write_team(team, folder / team.name, replace=True)
    return folder / team.name


STAGES: dict[str, Callable[[Team, Path], Callable[[], object]]] = {
    "generate": lambda team, _: lambda: coloring_of(tree(len(team.robots)), 3),
    "check": lambda team, _: lambda: check_team(Team(team.name, team.robots)),
    "write": lambda team, folder: lambda: in_files(team, folder),
    "read": lambda team, folder: partial(read_team, in_files(team, folder)),
    "set up": lambda team, _: lambda: Simulation(team, protocol_named("dsa"), Concurrent(0)),
    "dsa": lambda team, _: lambda: solve(team, simulated("dsa", cycles="3")),
    "mgm": lambda team, _: lambda: solve(team, simulated("mgm", cycles="3")),
    "maxsum": lambda team, _: lambda: solve(team, simulated("maxsum", cycles="3")),
}
"""By name: what is counted, of a team and a folder to write to."""


@pytest.mark.parametrize("stage", STAGES)
def test_work_grows_as_the_team_does(stage: str, tmp_path: Path) -> None:
    STAGES[stage](ring(4), tmp_path)()  # what is imported, and made once
    size = 10 * SMALL if stage == "generate" else SMALL
    once, twice = (operations(STAGES[stage](ring(agents), tmp_path)) for agents in (size, 2 * size))
    assert once > size
    assert twice < TWICE * once


@pytest.mark.parametrize("protocol", ["abt", "afc-ng", "afc-tree", "dsa", "mgm", "mgm2", "maxsum", "dpop"])
def test_the_memory_of_robots_grows_as_the_team_does(protocol: str) -> None:
    def memory(agents: int) -> int:
        team = ring(agents)
        assert len(team.order) == len(team.owner) == agents  # made once, kept by the team
        return kept_bytes(lambda: Simulation(team, protocol_named(protocol), Concurrent(0)))

    memory(4)
    once, twice = memory(2 * SMALL), memory(4 * SMALL)
    assert 0 < twice < TWICE * once


def test_hundreds_of_robots_from_files(tmp_path: Path) -> None:
    team = coloring(500, 3, 4)
    read = read_team(in_files(team, tmp_path))
    assert read == team
    outcome = solve(read, simulated("dsa", cycles="2"))
    assert outcome.verdict is Verdict.SOLUTION
    assert outcome.metrics.messages == {"Value": 2 * 2 * 1_000}
    assert list(violations(read, outcome.assignment)) == []


def wide(robots: int) -> Team:
    """Return robots that share one constraint: at least one takes 1."""
    names = tuple(f"X{number}" for number in range(robots))
    body = Apply("ge", (Apply("add", tuple(Name(name) for name in names)), Constant(1)))
    scope = tuple(f"V{number}" for number in range(robots))
    variables = {f"R{number}": [Variable(f"V{number}", Domain("D", (range(2),)))] for number in range(robots)}
    return assemble("wide", variables, [Constraint("some", Predicate("some", names, body), scope, scope)])


def test_a_constraint_of_many_robots_is_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    team = wide(20)
    compiled: list[Sequence[str]] = []

    def compile_noted(body: Expression, names: Sequence[str]) -> Closure:
        compiled.append(names)
        return compile_expression(body, names)

    monkeypatch.setattr(encoding, "compile_expression", compile_noted)
    run = Simulation(team, protocol_named("dsa"), Concurrent(0), parameters=RunParameters(settings={"cycles": "2"}))
    assert run.search().verdict is Verdict.SOLUTION
    assert len(compiled) == 1


def test_time_ends_the_setting_up_too() -> None:
    with pytest.raises(TeamCompileTimeoutError, match="the time limit was reached before R0 was set up"):
        Simulation(wide(3), protocol_named("dsa"), Concurrent(0), deadline=0)
    # The limit may be a timeout or a deadline: no option is named that was not given.
    for limited in (Options(timeout=1e-9), Options(deadline=1e-9)):
        outcome = solve(wide(3), replace(limited, runtime=Runtime.SIMULATOR, protocol="dsa"))
        assert outcome.verdict is Verdict.UNKNOWN
        assert outcome.reason == "the time limit was exceeded while R0 was compiled"


GIB = 1 << 30


def robochoc_in_a_gibibyte(*words: str) -> str:
    """Run the program in a process that may take 1 GiB of addresses, and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "robochoc", *words],
        stdout=subprocess.PIPE,
        text=True,
        timeout=5 * HANG_S,
        check=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (GIB, GIB)),
    )
    return done.stdout


@pytest.mark.slow
@pytest.mark.timeout(3_000)
def test_ten_thousand_robots(tmp_path: Path) -> None:
    sparse, branches, easy = (str(tmp_path / name) for name in ("sparse", "branches", "easy"))
    of_size = ("generate", "coloring", "--agents", "10000")
    robochoc_in_a_gibibyte(*of_size, "--degree", "4", "-o", sparse)
    robochoc_in_a_gibibyte(*of_size, "--graph", "tree", "-o", branches)
    robochoc_in_a_gibibyte(*of_size, "--graph", "tree", "--conflicts", "hard", "-o", easy)
    assert "10000 robots" in robochoc_in_a_gibibyte("validate", sparse)
    runs = [
        *((sparse, protocol, ("--set", "cycles=20"), "solution") for protocol in ("dsa", "mgm", "maxsum")),
        (branches, "dpop", (), "optimal"),
        (easy, "abt", (), "solution"),
    ]
    for folder, protocol, options, verdict in runs:
        words = ("solve", folder, "--runtime", "simulator", "--protocol", protocol, *options, "--json")
        found = json.loads(robochoc_in_a_gibibyte(*words))
        assert (found["verdict"], len(found["assignment"])) == (verdict, 10_000)
