"""What is exported and imported again has the same optimum and verdict as the tables it was drawn from."""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest
from lxml import etree

from robochoc.formats import check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import find_dialect, read_foreign, recognise
from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import Constraint, ConstraintModel, Domain, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.examples import count
from tests.support.foreign_problems import optimum, random_problem, written

PLAIN = {"xdiscsp", "dcopsolver", "wcsp"}
"""Formats of integer costs of 0 or more."""
IN_XML = {"frodo", "xdiscsp", "dcopsolver"}


@pytest.mark.parametrize("name", ["frodo", "xdiscsp", "dcopsolver", "pydcop", "cfn", "wcsp"])
@count("rounds", 40, 1000)
def test_there_and_back(rounds: int, name: str, tmp_path: Path) -> None:
    chance = Random(name)
    for _ in range(rounds):
        problem, team = random_problem(chance, plain=name in PLAIN, simple=name == "dcopsolver")
        assert optimum(team) == problem.optimum()
        assert _there_and_back(name, team, tmp_path) == problem.optimum()


@count("rounds", 12, 200)
def test_asymmetric_teams_there_and_back(rounds: int, tmp_path: Path) -> None:
    chance = Random("asymmetric")
    exported: Counter[str] = Counter()
    while exported["frodo"] < rounds:
        team = random_asymmetric_team(chance)
        if math.prod(len(variable.domain) for variable in team.variables.values()) > 500:
            continue
        best = optimum(team)
        for name in ("frodo", "xdiscsp", "dcopsolver"):
            with contextlib.suppress(UnsupportedError):
                assert _there_and_back(name, team, tmp_path) == best
                exported[name] += 1
    assert min(exported.values()) > rounds / 4


def test_asymmetric_costs_of_three_variables_are_refused_in_xdiscsp() -> None:
    bit, scope = Domain("bit", (range(2),)), ("x", "y", "z")
    variables = {"a": [Variable("x", bit), Variable("y", bit)], "b": [Variable("z", bit)]}
    relation = Relation("r", 3, Semantics.SOFT, ((0, 0, 0),), (1,), 3)
    parts = {"a": [Constraint("c", relation, scope, scope, ConstraintModel.PKC)]}
    team = assemble("t", variables, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts))
    with pytest.raises(UnsupportedError, match="the partially known constraint c has 3 variables"):
        written("xdiscsp", team)


def test_dcopsolver_files_satisfy_its_parser() -> None:
    chance = Random("form")
    for _ in range(20):
        _, team = random_problem(chance, plain=True, simple=True)
        (content,) = written("dcopsolver", team).values()
        root = etree.fromstring(content)
        sizes = {}
        for element in root.iterfind("variables/variable"):
            domain = root.find(f"domains/domain[@name='{element.get('domain')}']")
            assert domain is not None
            assert domain.text == f"1..{domain.get('nbValues')}"
            sizes[element.get("name")] = int(domain.get("nbValues", ""))
        relations = {one.get("name"): one.text or "" for one in root.iterfind("relations/relation")}
        pairs = [
            (one.get("scope", "").split(), one.get("reference")) for one in root.iterfind("constraints/constraint")
        ]
        places = list(sizes)
        assert len({tuple(pair) for pair, _ in pairs}) == len(pairs)
        for (first, second), name in pairs:
            assert places.index(first) < places.index(second)
            tuples = [re.fullmatch(r"\d+:(\d+) (\d+)", one) for one in relations[name].split("|")]
            assert {(int(one[1]), int(one[2])) for one in tuples if one} == {
                *itertools.product(range(1, sizes[first] + 1), range(1, sizes[second] + 1))
            }


def test_dcopsolver_refuses_unsupported_parts_by_name() -> None:
    bit, names = Domain("bit", (range(2),)), ("x", "y", "z")
    apart: dict[str, list[Variable]] = {name: [Variable(name, bit)] for name in names}
    together = {"a": [Variable("x", bit), Variable("y", bit)], "b": [Variable("z", bit)]}

    def team(variables: Mapping[str, list[Variable]], scope: tuple[str, ...], cost: int, **units: Any) -> Team:  # noqa: ANN401
        relation = Relation("r", len(scope), Semantics.SOFT, ((0,) * len(scope),), (cost,), 0)
        constraint = Constraint("c", relation, scope, scope)
        return assemble("t", variables, [constraint], kind=ProblemKind.DISWCSP, costs=CostUnits(**units))

    for wrong, message in (
        (team(together, ("x", "z"), 1), "one variable for each agent, but a has 2"),
        (team(apart, names, 1), "the constraint c has 3 variables"),
        (team(apart, ("x", "y"), -1), "integer costs of 0 or more"),
        (team(apart, ("x", "y"), 1, places=1), "integer costs of 0 or more"),
        (team(apart, ("x", "y"), 1, maximize=True), "does not support utilities"),
        (team(apart, ("x", "y"), 2**30), "too large for integers of 32 bits"),
        (team({"a": [Variable("x", bit)]}, ("x",), 1), "requires two agents"),
    ):
        with pytest.raises(UnsupportedError, match=message):
            written("dcopsolver", wrong)


def test_names_of_values_stand_in_a_comment(tmp_path: Path) -> None:
    colours = ("red", "green", "blue--")
    domain = Domain("colours", (range(2),), colours)
    scope = ("x", "y")
    relation = Relation("differ", 2, Semantics.CONFLICTS, ((0, 0), (1, 1)))
    team = assemble("t", {name: [Variable(name, domain)] for name in scope}, [Constraint("c", relation, scope, scope)])
    (content,) = written("frodo", team).values()
    assert b"<!-- colours: 0 is red, 1 is green -->" in content
    assert b'nbDomains="1"' in content
    assert _there_and_back("frodo", team, tmp_path) == 0


def _there_and_back(name: str, team: Team, folder: Path) -> Fraction | None:
    file, content = next(iter(written(name, team).items()))
    path = folder / file
    path.write_bytes(content)
    assert recognise(path) is find_dialect("xdiscsp" if name == "dcopsolver" else name)
    back = read_foreign([path], ImportOptions())
    check_team(back.team)
    assert name not in IN_XML or back.names == {}
    return optimum(back.team)
