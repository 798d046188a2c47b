"""The fuzzer itself, in short, and what it has found."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest

from robochoc.authority.certificates import (
    CertificateError,
    ca_certificate,
    new_key,
    pem,
    read_certificate,
    read_request,
    signing_request,
    utc_time,
)
from robochoc.formats.result import ResultError, read_result
from robochoc.ros.message_types import types_of
from tests.fuzz.file_targets import TARGETS as FILES
from tests.fuzz.foreign_targets import TARGETS as FOREIGN
from tests.fuzz.harness import Findings, Target, TooDearError, spoilt, tried
from tests.fuzz.mavlink_target import TARGETS as MAVLINK
from tests.fuzz.mutations import spoilt_bytes
from tests.fuzz.rmf_targets import TARGETS as RMF
from tests.fuzz.robot_targets import TARGETS as ROBOTS
from tests.fuzz.wire_targets import TARGETS as WIRE
from tests.support.cases import looped

INPUTS = 8
"""Spoilt inputs of each target: enough to see that it works."""


@looped("target", [*FILES, *FOREIGN, *MAVLINK, *RMF, *ROBOTS, *WIRE])
def test_valid_inputs_are_accepted_and_spoilt_ones_do_no_harm(target: Target) -> None:
    corpus = target.corpus()
    assert tried(target, corpus[0]) == (True, None)
    for number in range(INPUTS):
        assert tried(target, spoilt(target, corpus, 16, number))[1] is None


def test_the_same_seed_makes_the_same_inputs() -> None:
    target = Target("any", lambda: [b"0123456789"], spoilt_bytes, lambda _: True)
    made = [[spoilt(target, target.corpus(), seed, number) for number in range(20)] for seed in (1, 1, 2)]
    assert made[0] == made[1] != made[2]


def _reads_three(content: bytes) -> bool:
    if content.startswith(b"\x03"):
        raise LookupError
    return True


def test_what_comes_out_that_should_not_is_kept_once_of_each_kind(tmp_path: Path) -> None:
    findings = Findings(tmp_path, "three")
    target = Target("three", lambda: [b"\x03"], spoilt_bytes, _reads_three)
    accepted, error = tried(target, b"\x03")
    assert not accepted
    assert isinstance(error, LookupError)
    kept = findings.note(b"\x03", error)
    assert kept is not None
    assert kept.read_bytes() == b"\x03"
    assert "LookupError" in kept.with_suffix(".txt").read_text()
    assert findings.note(b"\x03!", error) is None


def test_an_input_that_takes_more_than_its_time_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def slowly(_: bytes) -> bool:
        while True:
            pass

    monkeypatch.setattr("tests.fuzz.harness.CPU_S", 0.05)
    assert isinstance(tried(Target("slow", lambda: [b""], spoilt_bytes, slowly), b"")[1], TooDearError)


# What it has found


def of_version(pem_text: bytes, mark: bytes, version: int) -> bytes:
    """The certificate or request with another version number, which stands at the end of `mark`."""
    first, *body, last = pem_text.splitlines()
    plain = base64.b64decode(b"".join(body))
    at = plain.index(mark) + len(mark) - 1
    return b"\n".join([first, base64.b64encode(plain[:at] + bytes([version]) + plain[at + 1 :]), last, b""])


def test_requests_and_certificates_of_other_versions_are_malformed() -> None:
    """`cryptography` says so by an exception that is no `ValueError`."""
    key = new_key()
    request, certificate = signing_request(key, "R1"), pem(ca_certificate(key, utc_time(1_800_000_000.0)))
    version = b"\x02\x01\x00"
    assert read_request(of_version(request, version, 0))[0] == "R1"
    with pytest.raises(CertificateError, match="malformed"):
        read_request(of_version(request, version, 1))
    version = b"\xa0\x03\x02\x01\x02"
    assert read_certificate(of_version(certificate, version, 2)).serial_number
    with pytest.raises(CertificateError, match="not a certificate"):
        read_certificate(of_version(certificate, version, 34))


@pytest.mark.parametrize("content", [b'"\xd2"', b'{"team": "\xff"}', b"[" * 10**6])
def test_what_is_not_utf_8_or_too_deep_is_no_result(content: bytes) -> None:
    with pytest.raises(ResultError):
        read_result(content)


def test_times_of_ros_1_after_2038_are_no_negative_ones() -> None:
    types = types_of(1)
    content = types.encode("std_msgs/Header", {"stamp": 7, "frame_id": "map"})
    at = 4  # after the sequence number
    assert int.from_bytes(content[at + 4 : at + 8], "little") == 7
    late = content[:at] + (2**32 - 1).to_bytes(4, "little") + content[at + 4 :]
    assert types.decode("std_msgs/Header", late)["stamp"] == (2**32 - 1) * 10**9 + 7
