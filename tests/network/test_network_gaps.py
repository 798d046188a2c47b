"""Gaps in frames, true ones and made-up ones: whom they concern, and that the others' run goes on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
import zenoh

from robochoc.authority.admission import InMemoryAuthority
from robochoc.authority.registry import Right, Role
from robochoc.communication.control import RobotFailed
from robochoc.communication.network.access import ALL, frame_key
from robochoc.communication.network.control_messages import DirectoryRequest, ProtocolMessage, Register
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.inbox import FrameArrived, FramesLost
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.router import Router
from robochoc.communication.network.settings import LEASE_MS, NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.search_result import RobotsLostError
from robochoc.model.outcome import Verdict
from tests.support.limits import HANG_S, wait_until
from tests.support.network_runs import NetworkRun, frame
from tests.support.paused_abt import CHAIN
from tests.support.ports import free_endpoint

FAR = 5000
WATCHER = "Watcher"


class Watched(InMemoryAuthority):
    """A household with an observer."""

    def names(self, role: Role | None = None, right: Right | None = None, *, invited: bool = False) -> tuple[str, ...]:
        others = (WATCHER,) if role in {None, Role.OBSERVER} and right is None else ()
        return (*super().names(role, right, invited=invited), *others)

    def is_revoked(self, who: str | int) -> bool:
        return who != WATCHER and super().is_revoked(who)


@contextmanager
def watched(folder: Path, conditions: NetworkSettings = NetworkSettings()) -> Iterator[NetworkRun]:
    run = NetworkRun(folder, CHAIN, conditions)
    run.household = Watched(CHAIN.order)
    with run:
        run.wait_for_progress()
        yield run


def put_with_a_gap(transport: Transport, receiver: str, content: bytes) -> None:
    """Three packets on the own key, of a source of the own, the last one with a number far beyond."""
    key = frame_key(receiver, transport.name)
    publisher = transport._session.declare_publisher(  # noqa: SLF001
        key, congestion_control=zenoh.CongestionControl.BLOCK
    )
    wait_until(lambda: publisher.matching_status.matching, "nobody hears it")  # type: ignore[attr-defined]  # zenoh's stubs
    for number in (1, 2, FAR):
        publisher.put(content, source_info=zenoh.SourceInfo(publisher.id, number))


def test_an_observers_gap_is_its_own(tmp_path: Path) -> None:
    """The master gave the whole run up: "4997 frames to it were lost for good"."""
    with watched(tmp_path) as run:
        with run.transport(WATCHER) as transport:
            put_with_a_gap(transport, MASTER, frame(run, WATCHER, MASTER, DirectoryRequest(1, "(")))
            refused = run.wait_for_refusal(WATCHER, "a frame to the master", "lost for good")
        assert refused.why == f"{FAR - 3:,} frames of it were lost for good"
        run.wait_for_progress()
        assert run.let_go().verdict is Verdict.SOLUTION
    assert not run.losses


def test_a_robots_gap_is_its_loss(tmp_path: Path) -> None:
    with watched(tmp_path, NetworkSettings(survive=True, patience_s=HANG_S)) as run, run.transport("RX3") as transport:
        put_with_a_gap(transport, MASTER, b"anything")
        result = run.wait_for_result()
    assert result.lost == {"RX3": f"{FAR - 3:,} frames of it were lost for good on the way to the master"}
    assert [lost.robot for lost in run.losses] == ["RX3"]


def test_a_gap_between_robots_that_is_none_is_told_and_ends_nothing(tmp_path: Path) -> None:
    with watched(tmp_path) as run:
        with run.transport("RX3") as transport:
            put_with_a_gap(transport, "RX2", b"anything")
            run.wait_for_refusal("RX3", "a frame to RX2", r"4,997 frames of it to RX2 were lost .*reported by RX2")
        run.wait_for_progress()
        assert run.let_go().verdict is Verdict.SOLUTION
    assert not run.losses


@pytest.mark.slow
def test_a_gap_between_robots_that_is_one_names_the_sender(tmp_path: Path) -> None:
    """With the key of RX3 somebody has taken the number of a frame of RX3, and there is a gap."""
    with watched(tmp_path, NetworkSettings(patience_s=3)) as run:
        with run.transport("RX3") as transport:
            put_with_a_gap(transport, "RX2", frame(run, "RX3", "RX2", ProtocolMessage(0, 0, b"")))
            run.wait_for_refusal("RX3", "a frame to RX2", "lost for good")
        with pytest.raises(RobotsLostError, match=r"RX3 was lost: .*reported by RX2"):
            run.let_go()


def test_a_gap_is_put_down_to_whose_key_it_came_on() -> None:
    """B uses the source of A: where each sender has a subscriber of its own, A's frames come all the same."""
    household = InMemoryAuthority(("A", "B", "C"))
    router = Router(free_endpoint(), household.master_identity(("127.0.0.1",)), None, LEASE_MS)
    router.open({"A": (ALL,), "B": (ALL,), "C": (ALL,)})
    join = partial(Transport, router.endpoint, watch=(), patience_s=HANG_S)
    try:
        with (
            join(household.identity("A")) as a,
            join(household.identity("B")) as b,
            join(household.identity("C")) as c,
            join(household.identity("C"), senders=("A", "B")) as careful,
        ):
            a.send("C", b"1")
            b.send("C", b"1")  # until it has come, the router may not know who hears B, and nobody asks for puts again
            for reader in (c, careful):
                came = {reader.inbox.get(timeout=HANG_S) for _ in "AB"}
                assert came == {FrameArrived("A", b"1"), FrameArrived("B", b"1")}
            source = a._publishers["C"]  # noqa: SLF001
            forged = zenoh.SourceInfo(source.id, FAR)
            b._session.put(frame_key("C", "B"), b"forged", source_info=forged)  # noqa: SLF001
            assert c.inbox.get(timeout=HANG_S) == FramesLost("B", FAR - 1)
            assert c.inbox.get(timeout=HANG_S) == FrameArrived("B", b"forged")
            assert careful.inbox.get(timeout=HANG_S) == FrameArrived("B", b"forged")
            a.send("C", b"2")
            assert careful.inbox.get(timeout=HANG_S) == FrameArrived("A", b"2")
    finally:
        router.close()


def test_why_a_robot_fails_reaches_other_owners_as_plain_text(tmp_path: Path) -> None:
    with NetworkRun(tmp_path, absent=["RX3"]) as run, run.transport("RX3") as transport:
        transport.send(MASTER, frame(run, "RX3", MASTER, Register(profile_of(CHAIN["RX3"]), "1")))
        run.wait_until(lambda: len(run.master.members.robots) == len(CHAIN.robots), "they are not all registered")
        transport.send(MASTER, frame(run, "RX3", MASTER, RobotFailed("\x1b[2J\u202e" + "x" * 1_000_000)))
        with pytest.raises(RobotsLostError) as lost:
            run.wait_for_result()
    assert str(lost.value).startswith(r"RX3 was lost: \x1b[2J\u202exxx")
    assert len(str(lost.value)) < 1000
    assert {ending.why for ending in run.endings.values()} == {"the run is over"}
