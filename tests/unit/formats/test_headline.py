"""What happened, in one line."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from typing import Any

from robochoc.formats.headline import describe_outcome
from robochoc.model.outcome import EpochOutcome, Verdict
from tests.support.cases import looped
from tests.support.outcomes import outcome_of

SOLVED = outcome_of({"V1": 1}, team="team")
SIX = tuple(f"Robot{number}" for number in range(6))
EPOCHS = (
    EpochOutcome(Verdict.SOLUTION, robots=SIX, assignment={"V1": 1}),
    EpochOutcome(Verdict.SOLUTION, robots=SIX[:3]),
)


@looped(
    ("changed", "headline"),
    [
        ({}, "solution for all 16 robots"),
        ({"verdict": Verdict.OPTIMAL, "cost": 1200}, "optimal solution for all 16 robots, cost 1,200"),
        ({"verdict": Verdict.OPTIMAL, "cost": Decimal("0.0")}, "optimal solution for all 16 robots, cost 0.0"),
        ({"verdict": Verdict.OPTIMAL, "cost": Decimal("1.5E-8")},
         "optimal solution for all 16 robots, cost 0.000000015"),
        ({"verdict": Verdict.OPTIMAL, "cost": Decimal("-1234567.50")},
         "optimal solution for all 16 robots, cost -1,234,567.50"),
        ({"cost": 0}, "solution for all 16 robots"),
        ({"cost": Decimal("0.00")}, "solution for all 16 robots, cost 0.00"),
        ({"verdict": Verdict.OPTIMAL, "withdrawn": SIX}, "10 of 16 fly (proven maximum)"),
        ({"withdrawn": SIX}, "10 of 16 fly (not proven to be the maximum)"),
        ({"withdrawn": SIX, "lost": SIX[:2]}, "10 of 16 fly (not proven to be the maximum; 2 lost)"),
        ({"withdrawn": SIX[:2], "lost": SIX[:2]}, "solution for 14 of 16 robots (2 lost)"),
        ({"verdict": Verdict.NO_SOLUTION}, "no solution"),
        ({"verdict": Verdict.NO_SOLUTION, "epochs": EPOCHS}, "no solution in the end"),
        ({"verdict": Verdict.NO_SOLUTION, "lost": SIX[:1]}, "no solution for the robots that are left"),
        ({"verdict": Verdict.UNKNOWN}, "no verdict, a limit was reached"),
        ({"verdict": Verdict.UNKNOWN, "withdrawn": SIX},
         "no verdict, a limit was reached; 10 of 16 fly in the best answer so far"),
        ({"epochs": EPOCHS}, "solution for all 3 robots"),
    ],
)  # fmt: skip
def test_the_headline_says_what_happened(changed: dict[str, Any], headline: str) -> None:
    assert describe_outcome(replace(SOLVED, **changed), 16, weighted=False) == headline


def test_the_headline_counts_what_the_caller_counts() -> None:
    assert describe_outcome(SOLVED, 1) == "solution for the robot"
    assert describe_outcome(SOLVED, 2, noun="drone") == "solution for all 2 drones"
    heavy = replace(SOLVED, verdict=Verdict.OPTIMAL, withdrawn=SIX)
    assert describe_outcome(heavy, 16) == "10 of 16 fly (proven best)"
    assert describe_outcome(heavy, 16, weighted=True) == "10 of 16 fly (proven maximum by weight)"
