"""The central solver: cliques, symmetries and what is exported keep all solutions, and no others."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import PREDEFINED
from robochoc.formats.dialects.xcsp3.writer import xcsp3
from robochoc.generators.queens3d import queens3d
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Predicate, Relation, Semantics, Team
from robochoc.run import Options, Runtime, solve
from robochoc.solver.ace import AceProcess
from robochoc.solver.ace_messages import AceSolutions
from robochoc.solver.central import CentralAnswer, CentralSolver
from robochoc.solver.cliques import cliques, with_cliques
from robochoc.solver.encoding import Codes, CodeTable, Component, Network
from robochoc.solver.errors import SolverLostError
from robochoc.solver.solver_choice import AutoSolver
from robochoc.solver.symmetry import Symmetry, break_symmetries, orbits, symmetries
from robochoc.solver.team_network import identifiers
from robochoc.verification.checker import RefutedError
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.solver_networks import brute_force, misheard
from tests.support.xcsp3_solvers import read_document, run_java, solver_jar

pytestmark = pytest.mark.usefixtures("shared_solvers")


def random_network(chance: Random, names: Sequence[str], images: Sequence[Symmetry]) -> Network:
    """Random binary tables, each with all that `images` make of it: a network that has these symmetries."""
    codes = tuple(range(chance.choice((2, 3))))
    wanted: dict[Codes, set[Codes]] = {}
    for pair in itertools.combinations(range(len(names)), 2):
        if chance.random() < 0.35:
            rows = [row for row in itertools.product(codes, codes) if chance.random() < 0.75]
            for symmetry in images:
                scope = tuple(symmetry.image[place] for place in pair)
                moved = {tuple(codes[-1] - c if symmetry.reflects else c for c in row) for row in rows}
                turned = moved if scope == tuple(sorted(scope)) else {(b, a) for a, b in moved}
                kept = wanted.setdefault(tuple(sorted(scope)), set(itertools.product(codes, codes)))
                kept &= turned
    tables = (CodeTable(scope, allowed=True, rows=tuple(sorted(rows))) for scope, rows in wanted.items())
    return Network(tuple(codes for _ in names), tuple(tables))


def closed(generators: Sequence[Symmetry], size: int) -> list[Symmetry]:
    group = {Symmetry(tuple(range(size)), reflects=False)}
    while new := {one.then(other) for one in group for other in generators} - group:
        group |= new
    return sorted(group)


def moved(rows: int, columns: int) -> Iterator[Codes]:
    """Where the cells of a board go when it is mirrored either way, or (a square one) turned over."""
    cells = list(itertools.product(range(rows), range(columns)))
    yield tuple(cells.index((rows - 1 - row, column)) for row, column in cells)
    yield tuple(cells.index((row, columns - 1 - column)) for row, column in cells)
    if rows == columns:
        yield tuple(cells.index((column, row)) for row, column in cells)


@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in (1, 2))])
def test_symmetries_are_found_and_broken_without_losing_an_orbit(batch: int) -> None:
    chance = Random(f"symmetric {batch}")
    seen = 0
    for _ in range(100):
        rows, columns = chance.choice(((2, 2), (2, 3), (3, 3)))
        names = [f"V{row}.{column}" for row in range(1, rows + 1) for column in range(1, columns + 1)]
        generators = [Symmetry(tuple(range(len(names))), reflects=True)]
        generators += [Symmetry(image, reflects=False) for image in moved(rows, columns)]
        wanted = chance.sample(generators, chance.randint(1, len(generators)))
        network = random_network(chance, names, closed(wanted, len(names)))
        part = Component(tuple(names), (0, 1, 2), network)
        group = symmetries(part)
        assert set(wanted) <= {*group, Symmetry(tuple(range(len(names))), reflects=False)}
        every = set(brute_force(network))
        firsts = set(brute_force(break_symmetries(network, group)))
        assert firsts <= every
        assert orbits(sorted(firsts), group, network) == every
        seen += len(every) > len(firsts) > 0
    assert seen > 15


def test_a_wrong_guess_is_no_symmetry() -> None:
    network = Network(((0, 1), (0, 1)), (CodeTable((0, 1), allowed=True, rows=((0, 1), (1, 1))),))
    assert symmetries(Component(("V1", "V2"), (0, 1), network)) == ()


def test_cliques_cover_every_pair_and_are_cliques() -> None:
    chance = Random("cliques")
    for _ in range(200):
        pairs = [pair for pair in itertools.combinations(range(8), 2) if chance.random() < 0.5]
        found = cliques(pairs)
        covered = {pair for clique in found for pair in itertools.combinations(clique, 2)}
        assert covered == set(pairs)


def test_cliques_made_explicit_keep_the_solutions() -> None:
    """Also where two constraints on one pair demand different things."""
    chance = Random("explicit")
    for _ in range(300):
        size, domain = chance.randint(2, 5), tuple(range(chance.randint(2, 4)))
        tables = []
        for scope in itertools.combinations(range(size), 2):
            for _ in range(chance.choice((0, 1, 1, 2))):
                kind = chance.random()
                rows = [row for row in itertools.product(domain, domain) if row[0] != row[1] or kind > 0.7]
                if kind > 0.4:
                    rows = [row for row in rows if chance.random() < 0.8]
                tables.append(CodeTable(scope, allowed=True, rows=tuple(rows)))
        network = Network(tuple(domain for _ in range(size)), tuple(tables))
        every = set(brute_force(network))
        assert set(brute_force(with_cliques(network, lambda _: None))) == every
        assert set(brute_force(with_cliques(network, lambda part: tuple(brute_force(part))))) == every


@looped(
    ("n", "model", "count"),
    [(1, "planar", 1), (2, "planar", 0), (4, "planar", 0), (4, "full", 0), (5, "planar", 0), (7, "planar", 56)],
)
@looped("robots", ["cells", "rows"])
def test_queens_are_counted(n: int, model: str, count: int, robots: str, solver: AceProcess) -> None:
    judgement = CentralSolver(solver=solver).solve(queens3d(n, model, robots), count=True)
    assert judgement.count == count
    assert judgement.verdict is (Verdict.SOLUTION if count else Verdict.NO_SOLUTION)


@pytest.mark.usefixtures("warm_ace")
@pytest.mark.parametrize("always", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["by ACE", "as it comes"])
def test_the_papers_528_solutions_are_all_there(*, always: bool) -> None:
    assert CentralSolver(always_ace=always).solve(queens3d(11), count=True).count == 528


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("model", ["planar", "full"])
def test_twelve_have_no_solution(model: str) -> None:
    assert CentralSolver().solve(queens3d(12, model)).verdict is Verdict.NO_SOLUTION


def test_small_permutations_with_a_value_missing_are_solved(solver: AceProcess) -> None:
    """ACE 2.6 makes a table of such an allDifferent, and fails at the value that a variable lacks."""
    chance = Random("permutations")
    for _ in range(60):
        size = chance.randint(3, 6)
        values = tuple(range(size))
        owned = {f"R{number}": [f"V{number}"] for number in range(size)}
        domains = {
            f"V{number}": sorted(chance.sample(values, chance.choice((2, size, size)))) for number in range(size)
        }
        differ = [Constraint("C", PREDEFINED["ne"], pair, pair) for pair in itertools.combinations(domains, 2)]
        team = complex_team(owned, domains, differ)
        count = sum(len(set(row)) == size for row in itertools.product(*domains.values()))
        assert CentralSolver(solver=solver).solve(team, count=True).count == count


def test_latin_rectangles_are_counted(solver: AceProcess) -> None:
    for rows, columns, count in ((2, 3, 12), (3, 3, 12), (2, 4, 216), (4, 4, 576)):
        cells = [f"V{row}.{column}" for row in range(1, rows + 1) for column in range(1, columns + 1)]
        lines = [[c for c in cells if c.startswith(f"V{row}.")] for row in range(1, rows + 1)]
        lines += [[c for c in cells if c.endswith(f".{column}")] for column in range(1, columns + 1)]
        pairs = [pair for line in lines for pair in itertools.combinations(line, 2)]
        differ = [Constraint("C", PREDEFINED["ne"], pair, pair) for pair in pairs]
        domains = {cell: range(1, columns + 1) for cell in cells}
        team = complex_team({f"R{cell[1:]}": [cell] for cell in cells}, domains, differ)
        assert CentralSolver(solver=solver).solve(team, count=True).count == count


def test_parts_that_share_nothing_are_multiplied(solver: AceProcess) -> None:
    differ = Relation("R", 2, Semantics.CONFLICTS, ((1, 1), (2, 2), (3, 3)))
    owned = {f"R{number}": [f"A{number}", f"B{number}"] for number in range(30)}
    domains = {name: (1, 2, 3) for names in owned.values() for name in names}
    team = complex_team(owned, domains, [Constraint("C", differ, (a, b), (a, b)) for a, b in owned.values()])
    assert CentralSolver(solver=solver).solve(team, count=True).count == 6**30
    assert len(CentralSolver(solver=solver).solve(team).assignment) == 60


def test_a_no_solution_that_the_judge_refutes_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AutoSolver, "solve", lambda *_, **__: CentralAnswer(Verdict.SOLUTION))
    with pytest.raises(RefutedError, match="no solution, but the central solver has found one"):
        solve(queens3d(4), Options(runtime=Runtime.SIMULATOR, verify=True))


def test_identifiers_are_legal_and_different() -> None:
    names = ["V1.1", "V1_1", "1a", "ä", "V1.1", "_"]
    found = identifiers(names)
    assert len(set(found)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) for name in found)


def read_back(content: bytes) -> int:
    """The number of solutions of an exported instance, by hand."""
    document = read_document(content)
    rows = itertools.product(*document.domains.values())
    return sum(document.allows(dict(zip(document.domains, row, strict=True))) for row in rows)


@pytest.mark.usefixtures("warm_ace")
def test_what_is_exported_has_the_same_solutions() -> None:
    chance = Random("exported")
    with AceProcess() as writer:
        for _ in range(12):
            team = random_complex_team(chance)
            assert read_back(xcsp3(team, writer)) == sum(1 for _ in solutions(team)), team


def negative_team() -> Team:
    sums = Relation("R", 2, Semantics.SUPPORTS, ((-3, -1), (-3, -2), (-1, 5)))
    product = Predicate("p", ("X", "Y"), parse("gt(mul(X, Y), 3)", ("X", "Y"), Type.BOOLEAN))
    owned = {"A": ["X1", "X2"], "B": ["Y1"]}
    domains = {"X1": (-3, -1), "X2": (-2, -1, 5), "Y1": (-4, 0, 4)}
    constraints = [
        Constraint("C1", sums, ("X1", "X2"), ("X1", "X2")),
        Constraint("C2", product, ("X2", "Y1"), ("X2", "Y1")),
    ]
    return complex_team(owned, domains, constraints)


TEAMS: dict[str, Callable[[], Team]] = {
    "seven queens": lambda: queens3d(7),
    "four queens": lambda: queens3d(4),
    "negative numbers": negative_team,
}


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        pytest.param("seven queens", "s SATISFIABLE", marks=pytest.mark.slow),
        pytest.param("four queens", "s UNSATISFIABLE", marks=pytest.mark.more),
        ("negative numbers", "s SATISFIABLE"),
    ],
)
def test_choco_reads_what_is_exported(name: str, answer: str, tmp_path: Path) -> None:
    path = tmp_path / "team.xml"
    path.write_bytes(xcsp3(TEAMS[name]()))
    assert answer in run_java(solver_jar("choco"), "org.chocosolver.parser.xcsp.ChocoXCSP", str(path), "-limit=[50s]")


@pytest.mark.usefixtures("warm_ace")
def test_a_search_that_broke_off_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """ACE says so in one line of many; a broken-off search without solutions is no `no-solution`."""
    misheard(monkeypatch, AceSolutions(found=0, complete=False, solutions=b""))
    for options in ({"count": True}, {"count": False}):
        with pytest.raises(SolverLostError, match="stopped before"):
            CentralSolver(always_ace=True).solve(queens3d(7), **options)
