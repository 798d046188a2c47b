"""Keys and X.509 certificates (RFC 5280): issued by the Authority, and checked by all participants.

All keys are on P-256. The Authority's certificate signs only leaf certificates (pathlen 0). A robot's certificate is
for
clients: its common name is the robot's name, which is used by zenoh's access control, and it has no host name, so that
no robot can impersonate a server. The master's certificate is also for servers. Its subject alternative names, which
rustls (zenoh's TLS) checks, are `MASTER` and the master's hosts.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.system.errors import RobochocError

MASTER = "MASTER"
"""The master's name, forbidden for robots in any capitalization, because host names are case-insensitive."""
SKEW = timedelta(minutes=5)
"""The tolerated difference between the clocks of two machines."""
CA_LIFETIME = timedelta(days=3650)
LONGEST_NAME = 64
"""The maximum length of a common name, in characters (RFC 5280, ub-common-name)."""
_DIGITAL_SIGNATURE = x509.KeyUsage(
    digital_signature=True,
    content_commitment=False,
    key_encipherment=False,
    data_encipherment=False,
    key_agreement=False,
    key_cert_sign=False,
    crl_sign=False,
    encipher_only=False,
    decipher_only=False,
)
_SIGNING_CERTIFICATES = x509.KeyUsage(
    digital_signature=False,
    content_commitment=False,
    key_encipherment=False,
    data_encipherment=False,
    key_agreement=False,
    key_cert_sign=True,
    crl_sign=True,
    encipher_only=False,
    decipher_only=False,
)


class CertificateError(RobochocError, ValueError):
    """A certificate, a certificate request, or a key is malformed or unsuitable."""


class HostNameError(RobochocError, ValueError):
    """The host name or address is not possible in a certificate."""


def utc_time(t: float) -> datetime:
    """Convert a Unix time to the form in certificates: UTC, in whole seconds."""
    return datetime.fromtimestamp(int(t), UTC)


def new_key() -> ec.EllipticCurvePrivateKey:
    """Return a new private key."""
    return ec.generate_private_key(ec.SECP256R1())


def key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    """Return `key` as unencrypted PKCS 8; the key is protected by file permissions."""
    pem, pkcs8 = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    return key.private_bytes(pem, pkcs8, serialization.NoEncryption())


def pem(certificate: x509.Certificate) -> bytes:
    """Return `certificate` as PEM text."""
    return certificate.public_bytes(serialization.Encoding.PEM)


def fingerprint(certificate: x509.Certificate) -> bytes:
    """Return the SHA-256 hash of `certificate` (32 bytes)."""
    return certificate.fingerprint(hashes.SHA256())


def ca_certificate(key: ec.EllipticCurvePrivateKey, now: datetime) -> x509.Certificate:
    """Return the Authority's self-signed certificate."""
    # The name contains the key's identifier, so that Authorities have different names.
    own = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    name = _subject(f"robochoc authority {own.digest.hex()[:16]}")
    return (
        _builder(name, name, key.public_key(), (now - SKEW, now + CA_LIFETIME))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_SIGNING_CERTIFICATES, critical=True)
        .add_extension(own, critical=False)
        .sign(key, hashes.SHA256())
    )


def leaf_certificate(
    ca: tuple[x509.Certificate, ec.EllipticCurvePrivateKey],
    holder: ec.EllipticCurvePublicKey,
    name: str,
    hosts: Sequence[str] | None,
    times: tuple[datetime, datetime],
) -> x509.Certificate:
    """Return a certificate for `name` with the key `holder`, valid within `times`. Raises `HostNameError`.

    `hosts` are the names and addresses of a server; None for a mere client.
    """
    issuer, key = ca
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if hosts is None:
        names: list[x509.GeneralName] = [x509.UniformResourceIdentifier(f"robochoc:{name}")]
    else:
        usages.append(ExtendedKeyUsageOID.SERVER_AUTH)
        names = [x509.DNSName(name), *map(_host, hosts)]
    return (
        _builder(_subject(name), issuer.subject, holder, (times[0] - SKEW, min(times[1], issuer.not_valid_after_utc)))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_DIGITAL_SIGNATURE, critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(holder), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )


def signing_request(key: ec.EllipticCurvePrivateKey, name: str) -> bytes:
    """Return a request (PKCS 10, PEM) for a certificate for `key` and `name`."""
    request = x509.CertificateSigningRequestBuilder().subject_name(_subject(name)).sign(key, hashes.SHA256())
    return request.public_bytes(serialization.Encoding.PEM)


def read_request(content: bytes) -> tuple[str, ec.EllipticCurvePublicKey]:
    """Return the name and the key in a request, which must be signed with this key. Raises `CertificateError`."""
    try:
        request = x509.load_pem_x509_csr(content)
        holder, genuine = request.public_key(), request.is_signature_valid
        name = common_name(request.subject)
    except (ValueError, TypeError, UnsupportedAlgorithm, x509.InvalidVersion) as error:
        raise CertificateError("the request for a certificate is malformed") from error
    if not genuine:
        raise CertificateError("the request for a certificate is not signed by its key")
    return name, _on_p256(holder)


def read_certificate(content: bytes) -> x509.Certificate:
    """Return the single certificate in `content`. Raises `CertificateError`."""
    try:
        found = x509.load_pem_x509_certificates(content)
    except (ValueError, TypeError, x509.InvalidVersion) as error:
        raise CertificateError("not a certificate") from error
    if len(found) != 1:
        raise CertificateError(f"expected one certificate, found {len(found)}")
    return found[0]


def read_key(content: bytes) -> ec.EllipticCurvePrivateKey:
    """Return the private key in `content`. Raises `CertificateError`."""
    try:
        key = serialization.load_pem_private_key(content, None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise CertificateError("not a private key") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise CertificateError("the private key is not on P-256")
    _on_p256(key.public_key())
    return key


def holder_of(certificate: x509.Certificate) -> ec.EllipticCurvePublicKey:
    """Return the public key in `certificate`. Raises `CertificateError`."""
    try:
        return _on_p256(certificate.public_key())
    except (ValueError, UnsupportedAlgorithm) as error:
        raise CertificateError("the certificate's key has an unsupported type") from error


def common_name(subject: x509.Name) -> str:
    """Return the name in a subject with a single common name. Raises `CertificateError`."""
    attributes = list(subject)
    if len(attributes) != 1 or attributes[0].oid != NameOID.COMMON_NAME or not isinstance(attributes[0].value, str):
        raise CertificateError("the subject must be a single common name")
    return attributes[0].value


def check_issued(certificate: x509.Certificate, ca: x509.Certificate, now: datetime) -> str:
    """Check that `certificate` was issued by `ca` and is valid `now`; return its name. Raises `CertificateError`.

    The check is the X.509 path validation of `cryptography` for client certificates, which include the master's.
    """
    try:
        name = common_name(certificate.subject)
        certificate.verify_directly_issued_by(ca)
    except (ValueError, TypeError, InvalidSignature, UnsupportedAlgorithm) as error:
        raise CertificateError("this Authority has not issued the certificate") from error
    if not certificate.not_valid_before_utc <= now <= certificate.not_valid_after_utc:
        times = f"{certificate.not_valid_before_utc:%Y-%m-%d %H:%M} to {certificate.not_valid_after_utc:%Y-%m-%d %H:%M}"
        who = on_one_line(shortened(name))
        raise CertificateError(f"the certificate of {who} is valid from {times} (UTC), not now: check the clock")
    try:
        PolicyBuilder().store(Store([ca])).time(now).build_client_verifier().verify(certificate, [])
    except VerificationError as error:
        raise CertificateError("the certificate is not valid for clients of this Authority") from error
    return name


def hosts_of(certificate: x509.Certificate) -> tuple[str, ...]:
    """Return the host names and addresses in `certificate`, without the holder's name."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    own = common_name(certificate.subject)
    return tuple(
        str(name.value) for name in names if isinstance(name, x509.DNSName | x509.IPAddress) and str(name.value) != own
    )


def check_hosts(hosts: Sequence[str]) -> None:
    """Raise `HostNameError` if one of `hosts` is not possible in a certificate."""
    for host in hosts:
        _host(host)


def _host(host: str) -> x509.DNSName | x509.IPAddress:
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        try:
            # RFC 5280 requires the ASCII form of internationalised names.
            name = host.encode("idna").decode("ascii")
        except ValueError:
            name = ""
        if not name:
            raise HostNameError(f"{on_one_line(shortened(host))!r} is neither a host name nor an address") from None
        return x509.DNSName(name)
    if address.is_unspecified:
        raise HostNameError(f"{host} means all addresses: name the host or the addresses that robots connect to")
    return x509.IPAddress(address)


def _on_p256(key: object) -> ec.EllipticCurvePublicKey:
    if not isinstance(key, ec.EllipticCurvePublicKey) or not isinstance(key.curve, ec.SECP256R1):
        raise CertificateError("the key is not on P-256")
    return key


def _subject(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _builder(
    subject: x509.Name, issuer: x509.Name, holder: ec.EllipticCurvePublicKey, times: tuple[datetime, datetime]
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(holder)
        .serial_number(x509.random_serial_number())
        .not_valid_before(times[0])
        .not_valid_after(times[1])
    )
