"""The Authority: whom it certifies, whom it refuses, and what others make of its certificates."""

from __future__ import annotations

import ssl
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.x509.oid import ExtendedKeyUsageOID
from hypothesis import given
from hypothesis import strategies as st

from robochoc.authority.authority import (
    IN_FORCE_AT_MOST,
    Authority,
    NotGrantedError,
)
from robochoc.authority.certificates import (
    MASTER,
    CertificateError,
    HostNameError,
    check_issued,
    hosts_of,
    new_key,
    pem,
    read_certificate,
    read_request,
    signing_request,
    utc_time,
)
from robochoc.authority.events import Granted, Refused
from robochoc.authority.identity import Identity, IdentityError
from robochoc.authority.names import InvalidNameError, NotEnrolledError
from robochoc.authority.registry import EnrolmentState, Right, Role
from tests.support.authorities import HOUR, START, Clock, Seen, identity_of
from tests.support.cases import looped


def state_of(authority: Authority, name: str) -> EnrolmentState:
    found = {member.name: member for member in authority.members()}
    return found[name].state(authority.clock())


def test_a_token_gives_a_certificate_in_its_name(authority: Authority, tmp_path: Path, seen: Seen) -> None:
    assert authority.names() == ()
    robot = identity_of(authority, "Robot3.1", tmp_path / "robot")
    assert robot.name == "Robot3.1"
    assert robot.expires == utc_time(START + 24 * HOUR)
    assert robot.certificate.not_valid_before_utc == utc_time(START - 300)
    assert authority.names() == ("Robot3.1",)
    assert authority.names(Role.OBSERVER) == ()
    assert not authority.is_revoked("Robot3.1")
    assert not authority.is_revoked(robot.certificate.serial_number)
    assert seen.events == [Granted(t=START, who="Robot3.1", what="redeem a token")]


def test_robots_are_clients_and_the_master_is_a_server_with_names(authority: Authority, tmp_path: Path) -> None:
    """Rustls looks at the subject alternative names; a robot named like a host must not pass for that host."""
    robot = identity_of(authority, "localhost", tmp_path / "robot").certificate
    master = authority.master_identity(["localhost", "192.168.1.14", "::1", "bücher.example"])

    def usages(certificate: x509.Certificate) -> set[x509.ObjectIdentifier]:
        return set(certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)

    assert usages(robot) == {ExtendedKeyUsageOID.CLIENT_AUTH}
    assert usages(master.certificate) == {ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH}
    names = master.certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == [MASTER, "localhost", "xn--bcher-kva.example"]
    assert list(map(str, names.get_values_for_type(x509.IPAddress))) == ["192.168.1.14", "::1"]
    assert set(master.hosts) == {"localhost", "192.168.1.14", "::1", "xn--bcher-kva.example"}
    robots = robot.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert robots.get_values_for_type(x509.DNSName) == []


def test_the_ca_signs_leaves_only(authority: Authority) -> None:
    extensions = authority.certificate.extensions
    basic = extensions.get_extension_for_class(x509.BasicConstraints)
    assert basic.critical
    assert basic.value == x509.BasicConstraints(ca=True, path_length=0)
    usage = extensions.get_extension_for_class(x509.KeyUsage)
    assert usage.critical
    assert usage.value.key_cert_sign
    assert not usage.value.digital_signature


def test_a_robot_cannot_issue_certificates(authority: Authority, tmp_path: Path) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    key = new_key()
    forged = (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "B")]))
        .issuer_name(robot.certificate.subject)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(utc_time(START))
        .not_valid_after(utc_time(START + HOUR))
        .sign(robot.key, hashes.SHA256())
    )
    with pytest.raises(CertificateError, match="has not issued"):
        check_issued(forged, authority.certificate, utc_time(START))


def test_the_ca_itself_is_nobodys_certificate(authority: Authority) -> None:
    with pytest.raises(CertificateError, match="is not valid for clients"):
        check_issued(authority.certificate, authority.certificate, utc_time(START))


def test_a_token_works_once(authority: Authority, seen: Seen) -> None:
    token = authority.enrol("A")
    authority.redeem(token.secret, signing_request(new_key(), "A"))
    with pytest.raises(NotGrantedError, match="already been used"):
        authority.redeem(token.secret, signing_request(new_key(), "A"), "here:1")
    why = "the token has already been used"
    assert seen.refusals == [Refused(t=START, who="A", what="redeem a token", why=why, origin="here:1")]


def test_a_token_expires(authority: Authority, clock: Clock, seen: Seen) -> None:
    token = authority.enrol("A", ttl=timedelta(hours=2))
    clock.now += 2 * HOUR
    with pytest.raises(NotGrantedError, match="expired"):
        authority.redeem(token.secret, signing_request(new_key(), "A"))
    assert state_of(authority, "A") is EnrolmentState.EXPIRED
    assert len(seen.refusals) == 1


def test_a_newer_token_replaces_the_older_one(authority: Authority) -> None:
    older, newer = authority.enrol("A"), authority.enrol("A")
    with pytest.raises(NotGrantedError, match="unknown"):
        authority.redeem(older.secret, signing_request(new_key(), "A"))
    authority.redeem(newer.secret, signing_request(new_key(), "A"))


def test_a_token_is_for_its_own_name_only_and_is_not_spent_by_the_attempt(authority: Authority, seen: Seen) -> None:
    token = authority.enrol("A")
    authority.enrol("B")
    for other in ("B", "Stranger", MASTER, "a"):
        with pytest.raises(NotGrantedError, match="for another name"):
            authority.redeem(token.secret, signing_request(new_key(), other))
    assert [refusal.who for refusal in seen.refusals] == ["B", "Stranger", MASTER, "a"]
    authority.redeem(token.secret, signing_request(new_key(), "A"))


def request_with(key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey, *names: str) -> bytes:
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name) for name in names])
    request = x509.CertificateSigningRequestBuilder().subject_name(subject).sign(key, hashes.SHA256())
    return request.public_bytes(serialization.Encoding.PEM)


def test_bad_requests_are_refused_and_the_token_lives_on(authority: Authority, seen: Seen) -> None:
    token = authority.enrol("A")
    good = signing_request(new_key(), "A")
    der = bytearray(x509.load_pem_x509_csr(good).public_bytes(serialization.Encoding.DER))
    der[-1] ^= 1
    unsigned = ssl.DER_cert_to_PEM_cert(bytes(der)).replace("CERTIFICATE", "CERTIFICATE REQUEST").encode()
    weak = request_with(rsa.generate_private_key(65537, 2048), "A")
    other_curve = request_with(ec.generate_private_key(ec.SECP384R1()), "A")
    several = request_with(new_key(), "A", "B")
    nameless = request_with(new_key())
    bad = [b"", b"\0\xff", good[:100], unsigned, weak, other_curve, several, nameless, pem(authority.certificate)]
    for request in bad:
        with pytest.raises(NotGrantedError):
            authority.redeem(token.secret, request)
    assert len(seen.refusals) == len(bad)
    authority.redeem(token.secret, good)


@given(st.binary(max_size=300))
def test_no_bytes_make_reading_a_request_fail_otherwise(content: bytes) -> None:
    wrapped = b"-----BEGIN CERTIFICATE REQUEST-----\n" + content + b"\n-----END CERTIFICATE REQUEST-----\n"
    for request in (content, wrapped):
        with pytest.raises(CertificateError):
            read_request(request)


def test_renewal(authority: Authority, tmp_path: Path, clock: Clock, seen: Seen) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    clock.now += 13 * HOUR
    assert robot.is_due(clock.now)
    assert not robot.is_due(START)
    new = read_certificate(authority.renew(signing_request(robot.key, "A"), robot.certificate))
    assert new.not_valid_after_utc == utc_time(clock.now + 24 * HOUR)
    assert not authority.is_revoked(robot.certificate.serial_number)
    assert not authority.is_revoked(new.serial_number)
    with pytest.raises(NotGrantedError, match="differs from the name"):
        authority.renew(signing_request(robot.key, "B"), robot.certificate)
    clock.now = START + 25 * HOUR
    with pytest.raises(NotGrantedError, match="not now"):
        authority.renew(signing_request(robot.key, "A"), robot.certificate)
    assert len(seen.refusals) == 2


def test_renewal_by_another_authoritys_certificate_is_refused(
    authority: Authority, tmp_path: Path, clock: Clock
) -> None:
    authority.enrol("A")
    other = Authority.create(tmp_path / "other", clock=clock)
    stranger = identity_of(other, "A", tmp_path / "stranger")
    with pytest.raises(NotGrantedError, match="has not issued"):
        authority.renew(signing_request(stranger.key, "A"), stranger.certificate)


def test_who_renews_without_end_is_stopped(authority: Authority, tmp_path: Path, clock: Clock) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    for _ in range(IN_FORCE_AT_MOST - 1):
        authority.renew(signing_request(robot.key, "A"), robot.certificate)
    with pytest.raises(NotGrantedError, match="valid certificates, the maximum"):
        authority.renew(signing_request(robot.key, "A"), robot.certificate)
    clock.now += 25 * HOUR
    authority.redeem(authority.enrol("A").secret, signing_request(new_key(), "A"))
    (member,) = authority.members()
    assert len(member.certificates) == 1
    assert member.withdrawn == (), "what has expired is forgotten"


def test_the_masters_certificate_is_not_renewed_from_afar(authority: Authority) -> None:
    master = authority.master_identity(["localhost"])
    with pytest.raises(NotGrantedError, match="only be renewed on"):
        authority.renew(signing_request(master.key, MASTER), master.certificate)


def test_revocation_takes_effect_at_once_also_in_another_process(authority: Authority, tmp_path: Path) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    elsewhere = Authority.open(authority.folder, clock=authority.clock)
    assert not elsewhere.is_revoked("A")
    authority.revoke("A")
    for each in (authority, elsewhere):
        assert each.is_revoked("A")
        assert each.is_revoked(robot.certificate.serial_number)
        assert each.names() == ()
        with pytest.raises(NotGrantedError, match="revoked"):
            each.renew(signing_request(robot.key, "A"), robot.certificate)
    assert state_of(authority, "A") is EnrolmentState.REVOKED


def test_revocation_takes_an_unused_token_as_well(authority: Authority) -> None:
    token = authority.enrol("A")
    authority.revoke("A")
    with pytest.raises(NotGrantedError, match="unknown"):
        authority.redeem(token.secret, signing_request(new_key(), "A"))


def test_rights_are_given_by_enrolment_renewed_and_revoked_with_the_name(authority: Authority, tmp_path: Path) -> None:
    identity_of(authority, "A", tmp_path / "a")
    assert authority.names(right=Right.SNIFF) == ()
    token = authority.enrol("A", may=[Right.SNIFF])
    assert authority.names(right=Right.SNIFF) == ("A",)  # at once, as it has a certificate
    key = new_key()
    current = read_certificate(authority.redeem(token.secret, signing_request(key, "A")))
    authority.renew(signing_request(key, "A"), current)
    assert authority.names(right=Right.SNIFF) == authority.names(Role.ROBOT, Right.SNIFF) == ("A",)
    assert authority.names(Role.OBSERVER, Right.SNIFF) == ()
    authority.revoke("A")
    assert authority.names(right=Right.SNIFF) == ()
    again = authority.enrol("A")
    authority.redeem(again.secret, signing_request(new_key(), "A"))
    assert (authority.names(), authority.names(right=Right.SNIFF)) == (("A",), ())


def test_who_is_readmitted_stays_out_until_the_token_is_shown_and_old_certificates_stay_revoked(
    authority: Authority, tmp_path: Path
) -> None:
    old = identity_of(authority, "A", tmp_path / "old")
    authority.revoke("A")
    token = authority.enrol("A")
    assert authority.is_revoked("A")
    assert state_of(authority, "A") is EnrolmentState.INVITED
    key = new_key()
    new = read_certificate(authority.redeem(token.secret, signing_request(key, "A")))
    assert not authority.is_revoked("A")
    assert not authority.is_revoked(new.serial_number)
    assert authority.is_revoked(old.certificate.serial_number)


def test_a_name_has_one_key(authority: Authority, tmp_path: Path) -> None:
    first = identity_of(authority, "A", tmp_path / "first")
    second = identity_of(authority, "A", tmp_path / "second")
    assert authority.is_revoked(first.certificate.serial_number)
    assert not authority.is_revoked(second.certificate.serial_number)
    with pytest.raises(NotGrantedError, match="revoked"):
        authority.renew(signing_request(first.key, "A"), first.certificate)


def test_what_is_unknown_is_denied(authority: Authority) -> None:
    assert authority.is_revoked("Stranger")
    assert authority.is_revoked(42)
    authority.enrol("Robot1")
    with pytest.raises(NotEnrolledError, match="did you mean 'Robot1'"):
        authority.revoke("Robt1")


@looped("name", ["", "1A", "A/B", "A*", "$SYS", "A B", "A\n", "é", MASTER, "Master", "A" * 65])
def test_names_that_no_robot_can_have(authority: Authority, name: str) -> None:
    with pytest.raises(InvalidNameError):
        authority.enrol_all(["Good", name])
    assert authority.members() == (), "all or none"


def test_the_longest_name_can_be_certified(authority: Authority, tmp_path: Path) -> None:
    assert identity_of(authority, "A" * 64, tmp_path / "a").name == "A" * 64


def test_a_standby_master_is_certified_for_its_hosts(authority: Authority, tmp_path: Path) -> None:
    hosts = ["localhost", "192.0.2.7"]
    key = new_key()
    secret = authority.enrol("B", Role.MASTER, hosts=hosts).secret
    certificate = read_certificate(authority.redeem(secret, signing_request(key, "B")))
    assert hosts_of(certificate) == tuple(hosts)
    assert hosts_of(read_certificate(authority.renew(signing_request(key, "B"), certificate))) == tuple(hosts)
    assert hosts_of(identity_of(authority, "A", tmp_path / "a").certificate) == ()
    assert authority.names(Role.MASTER) == ("B",)
    authority.enrol("B")
    assert authority.names(Role.MASTER) == ()


@looped("host", ["0.0.0.0", "a..b"])  # noqa: S104 - that is refused
def test_hosts_that_no_standby_can_have(authority: Authority, host: str) -> None:
    with pytest.raises(HostNameError):
        authority.enrol("B", Role.MASTER, hosts=[host])
    assert authority.members() == ()


def test_the_roles_of_masters_and_robots(authority: Authority) -> None:
    with pytest.raises(InvalidNameError, match="B is a standby master, and robots check its address: add --host NAME"):
        authority.enrol("B", Role.MASTER)
    with pytest.raises(InvalidNameError, match="A has the role robot, and only a master has hosts: remove --host"):
        authority.enrol("A", hosts=["localhost"])
    with pytest.raises(InvalidNameError, match="needs no token"):
        authority.enrol(MASTER, Role.MASTER, hosts=["localhost"])
    with pytest.raises(InvalidNameError, match="new Authority"):
        authority.revoke(MASTER)
    authority.master_identity(["localhost"])
    assert authority.names(Role.MASTER) == (MASTER,)


@looped("host", ["0.0.0.0", "::", "", "a" * 300, "a..b"])  # noqa: S104 - that is refused
def test_hosts_that_no_certificate_can_name(authority: Authority, host: str) -> None:
    with pytest.raises(HostNameError):
        authority.master_identity([host])
    assert authority.members() == ()


def test_the_clocks_of_two_machines_may_differ_by_five_minutes(authority: Authority, tmp_path: Path) -> None:
    robot = identity_of(authority, "A", tmp_path / "a")
    assert Identity.load(robot.folder, START - 299).name == "A"
    with pytest.raises(IdentityError):
        Identity.load(robot.folder, START - 301)


def test_certificates_live_as_long_as_is_said(tmp_path: Path, clock: Clock) -> None:
    authority = Authority.create(tmp_path / "authority", clock=clock, lifetime=timedelta(minutes=10))
    assert identity_of(authority, "A", tmp_path / "a").expires == utc_time(START + 600)


def test_certificates_do_not_outlive_the_authority(authority: Authority, tmp_path: Path, clock: Clock) -> None:
    clock.now += timedelta(days=3650).total_seconds() - HOUR
    assert identity_of(authority, "A", tmp_path / "a").expires == authority.certificate.not_valid_after_utc


def test_master_identities_are_written_where_asked(authority: Authority, tmp_path: Path) -> None:
    master = authority.master_identity(["127.0.0.1"], tmp_path / "elsewhere")
    assert master.folder == tmp_path / "elsewhere"
    assert Identity.load(tmp_path / "elsewhere", START).name == MASTER


def test_revoking_an_unknown_name_lists_those_that_are_enrolled(tmp_path: Path) -> None:
    authority = Authority.create(tmp_path / "authority")
    with pytest.raises(NotEnrolledError, match=r"\(there are no enrolled names; run: robochoc authority enrol NAME\)$"):
        authority.revoke("Robot1.2")
    authority.enrol_all(["Scout", "Relay", "Base"])
    with pytest.raises(NotEnrolledError, match=r"^'Robot1.2' is not enrolled \(enrolled: Base, Relay, Scout\)$"):
        authority.revoke("Robot1.2")
    authority.enrol_all([f"Drone{number:02}" for number in range(20)])
    with pytest.raises(NotEnrolledError, match=r"did you mean 'Scout'\? enrolled: Base, Drone00, .* and 13 more\)$"):
        authority.revoke("Scott")
