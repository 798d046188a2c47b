"""3D N^2 queens: Figure 2 to the letter, the two models, and what is known about n = 4, 7 and 11."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from robochoc.formats import read_robot, read_team, write_team
from robochoc.generators.queens3d import QueensModel, queens3d
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.verification.checker import needlessly_withdrawn, violations
from tests.support.cases import looped
from tests.support.limits import HANG_S
from tests.support.program import ROOT

FIGURE_2 = ROOT / "tests" / "data" / "figure2" / "Robot3.1.xml"
INSTANCES = ROOT / "instances"
IN_PROCESSES = pytest.param(Runtime.PROCESSES, marks=pytest.mark.slow)


def attacks(model: QueensModel, one: tuple[int, int, int], other: tuple[int, int, int]) -> bool:
    """Whether queens at (row, column, level) attack each other, from first principles."""
    row, column, level = (abs(a - b) for a, b in zip(one, other, strict=True))
    in_a_line = len({row, column, level} - {0}) == 1
    if 0 not in (row, column, level):
        return in_a_line and model is QueensModel.FULL
    if level == 0 or row == 0 or column == 0:
        return in_a_line
    return False


def test_robot_3_1_of_four_is_figure_2() -> None:
    figure, ours = read_robot(FIGURE_2), queens3d(4)["Robot3.1"]
    assert ours.variables == figure.variables
    assert [parent.name for parent in ours.parents] == [parent.name for parent in figure.parents]
    assert ours.children == figure.children
    assert [topic.name for topic in ours.topics] == [topic.name for topic in figure.topics]
    for mine, theirs in zip(ours.shared, figure.shared, strict=True):
        assert (mine.name, mine.scope, mine.parameters, mine.model) == (
            theirs.name,
            theirs.scope,
            theirs.parameters,
            theirs.model,
        )
        assert allowed(mine) == allowed(theirs)


def allowed(constraint: Constraint) -> list[bool]:
    pairs = itertools.product(range(1, 5), repeat=2)
    return [constraint.allows(dict(zip(constraint.variables, pair, strict=True))) for pair in pairs]


@looped("model", list(QueensModel))
@looped("n", [1, 2, 3, 4, 5])
def test_constraints_say_who_attacks_whom(n: int, model: QueensModel) -> None:
    team = queens3d(n, model)
    cells = list(itertools.product(range(1, n + 1), repeat=2))
    shared = {constraint.variables: constraint for constraint in team.constraints()}
    for one, other in itertools.combinations(cells, 2):
        names = (f"V{one[0]}.{one[1]}", f"V{other[0]}.{other[1]}")
        constraint = shared.get(names)
        for levels in itertools.product(range(1, n + 1), repeat=2):
            allows = constraint is None or constraint.allows(dict(zip(names, levels, strict=True)))
            queens = ((one[0], one[1], levels[0]), (other[0], other[1], levels[1]))
            assert allows is not attacks(model, *queens)


def test_priority_is_lexicographic() -> None:
    order = queens3d(11).order
    assert order[:2] == ("Robot1.1", "Robot1.2")
    assert order[9:12] == ("Robot1.10", "Robot1.11", "Robot2.1")


@pytest.mark.parametrize("model", list(QueensModel))
def test_written_and_read_it_is_the_same(tmp_path: Path, model: QueensModel) -> None:
    team = queens3d(4, model)
    write_team(team, tmp_path / "queens3d-4")
    assert read_team(tmp_path / "queens3d-4") == team


@pytest.mark.parametrize("n", [4, 7])
def test_the_instances_in_the_repository_are_what_generate_writes(n: int) -> None:
    assert read_team(INSTANCES / f"queens3d-{n}") == queens3d(n)


@pytest.mark.parametrize(
    ("model", "runtime"),
    [
        (QueensModel.PLANAR, Runtime.SIMULATOR),
        (QueensModel.FULL, Runtime.SIMULATOR),
        pytest.param(QueensModel.FULL, Runtime.PROCESSES, marks=pytest.mark.more),
        pytest.param(QueensModel.PLANAR, Runtime.PROCESSES, marks=pytest.mark.slow),
    ],
)
def test_four_has_no_solution_and_some_can_fly(model: QueensModel, runtime: Runtime) -> None:
    team = queens3d(4, model)
    assert solve(team, Options(runtime=runtime)).verdict is Verdict.NO_SOLUTION
    outcome = solve(team, Options(runtime=runtime, withdraw=Withdrawal.MAXIMAL))
    assert outcome.verdict is Verdict.SOLUTION
    assert not list(violations(team, outcome.assignment, outcome.withdrawn))
    assert not list(needlessly_withdrawn(team, outcome.assignment, outcome.withdrawn))
    most = {QueensModel.PLANAR: 10, QueensModel.FULL: 7}[model]
    assert len(outcome.assignment) <= most


@pytest.mark.parametrize("runtime", [Runtime.SIMULATOR, IN_PROCESSES])
@looped("protocol", ["abt", "sfb"])
@looped(("model", "most"), [("planar", 10), ("full", 7)])
def test_of_four_it_is_proven_how_many_can_fly(protocol: str, model: str, most: int, runtime: Runtime) -> None:
    """Whether the fewest are told after it has been found that not all can, or at once."""
    options = Options(protocol=protocol, runtime=runtime, withdraw=Withdrawal.MINIMUM, timeout=HANG_S)
    outcome = solve(queens3d(4, model), options)
    assert outcome.verdict is Verdict.OPTIMAL
    assert outcome.verified
    assert outcome.placed_by == (None if protocol == "sfb" else "sfb")
    assert len(outcome.assignment) == most


@pytest.mark.parametrize("runtime", [Runtime.SIMULATOR, IN_PROCESSES])
def test_seven_has_a_solution_in_planar_and_none_in_full(runtime: Runtime) -> None:
    assert solve(queens3d(7, "planar"), Options(runtime=runtime)).verdict is Verdict.SOLUTION
    assert solve(queens3d(7, "full"), Options(runtime=runtime)).verdict is Verdict.NO_SOLUTION


@pytest.mark.slow
@pytest.mark.parametrize("model", list(QueensModel))
def test_the_flagship_121_robots_in_121_processes(model: QueensModel) -> None:
    outcome = solve(queens3d(11, model), Options(timeout=HANG_S))
    assert outcome.verdict is Verdict.SOLUTION
    assert len(outcome.assignment) == 121
    assert outcome.verified
