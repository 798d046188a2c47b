"""What is true is never excluded: over every protocol, random problems of every family, and schedules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random
from typing import get_args

import pytest

from robochoc.journal.journal import Journal
from robochoc.privacy import Kind, Measure, PrivacyReport, privacy_of
from robochoc.protocols.shared.messages.anytime import Step
from robochoc.replay import ReplayOptions
from robochoc.replay.steps import runs_of
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.ace import AceProcess
from tests.support.asymmetric_problems import random_asymmetric_team, random_pkc_options
from tests.support.examples import count
from tests.support.replays import in_text, random_run, recorded

pytestmark = pytest.mark.usefixtures("quick_encryption")
WITH_RULES = (
    "a-dsa", "abt", "abt-do-retro", "abt-hyb", "acls", "adopt", "adopt-k", "afb", "afc", "afc-ng", "afc-tree",
    "agile-abt", "async-maxsum", "awc", "bnb-adopt", "bnb-adopt-fdac", "bounded-maxsum", "cbaa", "cbba", "cocoa",
    "compapo", "count-dpop", "d-gibbs", "dba", "disfc", "dpop", "dsa", "dsa-sdp", "duct", "dynabt", "gca-mgm", "gdba",
    "grape", "hs-cai", "kopt", "lamdls", "maxsum", "maxsum-ad", "mb-dpop", "mcs-mgm", "mgm", "mgm2", "mixed-dsa",
    "ncbb", "o-dpop", "p-dpop", "p2-dpop", "p32-dpop", "pt-fb", "rmb-dpop", "s-dpop", "sbt", "sfb", "ssi", "syncabb",
    "syncbb",
)  # fmt: skip
"""Protocols whose messages all have rules; in others losses are not known."""
SILENT = {"p2-dpop"}
"""Protocols of these whose messages prove nothing."""
VARIANTS = {
    "adopt-k": {"heuristic": "dp", "k": "2"},
    "bnb-adopt": {"heuristic": "dp"},
    "bnb-adopt-fdac": {"level": "ac"},
    "hs-cai": {"k": "1"},
    "kopt": {"k": "4"},
    "maxsum": {"split": "0.3"},
    "mb-dpop": {"k": "1"},
    "rmb-dpop": {"k": "1"},
    "syncabb": {"phases": "2"},
}
"""Settings with which robots say other things."""


@pytest.fixture(scope="module")
def warm() -> Iterator[AceProcess]:
    """A solver for complex robots that need not be started for each team."""
    with AceProcess() as ace:
        yield ace


def reports(journal: Journal, warm: AceProcess) -> Iterator[PrivacyReport]:
    """The report of each run; `privacy_of` raises an error if what is true was excluded."""
    for number, _ in enumerate(runs_of(journal.events), 1):
        yield privacy_of(journal, ReplayOptions(solver=warm), number)


def variant(protocol: str) -> dict[str, str]:
    """Return settings with which robots say other things; local search also finds its best cycle."""
    anytime = {"anytime": "yes"} if Step in get_args(protocol_named(protocol).messages) else {}
    return {**VARIANTS.get(protocol, {}), **anytime}


@pytest.mark.parametrize("protocol", protocol_names())
@count("number", fast=3, slow=150)
def test_the_truth_is_never_excluded(protocol: str, number: int, warm: AceProcess) -> None:
    learnt = 0.0
    for seed in range(number):
        team, options = random_run(protocol, Random(f"privacy {protocol} {seed}"), seed)
        if seed % 2:
            options = replace(options, settings={**options.settings, **variant(protocol)})
        journal = recorded(team, options, warm)
        for report in reports(in_text(journal) if seed % 2 else journal, warm):
            if report.without_rule:
                assert protocol not in WITH_RULES, report.without_rule
                continue
            assert all(0 <= (loss.by(one) or 0) <= 1 for loss in report.losses for one in Measure)
            learnt += sum(report.system_loss(kind, Measure.ENTROPY) or 0 for kind in Kind)
    assert (learnt > 0) is (protocol not in SILENT) or protocol not in WITH_RULES


@pytest.mark.parametrize("protocol", [name for name in protocol_names() if protocol_named(name).traits.asymmetric])
def test_of_two_sides_costs_nothing_is_concluded_together(protocol: str, warm: AceProcess) -> None:
    for seed in range(6):
        chance = Random(f"one side {protocol} {seed}")
        team = random_asymmetric_team(chance, simple=True)
        for report in reports(recorded(team, random_pkc_options(team, protocol, chance), warm), warm):
            assert protocol not in WITH_RULES or not report.without_rule
