"""The example with costs: what the tutorial says of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.formats import read_team
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind
from robochoc.run import Options, Runtime, solve
from robochoc.run.registry import protocol_named
from tests.support.allocation_problems import ANY_TEAM
from tests.support.brute_force import least_cost
from tests.support.cases import cases
from tests.support.program import ROOT

pytestmark = pytest.mark.usefixtures("quick_encryption")
PATROL = ROOT / "docs" / "examples" / "patrol"
BEST = {"lead": 3, "north": 2, "south": 1, "west": 2}


def test_the_example_has_soft_and_hard_constraints() -> None:
    team = read_team(PATROL)
    assert team.kind is ProblemKind.DISWCSP
    assert least_cost(team) == 6


WITHOUT_ANSWER = {"async-maxsum", "bounded-maxsum"}
"""Without a repair: no cycles of which the best is taken, and their last values break something hard here."""
PROVEN = {"adpop"}
"""Incomplete protocols whose result meets their own bound here."""


def test_every_protocol_that_minimises_comes_to_the_tutorials_answer() -> None:
    with cases() as each:
        for protocol in (name for name in ANY_TEAM if protocol_named(name).traits.costs):
            with each(protocol):
                on_shares = protocol_named(protocol).traits.encrypted_tables
                enough = {"cycles": "12"} if on_shares and not protocol_named(protocol).traits.complete else {}
                options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, settings=enough)
                outcome = solve(read_team(PATROL), options)
                if protocol in WITHOUT_ANSWER:
                    bare = solve(read_team(PATROL), replace(options, repair=False))
                    assert (bare.verdict, bare.assignment) == (Verdict.UNKNOWN, {})
                complete = protocol in PROVEN or protocol_named(protocol).traits.complete
                assert outcome.verdict is (Verdict.OPTIMAL if complete else Verdict.SOLUTION)
                assert (outcome.assignment, outcome.cost) == (BEST, 6) or not complete
                assert outcome.verified
