"""Problems with random variables: the best expected and the best worst cost, against all policies in all scenarios."""

from __future__ import annotations

from fractions import Fraction

from robochoc.model.outcome import Verdict
from robochoc.model.policies import Risk
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.examples import count, drawn
from tests.support.uncertain import uncertain_problem

PROTOCOLS = ("dpop", "syncbb", "afb", "adopt", "central")


@count("problems", 40, 2000)
def test_costs_equal_those_of_the_best_policy(problems: int) -> None:
    chance = drawn("uncertainty")
    solved = 0
    for number in range(problems):
        problem = uncertain_problem(chance)
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
