"""Enrolment: strangers, junk, and those who take their time; the service goes on."""

from __future__ import annotations

import socket
import ssl
import threading
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.authority.certificates import new_key, signing_request
from robochoc.authority.enrolment import enrol
from robochoc.authority.enrolment_server import EnrolmentServer
from robochoc.authority.frames import (
    LARGEST_BYTES,
    EnrolmentDenied,
    Exchange,
    FrameError,
    Introduce,
    Redeem,
    Renew,
    decode_question,
)
from tests.support.authority_service import SOON_S, AuthorityService, answered, drip, framed, trusting
from tests.support.cases import cases
from tests.support.limits import HANG_S, wait_until


def test_oversized_requests_are_not_even_read(desk: AuthorityService) -> None:
    for size in (LARGEST_BYTES + 1, 2**31, 2**32 - 1):
        answer = answered(desk, size.to_bytes(4, "big"))
        assert isinstance(answer, EnrolmentDenied)
        assert "maximum" in answer.why
    assert "maximum" in desk.refusal(3)


MALFORMED = [
    b"",
    b"\xc1",
    b"\xff" * LARGEST_BYTES,
    b"GET / HTTP/1.1\r\n\r\n",
    b"\x82\xa4type\xa6Redeem\xa6secret" + b"\x91" * 16000,
    msgspec.msgpack.encode({"type": "Redeem", "secret": b"x"}),
    msgspec.msgpack.encode({"type": "Redeem", "secret": b"x", "request": b"", "more": 1}),
    msgspec.msgpack.encode({"type": "Redeem", "secret": "text", "request": 1}),
    msgspec.msgpack.encode({"type": "Certified", "certificate": b""}),
    msgspec.msgpack.encode({"type": b"\xff"}),
    msgspec.msgpack.encode([]),
]


def test_malformed_requests(desk: AuthorityService) -> None:
    with cases() as each:
        for number, content in enumerate(MALFORMED, 1):
            with each(content[:80]):
                assert isinstance(answered(desk, framed(content)), EnrolmentDenied)
                assert "invalid request" in desk.refusal(number)


@given(st.binary(max_size=200))
def test_no_bytes_make_decoding_fail_otherwise(content: bytes) -> None:
    try:
        question = decode_question(content)
    except FrameError:
        return
    assert isinstance(question, Introduce | Redeem | Renew)


def test_an_unknown_token(desk: AuthorityService) -> None:
    question = Redeem(b"guess", signing_request(new_key(), "A"))
    answer = answered(desk, framed(msgspec.msgpack.encode(question)))
    assert isinstance(answer, EnrolmentDenied)
    assert "unknown" in desk.refusal()


def test_plain_tcp_and_old_tls_are_refused(desk: AuthorityService) -> None:
    with socket.create_connection(desk.place, SOON_S) as plain:
        plain.sendall(framed(msgspec.msgpack.encode(Introduce())) * 10)
        with pytest.raises((OSError, FrameError)):
            Exchange(plain, SOON_S).answer()
    assert "TLS failed" in desk.refusal()
    context = trusting(desk)
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with pytest.raises(ssl.SSLError):
        answered(desk, b"", context)
    assert "TLS failed" in desk.refusal(2)


def slow_ones(stack: ExitStack, desk: AuthorityService) -> tuple[socket.socket, ssl.SSLSocket]:
    """One does nothing, one has begun a handshake, and one, who is yet to begin a request, is through with it."""
    mute, half, plain = (stack.enter_context(socket.create_connection(desk.place, SOON_S)) for _ in range(3))
    half.sendall(b"\x16\x03\x01")
    return mute, stack.enter_context(trusting(desk).wrap_socket(plain))


def test_slow_ones_are_hung_up_on_and_others_are_served_after(tmp_path: Path) -> None:
    desk = AuthorityService(tmp_path / "authority", patience_s=1.0)
    with desk.server, ExitStack() as stack:
        mute, slow = slow_ones(stack, desk)
        drip(slow, framed(bytes(100_000)))
        assert "within 1 s" in desk.refusal(3)
        assert mute.recv(1) == b""
        desk.server._patience_s = HANG_S  # noqa: SLF001 - on a busy machine this one takes long, too
        assert enrol(*desk.place, desk.authority.enrol("B"), tmp_path / "b", "B").name == "B"


def test_others_are_served_beside_slow_ones(tmp_path: Path) -> None:
    """Nobody has to wait for them: they may take longer than this test."""
    desk = AuthorityService(tmp_path / "authority", patience_s=2 * HANG_S)
    token = desk.authority.enrol("A")
    with desk.server, ExitStack() as stack:
        slow_ones(stack, desk)
        assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A"
        assert not desk.seen.refusals


def test_who_fills_all_places_delays_others_no_longer_than_the_patience(tmp_path: Path) -> None:
    desk = AuthorityService(tmp_path / "authority", patience_s=1.0)
    token = desk.authority.enrol("A")
    with desk.server, ExitStack() as stack:
        before = threading.active_count()
        for _ in range(4):
            stack.enter_context(socket.create_connection(desk.place, SOON_S))
        wait_until(lambda: threading.active_count() >= before + 4, "they are not served")
        desk.server._patience_s = HANG_S  # noqa: SLF001 - of those who come now
        assert enrol(*desk.place, token, tmp_path / "a", "A").name == "A"


def test_closing_hangs_up_on_everybody_at_once(tmp_path: Path) -> None:
    desk = AuthorityService(tmp_path / "authority")
    desk.server = EnrolmentServer(desk.authority, desk.master, patience_s=2 * HANG_S, connections=2)
    before = threading.active_count()
    with ExitStack() as stack:
        with ExitStack() as serving:
            serving.enter_context(desk.server)
            for _ in range(3):
                stack.enter_context(socket.create_connection(desk.place, SOON_S))
            wait_until(lambda: threading.active_count() >= before + 3, "they are not served")
            serving.close()
        assert threading.active_count() == before
    assert desk.seen.events == [], "what we do ourselves is no refusal"
