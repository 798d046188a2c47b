"""Random problems through a model: the same optimum as all assignments tried in fractions, by several ways."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from random import Random

import robochoc
from robochoc.model.outcome import Verdict
from robochoc.solver.errors import UnsupportedError
from tests.support.examples import count
from tests.support.random_models import RandomProblem, large_problem, random_problem

PROTOCOLS = ("dpop", "syncbb", "afb", "sfb", "bnb-adopt")


def check(problem: RandomProblem, model: robochoc.Model, protocol: str) -> None:
    """Solve, and compare verdict, sum and values with the truth."""
    best = problem.best()
    outcome = model.solve(protocol, runtime="simulator")
    if best is None:
        assert outcome.verdict is Verdict.NO_SOLUTION
        return
    assert outcome.verdict in {Verdict.OPTIMAL, Verdict.SOLUTION}
    if model is problem.model:
        assert problem.total(outcome.values) == best
    if model.team.kind == "DisWCSP":
        assert outcome.cost is not None
        assert Fraction(outcome.cost) == best


@count("number", fast=40, slow=2000)
def test_a_model_has_the_optimum_of_what_it_says(number: int, tmp_path: Path) -> None:
    chance = Random(19)
    solved = 0
    for n in range(number):
        problem = random_problem(chance)
        team = problem.model.team
        solved += problem.best() is not None
        check(problem, problem.model, "central")
        protocol = chance.choice(PROTOCOLS) if team.kind == "DisWCSP" else chance.choice(("abt", "afc-ng"))
        check(problem, problem.model, protocol)
        check(problem, robochoc.Model.of(team), "central")
        problem.model.save(tmp_path / f"team{n}")
        loaded = robochoc.Model.load(tmp_path / f"team{n}")
        check(problem, loaded, protocol)
    assert solved > number / 2


@count("number", fast=40, slow=5000)
def test_large_numbers_are_exact_or_refused(number: int) -> None:
    solved = refused = 0
    for seed in range(number):
        chance = Random(seed)
        problem = large_problem(chance)
        if problem is None:
            refused += 1
            continue
        protocols = PROTOCOLS if problem.model.team.kind == "DisWCSP" else ("abt", "afc-ng")
        with suppress(UnsupportedError):  # a protocol that does not hold such sums says so
            check(problem, problem.model, chance.choice(protocols))
            solved += 1
    assert solved > number / 2
    assert refused > number / 5
