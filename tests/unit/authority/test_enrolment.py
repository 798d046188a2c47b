"""Enrolment over real sockets: robots that are welcome, and all who are not."""

from __future__ import annotations

import socket
import stat
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import timedelta
from pathlib import Path

import msgspec
import pytest

from robochoc.authority.certificates import new_key, read_certificate, signing_request
from robochoc.authority.enrolment import EnrolmentError, NotTrustedError, enrol, renew
from robochoc.authority.enrolment_server import EnrolmentServer
from robochoc.authority.frames import (
    Answer,
    Certified,
    EnrolmentDenied,
    FrameError,
    Introduction,
    Renew,
)
from robochoc.authority.identity import Identity, save
from robochoc.authority.token import EnrolmentToken, TokenError
from tests.support.authorities import HOUR
from tests.support.authority_service import AuthorityService, answered, drip, framed, trusting
from tests.support.cases import looped


def test_a_robot_enrols_and_renews(desk: AuthorityService, tmp_path: Path) -> None:
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


def test_a_whole_team_enrols_at_once(desk: AuthorityService, tmp_path: Path) -> None:
    """More than are served at a time: the others wait."""
    names = [f"R{number}" for number in range(20)]
    tokens = desk.authority.enrol_all(names)
    with ThreadPoolExecutor(20) as threads:
        robots = threads.map(lambda name: enrol(*desk.place, tokens[name], tmp_path / name, name), names)
        assert [robot.name for robot in robots] == names
    assert not desk.seen.refusals


def test_a_token_used_twice(desk: AuthorityService, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    robot = enrol(*desk.place, token, tmp_path / "a", "A")
    with pytest.raises(EnrolmentError, match="already been used"):
        enrol(*desk.place, token, tmp_path / "a", "A")
    assert desk.refusal() == "the token has already been used"
    assert Identity.load(tmp_path / "a").certificate == robot.certificate, "who is refused keeps what it had"
    assert desk.seen.refusals[0].origin.startswith("127.0.0.1:")


def test_a_token_that_has_expired(desk: AuthorityService, tmp_path: Path) -> None:
    token = desk.authority.enrol("A", ttl=timedelta(seconds=30))
    desk.clock.now += 31
    with pytest.raises(EnrolmentError, match="expired"):
        enrol(*desk.place, token, tmp_path / "a", "A")


def test_a_token_of_another_name(desk: AuthorityService, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    with pytest.raises(EnrolmentError, match="for another name"):
        enrol(*desk.place, token, tmp_path / "b", "B")
    assert not (tmp_path / "b" / "key.pem").exists()


def test_half_a_token_goes_nowhere(tmp_path: Path) -> None:
    with pytest.raises(TokenError, match="copy the whole output"):
        enrol("127.0.0.1", 1, "abc", tmp_path / "a", "A")


def test_a_machine_in_the_middle_does_not_see_the_token(desk: AuthorityService, tmp_path: Path) -> None:
    """It has an Authority of its own, and answers in the place of the right one."""
    other = AuthorityService(tmp_path / "middle")
    token = desk.authority.enrol("A")
    with other.server, pytest.raises(NotTrustedError, match="not sent"):
        enrol(*other.place, token, tmp_path / "a", "A")
    assert other.seen.events == []
    assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A", "the token is as good as new"


def test_a_machine_in_the_middle_that_shows_the_right_certificate_does_not_see_the_token_either(
    desk: AuthorityService, tmp_path: Path
) -> None:
    """The Authority's certificate is no secret; to be the master takes a key that it has certified."""
    other = AuthorityService(tmp_path / "middle")
    token = desk.authority.enrol("A")
    other.authority.certificate = desk.authority.certificate
    with other.server:
        with pytest.raises(NotTrustedError, match="not the master"):
            enrol(*other.place, token, tmp_path / "a", "A")
        assert "TLS failed" in other.refusal()


def test_a_robot_cannot_pose_as_the_master(desk: AuthorityService, tmp_path: Path) -> None:
    thief = enrol(*desk.place, desk.authority.enrol("Thief"), tmp_path / "thief", "Thief")
    token = desk.authority.enrol("A")
    with EnrolmentServer(desk.authority, thief) as posing, pytest.raises(NotTrustedError, match="not the master"):
        enrol(*posing.address, token, tmp_path / "a", "A")


def test_nobody_there(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(EnrolmentError, match="robochoc master"):
        enrol("127.0.0.1", port, EnrolmentToken.new(bytes(32)), tmp_path / "a", "A")


def silent(connection: socket.socket) -> None:
    while connection.recv(100000):
        pass


def dripping(connection: socket.socket) -> None:
    drip(connection, b"\x16\x03\x03\x3f\xff" + bytes(1000))


@looped("behaviour", [silent, dripping])
def test_a_service_that_takes_for_ever_is_left(behaviour: Callable[[socket.socket], None], tmp_path: Path) -> None:
    def serve() -> None:
        connection, _ = listener.accept()
        with connection, suppress(OSError):
            behaviour(connection)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = threading.Thread(target=serve)
        server.start()
        with pytest.raises(EnrolmentError):
            enrol(
                "127.0.0.1",
                listener.getsockname()[1],
                EnrolmentToken.new(bytes(32)),
                tmp_path / "a",
                "A",
                patience_s=0.3,
            )
        server.join()


def test_renewal_by_a_revoked_robot(desk: AuthorityService, tmp_path: Path) -> None:
    robot = enrol(*desk.place, desk.authority.enrol("A"), tmp_path / "a", "A")
    desk.authority.revoke("A")
    with pytest.raises(EnrolmentError, match="revoked"):
        renew(robot, *desk.place)
    assert desk.refusal() == "the certificate has been revoked"
    assert Identity.load(tmp_path / "a").certificate == robot.certificate


def test_renewal_in_another_name(desk: AuthorityService, tmp_path: Path) -> None:
    robot = enrol(*desk.place, desk.authority.enrol("A"), tmp_path / "a", "A")
    context = trusting(desk)
    context.load_cert_chain(robot.certificate_file, robot.key_file)
    desk.authority.enrol("B")
    request = signing_request(robot.key, "B")
    answer = answered(desk, framed(msgspec.msgpack.encode(Renew(request))), context)
    assert answer == EnrolmentDenied("the name in the request differs from the name in the certificate")
    assert desk.refusal()


def test_renewal_without_a_certificate(desk: AuthorityService) -> None:
    request = signing_request(new_key(), "A")
    assert isinstance(answered(desk, framed(msgspec.msgpack.encode(Renew(request)))), EnrolmentDenied)
    assert "uses the same certificate" in desk.refusal()


def test_renewal_with_a_certificate_of_another_authority(desk: AuthorityService, tmp_path: Path) -> None:
    other = AuthorityService(tmp_path / "other")
    with other.server:
        stranger = enrol(*other.place, other.authority.enrol("A"), tmp_path / "a", "A")
    with pytest.raises(NotTrustedError):
        renew(stranger, *desk.place)
    assert "TLS failed" in desk.refusal()
    context = trusting(desk)  # this one does not mind whom it talks to
    context.load_cert_chain(stranger.certificate_file, stranger.key_file)
    with pytest.raises((OSError, FrameError)):
        answered(desk, framed(msgspec.msgpack.encode(Renew(signing_request(stranger.key, "A")))), context)
    assert "TLS failed" in desk.refusal(2)


def test_renewal_with_an_expired_certificate(tmp_path: Path) -> None:
    old = AuthorityService(tmp_path / "authority")
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
        with pytest.raises(EnrolmentError):
            renew(expired, *old.place)
        assert old.refusal() == "TLS failed: certificate has expired"


def test_the_masters_certificate_is_renewed_while_it_serves(desk: AuthorityService, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    serial = Identity.load(desk.master.folder).certificate.serial_number
    desk.clock.now += 13 * HOUR
    with pytest.raises(NotTrustedError):  # made for a time that has not come here yet
        enrol(*desk.place, token, tmp_path / "a", "A")
    new = Identity.load(desk.master.folder, time.time() + desk.clock.now)
    assert new.certificate.serial_number != serial
    assert new.hosts == ("127.0.0.1",)


def test_a_lost_authority_is_said_and_the_service_goes_on(desk: AuthorityService, tmp_path: Path) -> None:
    token = desk.authority.enrol("A")
    registry = desk.authority.folder / "registry.json"
    content = registry.read_bytes()
    registry.write_bytes(b"rubbish")
    with pytest.raises(EnrolmentError, match="ask its operator"):
        enrol(*desk.place, token, tmp_path / "a", "A")
    assert "registry" in desk.refusal()
    registry.write_bytes(content)
    assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A"


@looped(
    "answer",
    [Introduction(b""), Introduction(b"x" * 9000), Certified(b""), EnrolmentDenied("no")],
)
def test_a_lying_service_is_not_believed(tmp_path: Path, answer: Answer) -> None:
    desk = AuthorityService(tmp_path / "authority")

    def lie(*_any: object) -> Answer:
        return answer

    desk.server._answer = lie  # type: ignore[assignment, method-assign]  # noqa: SLF001 - a service that lies
    with desk.server, pytest.raises(NotTrustedError):
        enrol(*desk.place, EnrolmentToken.new(bytes(32)), tmp_path / "a", "A")


@looped("kind", ["another key", "another name", "rubbish", "introduction"])
def test_a_certificate_that_is_not_ours_is_not_taken(tmp_path: Path, kind: str) -> None:
    desk = AuthorityService(tmp_path / "authority")

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

    with desk.server:
        robot = enrol(*desk.place, desk.authority.enrol("A"), tmp_path / "a", "A")
        desk.server._answer = lie  # type: ignore[assignment, method-assign]  # noqa: SLF001 - a service that lies
        with pytest.raises(EnrolmentError, match=r"another|wrong type|invalid certificate"):
            renew(robot, *desk.place)
    assert Identity.load(tmp_path / "a").certificate == robot.certificate
