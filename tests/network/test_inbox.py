"""What waits for a participant is bounded for each sender, and a flood is its sender's loss."""

from __future__ import annotations

from queue import Empty

import pytest

from robochoc.communication.network.inbox import FrameArrived, FramesLost, Inbox, Item, WakeUp
from robochoc.communication.network.quotas import BURST_S, OBSERVER_SHARE, ROBOT_SHARE, Allowance, Share


def all_in(inbox: Inbox) -> list[Item]:
    items: list[Item] = []
    while not inbox.empty():
        items.append(inbox.get_nowait())
    return items


def test_what_is_more_than_a_senders_share_is_dropped_and_told_once() -> None:
    inbox = Inbox(lambda _sender: Share(2, 100), clock=lambda: 0.0)
    for number in range(1000):
        inbox.put(FrameArrived("A", str(number).encode()))
    inbox.put(FrameArrived("B", b"mine"))
    inbox.put(WakeUp())
    expected = [
        FrameArrived("A", b"0"),
        FrameArrived("A", b"1"),
        FramesLost("A", 998, dropped=True),
        FrameArrived("B", b"mine"),
        WakeUp(),
    ]
    assert all_in(inbox) == expected
    inbox.put(FrameArrived("A", b"again"))
    assert all_in(inbox) == [FrameArrived("A", b"again")], "there is room again"


def test_news_of_gaps_is_bounded_too() -> None:
    inbox = Inbox(lambda _sender: Share(2, 100), clock=lambda: 0.0)
    for _ in range(1000):
        inbox.put(FramesLost("A", 5))
    assert all_in(inbox) == [FramesLost("A", 5), FramesLost("A", 5), FramesLost("A", 998, dropped=True)]
    inbox.put(FramesLost("A", 5))
    assert all_in(inbox) == [FramesLost("A", 5)]


def test_bytes_that_wait_are_bounded() -> None:
    inbox = Inbox(lambda _sender: Share(1000, 100), clock=lambda: 0.0)
    for _ in range(5):
        inbox.put(FrameArrived("A", bytes(40)))
    assert all_in(inbox) == [FrameArrived("A", bytes(40))] * 2 + [FramesLost("A", 3, dropped=True)]
    inbox.put(FrameArrived("A", bytes(101)))
    assert all_in(inbox) == [FramesLost("A", 1, dropped=True)]


def test_so_many_a_second_in_the_long_run() -> None:
    now = 0.0
    inbox = Inbox(lambda _sender: OBSERVER_SHARE, clock=lambda: now)

    def taken(frames: int) -> int:
        count = 0
        for _ in range(frames):
            inbox.put(FrameArrived("A", b""))
            count += isinstance(inbox.get_nowait(), FrameArrived)
        return count

    burst = BURST_S * OBSERVER_SHARE.frames_a_second
    assert taken(10_000) == burst
    now += 2
    assert taken(10_000) == 2 * OBSERVER_SHARE.frames_a_second
    now += 10_000
    assert taken(10_000) == burst


def test_what_a_sender_may_have_is_asked_once() -> None:
    asked: list[str] = []

    def share_of(sender: str) -> Share:
        asked.append(sender)
        return ROBOT_SHARE

    inbox = Inbox(share_of)
    for sender in ("A", "B", "A", "B"):
        inbox.put(FrameArrived(sender, b""))
    assert asked == ["A", "B"]


def test_nothing_is_there() -> None:
    with pytest.raises(Empty):
        Inbox().get_nowait()
    with pytest.raises(Empty):
        Inbox().get(timeout=0)


def test_an_allowance_without_a_limit_and_a_clock_that_stands_still() -> None:
    allowance = Allowance(1e15, 0.0)
    for _ in range(3):
        assert allowance.has(2**53, 0.0)
        allowance.use(2**53)
