"""The keys by which ROS 2 finds topics in zenoh, as ros2/rmw_zenoh's docs/design.md and its sources say.

A topic's messages travel on `DOMAIN/TOPIC/TYPE/HASH`. Whoever publishes or subscribes says so by a liveliness token,
`@ros2_lv/DOMAIN/SESSION/NODE/ENTITY/KIND/...`: from these `ros2 topic list` and `ros2 node list` know us. Each message
has an attachment. A service is a queryable with such a key, and its requests are queries with a payload and an
attachment. Pure: texts and bytes.
"""

from __future__ import annotations

import hashlib
import struct
from typing import Literal, NamedTuple

from robochoc.ros.live.ros2_names import dds_type_name

NO_HASH = "TypeHashNotSupported"
"""The hash in the keys of ROS 2 Humble, whose types have none."""
LATCHED = "1:1:1,1:,:,:,,"
"""Quality of service in a token: reliable, transient local, keep the last 1; no limits of time.

What equals the defaults may be left out, but versions of rmw_zenoh differ in these.
"""

SERVICES_QOS = "1:2:1,10:,:,:,,"
"""The same for services: reliable, volatile, keep the last 10."""

_ATTACHMENT = struct.Struct("<qqB16s")
_GID_SIZE = 16

EntityKind = Literal["MP", "MS", "SS"]
"""A publisher, a subscription, or a service that answers."""


class RosNode(NamedTuple):
    """A node of ours: the session and its domain."""

    domain: int
    session: str

    @property
    def name(self) -> str:
        """The node's name, which is not that of another one."""
        return f"robochoc_{self.session[:8]}"

    @property
    def token(self) -> str:
        """The token that says that the node is there."""
        return self._token(0, "NN")

    def entity_token(self, number: int, kind: EntityKind, topic: Topic) -> str:
        """Return the token of an entity, which has a number of its own in this node."""
        quality = SERVICES_QOS if kind == "SS" else LATCHED
        return f"{self._token(number, kind)}/{topic.name.replace('/', '%')}/{topic.type}/{topic.hash}/{quality}"

    def _token(self, number: int, kind: str) -> str:
        # The first % is the enclave, the second the namespace: that of all, "/".
        return f"@ros2_lv/{self.domain}/{self.session}/0/{number}/{kind}/%/%/{self.name}"


class Topic(NamedTuple):
    """A topic: its name in ROS, its type's name in DDS, and the hash of that type."""

    name: str
    type: str
    hash: str

    @classmethod
    def of(cls, name: str, kind: str, type_hash: str) -> Topic:
        """Return the topic of that name and ROS type."""
        return cls(name, dds_type_name(kind), type_hash)

    @classmethod
    def of_service(cls, name: str, kind: str, type_hash: str) -> Topic:
        """Return the same for a service, whose type is such as `std_srvs/Trigger`."""
        return cls(name, dds_type_name(kind).replace("::msg::", "::srv::"), type_hash)

    def key(self, domain: int) -> str:
        """Return the key of the topic's messages."""
        return f"{domain}/{self.name.strip('/')}/{self.type}/{self.hash}"

    def any_key(self, domain: int) -> str:
        """Return what matches the topic's messages with any hash."""
        return f"{domain}/{self.name.strip('/')}/{self.type}/*"


def gid_of(token: str) -> bytes:
    """Return 16 bytes that stand for the publisher with that token in its messages."""
    return hashlib.blake2b(token.encode(), digest_size=_GID_SIZE).digest()


def attachment(number: int, at_ns: int, gid: bytes) -> bytes:
    """Return what goes with a publisher's message: its number, from 1, the time in nanoseconds, and who publishes."""
    return _ATTACHMENT.pack(number, at_ns, _GID_SIZE, gid)


def sender(attached: bytes) -> tuple[int, bytes] | None:
    """Return the number of a request and 16 bytes that stand for its client; None if `attached` is no attachment."""
    if len(attached) != _ATTACHMENT.size:
        return None
    number, _, size, gid = _ATTACHMENT.unpack(attached)
    return (number, gid) if size == _GID_SIZE and number >= 0 else None
