"""The Authority: a small certification authority, and the registry of the names that may take part.

A person enrols a name and carries the token to the robot; the robot makes a key of its own and shows the token once;
the Authority signs a certificate that is valid for a day and is renewed before. A revocation is kept until the
certificate would have expired. The holder of the folder's `ca.key` is the Authority.
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
    check_issued,
    fingerprint,
    key_pem,
    leaf_certificate,
    moment,
    new_key,
    pem,
    read_certificate,
    read_key,
    read_request,
)
from robochoc.authority.events import AuthorityEvent, AuthorityObserver, Granted, Refused, unobserved
from robochoc.authority.identity import Identity, private_folder, save
from robochoc.authority.names import InvalidNameError, UnknownNameError, check_member_name, describe_enrolled
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
"""The largest number of certificates in force for one name. A robot that requests more is faulty or hostile."""
_KEY, _CERTIFICATE, _MASTER = "ca.key", "ca.pem", "master"
_OTHERS = 0o077


class NotGrantedError(RobochocError):
    """The Authority refuses. The message says why, and may be sent to the one that asked."""


class Authority:
    """The Authority in `folder`; `create` and `open` make one.

    Several threads and processes may use the same folder at once.

    Args:
        folder: Where its files are.
        key: Its private key.
        certificate: Its certificate.
        observer: Receives what is granted and refused.
        clock: Returns Unix time.
        lifetime: How long certificates are valid.
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
        """Return a new Authority in `folder`, which is closed to other users.

        Raises `AuthorityError` where one is already.
        """
        folder = Path(folder)
        private_folder(folder)
        with locked(folder):
            if (folder / _KEY).exists() or (folder / _CERTIFICATE).exists():
                raise AuthorityError(
                    f"there is an Authority in {folder} already; keep it, or all robots must enrol again"
                )
            key = new_key()
            certificate = ca_certificate(key, moment(clock()))
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
        """Return the Authority in `folder`. Raises `AuthorityError` where there is none that can be used."""
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
                f"others can read the key of the Authority (mode {mode & 0o777:o}); run: chmod 600 {folder / _KEY}"
            )
        if certificate.public_key() != key.public_key():
            raise AuthorityError(f"the Authority in {folder} is damaged: {_KEY} is not the key of {_CERTIFICATE}")
        if not certificate.not_valid_before_utc <= moment(clock()) < certificate.not_valid_after_utc:
            raise AuthorityError(f"the Authority in {folder} has expired, or the clock is wrong")
        return cls(folder, key, certificate, observer=observer, clock=clock, lifetime=lifetime)

    def enrol(
        self, name: str, role: Role = Role.ROBOT, ttl: timedelta = TOKEN_LIFETIME, may: Iterable[Right] = ()
    ) -> EnrolmentToken:
        """Return a token for `name`, which works once, within `ttl`. See `enrol_all`."""
        return self.enrol_all([name], role, ttl, may)[name]

    def enrol_all(
        self,
        names: Iterable[str],
        role: Role = Role.ROBOT,
        ttl: timedelta = TOKEN_LIFETIME,
        may: Iterable[Right] = (),
    ) -> dict[str, EnrolmentToken]:
        """Return a token for each of `names`, or for none of them. Raises `InvalidNameError`.

        A name that is enrolled gets a new token as well; when that is redeemed, its certificates so far are revoked:
        a name has one key. One that was revoked is readmitted then. The role, and the rights that it has from now on
        (`may`, and no others), hold at once.
        """
        rights = tuple(sorted(set(may)))
        names = list(names)
        for name in names:
            check_member_name(name, role)
        tokens = {name: EnrolmentToken.new(fingerprint(self.certificate)) for name in names}
        with self._registry.change() as members:
            for name, token in tokens.items():
                invitation = Invitation(digest(token.secret), self.clock() + ttl.total_seconds())
                member = members.get(name) or EnrolledName(name, role)
                members[name] = msgspec.structs.replace(member, role=role, invitation=invitation, may=rights)
        return tokens

    def redeem(self, secret: bytes, request: bytes, origin: str = "") -> bytes:
        """Return the certificate (PEM) that `request` (PKCS 10, PEM) asks for, against the secret of a token.

        Args:
            secret: The token's secret.
            request: The request.
            origin: Where the request came from, for the observer.

        Raises:
            NotGrantedError: when the secret is unknown, used or expired, or the request is not in the token's name.
        """
        what = "redeem a token"
        with self._answering(what, request, origin) as (name, holder), self._registry.change() as members:
            now = self.clock()
            member, invitation = _invited(members, digest(secret), name, now)
            certificate, issued = self._issue(holder, name)
            members[name] = EnrolledName(
                name,
                member.role,
                msgspec.structs.replace(invitation, used=True),
                (issued,),
                (*member.withdrawn, *member.certificates),
                may=member.may,
            ).since(now)
        self.report(Granted(t=now, who=name, what=what, origin=origin))
        return certificate

    def renew(self, request: bytes, current: Certificate, origin: str = "") -> bytes:
        """Return a new certificate (PEM) for the holder of `current`, for the key in `request` (PKCS 10, PEM).

        The caller has made sure, by TLS, that the request comes from the holder of the key of `current`. That
        certificate stays in force until it expires. `origin` says where the request came from, for the observer.

        Raises:
            NotGrantedError: when `current` is not in force, or the request is in another name.
        """
        what = "renew a certificate"
        with self._answering(what, request, origin) as (name, holder), self._registry.change() as members:
            now = self.clock()
            try:
                proven = check_issued(current, self.certificate, moment(now))
            except CertificateError as error:
                raise NotGrantedError(str(error)) from error
            if proven != name:
                raise NotGrantedError("the request is in another name than the certificate")
            if name == MASTER:
                raise NotGrantedError(f"{MASTER} is certified where the Authority is, not from afar")
            if self.is_revoked(current.serial_number):
                raise NotGrantedError("the certificate has been revoked")
            member = members[name].since(now)
            if len(member.certificates) >= IN_FORCE_AT_MOST:
                raise NotGrantedError(f"{IN_FORCE_AT_MOST} certificates of this name are in force, and no more may be")
            certificate, issued = self._issue(holder, name)
            members[name] = msgspec.structs.replace(member, certificates=(*member.certificates, issued))
        self.report(Granted(t=now, who=name, what=what, origin=origin))
        return certificate

    def master_identity(self, hosts: Sequence[str], folder: Path | None = None) -> Identity:
        """Return a new identity of the master, for servers that are reached at `hosts` (names or addresses).

        It is written to `folder` (the Authority's own `master` if None) and needs no token: only who has the
        Authority's key can make one. Raises `HostNameError`.
        """
        key = new_key()
        with self._registry.change() as members:
            now = self.clock()
            content, issued = self._issue(key.public_key(), MASTER, hosts)
            member = (members.get(MASTER) or EnrolledName(MASTER, Role.MASTER)).since(now)
            members[MASTER] = msgspec.structs.replace(member, certificates=(*member.certificates, issued))
            place = folder or self.folder / _MASTER
            save(place, key, read_certificate(content), self.certificate)
            return Identity.load(place, now)

    def revoke(self, name: str) -> None:
        """Revoke the certificates, the unused token and the rights of `name`.

        Raises:
            UnknownNameError: when the name is not enrolled; the message lists names that are.
            InvalidNameError: for the master, as robots would not learn of it.
        """
        if name == MASTER:
            raise InvalidNameError(
                f"{MASTER} cannot be revoked, for robots would not learn of it: make a new Authority"
            )
        with self._registry.change() as members:
            member = members.get(name)
            if member is None:
                what = f"no '{on_one_line(shortened(name))}' is enrolled"
                raise UnknownNameError(f"{what} ({describe_enrolled(name, members)})")
            withdrawn = (*member.withdrawn, *member.certificates)
            members[name] = EnrolledName(name, member.role, None, (), withdrawn, revoked=True).since(self.clock())

    def is_revoked(self, who: str | int) -> bool:
        """Return whether the name or the certificate's serial number `who` is refused.

        It is when it was revoked, and when this Authority does not know it: what is not granted is denied.
        """
        members = self._registry.members()
        if isinstance(who, str):
            return who not in members or members[who].revoked
        serial = f"{who:x}"
        return not any(one.serial == serial for member in members.values() for one in member.certificates)

    def names(self, role: Role | None = None, right: Right | None = None, *, invited: bool = False) -> tuple[str, ...]:
        """Return the names that have a certificate in force now, sorted. See `Admission.names`."""
        now = self.clock()
        return tuple(
            member.name
            for member in self.members()
            if not member.revoked
            and role in (None, member.role)
            and right in (None, *member.may)
            and (member.since(now).certificates or (invited and member.never_certified))
        )

    def members(self) -> tuple[EnrolledName, ...]:
        """Return all names that were ever enrolled, sorted."""
        return tuple(member for _, member in sorted(self._registry.members().items()))

    def report(self, event: AuthorityEvent) -> None:
        """Report `event` to the observer."""
        self.observer(event)

    def _issue(
        self, holder: ec.EllipticCurvePublicKey, name: str, hosts: Sequence[str] | None = None
    ) -> tuple[bytes, Issued]:
        now = self.clock()
        times = (moment(now), moment(now + self.lifetime.total_seconds()))
        certificate = leaf_certificate((self.certificate, self._key), holder, name, hosts, times)
        issued = Issued(f"{certificate.serial_number:x}", certificate.not_valid_after_utc.timestamp())
        return pem(certificate), issued

    @contextmanager
    def _answering(self, what: str, request: bytes, origin: str) -> Iterator[tuple[str, ec.EllipticCurvePublicKey]]:
        """Yield the name and the key in `request`; a refusal within is reported."""
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


def _invited(members: Mapping[str, EnrolledName], known: str, name: str, now: float) -> tuple[EnrolledName, Invitation]:
    """Return the entry and the invitation of the token with the digest `known`, if it can be redeemed for `name` now.

    Raises `NotGrantedError`.
    """
    for member in members.values():
        invitation = member.invitation
        if invitation is None or invitation.digest != known:
            continue
        if invitation.used:
            raise NotGrantedError("the token has been used already")
        if now >= invitation.expires:
            raise NotGrantedError("the token has expired")
        if member.name != name:
            raise NotGrantedError("the token is not for this name")
        return member, invitation
    raise NotGrantedError("the token is unknown here, or a newer one has replaced it")


def default_authority_folder() -> Path:
    """Return the Authority's default folder, in the user's data folder."""
    from platformdirs import user_data_path  # noqa: PLC0415 - only who is given no folder needs it

    return user_data_path("robochoc") / "authority"
