"""An identity: the proof of a machine's name, in a folder with three files.

`key.pem` is created on the machine and never leaves it; `cert.pem` contains the holder's name; `ca.pem` is the
certificate of the issuing Authority, the only one that this machine accepts.
"""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509 import Certificate

from robochoc.authority.certificates import (
    CertificateError,
    check_issued,
    common_name,
    holder_of,
    hosts_of,
    key_pem,
    pem,
    read_certificate,
    read_key,
    utc_time,
)
from robochoc.authority.registry import PRIVATE
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically
from robochoc.system.lazy_dataclass import dataclass

KEY, CERTIFICATE, CA = "key.pem", "cert.pem", "ca.pem"
_OTHERS = 0o077
_LARGEST_BYTES = 65536


class IdentityError(RobochocError):
    """The folder has no identity, or an unusable one. The message suggests a solution."""


class IdentityTexts(NamedTuple):
    """An identity as PEM texts. `key` is secret."""

    key: bytes
    certificate: bytes
    ca: bytes


@dataclass(frozen=True, repr=False)
class Identity:
    """A private key, its certificate, and the Authority's certificate, checked by `load`."""

    folder: Path
    name: str
    key: ec.EllipticCurvePrivateKey
    certificate: Certificate
    ca: Certificate

    @classmethod
    def load(cls, folder: Path | str, now: float | None = None) -> Identity:
        """Return the identity in `folder`. `now` is the Unix time; None: the clock's.

        Raises `IdentityError` if a file is missing or malformed, if others may read the key, if the key does not belong
        to the certificate, or if the certificate was not issued by the Authority or is not valid now.
        """
        folder = Path(folder)
        try:
            key = read_key(_secret(folder / KEY))
            certificate, ca = read_certificate(_read(folder / CERTIFICATE)), read_certificate(_read(folder / CA))
            name = check_issued(certificate, ca, utc_time(time.time() if now is None else now))
            if holder_of(certificate) != key.public_key():
                raise IdentityError(f"{folder}: {KEY} is not the key of {CERTIFICATE}; enrol again, with a new token")
        except CertificateError as error:
            raise IdentityError(f"{folder}: {error}; enrol again, with a new token") from error
        return cls(folder, name, key, certificate, ca)

    @classmethod
    def from_texts(cls, texts: IdentityTexts) -> Identity:
        """Return the identity in `texts`, which are trusted because they come from this program."""
        key, certificate, ca = read_key(texts.key), read_certificate(texts.certificate), read_certificate(texts.ca)
        return cls(Path(), common_name(certificate.subject), key, certificate, ca)

    @property
    def texts(self) -> IdentityTexts:
        """The identity as PEM texts, for zenoh and for child processes."""
        return IdentityTexts(key_pem(self.key), pem(self.certificate), pem(self.ca))

    @property
    def key_file(self) -> Path:
        """The file of the private key."""
        return self.folder / KEY

    @property
    def certificate_file(self) -> Path:
        """The file of the certificate."""
        return self.folder / CERTIFICATE

    @property
    def ca_file(self) -> Path:
        """The file of the Authority's certificate."""
        return self.folder / CA

    @property
    def expires(self) -> datetime:
        """The expiry time of the certificate."""
        return self.certificate.not_valid_after_utc

    @property
    def hosts(self) -> tuple[str, ...]:
        """The host names and addresses in the certificate; only the master's certificate has any."""
        return hosts_of(self.certificate)

    def is_due(self, now: float | None = None) -> bool:
        """Return whether the certificate should be renewed because more than half of its validity has passed."""
        left = self.expires - utc_time(time.time() if now is None else now)
        return left < (self.expires - self.certificate.not_valid_before_utc) / 2

    def __repr__(self) -> str:
        return f"<Identity {self.name}, until {self.expires.astimezone(UTC):%Y-%m-%d %H:%M} UTC>"


def save(folder: Path, key: ec.EllipticCurvePrivateKey, certificate: Certificate, ca: Certificate) -> None:
    """Write an identity. The certificate is written last, so that an incomplete identity can be recognised."""
    private_folder(folder)
    for name in (CERTIFICATE, CA, KEY):
        (folder / name).unlink(missing_ok=True)
    write_atomically(folder / KEY, key_pem(key), PRIVATE)
    write_atomically(folder / CA, pem(ca))
    write_atomically(folder / CERTIFICATE, pem(certificate))


def private_folder(folder: Path) -> None:
    """Create `folder` with access only for its owner. Access to an existing empty folder is also restricted.

    Raises `OSError`, also for a folder with content that others can access, since it has another purpose.
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    mode = folder.stat().st_mode
    if not mode & _OTHERS:
        return
    if any(folder.iterdir()):
        raise PermissionError(f"other users can open {folder} (mode {mode & 0o777:o}); use a separate folder for keys")
    folder.chmod(0o700)


def default_identity_folder(name: str) -> Path:
    """Return the default folder for the identity of `name`, in the user's data folder."""
    from platformdirs import user_data_path  # noqa: PLC0415 - only needed without a given folder

    return user_data_path("robochoc") / "identities" / name


def _secret(path: Path) -> bytes:
    content = _read(path)
    mode = path.stat().st_mode
    if mode & _OTHERS:
        raise IdentityError(f"other users can read {path} (mode {mode & 0o777:o}); run: chmod 600 {path}")
    return content


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_BYTES + 1)
    except FileNotFoundError:
        raise IdentityError(f"{path} is missing: enrol this robot with a token first") from None
    except OSError as error:
        raise IdentityError(f"{path} cannot be read: {error.strerror}") from error
    if len(content) > _LARGEST_BYTES:
        raise IdentityError(f"{path} is not an identity file: it has more than {_LARGEST_BYTES} bytes")
    return content
