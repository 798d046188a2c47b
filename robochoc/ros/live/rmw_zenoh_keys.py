"""The keys of ROS 2 topics in zenoh, after docs/design.md and the sources of ros2/rmw_zenoh, without using zenoh.

Messages on a topic are sent with the key `DOMAIN/TOPIC/TYPE/HASH`. Publishers and subscribers are declared by
liveliness tokens, `@ros2_lv/DOMAIN/SESSION/NODE/ENTITY/KIND/...`, which `ros2 topic list` and `ros2 node list` read.
Each message has an attachment. A service is a queryable with such a key, and its requests are queries with a payload
and an attachment.
"""

from __future__ import annotations

import hashlib
import struct
from typing import Literal, NamedTuple

from robochoc.ros.live.ros2_names import dds_type_name

NO_HASH = "TypeHashNotSupported"
"""The hash in keys of ROS 2 Humble, whose types have no hashes."""
LATCHED = "1:1:1,1:,:,:,,"
"""The quality of service in a token: reliable, transient local, keep the last 1; no time limits.

Default values could be omitted, but versions of rmw_zenoh have different defaults.
"""

SERVICES_QOS = "1:2:1,10:,:,:,,"
"""The quality of service of services: reliable, volatile, keep the last 10."""

_ATTACHMENT = struct.Struct("<qqB16s")
_GID_SIZE = 16

EntityKind = Literal["MP", "MS", "SS", "SC"]
"""A publisher, a subscription, a server or a client of a service."""


class RosNode(NamedTuple):
    """A node of robochoc: its domain and its session."""

    domain: int
    session: str

    @property
    def name(self) -> str:
        """The node's unique name."""
        return f"robochoc_{self.session[:8]}"

    @property
    def token(self) -> str:
        """The liveliness token of the node."""
        return self._token(0, "NN")

    def entity_token(self, number: int, kind: EntityKind, topic: ZenohTopic) -> str:
        """Return the token of an entity. Each entity of the node has its own number."""
        quality = SERVICES_QOS if kind in {"SS", "SC"} else LATCHED
        return f"{self._token(number, kind)}/{topic.name.replace('/', '%')}/{topic.type}/{topic.hash}/{quality}"

    def _token(self, number: int, kind: str) -> str:
        # The first % is the enclave, the second the namespace; both are "/".
        return f"@ros2_lv/{self.domain}/{self.session}/0/{number}/{kind}/%/%/{self.name}"


class ZenohTopic(NamedTuple):
    """A topic: its name in ROS, the name of its type in DDS, and the hash of this type."""

    name: str
    type: str
    hash: str

    @classmethod
    def for_topic(cls, name: str, kind: str, type_hash: str) -> ZenohTopic:
        """Return the topic, or the service, with this name and ROS type."""
        return cls(name, dds_type_name(kind), type_hash)

    def key(self, domain: int) -> str:
        """Return the key for messages on the topic."""
        return f"{domain}/{self.name.strip('/')}/{self.type}/{self.hash}"

    def any_key(self, domain: int) -> str:
        """Return the key expression for messages on the topic with any type hash."""
        return f"{domain}/{self.name.strip('/')}/{self.type}/*"

    def any_server_token(self, domain: int) -> str:
        """Return the key expression for the tokens of all servers of this service."""
        return f"@ros2_lv/{domain}/*/*/*/SS/*/*/*/{self.name.replace('/', '%')}/{self.type}/{self.hash}/**"


def gid_of(token: str) -> bytes:
    """Return the 16 bytes that identify the publisher with `token` in its messages."""
    return hashlib.blake2b(token.encode(), digest_size=_GID_SIZE).digest()


def attachment(number: int, at_ns: int, gid: bytes) -> bytes:
    """Return the attachment of a message: its number (from 1), the time in nanoseconds, and the publisher's id."""
    return _ATTACHMENT.pack(number, at_ns, _GID_SIZE, gid)


def sender(attached: bytes) -> tuple[int, bytes] | None:
    """Return the number of a request and its client's id (16 bytes); None if `attached` is malformed."""
    if len(attached) != _ATTACHMENT.size:
        return None
    number, _, size, gid = _ATTACHMENT.unpack(attached)
    return (number, gid) if size == _GID_SIZE and number >= 0 else None
