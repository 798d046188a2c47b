"""The transport of one participant by zenoh: transmits frames in both directions, and tracks the present members.

Frames are sent by zenoh's advanced publishers and subscribers, which number and store frames, and request frames again
that were lost in an outage; plain ones lose messages silently. Only this module and the router's import zenoh. zenoh
runs callbacks in its own threads; they only put items into `inbox`.
"""

from __future__ import annotations

import atexit
import base64
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Self

import zenoh
import zenoh.ext

from robochoc.authority.identity import Identity
from robochoc.communication.network.access import ALL, frame_key, life_key, name_in
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Inbox, PresenceChanged, WakeUp
from robochoc.communication.network.settings import LEASE_MS
from robochoc.communication.network.zenoh_config import config
from robochoc.communication.resources import require_descriptors
from robochoc.system.errors import RobochocError

RETRY = {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5}
HEARTBEAT_S = 5.0
"""The longest time in seconds until a receiver notices that the last frame is missing.

Other missing frames are noticed when the next frame arrives. Each pair that has exchanged a frame has its own
heartbeat, which costs about 0.2 ms of CPU; 121 robots have some 4,000 pairs. Frames lost in an outage need not wait for
the heartbeat: a receiver requests them as soon as it sees the sender again.
"""
KEPT_FRAMES = 100_000
_LATE_S = 1.0
_CLOSE_S = 12.0
"""The longest time in seconds that closing a dead link takes; zenoh needs 10 s."""
_FIRST_ATTEMPT_S, _LONGEST_ATTEMPT_S = 2.0, 10.0
"""The duration of attempts to connect, in seconds. A busy router may need a long time for a handshake."""


DESCRIPTORS = 24
"""The number of open files that a session may need, including those for zenoh's threads."""


class CannotConnectError(RobochocError):
    """Raised if there is no master at that address, or the master does not admit this agent."""


TEAM = (MASTER, ALL)
"""The senders to which a robot subscribes: the master, with a separate subscriber, and all others."""
_Subscriber = tuple[zenoh.ext.AdvancedSubscriber[None], zenoh.ext.SampleMissListener[None]]
Answering = Callable[[str, bytes], bytes | None]
"""A function that returns the answer to a participant's question, or None if there is no answer."""


class Transport:
    """The connection of `identity` to the router at `endpoint` (`HOST:PORT`); a context manager.

    Its name in the run is `name`, by default the name in the certificate; a leading master is called `MASTER` in every
    run. It tracks the presence of the names in `watch`, and puts the frames from `senders` (and others: `subscribe`)
    into `inbox`. A link that is silent for `lease_ms` counts as down. Raises `CannotConnectError` if no connection is
    established within `patience_s`.
    """

    def __init__(
        self,
        endpoint: str,
        identity: Identity,
        *,
        name: str = "",
        watch: Iterable[str] = (ALL,),
        senders: Iterable[str] = TEAM,
        inbox: Inbox | None = None,
        patience_s: float = 10.0,
        lease_ms: int = LEASE_MS,
    ) -> None:
        self.name = name or identity.name
        self.inbox = inbox or Inbox()
        self._publishers: dict[str, zenoh.ext.AdvancedPublisher] = {}
        self._subscribers: dict[str, _Subscriber] = {}
        self._session = _opened(endpoint, identity, patience_s, lease_ms)
        self.subscribe(senders)
        self._token = self._session.liveliness().declare_token(life_key(self.name))
        self._watchers = [
            self._session.liveliness().declare_subscriber(life_key(name), self._note_presence, history=True)
            for name in watch
        ]

    def subscribe(self, senders: Iterable[str]) -> None:
        """Subscribe also to the frames from `senders`. Their earlier frames arrive soon.

        Each sender has its own subscriber, because zenoh trusts the source and the number in a packet: with one
        subscriber for all senders, a sender could use the source of another, whose frames would then count as old or
        missing. But separate subscribers are expensive, since the router stores every pair. So robots use one
        subscriber for all neighbours (`ALL`), and one for the master.
        """
        for sender in senders:
            if sender not in self._subscribers:
                self._subscribers[sender] = self._subscribed(sender)

    def send(self, receiver: str, content: bytes) -> None:
        """Send a frame. While the link is down the frame is stored. Later it is sent, or requested by the receiver."""
        publisher = self._publishers.get(receiver)
        if publisher is None:
            publisher = self._publishers[receiver] = zenoh.ext.declare_advanced_publisher(
                self._session,
                frame_key(receiver, self.name),
                congestion_control=zenoh.CongestionControl.BLOCK,
                cache=zenoh.ext.CacheConfig(KEPT_FRAMES),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=HEARTBEAT_S, sporadic_heartbeat=None),
                publisher_detection=True,
            )
        publisher.put(content)

    @property
    def router(self) -> str:
        """The identifier of the connected router; empty without a connection. A restarted router has another one."""
        return next(map(str, self._session.info.routers_zid()), "")

    def answer(self, key: str, answered: Answering) -> None:
        """Start answering questions on `key`, in one of zenoh's threads."""

        def reply(query: zenoh.Query) -> None:
            content = answered(name_in(str(query.key_expr)), query.payload.to_bytes() if query.payload else b"")
            if content is not None:
                query.reply(query.key_expr, content)

        self._answering = self._session.declare_queryable(key, reply)

    def ask(self, key: str, content: bytes, patience_s: float) -> bytes | None:
        """Return the answer to `content` on `key`, or None if no answer arrives within `patience_s` seconds.

        The answer has a lower priority than robots' frames, and is dropped if it cannot be sent at once.
        """
        replies: SimpleQueue[zenoh.Reply | None] = SimpleQueue()
        handler = zenoh.handlers.Callback(replies.put, lambda: replies.put(None))
        self._session.get(
            key,
            handler,
            payload=content,
            timeout=patience_s,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.BACKGROUND,
        )
        with suppress(Empty):
            while reply := replies.get(timeout=patience_s + _LATE_S):
                if reply.ok is not None:
                    return reply.ok.payload.to_bytes()
        return None

    def wake(self) -> None:
        """End a wait for the inbox."""
        self.inbox.put(WakeUp())

    def close(self) -> None:
        """Close the connection. Pending frames are sent first, unless the link is dead."""
        with suppress(zenoh.ZError):  # the other end of a dead link does not answer
            self._session.close()  # type: ignore[no-untyped-call]  # zenoh's stubs

    def abandon(self) -> None:
        """Close the connection in a thread. On a dead link, this takes 10 s, for which the program's end waits."""
        thread = threading.Thread(target=self.close, name=f"close {self.name}", daemon=True)
        thread.start()
        atexit.register(thread.join, _CLOSE_S)  # a thread in zenoh during Python's end aborts the program

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _subscribed(self, sender: str) -> _Subscriber:
        """Return a subscriber to `sender` alone (`ALL`: to all others), which also notices lost frames.

        zenoh reports a gap just before the frame after the gap, in the same thread (with `indirect`, in another
        thread). So the loss is attributed to the sender of that frame, which the router has verified, not to the source
        in a packet.
        """
        gap = 0

        def note_miss(miss: zenoh.ext.Miss) -> None:
            nonlocal gap
            gap += miss.nb

        def receive(sample: zenoh.Sample) -> None:
            nonlocal gap
            lost, gap = gap, 0
            of = name_in(str(sample.key_expr))
            if sender != ALL or of not in self._subscribers:
                self._put(of, lost, sample.payload.to_bytes())

        subscriber = zenoh.ext.declare_advanced_subscriber(
            self._session,
            frame_key(self.name, sender),
            zenoh.handlers.Callback(receive, indirect=False),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            subscriber_detection=True,
        )
        return subscriber, subscriber.sample_miss_listener(zenoh.handlers.Callback(note_miss, indirect=False))

    # Called by zenoh's threads

    def _put(self, sender: str, lost: int, content: bytes) -> None:
        if lost:
            self.inbox.put(FramesLost(sender, lost))
        self.inbox.put(FrameArrived(sender, content))

    def _note_presence(self, sample: zenoh.Sample) -> None:
        self.inbox.put(PresenceChanged(name_in(str(sample.key_expr)), sample.kind == zenoh.SampleKind.PUT))


def _opened(endpoint: str, identity: Identity, patience_s: float, lease_ms: int) -> zenoh.Session:
    """Return a session. Each attempt to connect is short, because zenoh ignores Ctrl-C while it connects."""
    if endpoint.startswith("["):
        raise CannotConnectError(
            f"{endpoint}: zenoh cannot check certificates of IPv6 addresses: use a host name of the master"
        )
    require_descriptors(DESCRIPTORS)
    until = time.monotonic() + patience_s
    attempt_s = _FIRST_ATTEMPT_S
    while True:
        left = until - time.monotonic()
        try:
            return zenoh.open(client_config(endpoint, identity, min(attempt_s, left), lease_ms))
        except zenoh.ZError as error:
            if time.monotonic() >= until:
                raise CannotConnectError(
                    f"no master answers at {endpoint}, or it does not admit {identity.name}"
                ) from error
        attempt_s = min(2 * attempt_s, _LONGEST_ATTEMPT_S)


def client_config(endpoint: str, identity: Identity, patience_s: float, lease_ms: int) -> zenoh.Config:
    """Return a participant's configuration: it connects only to this router, by mutual TLS."""
    texts = identity.texts
    tls = {
        "root_ca_certificate_base64": encoded(texts.ca),
        "connect_private_key_base64": encoded(texts.key),
        "connect_certificate_base64": encoded(texts.certificate),
        "enable_mtls": True,
        "verify_name_on_connect": True,
    }
    return config(
        {
            "mode": "client",
            "listen/endpoints": [],
            "connect/endpoints": [f"tls/{endpoint}"],
            "connect/timeout_ms": max(1, int(patience_s * 1000)),
            "connect/exit_on_failure": True,
            "connect/retry": RETRY,
            "transport/link/tls": tls,
            "transport/link/tx/lease": lease_ms,
        }
    )


def encoded(content: bytes) -> str:
    """Return PEM in the form that zenoh accepts without a file."""
    return base64.b64encode(content).decode()
