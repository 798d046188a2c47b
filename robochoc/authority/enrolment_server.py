"""The Authority's enrolment service on a TLS port, which is run by the master.

All connections use TLS 1.3 with the master's certificate. A robot with a token needs no certificate yet. Renewal uses
mutual TLS: in the handshake, OpenSSL checks the robot's certificate (chain, time, purpose) and its possession of the
key, so no additional signature format is needed.
"""

from __future__ import annotations

import selectors
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Self, assert_never

from cryptography import x509

from robochoc.authority.authority import Authority, NotGrantedError
from robochoc.authority.certificates import pem
from robochoc.authority.events import Refused
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
from robochoc.authority.identity import Identity
from robochoc.authority.registry import AuthorityError

CONNECTIONS = 32
"""The maximum number of connections served at once. Further connections wait to be accepted."""
PATIENCE_S = 10.0
"""The longest duration of a connection, in seconds."""
_BACKLOG = 256


class EnrolmentServer:
    """Serves `authority` at `host` and `port` (0: any free port; see `address`) within its context.

    `identity` is the master's. After half of its validity, the Authority creates a new identity for the same hosts.
    Refusals are reported to the Authority's observer from the threads of this server, one at a time.
    """

    def __init__(
        self,
        authority: Authority,
        identity: Identity,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        connections: int = CONNECTIONS,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._authority = authority
        self._identity = identity
        self._patience_s = patience_s
        self._context = _server_context(identity)
        self._free = threading.BoundedSemaphore(connections)
        self._place = (host, port)
        self._open: dict[ssl.SSLSocket, threading.Thread] = {}
        self._lock = threading.Lock()
        self._reporting = threading.Lock()
        self._closing = False

    @property
    def address(self) -> tuple[str, int]:
        """The host and port; available within the context."""
        host, port = self._listener.getsockname()[:2]
        return host, port

    def __enter__(self) -> Self:
        """Start listening. Raises `OSError`."""
        family = socket.AF_INET6 if ":" in self._place[0] else socket.AF_INET
        self._listener = socket.create_server(self._place, family=family, backlog=_BACKLOG)
        self._wake_sender, self._wake_receiver = socket.socketpair()
        self._acceptor = threading.Thread(target=self._accept_connections, name="robochoc enrolment", daemon=True)
        self._acceptor.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close all connections, and end all threads."""
        with self._lock:
            self._closing = True
            for connection in self._open:
                _hang_up(connection)
            threads = list(self._open.values())
        self._wake_sender.send(b"!")
        for thread in (self._acceptor, *threads):
            thread.join()
        for each in (self._listener, self._wake_sender, self._wake_receiver):
            each.close()

    def _accept_connections(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ)
            selector.register(self._wake_receiver, selectors.EVENT_READ)
            while True:
                self._free.acquire()
                ready = {key.fileobj for key, _ in selector.select()}
                if self._wake_receiver in ready:
                    return
                self._admit()

    def _admit(self) -> None:
        """Accept a connection and serve it in a thread. Its failure does not affect other connections."""
        try:
            raw, peer = self._listener.accept()
            origin = f"{peer[0]}:{peer[1]}"
            try:
                self._renew_identity()
                connection = self._context.wrap_socket(raw, server_side=True, do_handshake_on_connect=False)
            except BaseException:
                raw.close()
                raise
        except (OSError, AuthorityError) as error:
            self._free.release()
            self._refuse("", f"the connection could not be accepted: {error}")
            return
        with self._lock:
            if self._closing:
                connection.close()
                return
            thread = threading.Thread(
                target=self._serve, args=(connection, origin), name="robochoc enrolment desk", daemon=True
            )
            self._open[connection] = thread
            thread.start()

    def _renew_identity(self) -> None:
        if self._identity.is_due(self._authority.clock()):
            self._identity = self._authority.master_identity(self._identity.hosts)
            self._context = _server_context(self._identity)

    def _serve(self, connection: ssl.SSLSocket, origin: str) -> None:
        try:
            with self._tracked(connection):
                exchange = Exchange(connection, self._patience_s)
                exchange.wait()
                connection.do_handshake()
                exchange.send(self._answer_or_denial(exchange, connection, origin))
        except ssl.SSLError as error:
            why = error.verify_message if isinstance(error, ssl.SSLCertVerificationError) else error.reason
            self._refuse(origin, f"TLS failed: {why or error}")
        except TimeoutError:
            self._refuse(origin, f"no complete request within {self._patience_s:g} s")
        except OSError as error:
            self._refuse(origin, f"the connection failed: {error.strerror or error}")

    def _answer_or_denial(self, exchange: Exchange, connection: ssl.SSLSocket, origin: str) -> Answer:
        try:
            return self._answer(exchange.question(), connection.getpeercert(binary_form=True), origin)
        except NotGrantedError as refusal:  # reported by the Authority
            return EnrolmentDenied(str(refusal))
        except FrameError as error:
            self._refuse(origin, str(error))
            return EnrolmentDenied(str(error))
        except AuthorityError as error:
            self._refuse(origin, str(error))
            return EnrolmentDenied("the Authority cannot answer now: ask its operator")

    def _answer(self, question: Question, shown: bytes | None, origin: str) -> Answer:
        """Return the answer to a robot; `shown` is its certificate (DER) in the handshake, None without one."""
        match question:
            case Introduce():
                return Introduction(pem(self._authority.certificate))
            case Redeem():
                return Certified(self._authority.redeem(question.secret, question.request, origin))
            case Renew():
                if shown is None:
                    raise FrameError(
                        "a certificate can only be renewed over a connection that uses the same certificate"
                    )
                current = x509.load_der_x509_certificate(shown)
                return Certified(self._authority.renew(question.request, current, origin))
            case _:
                assert_never(question)

    @contextmanager
    def _tracked(self, connection: ssl.SSLSocket) -> Iterator[None]:
        try:
            with connection:
                yield
        finally:
            with self._lock:
                del self._open[connection]
            self._free.release()

    def _refuse(self, origin: str, why: str) -> None:
        """Report the error, unless the server is closing."""
        with self._lock:
            if self._closing:
                return
        with self._reporting:
            self._authority.report(
                Refused(t=self._authority.clock(), who="unknown", what="enrolment", why=why, origin=origin)
            )


def _server_context(identity: Identity) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.load_cert_chain(identity.certificate_file, identity.key_file)
    context.load_verify_locations(cadata=pem(identity.ca).decode())
    context.verify_mode = ssl.CERT_OPTIONAL
    context.num_tickets = 0  # a resumed session would contain no certificate
    return context


def _hang_up(connection: socket.socket) -> None:
    """End all waits on `connection`. `SSLSocket.shutdown` is not used, because it would continue without TLS."""
    with suppress(OSError):
        socket.socket.shutdown(connection, socket.SHUT_RDWR)
