"""Lost frames between robots: their sender counts as lost if they were needed."""

from __future__ import annotations

from itertools import count
from types import SimpleNamespace
from typing import Any, cast

import pytest

from robochoc.communication.network.control_messages import LostFrames
from robochoc.communication.network.frame_loss import LossTracker

PATIENCE_S = 3.0


@pytest.fixture
def lost() -> dict[str, str]:
    return {}


@pytest.fixture
def tracker(lost: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> LossTracker:
    """A tracker for which a second passes whenever it looks at the clock."""
    seconds = count()
    clock = SimpleNamespace(monotonic=lambda: float(next(seconds)))
    monkeypatch.setattr("robochoc.communication.network.frame_loss.time", clock)
    members = cast("Any", SimpleNamespace(robots=dict.fromkeys(("RX1", "RX2"))))
    return LossTracker(members, lambda *_: None, lambda name, why, **_: lost.update({name: why}))


def test_frames_lost_before_the_search_are_a_loss_if_the_receiver_does_not_become_ready(
    tracker: LossTracker, lost: dict[str, str]
) -> None:
    """`make simulate` found a run that waited forever for a robot without the copies of its constraints."""
    tracker.note_between("RX2", LostFrames("RX1", 1))
    tracker.explain_unready(lambda _: False, PATIENCE_S)
    assert not lost
    for _ in range(5):
        tracker.explain_unready(lambda name: name == "RX2", PATIENCE_S)
    assert not lost
    tracker.explain_unready(lambda _: False, PATIENCE_S)
    assert lost == {"RX1": "1 frames of it to RX2 were lost for good (reported by RX2)"}


def test_reports_from_an_earlier_search_do_not_count(tracker: LossTracker, lost: dict[str, str]) -> None:
    tracker.note_between("RX2", LostFrames("RX1", 1))
    tracker.start_search()
    for _ in range(5):
        tracker.explain_unready(lambda _: False, PATIENCE_S)
    assert not lost
    assert not tracker.explain_missing()
