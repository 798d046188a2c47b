"""The outcome at the end of a journal is the outcome of the run, in both forms."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from robochoc.journal.entries import Header
from robochoc.journal.reader import lines_of, read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.model.outcome import Optima, Outcome
from tests.support.random_outcomes import random_outcome


def check(outcome: Outcome) -> None:
    """Check that a journal, and its text form, hold `outcome`."""
    recorder = JournalRecorder(Header(team="t", protocol="abt", runtime="simulator", seed=1))
    recorder.outcome = outcome
    journal = read_journal(recorder.content())
    assert journal.outcome == outcome
    assert read_journal(b"".join(lines_of(journal))).outcome == outcome


def test_every_field_survives() -> None:
    chance = Random(6)
    for _ in range(100):
        check(random_outcome(chance))


def test_numbers_of_solutions_of_any_length() -> None:
    outcome = random_outcome(Random(1))
    for number in (2**63 - 1, 2**63, 2**64, 10**40):
        check(replace(outcome, count=number, optima=Optima(number, ({"a.x": 1},))))
        check(replace(outcome, count=number, optima=None))
