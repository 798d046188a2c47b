"""What an Authority and its robots keep: files, registries, tokens, identities; whose they are, and what is wrong."""

from __future__ import annotations

import stat
import string
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.authority.authority import Authority, NotGrantedError
from robochoc.authority.certificates import (
    fingerprint,
    key_pem,
    new_key,
    signing_request,
)
from robochoc.authority.identity import Identity, IdentityError, save
from robochoc.authority.registry import AuthorityError
from robochoc.authority.token import EnrolmentToken, TokenError
from robochoc.system import files
from tests.support.authorities import HOUR, START, Clock, Seen, identity_of
from tests.support.cases import looped
from tests.support.program import ROOT

ENROLLER = """
import sys
from robochoc.authority.authority import Authority
authority = Authority.open(sys.argv[1])
print("ready", flush=True)
sys.stdin.readline()
for number in range(25):
    authority.enrol(f"{sys.argv[2]}.{number}")
"""


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_keys_are_for_their_owner_only(authority: Authority, tmp_path: Path) -> None:
    identity_of(authority, "A", tmp_path / "a")
    authority.master_identity(["localhost"])
    for folder in (authority.folder, authority.folder / "master", tmp_path / "a"):
        assert mode(folder) == 0o700
    for key in (
        authority.folder / "ca.key",
        authority.folder / "registry.json",
        authority.folder / "master" / "key.pem",
        tmp_path / "a" / "key.pem",
    ):
        assert mode(key) == 0o600


def test_secrets_are_for_their_owner_only_where_files_have_names_from_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(*_any: object) -> None:
        return

    monkeypatch.setattr(files, "_unnamed", unknown)
    files.write_atomically(tmp_path / "secret", b"x", 0o600)
    assert mode(tmp_path / "secret") == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["secret"]


def test_the_registry_holds_no_secret(authority: Authority) -> None:
    token = authority.enrol("A")
    written = (authority.folder / "registry.json").read_bytes()
    assert str(token).partition(".")[0].encode() not in written
    assert token.secret.hex().encode() not in written
    assert token.secret not in written


def test_a_folder_that_serves_another_purpose_is_left_alone(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(PermissionError, match="a separate folder"):
        Authority.create(tmp_path)
    assert mode(tmp_path) == 0o755
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_there_is_one_authority_in_a_folder(authority: Authority) -> None:
    with pytest.raises(AuthorityError, match="already"):
        Authority.create(authority.folder)
    assert Authority.open(authority.folder, clock=authority.clock).certificate == authority.certificate


def test_what_is_wrong_with_an_authority_is_said(authority: Authority, tmp_path: Path, clock: Clock) -> None:
    key = authority.folder / "ca.key"
    with pytest.raises(AuthorityError, match="robochoc authority init"):
        Authority.open(tmp_path / "nowhere")
    key.chmod(0o644)
    with pytest.raises(AuthorityError, match="chmod 600"):
        Authority.open(authority.folder, clock=clock)
    key.chmod(0o600)
    clock.now += timedelta(days=3651).total_seconds()
    with pytest.raises(AuthorityError, match="not valid now"):
        Authority.open(authority.folder, clock=clock)
    clock.now = START
    key.write_bytes(key_pem(new_key()))
    with pytest.raises(AuthorityError, match="not the key"):
        Authority.open(authority.folder, clock=clock)
    key.write_bytes(b"rubbish")
    with pytest.raises(AuthorityError, match="damaged"):
        Authority.open(authority.folder, clock=clock)


@looped("content", [b"", b"[]", b'{"members":{},"version":2}', b'{"members":{"A":1}}', b"\xff"])
def test_a_registry_that_is_none_is_not_overwritten(authority: Authority, content: bytes) -> None:
    (authority.folder / "registry.json").write_bytes(content)
    with pytest.raises(AuthorityError, match="registry"):
        authority.enrol("A")
    assert (authority.folder / "registry.json").read_bytes() == content


def test_processes_do_not_lose_each_others_changes(tmp_path: Path) -> None:
    """While the master redeems, the command line enrols: four processes, and threads of a fifth."""
    authority = Authority.create(tmp_path / "authority")
    tokens = authority.enrol_all([f"T{number}" for number in range(20)])
    others = [
        subprocess.Popen(
            [sys.executable, "-c", ENROLLER, authority.folder, f"P{number}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
        )
        for number in range(3)
    ]
    for other in others:
        assert other.stdout
        other.stdout.readline()
    for other in others:
        assert other.stdin
        other.stdin.write(b"\n")
        other.stdin.flush()

    def redeem(name: str) -> bytes:
        return authority.redeem(tokens[name].secret, signing_request(new_key(), name))

    with ThreadPoolExecutor(4) as threads:
        assert len(list(threads.map(redeem, tokens))) == 20
    for other in others:
        with other:
            pass
        assert other.returncode == 0
    assert len(authority.members()) == 20 + 3 * 25
    assert len(authority.names()) == 20


def test_only_one_of_many_redeems_a_token(tmp_path: Path) -> None:
    seen = Seen()
    authority = Authority.create(tmp_path / "authority", observer=seen)
    token = authority.enrol("A")

    def redeem(_number: int) -> bool:
        try:
            authority.redeem(token.secret, signing_request(new_key(), "A"))
        except NotGrantedError:
            return False
        return True

    with ThreadPoolExecutor(8) as threads:
        assert sum(threads.map(redeem, range(16))) == 1
    assert len(seen.refusals) == 15


def test_tokens_survive_being_copied_by_people(authority: Authority) -> None:
    token = authority.enrol("A")
    assert EnrolmentToken.parse(f"  {token}\n") == token
    assert EnrolmentToken.parse(str(token).upper()) == token
    assert token.fingerprint == fingerprint(authority.certificate)
    assert str(token).partition(".")[0] not in repr(token)


@given(st.text(string.printable, max_size=120))
def test_no_text_makes_reading_a_token_fail_otherwise(text: str) -> None:
    with pytest.raises(TokenError, match="copy the whole output"):
        EnrolmentToken.parse(text)


@given(st.integers(0, 83))
def test_a_part_of_a_token_is_none(length: int) -> None:
    with pytest.raises(TokenError):
        EnrolmentToken.parse(str(EnrolmentToken(bytes(20), bytes(32)))[:length])


def test_an_identity_is_what_was_written(authority: Authority, tmp_path: Path) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    again = Identity.load(robot.folder, START)
    assert (again.name, again.certificate, again.ca) == ("A", robot.certificate, authority.certificate)
    assert again.key.public_key() == robot.key.public_key()
    assert {robot.key_file.name, robot.certificate_file.name, robot.ca_file.name} == {"key.pem", "cert.pem", "ca.pem"}
    assert "A" in repr(robot)


def test_an_identity_that_cannot_be_used_says_why(authority: Authority, tmp_path: Path, clock: Clock) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    other = identity_of(authority, "B", tmp_path / "b")
    stranger = Authority.create(tmp_path / "other", clock=clock)
    folder = tmp_path / "a"

    def fault(now: float = START) -> str:
        with pytest.raises(IdentityError) as raised:
            Identity.load(folder, now)
        return str(raised.value)

    assert "not now" in fault(START + 25 * HOUR)
    assert "clock" in fault(START - HOUR)
    robot.key_file.chmod(0o640)
    assert "chmod 600" in fault()
    save(folder, robot.key, other.certificate, robot.ca)
    assert "not the key" in fault()
    save(folder, robot.key, robot.certificate, stranger.certificate)
    assert "has not issued" in fault()
    (folder / "cert.pem").write_bytes(b"x" * 70000)
    assert "bytes" in fault()
    (folder / "cert.pem").unlink()
    assert "enrol" in fault()
    (folder / "key.pem").write_bytes(b"rubbish")
    assert "not a private key" in fault()
