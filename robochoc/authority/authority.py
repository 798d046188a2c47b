"""The Authority: a small certification authority, and the registry of the names that may participate.

A person enrols a name and carries the token to the robot. The robot creates a key, and redeems the token once. The
Authority signs a certificate, which is valid for a day and is renewed before it expires. A revocation is recorded until
the certificate would have expired. Anyone who has the file `ca.key` in the folder can act as the Authority.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

import msgspec
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509 import Certificate

from robochoc.authority.certificates import (
    MASTER,
    CertificateError,
    ca_certificate,
    check_hosts,
    check_issued,
    fingerprint,
    key_pem,
    leaf_certificate,
    new_key,
    pem,
    read_certificate,
    read_key,
    read_request,
    utc_time,
)
from robochoc.authority.events import AuthorityEvent, AuthorityObserver, Granted, Refused, unobserved
from robochoc.authority.identity import Identity, private_folder, save
from robochoc.authority.names import InvalidNameError, NotEnrolledError, check_member_name, describe_enrolled
from robochoc.authority.registry import (
    PRIVATE,
    AuthorityError,
    EnrolledName,
    Invitation,
    Issued,
    Registry,
    Right,
    Role,
    locked,
)
from robochoc.authority.token import EnrolmentToken, digest
from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically

TOKEN_LIFETIME = timedelta(hours=24)
CERTIFICATE_LIFETIME = timedelta(hours=24)
IN_FORCE_AT_MOST = 16
"""The maximum number of certificates in force for one name. A robot that requests more is faulty or hostile."""
_KEY, _CERTIFICATE, _MASTER = "ca.key", "ca.pem", "master"
_OTHERS = 0o077


class NotGrantedError(RobochocError):
    """The Authority has refused a request. The message gives the reason, and may be sent to the requester."""


class Authority:
    """The Authority in `folder`. It is constructed by `create` or `open`.

    Several threads and processes may use the same folder at once.

    Args:
        folder: The folder with the Authority's files.
        key: The Authority's private key.
        certificate: The Authority's certificate.
        observer: Receives grants and refusals.
        clock: Returns Unix time.
        lifetime: The validity period of certificates.
    """

    def __init__(
        self,
        folder: Path,
        key: ec.EllipticCurvePrivateKey,
        certificate: Certificate,
        *,
        observer: AuthorityObserver = unobserved,
        clock: Callable[[], float] = time.time,
        lifetime: timedelta = CERTIFICATE_LIFETIME,
    ) -> None:
        self.folder = folder
        self.certificate = certificate
        self.observer = observer
        self.clock = clock
        self.lifetime = lifetime
        self._key = key
        self._registry = Registry(folder)

    @classmethod
    def create(
        cls,
        folder: Path | str,
        *,
        observer: AuthorityObserver = unobserved,
        clock: Callable[[], float] = time.time,
        lifetime: timedelta = CERTIFICATE_LIFETIME,
    ) -> Authority:
        """Create an Authority in `folder`, which other users cannot access.

        Raises `AuthorityError` if the folder already has an Authority.
        """
        folder = Path(folder)
        private_folder(folder)
        with locked(folder):
            if (folder / _KEY).exists() or (folder / _CERTIFICATE).exists():
                raise AuthorityError(
                    f"an Authority already exists in {folder}: choose another folder"
                    " (all robots would have to enrol again with a new Authority)"
                )
            key = new_key()
            certificate = ca_certificate(key, utc_time(clock()))
            write_atomically(folder / _KEY, key_pem(key), PRIVATE)
            write_atomically(folder / _CERTIFICATE, pem(certificate))
        return cls(folder, key, certificate, observer=observer, clock=clock, lifetime=lifetime)

    @classmethod
    def open(
        cls,
        folder: Path | str,
        *,
        observer: AuthorityObserver = unobserved,
        clock: Callable[[], float] = time.time,
        lifetime: timedelta = CERTIFICATE_LIFETIME,
    ) -> Authority:
        """Return the Authority in `folder`. Raises `AuthorityError` if it is missing or unusable."""
        folder = Path(folder)
        try:
            content, mode = (folder / _KEY).read_bytes(), (folder / _KEY).stat().st_mode
            key, certificate = read_key(content), read_certificate((folder / _CERTIFICATE).read_bytes())
        except FileNotFoundError:
            raise AuthorityError(f"there is no Authority in {folder}; run: robochoc authority init") from None
        except OSError as error:
            raise AuthorityError(f"the Authority in {folder} cannot be read: {error.strerror}") from error
        except CertificateError as error:
            raise AuthorityError(f"the Authority in {folder} is damaged: {error}") from error
        if mode & _OTHERS:
            raise AuthorityError(
                f"other users can read the key of the Authority (mode {mode & 0o777:o}); run: chmod 600 {folder / _KEY}"
            )
        if certificate.public_key() != key.public_key():
            raise AuthorityError(f"the Authority in {folder} is damaged: {_KEY} is not the key of {_CERTIFICATE}")
        if not certificate.not_valid_before_utc <= utc_time(clock()) < certificate.not_valid_after_utc:
            raise AuthorityError(
                f"the certificate of the Authority in {folder} is not valid now:"
                " check the clock, or create a new Authority"
            )
        return cls(folder, key, certificate, observer=observer, clock=clock, lifetime=lifetime)

    def enrol(
        self,
        name: str,
        role: Role = Role.ROBOT,
        ttl: timedelta = TOKEN_LIFETIME,
        may: Iterable[Right] = (),
        hosts: Sequence[str] = (),
    ) -> EnrolmentToken:
        """Return a token for `name` that can be used once, within `ttl`. See `enrol_all`."""
        return self.enrol_all([name], role, ttl, may, hosts)[name]

    def enrol_all(
        self,
        names: Iterable[str],
        role: Role = Role.ROBOT,
        ttl: timedelta = TOKEN_LIFETIME,
        may: Iterable[Right] = (),
        hosts: Sequence[str] = (),
    ) -> dict[str, EnrolmentToken]:
        """Return a token for each of `names`. Enrols no name if one is invalid, and raises `InvalidNameError`.

        A standby master needs the `hosts` by which robots reach it: its certificate contains them. Raises
        `HostNameError` for an invalid one.

        A name that is already enrolled also gets a new token. When the token is redeemed, previous certificates of the
        name are revoked, because a name has one key, and a revoked name is readmitted. The role and the rights `may`,
        which replace previous rights, are valid at once.
        """
        rights = tuple(sorted(set(may)))
        names = list(names)
        for name in names:
            check_member_name(name, role, hosts)
        check_hosts(hosts)
        tokens = {name: EnrolmentToken.new(fingerprint(self.certificate)) for name in names}
        with self._registry.change() as members:
            for name, token in tokens.items():
                invitation = Invitation(digest(token.secret), self.clock() + ttl.total_seconds())
                member = members.get(name) or EnrolledName(name, role)
                members[name] = msgspec.structs.replace(
                    member, role=role, invitation=invitation, may=rights, hosts=tuple(hosts)
                )
        return tokens

    def redeem(self, secret: bytes, request: bytes, origin: str = "") -> bytes:
        """Return the certificate (PEM) for `request` (PKCS 10, PEM) in exchange for the secret of a token.

        Args:
            secret: The token's secret.
            request: The request.
            origin: The origin of the request, for the observer.

        Raises:
            NotGrantedError: The secret is unknown, used or expired, or the name in the request is not that of the
                token.
        """
        what = "redeem a token"
        with self._reported_refusals(what, request, origin) as (name, holder), self._registry.change() as members:
            now = self.clock()
            member, invitation = _redeemable(members, digest(secret), name, now)
            certificate, issued = self._issue(holder, name, member.hosts or None)
            members[name] = EnrolledName(
                name,
                member.role,
                msgspec.structs.replace(invitation, used=True),
                (issued,),
                (*member.withdrawn, *member.certificates),
                may=member.may,
                hosts=member.hosts,
            ).without_expired(now)
        self.report(Granted(t=now, who=name, what=what, origin=origin))
        return certificate

    def renew(self, request: bytes, current: Certificate, origin: str = "") -> bytes:
        """Return a new certificate (PEM) for the holder of `current`, with the key in `request` (PKCS 10, PEM).

        The caller must have verified by TLS that the request comes from the holder of the key in `current`. The current
        certificate remains valid until it expires. `origin` is the origin of the request, for the observer.

        Raises:
            NotGrantedError: `current` is not valid, or the request contains another name.
        """
        what = "renew a certificate"
        with self._reported_refusals(what, request, origin) as (name, holder), self._registry.change() as members:
            now = self.clock()
            try:
                proven = check_issued(current, self.certificate, utc_time(now))
            except CertificateError as error:
                raise NotGrantedError(str(error)) from error
            if proven != name:
                raise NotGrantedError("the name in the request differs from the name in the certificate")
            if name == MASTER:
                raise NotGrantedError(f"the certificate of {MASTER} can only be renewed on the Authority's machine")
            if self.is_revoked(current.serial_number):
                raise NotGrantedError("the certificate has been revoked")
            member = members[name].without_expired(now)
            if len(member.certificates) >= IN_FORCE_AT_MOST:
                raise NotGrantedError(f"this name already has {IN_FORCE_AT_MOST} valid certificates, the maximum")
            certificate, issued = self._issue(holder, name, member.hosts or None)
            members[name] = msgspec.structs.replace(member, certificates=(*member.certificates, issued))
        self.report(Granted(t=now, who=name, what=what, origin=origin))
        return certificate

    def master_identity(self, hosts: Sequence[str], folder: Path | None = None) -> Identity:
        """Return a new identity for the master, for servers at `hosts` (names or addresses).

        The identity is written to `folder` (None: `master` in the Authority's folder). No token is needed, because the
        Authority's key is required. Raises `HostNameError`.
        """
        key = new_key()
        with self._registry.change() as members:
            now = self.clock()
            content, issued = self._issue(key.public_key(), MASTER, hosts)
            member = (members.get(MASTER) or EnrolledName(MASTER, Role.MASTER)).without_expired(now)
            members[MASTER] = msgspec.structs.replace(member, certificates=(*member.certificates, issued))
            place = folder or self.folder / _MASTER
            save(place, key, read_certificate(content), self.certificate)
            return Identity.load(place, now)

    def revoke(self, name: str) -> None:
        """Revoke the certificates, the unused token and the rights of `name`.

        Raises:
            NotEnrolledError: The name is not enrolled; the message lists enrolled names.
            InvalidNameError: The name is the master's: robots would not learn of the revocation.
        """
        if name == MASTER:
            raise InvalidNameError(
                f"{MASTER} cannot be revoked, because robots would not learn of it: create a new Authority"
            )
        with self._registry.change() as members:
            member = members.get(name)
            if member is None:
                problem = f"'{on_one_line(shortened(name))}' is not enrolled"
                raise NotEnrolledError(f"{problem} ({describe_enrolled(name, members)})")
            withdrawn = (*member.withdrawn, *member.certificates)
            members[name] = EnrolledName(name, member.role, None, (), withdrawn, revoked=True).without_expired(
                self.clock()
            )

    def is_revoked(self, who: str | int) -> bool:
        """Return whether `who`, a name or the serial number of a certificate, is revoked or unknown."""
        members = self._registry.members()
        if isinstance(who, str):
            return who not in members or members[who].revoked
        serial = f"{who:x}"
        return not any(one.serial == serial for member in members.values() for one in member.certificates)

    def names(self, role: Role | None = None, right: Right | None = None, *, invited: bool = False) -> tuple[str, ...]:
        """Return the names that currently have a valid certificate, sorted. See `Admission.names`."""
        now = self.clock()
        return tuple(
            member.name
            for member in self.members()
            if not member.revoked
            and role in (None, member.role)
            and right in (None, *member.may)
            and (member.without_expired(now).certificates or (invited and member.never_certified))
        )

    def members(self) -> tuple[EnrolledName, ...]:
        """Return all names that were ever enrolled, in sorted order."""
        return tuple(member for _, member in sorted(self._registry.members().items()))

    def report(self, event: AuthorityEvent) -> None:
        """Report `event` to the observer."""
        self.observer(event)

    def _issue(
        self, holder: ec.EllipticCurvePublicKey, name: str, hosts: Sequence[str] | None = None
    ) -> tuple[bytes, Issued]:
        now = self.clock()
        times = (utc_time(now), utc_time(now + self.lifetime.total_seconds()))
        certificate = leaf_certificate((self.certificate, self._key), holder, name, hosts, times)
        issued = Issued(f"{certificate.serial_number:x}", certificate.not_valid_after_utc.timestamp())
        return pem(certificate), issued

    @contextmanager
    def _reported_refusals(
        self, what: str, request: bytes, origin: str
    ) -> Iterator[tuple[str, ec.EllipticCurvePublicKey]]:
        """Yield the name and the key in `request`; report a refusal raised in the block."""
        who = "unknown"
        try:
            try:
                name, holder = read_request(request)
            except CertificateError as error:
                raise NotGrantedError(str(error)) from error
            who = on_one_line(shortened(name))
            yield name, holder
        except NotGrantedError as refusal:
            self.report(Refused(t=self.clock(), who=who, what=what, why=str(refusal), origin=origin))
            raise


def _redeemable(
    members: Mapping[str, EnrolledName], known: str, name: str, now: float
) -> tuple[EnrolledName, Invitation]:
    """Return the record and the invitation for the token with the digest `known`.

    Raises `NotGrantedError` if the token cannot be redeemed for `name` now.
    """
    for member in members.values():
        invitation = member.invitation
        if invitation is None or invitation.digest != known:
            continue
        if invitation.used:
            raise NotGrantedError("the token has already been used")
        if now >= invitation.expires:
            raise NotGrantedError("the token has expired")
        if member.name != name:
            raise NotGrantedError("the token was issued for another name")
        return member, invitation
    raise NotGrantedError("the token is unknown, or has been replaced by a newer one")


def default_authority_folder() -> Path:
    """Return the Authority's default folder, in the user's data folder."""
    from platformdirs import user_data_path  # noqa: PLC0415 - only needed without a given folder

    return user_data_path("robochoc") / "authority"
