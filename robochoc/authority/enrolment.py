"""The robot's side of enrolment. The first certificate requires a token, later certificates the previous certificate.

A new robot trusts no server yet. It requests the Authority's certificate from the service, compares the certificate
with the fingerprint in its token, and closes the connection. It sends the token's secret only on a second connection,
after OpenSSL has verified by this certificate that the other end is the master.
"""

from __future__ import annotations

import hmac
import socket
import ssl
import time
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec

from robochoc.authority.certificates import (
    MASTER,
    CertificateError,
    check_issued,
    fingerprint,
    holder_of,
    new_key,
    pem,
    read_certificate,
    signing_request,
    utc_time,
)
from robochoc.authority.frames import (
    Answer,
    Certified,
    EnrolmentDenied,
    Exchange,
    FrameError,
    Introduce,
    Introduction,
    Question,
    Redeem,
    Renew,
)
from robochoc.authority.identity import CERTIFICATE, Identity, private_folder, save
from robochoc.authority.token import EnrolmentToken
from robochoc.formats.diagnostics import on_one_line
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically

PATIENCE_S = 30.0
"""The longest time for a request, including the wait at the service, in seconds."""


class EnrolmentError(RobochocError):
    """No certificate was obtained. The message gives the reason and a hint."""


class NotReachableError(EnrolmentError):
    """No service listens at this address (yet). Nothing was sent, so the same token can be used again."""


class NotTrustedError(EnrolmentError):
    """The server does not belong to the Authority of the token or identity. Nothing secret was sent."""


def enrol(
    host: str, port: int, token: EnrolmentToken | str, folder: Path | str, name: str, patience_s: float = PATIENCE_S
) -> Identity:
    """Create a key in `folder`, and have the Authority at `host` and `port` certify it as the key of `name`.

    An identity in `folder` is replaced after the certificate was granted. Raises `TokenError`, `NotTrustedError`,
    `NotReachableError`, `EnrolmentError` (refused), and `OSError` (for the folder).
    """
    token = token if isinstance(token, EnrolmentToken) else EnrolmentToken.parse(token)
    folder = Path(folder)
    private_folder(folder)
    place = (host, port)
    ca = _request_ca(place, token, patience_s)
    key = new_key()
    question = Redeem(token.secret, signing_request(key, name))
    certificate = _checked_certificate(_ask(place, question, _tls_context(ca), patience_s), ca, key, name)
    save(folder, key, certificate, ca)
    return Identity.load(folder)


def renew(identity: Identity, host: str, port: int, patience_s: float = PATIENCE_S) -> Identity:
    """Return the identity with a new certificate, which is also written to the identity's folder.

    The key does not change, so only one file is replaced, and no crash can separate a key from its certificate. Raises
    `NotTrustedError`, `EnrolmentError`.
    """
    context = _tls_context(identity.ca)
    context.load_cert_chain(identity.certificate_file, identity.key_file)
    answer = _ask((host, port), Renew(signing_request(identity.key, identity.name)), context, patience_s)
    certificate = _checked_certificate(answer, identity.ca, identity.key, identity.name)
    write_atomically(identity.folder / CERTIFICATE, pem(certificate))
    return Identity.load(identity.folder)


def _request_ca(place: tuple[str, int], token: EnrolmentToken, patience_s: float) -> x509.Certificate:
    """Return the certificate of the Authority that issued `token`, from the server at `place`."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # nothing secret is sent, and all answers are checked
    answer = _ask(place, Introduce(), context, patience_s)
    try:
        ca = read_certificate(answer.ca) if isinstance(answer, Introduction) else None
    except CertificateError:
        ca = None
    if ca is None or not hmac.compare_digest(fingerprint(ca), token.fingerprint):
        raise NotTrustedError(
            f"the server at {_as_text(place)} does not belong to the Authority of the token: the address is wrong, "
            "or the connection is intercepted; the token was not sent"
        )
    return ca


def _tls_context(ca: x509.Certificate) -> ssl.SSLContext:
    """Return a TLS context that accepts only the master certified by `ca`."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # verifies the certificate, and its name
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.hostname_checks_common_name = False
    context.load_verify_locations(cadata=pem(ca).decode())
    return context


def _ask(place: tuple[str, int], question: Question, context: ssl.SSLContext, patience_s: float) -> Answer:
    """Return the answer of the server at `place`, which must be accepted by `context`."""
    try:
        raw = socket.create_connection(place, patience_s)
    except OSError as error:
        raise NotReachableError(_no_answer_message(place, error)) from error
    try:
        with raw:
            Exchange(raw, patience_s).wait()
            # The certificate has the master's name, whatever address the server has.
            with context.wrap_socket(raw, server_hostname=MASTER) as connection:
                exchange = Exchange(connection, patience_s)
                exchange.send(question)
                return exchange.answer()
    except ssl.SSLCertVerificationError as error:
        raise NotTrustedError(
            f"the server at {_as_text(place)} is not the master of this Authority ({error.verify_message}); "
            "check the address, and the clocks of both machines"
        ) from error
    except ssl.SSLError as error:
        raise EnrolmentError(
            f"the Authority at {_as_text(place)} has closed the connection ({error.reason or error}); "
            "check that the robot's certificate is still valid"
        ) from error
    except (OSError, FrameError) as error:
        raise EnrolmentError(_no_answer_message(place, error)) from error


def _no_answer_message(place: tuple[str, int], error: Exception) -> str:
    why = error.strerror if isinstance(error, OSError) and error.strerror else error
    return f"no answer from the Authority at {_as_text(place)}: {why}; check that 'robochoc master' is running there"


def _checked_certificate(
    answer: Answer, ca: x509.Certificate, key: ec.EllipticCurvePrivateKey, name: str
) -> x509.Certificate:
    """Return the certificate in `answer` after checking that `ca` has issued it for `name` and `key`."""
    match answer:
        case EnrolmentDenied():
            raise EnrolmentError(f"the Authority has refused the request: {on_one_line(answer.why)}")
        case Certified():
            try:
                certificate = read_certificate(answer.certificate)
                proven = check_issued(certificate, ca, utc_time(time.time()))
            except CertificateError as error:
                raise EnrolmentError(f"the Authority issued an invalid certificate: {error}") from error
            if proven == name and holder_of(certificate) == key.public_key():
                return certificate
            raise EnrolmentError("the Authority issued a certificate for another name or key")
        case _:
            raise EnrolmentError("the Authority sent a response of the wrong type")


def _as_text(place: tuple[str, int]) -> str:
    return f"{place[0]}:{place[1]}"
