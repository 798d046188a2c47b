"""Exported problems have the optimum of brute force in the programs that they are for, where these are installed."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.external_programs import COSOCO, TOULBAR2
from tests.support.foreign_problems import Tables, optimum, random_problem, written
from tests.support.foreign_solvers import Solver, solvers, toulbar2_optima

ROUNDS = {"xcsp3": 30}
"""The number of problems of a format, if not 100: two Java processes are started for each XCSP3 file."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["xcsp3", "frodo", "cfn", "wcsp", "pydcop", "dcopsolver"])
def test_programs_find_the_optimum(kind: str, tmp_path: Path) -> None:
    programs = solvers().get(kind, {})
    if not programs:
        pytest.skip(f"no program for {kind} is installed: see tests/support/foreign_solvers.py")
    chance = Random(kind)
    for _ in range(ROUNDS.get(kind, 100)):
        problem, team = random_problem(chance, plain=chance.random() < 0.5, simple=kind == "dcopsolver")
        with contextlib.suppress(UnsupportedError):
            _compare(kind, programs, problem, team, tmp_path)


@pytest.mark.parametrize("kind", ["cfn", "wcsp"])
def test_toulbar2_reads_exports_and_finds_the_optimum(kind: str, tmp_path: Path) -> None:
    """100 problems in one process, by the reader of toulbar2 itself."""
    if not TOULBAR2.is_installed():
        pytest.skip("the extra toulbar2 is not installed")
    chance, wanted = Random(f"toulbar2 {kind}"), dict[Path, Fraction | None]()
    while len(wanted) < 100:
        problem, team = random_problem(chance, plain=kind == "wcsp" or chance.random() < 0.5)
        with contextlib.suppress(UnsupportedError):
            (content,) = written(kind, team).values()
            path = tmp_path / f"{len(wanted)}.{kind}"
            path.write_bytes(content)
            wanted[path] = problem.optimum()
    assert [*wanted.values()].count(None) > 2
    assert toulbar2_optima([*wanted]) == [*wanted.values()]


@pytest.mark.parametrize("problems", [8, pytest.param(100, marks=pytest.mark.slow)])
def test_cosoco_reads_exports_and_finds_the_optimum(problems: int, tmp_path: Path) -> None:
    """By the reader of cosoco itself; two processes are started for each problem."""
    if not COSOCO.is_installed():
        pytest.skip("the extra cosoco is not installed")
    chance = Random("cosoco")
    program = {"cosoco": solvers()["xcsp3"]["cosoco"]}
    for _ in range(problems):
        problem, team = random_problem(chance, plain=chance.random() < 0.5)
        with contextlib.suppress(UnsupportedError):
            _compare("xcsp3", program, problem, team, tmp_path)


def _compare(kind: str, programs: Mapping[str, Solver], problem: Tables, team: Team, folder: Path) -> None:
    file, content = next(iter(written(kind, team).items()))
    path = folder / file
    path.write_bytes(content)
    places = max(robot.costs.places for robot in team.robots) if kind == "xcsp3" else 0
    best = problem.optimum()
    assert best == optimum(team)
    wanted = None if best is None else best * 10**places
    assert {name: solve(path) for name, solve in programs.items()} == dict.fromkeys(programs, wanted)
