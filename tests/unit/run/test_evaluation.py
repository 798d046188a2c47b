"""Answers of searches become outcomes and epochs without loss."""

from __future__ import annotations

from dataclasses import fields
from random import Random

from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.run.evaluation import Answer
from tests.support.random_outcomes import drawn

ANSWER = {one.name for one in fields(Answer)}


def test_no_field_of_an_answer_is_dropped() -> None:
    chance = Random(4)
    header = Outcome("team", "abt", "simulator", 1, Verdict.UNKNOWN, order="dfs", channel="wifi")
    for _ in range(100):
        answer = drawn(Answer, chance)
        outcome, epoch = answer.as_outcome(header, ("gone",)), answer.as_epoch(("a", "b"), "a loss", ("gone",))
        for kind, made in ((Outcome, outcome), (EpochOutcome, epoch)):
            for name in ANSWER & {one.name for one in fields(kind)} - {"withdrawn"}:
                assert getattr(made, name) == getattr(answer, name), name
        assert outcome.withdrawn == ("gone", *answer.withdrawn)
        assert (outcome.team, outcome.order, outcome.channel) == ("team", "dfs", "wifi")
        assert (epoch.robots, epoch.opened_by, epoch.lost) == (("a", "b"), "a loss", ("gone",))
