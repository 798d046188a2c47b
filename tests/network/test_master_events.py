"""What the master's observer is told, and in which time."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.network.control_messages import ControlMessage, LostFrames, Objection
from robochoc.communication.network.master import Master
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.members import Member, NetworkMembers
from robochoc.communication.network.quotas import BURST_S, EVENTS_A_SECOND, REPORTS_A_SECOND
from robochoc.journal.events import AnyEvent, Decided, Granted, Lost, Refused, Registered

if TYPE_CHECKING:
    from robochoc.communication.network.profile import Profile


def test_times_are_since_the_search_began(monkeypatch: pytest.MonkeyPatch) -> None:
    now = itertools.count(1000)
    monkeypatch.setattr(
        "robochoc.communication.network.master_events.time", SimpleNamespace(monotonic=lambda: next(now))
    )
    told: list[AnyEvent] = []
    chronicle = MasterEvents(told.append)
    chronicle.registered("A")
    chronicle.start_search()
    chronicle.lost("A", "gone")
    chronicle.granted("Eye", "sniff")
    chronicle.relay(Granted(t=1e9, who="B", what="renew a certificate", origin="here:1"))
    assert told == [
        Registered(t=1, robot="A"),
        Lost(t=1, robot="A", why="gone"),
        Granted(t=2, who="Eye", what="sniff"),
        Granted(t=3, who="B", what="renew a certificate", origin="here:1"),
    ]


def test_robots_tell_of_themselves_only() -> None:
    told: list[AnyEvent] = []
    chronicle = MasterEvents(told.append)
    own, others = (Decided(t=3.0, robot=name, assignment={"V": 1}, clock=1) for name in "AB")
    chronicle.relay_from("A", [own, others, own])
    assert [event for event in told if isinstance(event, Decided)] == [own, own]
    assert [(event.who, event.what) for event in told if isinstance(event, Refused)] == [("A", "report Decided")]


def test_where_nobody_observes_nothing_is_told() -> None:
    chronicle = MasterEvents(None)
    chronicle.refuse("A", "anything", "it may not")
    chronicle.registered("A")


def test_a_robot_that_floods_reports_of_others_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever names it invents, and whatever it reports of them, its further reports are dropped."""
    now = 0.0
    monkeypatch.setattr("robochoc.communication.network.master_events.time", SimpleNamespace(monotonic=lambda: now))
    told: list[AnyEvent] = []
    authority = InMemoryAuthority("ABC")
    identity = authority.master_identity(("127.0.0.1",))
    master = Master(authority, identity, "127.0.0.1:7447", NetworkMembers(), observer=told.append)
    member = Member(cast("Profile", None), "1")

    def hear(name: str, message: ControlMessage) -> None:
        master._handle(name, member, message)  # noqa: SLF001 - without a network

    for number in range(3 * int(BURST_S) * REPORTS_A_SECOND):
        hear("A", Objection(f"B{number}", "a frame", "no") if number % 2 else LostFrames(f"B{number}", 1 + number))
    hear("C", Objection("B", "a frame", "no"))
    refused = [event for event in told if isinstance(event, Refused)]
    assert len(refused) < BURST_S * REPORTS_A_SECOND + 10
    assert ("A", "report others", "more than 10 times a second") in [(one.who, one.what, one.why) for one in refused]
    assert (refused[-1].who, refused[-1].why) == ("B", "no (reported by C)")
    now += 1.0
    hear("A", Objection("D", "a frame", "no"))
    assert isinstance(told[-1], Refused)
    assert told[-1].who == "D"


def test_who_tells_more_than_robots_have_to_tell_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.network.master_events.time", SimpleNamespace(monotonic=lambda: 0.0))
    told: list[AnyEvent] = []
    chronicle = MasterEvents(told.append)
    flood = [Decided(t=3.0, robot="A", assignment={}, clock=1)] * EVENTS_A_SECOND
    for _ in range(int(BURST_S) + 3):
        chronicle.relay_from("A", flood)
    chronicle.relay_from("B", [Decided(t=3.0, robot="B", assignment={}, clock=1)])
    decided = [event.robot for event in told if isinstance(event, Decided)]
    assert (decided.count("A"), decided.count("B")) == (BURST_S * EVENTS_A_SECOND, 1)
    refused = [event for event in told if isinstance(event, Refused)]
    assert [(one.who, one.what, one.why) for one in refused] == [("A", "report events", "more than 10,000 a second")]
