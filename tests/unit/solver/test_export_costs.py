"""What `export` and `compile` make of teams with costs."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import PREDEFINED, write_team
from robochoc.formats.dialects.xcsp3.writer import xcsp3
from robochoc.generators.coloring import coloring
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.errors import UnsupportedError
from tests.support.brute_force import least_cost
from tests.support.complex_problems import complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, with_costs
from tests.support.problems import team_of
from tests.support.program import robochoc, robochoc_within
from tests.support.xcsp3_solvers import read_document, run_java, solver_jar

pytestmark = pytest.mark.usefixtures("shared_solvers")


def least_exported(content: bytes) -> float:
    """The least cost of an exported instance, by hand: a table of each constraint that costs ends with its cost."""
    assert b'type="COP"' in content
    assert b'<minimize type="sum">' in content
    document = read_document(content)
    free = [name for name in document.domains if name not in document.paid]
    charged = [(scope[:-1], {row[:-1]: row[-1] for row in rows}) for scope, rows, _ in document.tables
               if scope[-1] in document.paid]  # fmt: skip
    last = {scope[-1] for scope, *_ in document.tables}
    anyway = sum(document.domains[name][0] for name in document.paid if name not in last)
    best = INFINITE
    for values in itertools.product(*(document.domains[name] for name in free)):
        given = dict(zip(free, values, strict=True))
        if document.allows(given):
            costs = (rows.get(tuple(given[name] for name in scope), INFINITE) for scope, rows in charged)
            best = min(best, anyway + sum(costs))
    return best


@pytest.mark.usefixtures("warm_ace")
def test_what_is_exported_costs_the_same() -> None:
    chance = Random("exported costs")
    with AceProcess() as writer:
        for _ in range(12):
            team = random_cost_team(chance) if chance.random() < 0.6 else random_complex_cost_team(chance)
            assert least_exported(xcsp3(team, writer)) == least_cost(team), team


@pytest.mark.slow
def test_ace_and_choco_find_the_least_cost_of_what_is_exported(tmp_path: Path) -> None:
    for team, least in ((coloring(4, 3, 3), 1), (charged_in_any_case(), 9), (spared(), 0)):
        path = tmp_path / "team.xml"
        path.write_bytes(xcsp3(team))
        ace = run_java(solver_jar("ace"), "main.Head", str(path), "-npc")
        choco = run_java(solver_jar("choco"), "org.chocosolver.parser.xcsp.ChocoXCSP", str(path), "-limit=[50s]")
        assert least_cost(team) == least
        assert re.search(rf"d BOUND\s+{least}\b", ace), ace
        assert re.findall(r"^o (\d+)", choco, re.MULTILINE)[-1] == str(least), choco
        assert "s OPTIMUM FOUND" in choco, choco


def charged_in_any_case() -> Team:
    """One constraint that charges the same whatever happens, and one that differs."""
    always = Relation("always", 2, Semantics.SOFT, (), (), 7)
    alone = Relation("alone", 1, Semantics.SOFT, ((1,), (2,)), (2, 5), 3)
    return with_costs(
        team_of(
            {"A": (1, 2), "B": (1, 2)},
            [Constraint("C", always, ("A", "B"), ("A", "B")), Constraint("D", alone, ("B",), ("B",))],
        )
    )


def spared() -> Team:
    """A DisWCSP without any cost."""
    return with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", PREDEFINED["ne"], ("A", "B"), ("A", "B"))]))


def test_costs_that_no_solver_could_add_are_not_exported() -> None:
    table = Relation("R", 2, Semantics.SOFT, ((1, 1),), (10**12,), 0)
    team = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", table, ("A", "B"), ("A", "B"))]))
    with pytest.raises(UnsupportedError, match="may add up to more than"):
        xcsp3(team)


def test_export_says_so(tmp_path: Path) -> None:
    write_team(coloring(4, 3, 3), tmp_path / "four")
    done = robochoc("export", tmp_path / "four")
    assert done.returncode == 0, done.stderr
    assert '<minimize type="sum">' in done.stdout
    assert done.stdout.count("note=") == 4


# Compiled


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    """A robot of two variables, of which its neighbour sees the first; and a robot of one, without costs."""
    table = Relation("R", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1)), (5, 3, INFINITE), 8)
    constraints = [
        Constraint("P", table, ("A1", "A2"), ("A1", "A2")),
        Constraint("S", PREDEFINED["ne"], ("A1", "B1"), ("A1", "B1"), cost=1),
    ]
    domains = dict.fromkeys(("A1", "A2", "B1"), (1, 2))
    write_team(with_costs(complex_team({"RA": ["A1", "A2"], "RB": ["B1"]}, domains, constraints)), tmp_path / "pair")
    return tmp_path / "pair"


def test_compile_shows_what_groups_cost(pair: Path) -> None:
    done = robochoc_within("compile", pair)
    assert done.returncode == 0, done.stderr
    head, *rows = (re.split(r" {2,}", line.strip()) for line in done.stdout.splitlines()[1:4])
    assert [row[head.index("cost")] for row in rows] == ["3..8", "0..0"]
    report = json.loads(robochoc_within("compile", "--json", pair).stdout)
    first, second = report["robots"]
    assert [first[name] for name in ("local_solutions", "groups", "cheapest", "dearest")] == [3, 2, 3, 8]
    assert (second["cheapest"], second["dearest"]) == (0, 0)
