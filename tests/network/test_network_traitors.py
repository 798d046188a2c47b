"""Traitors: robots that are of the team, or hold the keys of one, and routers that change what they carry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.network.control_messages import (
    Bye,
    ControlMessage,
    Copies,
    ProtocolMessage,
    Register,
    RegistrationDenied,
)
from robochoc.communication.network.framing import MASTER, Framing
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.profile import Profile, profile_of
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.search_result import RobotsLostError
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind
from robochoc.protocols.message import encode
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.protocols.satisfaction.awc import AWC
from tests.support.cases import looped
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.limits import HANG_S
from tests.support.network_runs import NetworkRun, frame
from tests.support.paused_abt import CHAIN, TRIANGLE

# Revoked in the middle of a run


@pytest.mark.parametrize("filters", [("signed", "sealed"), pytest.param((), marks=pytest.mark.slow)])
def test_a_robot_is_revoked_and_the_others_are_told_of_it(tmp_path: Path, filters: tuple[str, ...]) -> None:
    with NetworkRun(tmp_path, settings=NetworkSettings(filters, survive=True, patience_s=HANG_S)) as run:
        run.wait_for_progress()
        run.household.revoke("RX2")
        result = run.wait_for_result()
        run.wait_for_refusal("RX2", "take part", "its certificate was revoked")
        run.wait_for_refusal("RX2", "connect", "not registered with the Authority")
        run.wait_until_impatient("RX2")
    assert result.verdict is Verdict.UNKNOWN
    assert result.lost == {"RX2": "its certificate was revoked"}
    assert [lost.robot for lost in run.losses] == ["RX2"]
    assert run.endings["RX2"].why == "the master does not answer RX2: check that it is enrolled there, and not revoked"
    assert not any(run.endings[name].failed for name in ("RX0", "RX1", "RX3")), run.endings


@pytest.mark.slow
def test_a_robot_is_revoked_and_the_run_ends(tmp_path: Path) -> None:
    with NetworkRun(tmp_path, settings=NetworkSettings(patience_s=3)) as run:
        run.wait_for_progress()
        run.household.revoke("RX2")
        with pytest.raises(RobotsLostError, match="RX2 was lost: its certificate was revoked"):
            run.wait_for_result()


# Lies, before the search


changed = msgspec.structs.replace
LIES: dict[str, Callable[[Profile], Profile]] = {
    "the variable X0 is RX0's, and RX3's too": lambda p: changed(p, variables={"X0": ((0, 1),)}),
    "RX3 calls RX0 its parent, which does not list it": lambda p: changed(p, parents=("RX2", "RX0")),
    "RX2 calls RX3 its child, which does not list it": lambda p: changed(p, parents=()),
    "its file is 'RX0''s, and its certificate RX3's": lambda p: changed(p, name="RX0"),
    "X3 has 1,000,000,000,000,000,001 values": lambda p: changed(p, variables={"X3": ((0, 10**18),)}),
    "the ranges of X3 are not ascending": lambda p: changed(p, variables={"X3": ((5, 1),)}),
    "is not a valid name": lambda p: changed(p, variables={"../x": ((0, 1),)}),
    "it names itself": lambda p: changed(p, children=("RX3",)),
    "too many neighbours": lambda p: changed(p, children=tuple(f"N{i}" for i in range(20_000))),
    "a team is one or the other": lambda p: changed(p, kind=ProblemKind.DISWCSP),
}


def test_profiles_that_lie(tmp_path: Path) -> None:
    """Somebody with the key of RX3 tells what cannot be; then RX3 comes, tells the truth, and is taken."""
    truth = profile_of(CHAIN["RX3"])
    with NetworkRun(tmp_path, absent=["RX3"]) as run:
        run.wait_until(lambda: len(run.master.members.robots) == 3, "the others do not come")
        with run.transport("RX3") as transport:
            for number, (why, lie) in enumerate(LIES.items()):
                transport.send(MASTER, frame(run, "RX3", MASTER, Register(lie(truth), str(number))))
                run.wait_for_refusal("RX3", "register", why.replace("'", "."))
                assert told(transport, str(number)), f"it is told so: {why}"
        run.start("RX3")
        run.wait_for_progress()
        assert run.let_go().verdict is Verdict.SOLUTION


def told(transport: Transport, incarnation: str) -> bool:
    """Whether the master denies the registration `incarnation`."""
    framing = Framing(transport.name)
    while isinstance(item := transport.inbox.get(timeout=HANG_S), FrameArrived):
        word = framing.read(item.sender, item.content).message
        if isinstance(word, RegistrationDenied) and word.incarnation == incarnation:
            return True
    return False


def test_what_the_directory_cannot_take_does_not_keep_a_robot_out(tmp_path: Path) -> None:
    boastful = changed(profile_of(CHAIN["RX3"]), topics=("x" * 10_000, *map(str, range(200))))
    with NetworkRun(tmp_path, absent=["RX3"]) as run, run.transport("RX3") as transport:
        transport.send(MASTER, frame(run, "RX3", MASTER, Register(boastful, "1")))
        run.wait_for_refusal("RX3", "be in the directory", "unrecognised-parameter-value")
        assert "RX3" in run.master.members.robots
        transport.send(MASTER, frame(run, "RX3", MASTER, Bye()))  # so that the master does not wait for it
        run.give_up()


# Whoever carries the frames


@pytest.mark.parametrize(
    "filters", [("sealed",), *(pytest.param(f, marks=pytest.mark.slow) for f in (("signed",), ("signed", "sealed")))]
)
def test_a_router_that_changes_frames(tmp_path: Path, filters: tuple[str, ...]) -> None:
    """It can put on any key. What it makes up, changes or moves elsewhere is not genuine, whoever it is from."""
    with NetworkRun(tmp_path, TRIANGLE, NetworkSettings(filters)) as run:
        run.wait_for_progress()
        with run.transport("RX0") as reader, run.transport("RX1") as carrier:
            true = recorded_said(reader)
            made_up = encode(Ok((0,)))
            altered = true.content[:-1] + bytes([true.content[-1] ^ 1])
            for content in (made_up, altered, true.content, b""):
                carrier.send("RX2", frame(run, "RX1", "RX2", ProtocolMessage(1, 0, content)))
            for why in {"signed": ["signature is wrong"], "sealed": ["was changed", "too short"]}[filters[-1]]:
                run.wait_for_refusal("RX1", "frame to RX2", why)
        run.wait_for_progress()
        assert run.let_go().verdict is Verdict.NO_SOLUTION


@looped("filters", [(), ("sealed",)])
def test_constraints_that_others_have_to_know_are_sealed_too(
    filters: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[bytes] = []
    write = Framing.write

    def recorded(frames: Framing, receiver: str, word: ControlMessage) -> bytes:
        content = write(frames, receiver, word)
        if isinstance(word, Copies):
            sent.append(content)
        return content

    monkeypatch.setattr(Framing, "write", recorded)
    household = InMemoryAuthority(TRIANGLE.order)
    identities = {name: household.identity(name) for name in TRIANGLE.order}
    office = InMemoryNetwork(TRIANGLE, AWC, identities, filters)
    assert office.search().verdict is Verdict.NO_SOLUTION
    assert len(sent) == 3
    assert any(b"ne(X" in content for content in sent) is not bool(filters)


def recorded_said(reader: Transport) -> ProtocolMessage:
    framing = Framing(reader.name)
    while isinstance(item := reader.inbox.get(timeout=HANG_S), FrameArrived):
        word = framing._of_robot.decode(item.content).message if item.sender != MASTER else None  # noqa: SLF001
        if isinstance(word, ProtocolMessage):
            return word
    raise AssertionError


@pytest.mark.slow
def test_a_message_that_is_lost_for_good_ends_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the key of RX2 somebody has said nothing, in a frame that bears the number of RX2's first one."""
    monkeypatch.setattr("robochoc.communication.network.master_control.HELD_S", 0)
    with NetworkRun(tmp_path, settings=NetworkSettings(patience_s=3)) as run:
        run.wait_for_progress()
        with run.transport("RX2") as transport:
            transport.send("RX3", frame(run, "RX2", "RX3", ProtocolMessage(0, 0, b"")))
            transport.send("RX3", frame(run, "RX2", "RX3", ProtocolMessage(0, 0, b"")))
            run.wait_for_refusal("RX2", "frame to RX3", "frame 1 has already arrived")
        with pytest.raises(RobotsLostError, match="MASTER was lost: 1 messages between robots were lost for good"):
            run.let_go()
