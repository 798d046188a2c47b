"""What is true is never excluded: over every protocol, random problems of every family, and schedules."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

from robochoc.journal.journal import Journal
from robochoc.privacy import Kind, Measure, PrivacyReport, privacy_of
from robochoc.replay import ReplayOptions
from robochoc.replay.steps import runs_of
from robochoc.run.registry import protocol_names
from robochoc.solver.ace import AceProcess
from tests.support.examples import count
from tests.support.replays import in_text, random_run, recorded

WITH_RULES = (
    "abt", "abt-do-retro", "adopt", "afb", "afc", "afc-ng", "afc-tree", "agile-abt", "awc", "bnb-adopt", "dba", "disfc",
    "dpop", "dsa", "dynabt", "gdba", "mgm", "mgm2", "ncbb", "p-dpop", "pt-fb", "sbt", "sfb", "syncbb",
)  # fmt: skip
"""Protocols whose messages all have rules; in the others losses are not known."""


@pytest.fixture(scope="module")
def warm() -> Iterator[AceProcess]:
    """A solver for complex robots that need not be started for each team."""
    with AceProcess() as ace:
        yield ace


def reports(journal: Journal, warm: AceProcess) -> Iterator[PrivacyReport]:
    """The report of each run; `privacy_of` raises an error if what is true was excluded."""
    for number, _ in enumerate(runs_of(journal.events), 1):
        yield privacy_of(journal, ReplayOptions(solver=warm), number)


@pytest.mark.parametrize("protocol", protocol_names())
@count("number", fast=3, slow=150)
def test_the_truth_is_never_excluded(protocol: str, number: int, warm: AceProcess) -> None:
    learnt = 0.0
    for seed in range(number):
        team, options = random_run(protocol, Random(f"privacy {protocol} {seed}"), seed)
        journal = recorded(team, options, warm)
        for report in reports(in_text(journal) if seed % 2 else journal, warm):
            if report.without_rule:
                assert protocol not in WITH_RULES, report.without_rule
                continue
            assert all(0 <= (loss.by(one) or 0) <= 1 for loss in report.losses for one in Measure)
            learnt += sum(report.system_loss(kind, Measure.ENTROPY) or 0 for kind in Kind)
    assert learnt > 0 or protocol not in WITH_RULES
