"""Enrolment over real sockets: robots that are welcome, and all who are not."""

from __future__ import annotations

import socket
import ssl
import stat
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from datetime import timedelta
from pathlib import Path

import msgspec
import pytest
from authorities import HOUR, Clock, Seen
from hypothesis import given
from hypothesis import strategies as st

from robochoc.authority.authority import Authority
from robochoc.authority.certificates import new_key, pem, read_certificate, signing_request
from robochoc.authority.enrolment import EnrolmentFailed, NotTrusted, enrol, renew
from robochoc.authority.enrolment_server import EnrolmentServer
from robochoc.authority.frames import (
    LARGEST_BYTES,
    Answer,
    BadFrame,
    Certified,
    Denied,
    Exchange,
    Introduce,
    Introduction,
    Redeem,
    Renew,
    decode_question,
)
from robochoc.authority.identity import Identity, save
from robochoc.authority.token import BadToken, Token

SOON_S = 5.0


class Desk:
    """An Authority with its service, whose clock is the machine's plus what a test adds."""

    def __init__(self, folder: Path) -> None:
        self.clock = Clock(0)
        self.seen = Seen()
        self.authority = Authority.create(folder, observer=self.seen, clock=lambda: time.time() + self.clock.now)
        self.master = self.authority.master_identity(["127.0.0.1"])
        self.server = EnrolmentServer(self.authority, self.master, patience_s=1.0, connections=4)

    @property
    def place(self) -> tuple[str, int]:
        return self.server.address

    def refusal(self, count: int = 1) -> str:
        """Why the last one was refused, as soon as `count` were."""
        deadline = time.monotonic() + SOON_S
        while len(self.seen.refusals) < count and time.monotonic() < deadline:
            time.sleep(0.005)
        assert len(self.seen.refusals) == count, self.seen.refusals
        return self.seen.refusals[-1].why


def open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    before = threading.active_count(), open_files()
    desk = Desk(tmp_path / "authority")
    with desk.server:
        yield desk
    assert (threading.active_count(), open_files()) == before, "nothing is left behind"


def trusting(desk: Desk) -> ssl.SSLContext:
    context = ssl.create_default_context(cadata=pem(desk.authority.certificate).decode())
    context.check_hostname = False
    return context


def answered(desk: Desk, raw: bytes, context: ssl.SSLContext | None = None) -> Answer:
    """What the service answers to `raw`, over good TLS."""
    with (
        socket.create_connection(desk.place, SOON_S) as plain,
        (context or trusting(desk)).wrap_socket(plain) as connection,
    ):
        connection.sendall(raw)
        return Exchange(connection, SOON_S).answer()


def framed(content: bytes) -> bytes:
    return len(content).to_bytes(4, "big") + content


def test_a_robot_enrols_and_renews(desk: Desk, tmp_path: Path) -> None:
    token = str(desk.authority.enrol("Robot3.1"))
    folder = tmp_path / "home" / "Robot3.1"
    robot = enrol(*desk.place, token, folder, "Robot3.1")
    assert robot.name == "Robot3.1"
    assert Identity.load(folder).certificate == robot.certificate
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(robot.key_file.stat().st_mode) == 0o600
    new = renew(robot, *desk.place)
    assert new.certificate.serial_number != robot.certificate.serial_number
    assert new.key.public_key() == robot.key.public_key()
    assert Identity.load(folder).certificate == new.certificate
    assert not desk.seen.refusals
    assert [event.what for event in desk.seen.events] == ["redeem a token", "renew a certificate"]
    assert all(event.origin.startswith("127.0.0.1:") for event in desk.seen.events)


def test_a_whole_team_enrols_at_once(desk: Desk, tmp_path: Path) -> None:
    """More than are served at a time: the others wait."""
    names = [f"R{number}" for number in range(20)]
    tokens = desk.authority.enrol_all(names)
    with ThreadPoolExecutor(20) as threads:
        robots = threads.map(lambda name: enrol(*desk.place, tokens[name], tmp_path / name, name), names)
        assert [robot.name for robot in robots] == names
    assert not desk.seen.refusals


def test_a_token_used_twice(desk: Desk, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    robot = enrol(*desk.place, token, tmp_path / "a", "A")
    with pytest.raises(EnrolmentFailed, match="used already"):
        enrol(*desk.place, token, tmp_path / "a", "A")
    assert desk.refusal() == "the token has been used already"
    assert Identity.load(tmp_path / "a").certificate == robot.certificate, "who is refused keeps what it had"
    assert desk.seen.refusals[0].origin.startswith("127.0.0.1:")


def test_a_token_that_has_expired(desk: Desk, tmp_path: Path) -> None:
    token = desk.authority.enrol("A", ttl=timedelta(seconds=30))
    desk.clock.now += 31
    with pytest.raises(EnrolmentFailed, match="expired"):
        enrol(*desk.place, token, tmp_path / "a", "A")


def test_a_token_of_another_name(desk: Desk, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    with pytest.raises(EnrolmentFailed, match="not for this name"):
        enrol(*desk.place, token, tmp_path / "b", "B")
    assert not (tmp_path / "b" / "key.pem").exists()


def test_half_a_token_goes_nowhere(tmp_path: Path) -> None:
    with pytest.raises(BadToken, match="copy all"):
        enrol("127.0.0.1", 1, "abc", tmp_path / "a", "A")


def test_a_machine_in_the_middle_does_not_see_the_token(desk: Desk, tmp_path: Path) -> None:
    """It has an Authority of its own, and answers in the place of the right one."""
    other = Desk(tmp_path / "middle")
    token = desk.authority.enrol("A")
    with other.server, pytest.raises(NotTrusted, match="not shown"):
        enrol(*other.place, token, tmp_path / "a", "A")
    assert other.seen.events == []
    assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A", "the token is as good as new"


def test_a_machine_in_the_middle_that_shows_the_right_certificate_does_not_see_the_token_either(
    desk: Desk, tmp_path: Path
) -> None:
    """The Authority's certificate is no secret; to be the master takes a key that it has certified."""
    other = Desk(tmp_path / "middle")
    token = desk.authority.enrol("A")
    other.authority.certificate = desk.authority.certificate
    with other.server:
        with pytest.raises(NotTrusted, match="not the master"):
            enrol(*other.place, token, tmp_path / "a", "A")
        assert "TLS failed" in other.refusal()


def test_a_robot_cannot_pose_as_the_master(desk: Desk, tmp_path: Path) -> None:
    thief = enrol(*desk.place, desk.authority.enrol("Thief"), tmp_path / "thief", "Thief")
    token = desk.authority.enrol("A")
    with EnrolmentServer(desk.authority, thief) as posing, pytest.raises(NotTrusted, match="not the master"):
        enrol(*posing.address, token, tmp_path / "a", "A")


def test_nobody_there(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(EnrolmentFailed, match="robochoc master"):
        enrol("127.0.0.1", port, Token.new(bytes(32)), tmp_path / "a", "A")


def drip(connection: socket.socket, content: bytes) -> None:
    """Send a byte now and then, until the other side has hung up."""
    with suppress(OSError):
        for byte in content:
            connection.sendall(bytes([byte]))
            time.sleep(0.05)
        pytest.fail("nobody hung up")


def silent(connection: socket.socket) -> None:
    while connection.recv(100000):
        pass


def dripping(connection: socket.socket) -> None:
    drip(connection, b"\x16\x03\x03\x3f\xff" + bytes(1000))


@pytest.mark.parametrize("behaviour", [silent, dripping])
def test_a_service_that_takes_for_ever_is_left(behaviour: Callable[[socket.socket], None], tmp_path: Path) -> None:
    def serve() -> None:
        connection, _ = listener.accept()
        with connection, suppress(OSError):
            behaviour(connection)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = threading.Thread(target=serve)
        server.start()
        began = time.monotonic()
        with pytest.raises(EnrolmentFailed):
            enrol("127.0.0.1", listener.getsockname()[1], Token.new(bytes(32)), tmp_path / "a", "A", patience_s=0.3)
        assert time.monotonic() - began < SOON_S
        server.join()


def test_renewal_by_a_revoked_robot(desk: Desk, tmp_path: Path) -> None:
    robot = enrol(*desk.place, desk.authority.enrol("A"), tmp_path / "a", "A")
    desk.authority.revoke("A")
    with pytest.raises(EnrolmentFailed, match="revoked"):
        renew(robot, *desk.place)
    assert desk.refusal() == "the certificate has been revoked"
    assert Identity.load(tmp_path / "a").certificate == robot.certificate


def test_renewal_in_another_name(desk: Desk, tmp_path: Path) -> None:
    robot = enrol(*desk.place, desk.authority.enrol("A"), tmp_path / "a", "A")
    context = trusting(desk)
    context.load_cert_chain(robot.certificate_file, robot.key_file)
    desk.authority.enrol("B")
    request = signing_request(robot.key, "B")
    answer = answered(desk, framed(msgspec.msgpack.encode(Renew(request))), context)
    assert answer == Denied("the request is in another name than the certificate")
    assert desk.refusal()


def test_renewal_without_a_certificate(desk: Desk) -> None:
    request = signing_request(new_key(), "A")
    assert isinstance(answered(desk, framed(msgspec.msgpack.encode(Renew(request)))), Denied)
    assert "shows it" in desk.refusal()


def test_renewal_with_a_certificate_of_another_authority(desk: Desk, tmp_path: Path) -> None:
    other = Desk(tmp_path / "other")
    with other.server:
        stranger = enrol(*other.place, other.authority.enrol("A"), tmp_path / "a", "A")
    with pytest.raises(NotTrusted):
        renew(stranger, *desk.place)
    assert "TLS failed" in desk.refusal()
    context = trusting(desk)  # this one does not mind whom it talks to
    context.load_cert_chain(stranger.certificate_file, stranger.key_file)
    with pytest.raises((OSError, BadFrame)):
        answered(desk, framed(msgspec.msgpack.encode(Renew(signing_request(stranger.key, "A")))), context)
    assert "TLS failed" in desk.refusal(2)


def test_renewal_with_an_expired_certificate(tmp_path: Path) -> None:
    old = Desk(tmp_path / "authority")
    old.clock.now = -25 * HOUR
    token = old.authority.enrol("A")
    key = new_key()
    folder = tmp_path / "a"
    folder.mkdir(mode=0o700)
    certificate = read_certificate(old.authority.redeem(token.secret, signing_request(key, "A")))
    save(folder, key, certificate, old.authority.certificate)
    expired = Identity(folder, "A", key, certificate, old.authority.certificate)
    old.clock.now = 0
    with old.server:
        with pytest.raises(EnrolmentFailed):
            renew(expired, *old.place)
        assert old.refusal() == "TLS failed: certificate has expired"


def test_oversized_requests_are_not_even_read(desk: Desk) -> None:
    for size in (LARGEST_BYTES + 1, 2**31, 2**32 - 1):
        answer = answered(desk, size.to_bytes(4, "big"))
        assert isinstance(answer, Denied)
        assert "allowed" in answer.why
    assert "allowed" in desk.refusal(3)


DEEP = b"\x82\xa4type\xa6Redeem\xa6secret" + b"\x91" * 16000


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xc1",
        b"\xff" * LARGEST_BYTES,
        b"GET / HTTP/1.1\r\n\r\n",
        DEEP,
        msgspec.msgpack.encode({"type": "Redeem", "secret": b"x"}),
        msgspec.msgpack.encode({"type": "Redeem", "secret": b"x", "request": b"", "more": 1}),
        msgspec.msgpack.encode({"type": "Redeem", "secret": "text", "request": 1}),
        msgspec.msgpack.encode({"type": "Certified", "certificate": b""}),
        msgspec.msgpack.encode({"type": b"\xff"}),
        msgspec.msgpack.encode([]),
    ],
)
def test_malformed_requests(desk: Desk, content: bytes) -> None:
    assert isinstance(answered(desk, framed(content)), Denied)
    assert "no question" in desk.refusal()


@given(st.binary(max_size=200))
def test_no_bytes_make_decoding_fail_otherwise(content: bytes) -> None:
    try:
        question = decode_question(content)
    except BadFrame:
        return
    assert isinstance(question, Introduce | Redeem | Renew)


def test_an_unknown_token(desk: Desk) -> None:
    question = Redeem(b"guess", signing_request(new_key(), "A"))
    answer = answered(desk, framed(msgspec.msgpack.encode(question)))
    assert isinstance(answer, Denied)
    assert "unknown" in desk.refusal()


def test_plain_tcp_and_old_tls_are_refused(desk: Desk) -> None:
    with socket.create_connection(desk.place, SOON_S) as plain:
        plain.sendall(framed(msgspec.msgpack.encode(Introduce())) * 10)
        with pytest.raises((OSError, BadFrame)):
            Exchange(plain, SOON_S).answer()
    assert "TLS failed" in desk.refusal()
    context = trusting(desk)
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with pytest.raises(ssl.SSLError):
        answered(desk, b"", context)
    assert "TLS failed" in desk.refusal(2)


def test_slow_ones_are_hung_up_on_and_others_are_served_meanwhile_and_after(desk: Desk, tmp_path: Path) -> None:
    """One does nothing, one drips bytes of a handshake, one bytes of a request: in time all of them are gone."""
    tokens = desk.authority.enrol_all(["A", "B"])
    with ExitStack() as stack:
        mute = stack.enter_context(socket.create_connection(desk.place, SOON_S))
        half = stack.enter_context(socket.create_connection(desk.place, SOON_S))
        half.sendall(b"\x16\x03\x01")
        plain = stack.enter_context(socket.create_connection(desk.place, SOON_S))
        slow = stack.enter_context(trusting(desk).wrap_socket(plain))
        began = time.monotonic()
        assert enrol(*desk.place, tokens["A"], tmp_path / "a", "A").name == "A"
        assert time.monotonic() - began < 0.9, "nobody had to be waited for"
        drip(slow, framed(bytes(1000)))
        assert time.monotonic() - began < 2.5
        assert "more than 1 s" in desk.refusal(3)
        assert mute.recv(1) == b""
    assert enrol(*desk.place, tokens["B"], tmp_path / "b", "B").name == "B"


def test_who_fills_all_places_delays_others_no_longer_than_the_patience(desk: Desk, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    with ExitStack() as stack:
        for _ in range(4):
            stack.enter_context(socket.create_connection(desk.place, SOON_S))
        assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A"


def test_closing_hangs_up_on_everybody_at_once(tmp_path: Path) -> None:
    desk = Desk(tmp_path / "authority")
    desk.server = EnrolmentServer(desk.authority, desk.master, connections=2)
    before = threading.active_count()
    with ExitStack() as stack:
        with desk.server:
            for _ in range(3):
                stack.enter_context(socket.create_connection(desk.place, SOON_S))
            while threading.active_count() < before + 3:
                time.sleep(0.005)
            began = time.monotonic()
        assert time.monotonic() - began < 2
        assert threading.active_count() == before
    assert desk.seen.events == [], "what we do ourselves is no refusal"


def test_the_masters_certificate_is_renewed_while_it_serves(desk: Desk, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    serial = Identity.load(desk.master.folder).certificate.serial_number
    desk.clock.now += 13 * HOUR
    with pytest.raises(NotTrusted):  # made for a time that has not come here yet
        enrol(*desk.place, token, tmp_path / "a", "A")
    new = Identity.load(desk.master.folder, time.time() + desk.clock.now)
    assert new.certificate.serial_number != serial
    assert new.hosts == ("127.0.0.1",)


def test_a_lost_authority_is_said_and_the_service_goes_on(desk: Desk, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    registry = desk.authority.folder / "registry.json"
    content = registry.read_bytes()
    registry.write_bytes(b"rubbish")
    with pytest.raises(EnrolmentFailed, match="at the moment"):
        enrol(*desk.place, token, tmp_path / "a", "A")
    assert "registry" in desk.refusal()
    registry.write_bytes(content)
    assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A"


@pytest.mark.parametrize(
    "answer",
    [Introduction(b""), Introduction(b"x" * 9000), Certified(b""), Denied("no")],
    ids=["empty", "long", "other", "denied"],
)
def test_a_lying_service_is_not_believed(tmp_path: Path, answer: Answer) -> None:
    desk = Desk(tmp_path / "authority")

    def lie(*_any: object) -> Answer:
        return answer

    desk.server._answer = lie  # type: ignore[assignment, method-assign]  # noqa: SLF001 - a service that lies
    with desk.server, pytest.raises(NotTrusted):
        enrol(*desk.place, Token.new(bytes(32)), tmp_path / "a", "A")


@pytest.mark.parametrize("kind", ["another key", "another name", "rubbish", "introduction"])
def test_a_certificate_that_is_not_ours_is_not_taken(desk: Desk, tmp_path: Path, kind: str) -> None:
    robot = enrol(*desk.place, desk.authority.enrol("A"), tmp_path / "a", "A")

    def lie(question: object, *_rest: object) -> Answer:
        assert isinstance(question, Renew)
        match kind:
            case "another key":
                secret = desk.authority.enrol("A").secret
                return Certified(desk.authority.redeem(secret, signing_request(new_key(), "A")))
            case "another name":
                secret = desk.authority.enrol("B").secret
                return Certified(desk.authority.redeem(secret, signing_request(robot.key, "B")))
            case "rubbish":
                return Certified(b"rubbish")
            case _:
                return Introduction(b"")

    desk.server._answer = lie  # type: ignore[assignment, method-assign]  # noqa: SLF001 - a service that lies
    with pytest.raises(EnrolmentFailed, match=r"another|not good"):
        renew(robot, *desk.place)
    assert Identity.load(tmp_path / "a").certificate == robot.certificate
