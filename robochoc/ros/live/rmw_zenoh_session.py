"""A session with the zenoh router of a ROS 2 network, which publishes and receives bytes on topics.

Only this module and `communication/network` use zenoh. The session is a client of the router, which forwards all
messages, so it listens on no port. zenoh's calls may block for a long time and ignore signals; so sessions are opened
and closed in a separate thread. zenoh restores a broken link in the background, with all declarations.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

import zenoh
import zenoh.ext

from robochoc.communication.network.zenoh_config import config
from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.ros.live.rmw_zenoh_keys import RosNode, ZenohTopic, attachment, gid_of, sender
from robochoc.ros.live.ros2_names import domain_id
from robochoc.ros.live.transport import ErrorClass, succeeds_in_time

PORT = 7447
"""The default port of a zenoh router."""
OPEN_S = 5.0
"""The longest wait for an answer from the router, in seconds."""
LATE_S = 1.0
"""The time after `OPEN_S` by which zenoh itself must have given up, in seconds."""
GONE_S = 5.0
"""The longest time for which the link may be broken, in seconds."""
CLOSE_S = 10.0
"""The longest time for closing a session, in seconds."""
CONFIG_FILE = "ZENOH_SESSION_CONFIG_URI"
"""The environment variable with the path of a zenoh configuration (certificates, an endpoint), as in ROS 2 itself."""
_SERVERS_MAX = 100
"""The maximum number of servers of one service that are counted."""
_HEARTBEAT_S = 0.5
"""The time after which a subscriber detects that it has missed the last message, in seconds."""
_START = "start one: `ros2 run rmw_zenoh_cpp rmw_zenohd`"

Receive = Callable[[str, bytes], None]
"""Called with the key and the bytes of a message, in zenoh's threads."""
ReceiveQuery = Callable[[bytes, "RosQuery"], None]
"""Called with the bytes of a request and the query to answer, in zenoh's threads."""


class RouterAddress(NamedTuple):
    """The address of a zenoh router."""

    host: str
    port: int

    @classmethod
    def parse(cls, place: str) -> RouterAddress:
        """Parse `HOST`, `HOST:PORT`, `//HOST:PORT` or an empty place. Raises `ValueError`."""
        wanted = f"expected rmw_zenoh, or rmw_zenoh://HOST:PORT, as in rmw_zenoh://localhost:{PORT}"
        text = place.removeprefix("//")
        try:
            parts = urlsplit(f"//{text}")
            port = PORT if parts.port is None else parts.port
        except ValueError as error:
            raise ValueError(f"{shortened(place)!r}: {on_one_line(str(error))}; {wanted}") from error
        unknown = parts.path or parts.query or parts.fragment or parts.username
        if unknown or port == 0 or (text and not parts.hostname):
            raise ValueError(f"{shortened(place)!r} is not the address of a zenoh router; {wanted}")
        return cls(parts.hostname or "localhost", port)

    def __str__(self) -> str:
        return f"{f'[{self.host}]' if ':' in self.host else self.host}:{self.port}"


class RosPublisher:
    """Publishes on one topic. Late subscribers receive the last message."""

    def __init__(self, session: zenoh.Session, node: RosNode, topic: ZenohTopic, number: int) -> None:
        token = node.entity_token(number, "MP", topic)
        self._gid = gid_of(token)
        self._published = 0
        self._publisher = zenoh.ext.declare_advanced_publisher(
            session,
            topic.key(node.domain),
            congestion_control=zenoh.CongestionControl.BLOCK,
            reliability=zenoh.Reliability.RELIABLE,
            cache=zenoh.ext.CacheConfig(1),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT_S),
            publisher_detection=True,
        )
        self._token = session.liveliness().declare_token(token)

    def put(self, content: bytes, at_ns: int) -> None:
        """Publish a message. Waits while the link is congested; zenoh closes such a link after some seconds."""
        self._published += 1
        self._publisher.put(content, attachment=attachment(self._published, at_ns, self._gid))


class RosQuery:
    """A request from a client of a service, which is answered once. It is not an error if the client has left."""

    def __init__(self, query: zenoh.Query, key: str, number: int, gid: bytes) -> None:
        self._query, self._key, self._number, self._gid = query, key, number, gid

    def reply(self, content: bytes) -> None:
        """Send the answer, whose attachment contains the number of the request and the client's id."""
        attached = attachment(self._number, time.time_ns(), self._gid)
        with suppress(zenoh.ZError):
            self._query.reply(self._key, content, attachment=attached)
        self._query.drop()  # type: ignore[no-untyped-call]  # zenoh's stubs


class RosClient:
    """Calls one service, and counts the servers that offer it."""

    def __init__(self, session: zenoh.Session, node: RosNode, service: ZenohTopic, number: int) -> None:
        token = node.entity_token(number, "SC", service)
        self._session, self._gid = session, gid_of(token)
        self._key = service.key(node.domain)
        self._servers: set[str] = set()
        self._token = session.liveliness().declare_token(token)
        self._watch = session.liveliness().declare_subscriber(
            service.any_server_token(node.domain), zenoh.handlers.Callback(self._on_token, indirect=False), history=True
        )

    def has_server(self) -> bool:
        """Return whether a server offers the service."""
        return bool(self._servers)

    def call(self, number: int, content: bytes, wait_s: float, receive: Callable[[bytes | None], None]) -> None:
        """Send the request `number`, and pass its answers to `receive`, then None when no more will arrive.

        zenoh ends the query after `wait_s` seconds, or when the server is gone.
        """

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                receive(reply.ok.payload.to_bytes())

        self._session.get(
            self._key,
            zenoh.handlers.Callback(on_reply, drop=lambda: receive(None), indirect=False),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=wait_s,
            payload=content,
            attachment=attachment(number, time.time_ns(), self._gid),
        )

    def _on_token(self, sample: zenoh.Sample) -> None:
        token = str(sample.key_expr)
        if sample.kind == zenoh.SampleKind.DELETE:
            self._servers.discard(token)
        elif len(self._servers) < _SERVERS_MAX:
            self._servers.add(token)


class RosSession:
    """A ROS 2 node, connected to the router at `place`. Raises `failed` if the router is missing or lost."""

    def __init__(self, place: str, failed: ErrorClass) -> None:
        self._failed = failed
        domain = domain_id(failed)
        configured = os.environ.get(CONFIG_FILE, "").strip()
        try:
            address = None if configured and not place else RouterAddress.parse(place)
        except ValueError as error:
            raise failed(str(error)) from error
        self.router = on_one_line(f"of {configured}") if address is None else f"at {address}"
        if address is not None:
            self._check_listening(address)
        self._session = self._open(address, Path(configured) if configured else None)
        self._node = RosNode(domain, str(self._session.zid()))
        self._entities = 0
        self._missed_since: float | None = None
        self._declared: list[object] = [self._session.liveliness().declare_token(self._node.token)]

    def publisher(self, topic: ZenohTopic) -> RosPublisher:
        """Return a new publisher on `topic`, which is then visible in ROS 2."""
        self._entities += 1
        return RosPublisher(self._session, self._node, topic, self._entities)

    def subscribe(self, topic: ZenohTopic, receive: Receive) -> None:
        """Pass messages on `topic`, with any type hash, to `receive`, beginning with the publishers' last messages."""
        self._entities += 1

        def on_sample(sample: zenoh.Sample) -> None:
            receive(str(sample.key_expr), sample.payload.to_bytes())

        subscriber = zenoh.ext.declare_advanced_subscriber(
            self._session,
            topic.any_key(self._node.domain),
            zenoh.handlers.Callback(on_sample, indirect=False),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            subscriber_detection=True,
        )
        token = self._session.liveliness().declare_token(self._node.entity_token(self._entities, "MS", topic))
        self._declared += [subscriber, token]

    def client(self, service: ZenohTopic) -> RosClient:
        """Return a client of `service`."""
        self._entities += 1
        return RosClient(self._session, self._node, service, self._entities)

    def serve(self, service: ZenohTopic, receive: ReceiveQuery) -> None:
        """Offer `service`, and pass its requests to `receive`. Requests without a client's id get an error."""
        self._entities += 1
        key = service.key(self._node.domain)

        def on_query(query: zenoh.Query) -> None:
            attached, payload = query.attachment, query.payload
            known = sender(attached.to_bytes()) if attached is not None else None
            if known is None or payload is None:
                with suppress(zenoh.ZError):
                    query.reply_err(b"invalid request: rmw_zenoh requires a payload and an attachment")
                query.drop()  # type: ignore[no-untyped-call]  # zenoh's stubs
                return
            receive(payload.to_bytes(), RosQuery(query, key, *known))

        handler = zenoh.handlers.Callback(on_query, indirect=False)
        queryable = self._session.declare_queryable(key, handler, complete=True)
        token = self._session.liveliness().declare_token(self._node.entity_token(self._entities, "SS", service))
        self._declared += [queryable, token]

    def check(self) -> None:
        """Raise `failed` if the router has been out of reach for `GONE_S`."""
        info = self._session.info
        if [*info.routers_zid(), *info.peers_zid()]:
            self._missed_since = None
            return
        now = time.monotonic()
        self._missed_since = now if self._missed_since is None else self._missed_since
        if now - self._missed_since > GONE_S:
            raise self._failed(f"the connection to the zenoh router {self.router} is lost; {_START}")

    def wait_for_link(self) -> None:
        """Wait for a link to the router. Raises `failed` after `GONE_S`."""
        self.check()
        while self._missed_since is not None:
            time.sleep(0.02)
            self.check()

    def close(self) -> bool:
        """End the session; return whether the router has received all its messages."""
        has_received = succeeds_in_time(self._flush, CLOSE_S)
        self.discard()
        return has_received

    def discard(self) -> None:
        """End the session at once. Messages under way may be lost."""
        succeeds_in_time(self._session.close, CLOSE_S)

    def _flush(self) -> None:
        """Wait until the router has received all messages. Raises `TimeoutError`.

        Without this, closing the socket could destroy messages that the router has not read yet. The router reads in
        order, so its answer to a query of the lowest priority proves that it has read all messages before it.
        """
        key = f"robochoc/flush/{self._session.zid()}"
        answers = self._session.get(key, timeout=CLOSE_S, priority=zenoh.Priority.BACKGROUND)
        if any(answer.err is not None for answer in answers):
            raise TimeoutError

    def _check_listening(self, address: RouterAddress) -> None:
        """Raise `failed` at once if no program listens; zenoh would retry."""
        try:
            socket.create_connection(address, OPEN_S).close()
        except (OSError, UnicodeError) as error:
            why = shortened(on_one_line(getattr(error, "strerror", None) or str(error) or type(error).__name__))
            raise self._failed(f"no zenoh router listens at {address} ({why}); {_START}") from error

    def _open(self, address: RouterAddress | None, file: Path | None) -> zenoh.Session:
        settings: dict[str, object] = {
            "mode": "client",
            "listen/endpoints": [],
            "connect/timeout_ms": int(OPEN_S * 1000),
            "connect/exit_on_failure": True,
        }
        if address is not None:
            settings["connect/endpoints"] = [f"tcp/{address}"]
        try:
            made = config(settings, file)
        except zenoh.ZError as error:
            why = shortened(on_one_line(str(error)))
            raise self._failed(f"{CONFIG_FILE} does not name a valid zenoh configuration: {why}") from error
        opening = _Opening()
        succeeds_in_time(lambda: opening.set_session(zenoh.open(made)), OPEN_S + LATE_S)
        session = opening.session_in_time()
        if session is None:
            raise self._failed(f"the zenoh router {self.router} does not answer as a zenoh router; {_START}")
        return session


class _Opening:
    """A session that is being opened in a thread, which closes the session again if it is opened too late."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._session: zenoh.Session | None = None
        self._is_late = False

    def set_session(self, session: zenoh.Session) -> None:
        """Store the session; called in the thread that has opened it."""
        with self._lock:
            self._session = session
            is_late = self._is_late
        if is_late:
            session.close()  # type: ignore[no-untyped-call]  # zenoh's stubs

    def session_in_time(self) -> zenoh.Session | None:
        """Return the session; None if it is not open yet. From then on it counts as late."""
        with self._lock:
            self._is_late = True
            return self._session
