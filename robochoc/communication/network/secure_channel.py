"""A robot's channel to the master and to other robots: frames, and filters that seal messages between robots.

It performs no I/O, and only writes and reads bytes. Other robots' key cards arrive with the master's task.
"""

from __future__ import annotations

import time
from collections.abc import Iterable

import msgspec

from robochoc.authority.identity import Identity
from robochoc.authority.keyring import KeyCard, KeyCardError, KeyRing, UnknownPeerError
from robochoc.communication.filters import FilterStack, UnknownFilterError, filter_named
from robochoc.communication.network.control_messages import Copies, ProtocolMessage, ToMaster, ToPeer
from robochoc.communication.network.framing import MASTER, Framing, Opened
from robochoc.solver.errors import UnsupportedError


class SecureChannel:
    """The channel of the robot with this identity, under the name `name`."""

    def __init__(self, name: str, identity: Identity) -> None:
        self._name = name
        self._identity = identity
        self._framing = Framing(name)
        self._ring: KeyRing | None = None
        self._filters: FilterStack | None = None

    def start_run(self, run: str, filters: tuple[str, ...]) -> None:
        """Start a run whose messages pass through `filters`. Raises `UnsupportedError` for an unknown filter."""
        self._framing.start_run(run)
        if not filters:
            return
        self._ring = KeyRing(self._identity, run)
        try:
            self._filters = FilterStack(self._ring, [filter_named(name) for name in filters])
        except UnknownFilterError as unknown:
            raise UnsupportedError(f"{self._name}: {unknown}") from None

    @property
    def card(self) -> bytes:
        """The robot's key card for this run; empty if no filter needs a key card."""
        return self._ring.card.encode() if self._ring else b""

    def admit(self, cards: Iterable[bytes]) -> list[str]:
        """Accept key cards of others that the Authority has certified. Return the reasons for refused cards."""
        if self._ring is None:
            return []
        faults = []
        for content in cards:
            try:
                card = KeyCard.decode(content)
                if card.name != self._name:
                    self._ring.admit(card, time.time())
            except KeyCardError as bad:
                faults.append(str(bad))
        return faults

    def revoke(self, name: str) -> None:
        """Accept no more messages from `name`, whose certificate was revoked."""
        if self._ring:
            self._ring.dismiss(name)

    def frame(self, message: ToMaster) -> bytes:
        """Return the next frame to the master."""
        return self._framing.write(MASTER, message)

    def sealed_frame(self, receiver: str, message: ToPeer) -> bytes | None:
        """Return the next frame to another robot, or None if that robot was revoked."""
        if self._filters:
            context = self._context(self._name, receiver, self._framing.next_number(receiver), message)
            try:
                content = self._filters.seal(receiver, message.content, context)
            except UnknownPeerError:
                return None
            message = msgspec.structs.replace(message, content=content)
        return self._framing.write(receiver, message)

    def read(self, sender: str, content: bytes) -> Opened:
        """Return the content of a frame. The frame counts as received after `accept`. Raises `FrameRefusedError`."""
        return self._framing.read(sender, content)

    def accept(self, sender: str, number: int) -> None:
        """Accept the frame `number` from `sender`, and expect the next number."""
        self._framing.accept(sender, number)

    def unsealed(self, sender: str, number: int, message: ToPeer) -> ToPeer:
        """Return the unsealed message from another robot.

        Raises:
            NotGenuineError: if the filters detect a change in the message.
            UnknownPeerError: if the sender's key card is not known.
        """
        if self._filters is None:
            return message
        context = self._context(sender, self._name, number, message)
        return msgspec.structs.replace(message, content=self._filters.open(sender, message.content, context))

    def _context(self, sender: str, receiver: str, number: int, message: ProtocolMessage | Copies) -> bytes:
        """Return the context that binds a sealed message to its position in the run."""
        kind = message.clock if isinstance(message, ProtocolMessage) else "copies"
        return f"{self._framing.run} {sender} {receiver} {number} {message.epoch} {kind}".encode()
