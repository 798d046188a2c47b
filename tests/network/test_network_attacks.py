"""Attacks on a run across machines: each is refused and reported, and the run goes on to its right verdict."""

from __future__ import annotations

import socket
import ssl
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from typing import Any

import msgspec
import pytest

from robochoc.authority.admission import InMemoryAuthority
from robochoc.authority.certificates import leaf_certificate, new_key, utc_time
from robochoc.authority.identity import Identity
from robochoc.communication.control import Conclusion
from robochoc.communication.network.access import frame_key
from robochoc.communication.network.control_messages import DirectoryRequest, ProtocolMessage, Register
from robochoc.communication.network.framing import LARGEST_FRAME, MASTER
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.robot import NetworkRobot
from robochoc.communication.network.router import Router
from robochoc.communication.network.transport import CannotConnectError, Transport
from robochoc.model.outcome import Verdict
from robochoc.protocols.message import encode
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.cases import looped
from tests.support.limits import HANG_S
from tests.support.network_runs import NetworkRun, frame, put
from tests.support.paused_abt import CHAIN, PausedABT
from tests.support.ports import free_endpoint

A_DAY_S = 86_400
JUNK = 1_000
SOON_S = 0.1
"""How long somebody tries who is not let in."""


@pytest.fixture(scope="module", name="run")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[NetworkRun]:
    """A team in the middle of its search. However it was attacked, it has to come to its right verdict."""
    with NetworkRun(tmp_path_factory.mktemp("run")) as run:
        run.wait_for_progress()
        yield run
        assert run.let_go().verdict is Verdict.SOLUTION
        assert run.held == (True, 0.0)
    assert not run.losses
    assert all(not ending.failed for ending in run.endings.values()), run.endings


def shaken(endpoint: str) -> socket.socket:
    host, _, port = endpoint.rpartition(":")
    return socket.create_connection((host, int(port)), HANG_S)


def turned_away(run: NetworkRun, identity: Identity, why: str) -> None:
    """This identity does not get in, however often it tries, and that is reported."""

    def is_reported() -> bool:
        with pytest.raises(CannotConnectError, match=f"does not admit {identity.name}"):
            Transport(run.endpoint, identity, patience_s=SOON_S)
        return ("somebody", "connect", why) in {(one.who, one.what, one.why) for one in run.refusals}

    run.wait_until(is_reported, f"it is not reported that {why}")
    run.wait_for_progress()


# Who is not let in


def test_a_robot_that_is_not_of_the_team(run: NetworkRun) -> None:
    with run.transport("Intruder") as transport:
        transport.send(MASTER, frame(run, "Intruder", MASTER, Register(profile_of(CHAIN.robots[0]), "x")))
        put(transport, frame_key("RX0", "Intruder"))
        run.wait_for_refusal("Intruder", "connect", "not registered with the Authority")
        run.wait_for_progress()
        assert transport.inbox.empty()
    assert "Intruder" not in run.master.members.robots


def test_a_certificate_of_another_authority(run: NetworkRun) -> None:
    other = InMemoryAuthority(CHAIN.order).identity("RX0")
    turned_away(run, other, "it does not trust the master, which its Authority has not certified")
    unconcerned = replace(other, ca=run.household.identity("RX0").ca)  # it does not mind whom it talks to
    turned_away(run, unconcerned, "its certificate was not issued by this Authority")


def test_a_certificate_that_has_expired(run: NetworkRun) -> None:
    turned_away(run, out_of_date(run.household, "RX0"), "its certificate has expired")


def out_of_date(household: InMemoryAuthority, name: str) -> Identity:
    key, now = new_key(), time.time()
    times = (utc_time(now - 2 * A_DAY_S), utc_time(now - A_DAY_S))
    issuer = (household._certificate, household._key)  # noqa: SLF001
    identity = household.identity(name)
    return replace(identity, key=key, certificate=leaf_certificate(issuer, key.public_key(), name, None, times))


def test_no_certificate(run: NetworkRun) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    with shaken(run.endpoint) as raw, suppress(OSError), context.wrap_socket(raw) as connection:
        connection.sendall(b"anything")
        connection.recv(1)
    run.wait_for_refusal("somebody", "connect", "has sent no certificate")
    run.wait_for_progress()


@looped("content", [b"GET / HTTP/1.1\r\n\r\n", bytes(100_000), b"\x16\x03\x01\xff\xff" + b"\xff" * 1000])
def test_what_is_not_tls(run: NetworkRun, content: bytes) -> None:
    with shaken(run.endpoint) as raw, suppress(OSError):
        raw.sendall(content)
        raw.recv(1)
    run.wait_for_refusal("somebody", "connect", "does not speak TLS")
    run.wait_for_progress()


def test_many_connections_that_say_nothing(run: NetworkRun) -> None:
    """Nobody has to wait for them; when they hang up, each is refused in turn."""
    with ExitStack() as stack:
        mute = [stack.enter_context(shaken(run.endpoint)) for _ in range(12)]
        mute[0].sendall(b"\x16\x03")
        with run.transport("RX3"):
            run.wait_for_progress()
    run.wait_for_refusal("somebody", "connect", r"closed the connection during the handshake \(10 times so far\)")
    run.wait_for_progress()


def test_a_robot_that_poses_as_the_master(run: NetworkRun) -> None:
    """Its certificate is of the same Authority; but it is not one for a server at this address."""
    endpoint = free_endpoint()
    router = Router(endpoint, run.household.identity("RX3"), lambda _: None, 10_000)
    with closing(router):
        router.open({"RX0": ()})
        with pytest.raises(CannotConnectError):
            run.transport("RX0", endpoint=endpoint, patience_s=SOON_S)


# What those who are let in may not do


def test_a_forged_sender(run: NetworkRun) -> None:
    with run.transport("RX3") as transport:
        put(transport, frame_key("RX2", "RX1"), frame(run, "RX1", "RX2", ProtocolMessage(1, 0, encode(Ok((0,))))))
        put(transport, frame_key(MASTER, "RX1"), frame(run, "RX1", MASTER, Conclusion(1, "no-solution")))
        put(transport, frame_key("RX2", MASTER))
        run.wait_for_refusal("RX3", "put rc/msg/RX2/RX1", "no rule")
        run.wait_for_refusal("RX3", "put rc/msg/MASTER/RX1", "no rule")
        run.wait_for_refusal("RX3", "put rc/msg/RX2/MASTER", "no rule")
        run.wait_for_progress()


@looped("key", ["rc/msg/RX1/*", "rc/msg/*/RX1", "rc/**", "**", "rc/msg/RX1/RX0/@adv/**"])
def test_reading_the_frames_of_others(run: NetworkRun, key: str) -> None:
    heard: list[Any] = []
    with run.transport("RX3") as transport:
        session = transport._session  # noqa: SLF001
        subscriber = session.declare_subscriber(key, heard.append)
        assert not list(session.get(key))
        run.wait_for_refusal("RX3", f"declare subscriber {key}".replace("*", r"\*"), "no rule")
        run.wait_for_refusal("RX3", f"query {key}".replace("*", r"\*"), "no rule")
        run.wait_for_progress()
        assert {str(one.key_expr).split("/")[2] for one in heard} <= {"RX3"}  # the master welcomes whoever comes back
        del subscriber


def test_a_robot_that_writes_to_one_it_has_nothing_to_do_with(run: NetworkRun) -> None:
    """RX0 and RX3 share no constraint, and the protocol says that it goes `beyond` none."""
    assert not PausedABT.traits.writes_to_non_neighbours
    with run.transport("RX3") as transport:
        put(transport, frame_key("RX0", "RX3"), frame(run, "RX3", "RX0", ProtocolMessage(1, 0, encode(Ok((0,))))))
        run.wait_for_refusal("RX3", "put rc/msg/RX0/RX3", "no rule")
        run.wait_for_progress()


def test_posing_as_there(run: NetworkRun) -> None:
    with run.transport("RX3") as transport:
        token = transport._session.liveliness().declare_token("rc/live/RX0")  # noqa: SLF001
        run.wait_for_refusal("RX3", "liveliness token rc/live/RX0", "no rule")
        del token


def test_thousands_of_forbidden_frames(run: NetworkRun) -> None:
    """They cost a few events, that say how many there were."""
    before = len(run.refusals)
    with run.transport("RX2") as transport:
        for _ in range(JUNK):
            put(transport, frame_key("RX1", "RX0"), b"junk")
        run.wait_for_refusal("RX2", "put rc/msg/RX1/RX0", r"no rule .*1,000 times so far")
    assert len(run.refusals) < before + 20
    run.wait_for_progress()


# What those who are let in send to whom they may


def test_a_frame_of_an_earlier_run(run: NetworkRun) -> None:
    with run.transport("RX1") as transport:
        transport.send(
            "RX2", frame(run, "RX1", "RX2", ProtocolMessage(1, 0, encode(Ok((0,)))), of_run="0123456789abcdef")
        )
        transport.send(MASTER, frame(run, "RX1", MASTER, Conclusion(1, "no-solution"), of_run="0123456789abcdef"))
        run.wait_for_refusal("RX1", "frame to RX2", "replay: it was written in another run")
        run.wait_for_refusal("RX1", "frame to the master", "replay: it was written in another run")
    run.wait_for_progress()


def test_a_frame_that_comes_twice(run: NetworkRun) -> None:
    """Recorded where it may be read, and sent again by the one session that may write in its sender's name."""
    with run.transport("RX0") as reader, run.transport("RX1") as writer:
        recorded = next(
            item.content
            for item in iter(lambda: reader.inbox.get(timeout=HANG_S), None)
            if isinstance(item, FrameArrived) and item.sender == "RX1"
        )
        writer.send("RX0", recorded)
        run.wait_for_refusal("RX1", "frame to RX0", r"replay: frame \d+ has already arrived")
    run.wait_for_progress()


def test_a_frame_from_the_future(run: NetworkRun) -> None:
    with run.transport("RX1") as transport:
        transport.send("RX2", frame(run, "RX1", "RX2", ProtocolMessage(1, 0, encode(Ok((0,)))), number=10**6))
        run.wait_for_refusal("RX1", "frame to RX2", "is missing before frame 1000000")
        transport.send("RX2", frame(run, "RX1", "RX2", ProtocolMessage(10**6, 0, encode(Ok((0,))))))
        run.wait_for_refusal("RX1", "frame to RX2", "it is of epoch 1000000")


MALFORMED = {
    b"": "input data was truncated",
    b"\xc1": "invalid opcode",
    b"\xff" * 1000: "expected `array`, got `int`",
    b"\x93\xa3run\x01" + b"\x91" * 100_000: "expected `str`, got `array`",
    b"\x93\xa1\xff\x01\x92\xa4Said\x01": "can't decode byte 0xff",
    b"\x90": "expected `array` of at least length",
}
"""Contents, and why they are no frames."""


@looped("receiver", ["RX0", MASTER])
def test_malformed_frames(run: NetworkRun, receiver: str) -> None:
    before = len(run.refusals)
    with run.transport("RX1") as transport:
        for content, why in MALFORMED.items():
            transport.send(receiver, content)
            run.wait_for_refusal("RX1", f"frame to {receiver.replace(MASTER, 'the master')}", f"(?i)malformed: .*{why}")
        run.wait_for_progress()
    assert len(run.refusals) <= before + len(MALFORMED)


NO_MESSAGES = {
    b"": "input data was truncated",
    b"\xc1": "invalid opcode",
    b"\x01": "expected `array`, got `int`",
    msgspec.msgpack.encode(["Ok", "text"]): "expected `array`, got `str`",
    b"\x91\xa2\xff\xff": "can't decode byte 0xff",
}


def test_a_peer_that_speaks_no_protocol(run: NetworkRun) -> None:
    """Such a frame does not take the place of the right one."""
    with run.transport("RX2") as transport:
        for content, why in NO_MESSAGES.items():
            transport.send("RX1", frame(run, "RX2", "RX1", ProtocolMessage(1, 0, content)))
            run.wait_for_refusal("RX2", "frame to RX1", f"(?i)not a message of the protocol: .*{why}")
    run.wait_for_progress()


def test_frames_that_are_too_large(run: NetworkRun) -> None:
    """What zenoh takes is refused aloud; what is more than that ends the connection of who has sent it."""
    with run.transport("RX1") as transport:
        transport.send("RX2", bytes(LARGEST_FRAME + 1))
        transport.send(MASTER, bytes(LARGEST_FRAME + 1))
        run.wait_for_refusal("RX1", "frame to RX2", "has 8,388,609 bytes, more than")
        run.wait_for_refusal("RX1", "frame to the master", "has 8,388,609 bytes, more than")
        put(transport, frame_key(MASTER, "RX1"), bytes(5 * LARGEST_FRAME))
        run.wait_for_progress()


@looped("receiver", ["RX0", MASTER])
def test_thousands_of_junk_frames(run: NetworkRun, receiver: str) -> None:
    before = len(run.refusals)
    content = {"RX0": b"\x00junk", MASTER: b"\x01junk"}[receiver]
    with run.transport("RX1") as transport:
        for _ in range(JUNK):
            transport.send(receiver, content)
        run.wait_for_refusal(
            "RX1", f"frame to {'RX0' if receiver == 'RX0' else 'the master'}", r"malformed.*\(1,000 times so far\)"
        )
        run.wait_for_progress()
    assert len(run.refusals) < before + 20


def test_a_robot_of_a_name_that_is_there_already(run: NetworkRun) -> None:
    with run.transport("RX2") as transport:
        robot = NetworkRobot(CompiledRobot(CHAIN["RX2"]), run.household.identity("RX2"), transport, protocol_named)
        ending = robot.run()
    assert ending.failed
    assert ending.why == "the master does not admit RX2: a robot called RX2 is registered already"
    run.wait_for_refusal("RX2", "register", "a robot called RX2 is registered already")
    run.wait_for_progress()
    assert run.master.members.robots["RX2"].away_since is None, "the first one is there as before"


def protocol_named(_name: str) -> type[Protocol]:
    return PausedABT


def test_who_asks_the_directory_without_end(run: NetworkRun) -> None:
    with run.transport("RX3") as transport:

        def is_refused() -> bool:
            """Some are answered in the meantime."""
            for number in range(JUNK // 5):
                transport.send(MASTER, frame(run, "RX3", MASTER, DirectoryRequest(number, "(")))
            return any("ask the Directory" in one.what and "(100 times so far)" in one.why for one in run.refusals)

        run.wait_until(is_refused, "all of them are answered")
    run.wait_for_progress()
