"""Problems with random variables: the best expected and the best worst cost, against all policies in all scenarios."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign
from robochoc.model.outcome import Verdict
from robochoc.model.policies import Risk
from robochoc.model.uncertainty import is_uncertain
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.examples import count, drawn
from tests.support.uncertain import frodo_xml, uncertain_problem

PROTOCOLS = ("dpop", "syncbb", "afb", "adopt", "central")


@count("problems", 40, 2000)
def test_costs_equal_those_of_the_best_policy(problems: int) -> None:
    chance = drawn("uncertainty")
    solved = 0
    for number in range(problems):
        problem = uncertain_problem(chance)
        if not is_uncertain(problem.team):
            continue  # no constraint depends on chance
        expected, worst = problem.best()
        protocol = PROTOCOLS[number % len(PROTOCOLS)]
        for risk, wanted in ((Risk.EXPECTED, expected), (Risk.WORST, worst)):
            outcome = solve(problem.team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, risk=risk))
            if wanted is None:
                assert outcome.verdict == Verdict.NO_SOLUTION
                continue
            assert outcome.verdict == Verdict.OPTIMAL
            assert outcome.cost is not None
            assert Fraction(outcome.cost) == wanted
            report = outcome.uncertainty
            assert report is not None
            assert (report.expected if risk == Risk.EXPECTED else report.worst) == outcome.cost
            solved += 1
    assert solved > problems


@count("problems", 15, 300)
def test_problems_of_frodo_cost_the_same(problems: int, tmp_path: Path) -> None:
    chance = drawn("uncertainty of FRODO")
    for number in range(problems):
        problem = uncertain_problem(chance, observed=False)
        if not is_uncertain(problem.team):
            continue
        file = tmp_path / f"{number}.xml"
        file.write_text(frodo_xml(problem, digits=chance.choice([1, 17])))
        team = read_foreign([file], ImportOptions()).team
        constant = Fraction(problem.units.constant, 10**problem.units.places)  # FRODO has no constant
        for risk, best in zip((Risk.EXPECTED, Risk.WORST), problem.best(), strict=True):
            outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, risk=risk))
            found = None if outcome.cost is None else Fraction(outcome.cost) + constant
            assert found == best
