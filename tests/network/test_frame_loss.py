"""Lost frames between robots: their sender counts as lost if they were needed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from robochoc.communication.network.control_messages import LostFrames
from robochoc.communication.network.frame_loss import LossTracker


@pytest.fixture
def lost() -> dict[str, str]:
    return {}


@pytest.fixture
def tracker(lost: dict[str, str]) -> LossTracker:
    members = cast("Any", SimpleNamespace(robots=dict.fromkeys(("RX1", "RX2", "RX3"))))
    return LossTracker(members, lambda *_: None, lambda name, why, **_: lost.update({name: why}))


def test_the_sender_is_lost_for_whom_the_search_waits(tracker: LossTracker, lost: dict[str, str]) -> None:
    assert not tracker.is_reported
    tracker.note_between("RX2", LostFrames("RX1", 1))
    tracker.note_between("RX3", LostFrames("RX2", 4))
    assert tracker.explain(["RX2"])
    assert lost == {"RX1": "1 frames of it to RX2 were lost for good (reported by RX2)"}
    assert not tracker.explain(["RX1"])


def test_all_senders_are_lost_if_messages_are_missing(tracker: LossTracker, lost: dict[str, str]) -> None:
    tracker.note_between("RX2", LostFrames("RX1", 1))
    tracker.note_between("RX3", LostFrames("RX2", 4))
    assert tracker.explain([])
    assert [*lost] == ["RX1", "RX2"]


def test_losses_among_robots_that_are_gone_explain_nothing(tracker: LossTracker, lost: dict[str, str]) -> None:
    """If they did, the master would wait forever for robots that it had already removed."""
    tracker.note_between("RX2", LostFrames("RX1", 1))
    del tracker._members.robots["RX2"]  # noqa: SLF001 - as the master removes it
    assert not tracker.explain([])
    tracker.note_between("RX3", LostFrames("RX1", 2))
    del tracker._members.robots["RX1"]  # noqa: SLF001
    assert not tracker.explain([])
    assert not lost
