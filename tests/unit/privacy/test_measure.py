"""The losses of pairs without knowledge are computed once, and equal those computed for each pair."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.privacy import privacy_of
from robochoc.privacy.measure import _RunMeasurement
from tests.support.examples import count
from tests.support.replays import random_run, recorded

pytestmark = pytest.mark.usefixtures("quick_encryption")


@pytest.mark.parametrize("protocol", ["abt", "adopt", "dpop", "mgm2", "p-dpop", "sfb"])
@count("number", fast=6, slow=200)
def test_losses_equal_those_computed_for_each_pair(protocol: str, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    lossless = 0
    for seed in range(number):
        team, options = random_run(protocol, Random(f"privacy {protocol} {seed}"), seed)
        if any(robot.private for robot in team.robots):
            continue
        journal = recorded(team, options)
        if not journal.events:
            continue
        found = privacy_of(journal)
        with monkeypatch.context() as patch:
            patch.setattr(_RunMeasurement, "_loss", _RunMeasurement._computed_loss)  # noqa: SLF001 - the definition
            assert found == privacy_of(journal)
        lossless += sum(loss.linear == 0 for loss in found.losses)
    assert lossless
