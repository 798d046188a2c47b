"""The master's connection to the network: its router, its transport, its frames, and its journal server."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from queue import Empty
from types import MappingProxyType

from robochoc.authority.admission import Admission
from robochoc.authority.identity import Identity
from robochoc.authority.registry import Right, Role
from robochoc.communication.network.access import ALL, journal_key
from robochoc.communication.network.control_messages import ToRobot
from robochoc.communication.network.frame_loss import TO_MASTER
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing, Opened
from robochoc.communication.network.inbox import Inbox, Item
from robochoc.communication.network.journal_server import JournalServer, Publication
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.quotas import OBSERVER_SHARE, ROBOT_SHARE, Share
from robochoc.communication.network.router import CLOSED_EARLY, Refusal, RefusalObserver, Router
from robochoc.communication.network.settings import PATIENCE_S, NetworkSettings
from robochoc.communication.network.transport import Transport

Reach = Mapping[str, tuple[str, ...]]
"""The admitted members, each with its allowed receivers besides the master."""


class ConnectionPolicy:
    """The router at `endpoint`, which admits the members in the Authority's `admission`. The opener closes it.

    `ways` are the team's receivers, if known in advance: then the router need not be restarted to allow them.
    """

    def __init__(
        self,
        admission: Admission,
        identity: Identity,
        endpoint: str,
        refused: RefusalObserver | None,
        lease_ms: int,
        ways: Reach = MappingProxyType({}),
        scratch: str = "",
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._admission = admission
        # Robots give up after their patience, so the end of the router must be detected earlier.
        self._router = Router(endpoint, identity, refused, lease_ms, scratch, patience_s / 2)
        self._ways = ways
        self._masters = (MASTER, identity.name)
        """The names that no client of the router may have."""
        self.admitted: tuple[str, ...] = ()
        """The names that may connect under the router's current rules."""
        self.sniffable = False
        """True if sniffers may receive the journal of this run."""
        self._rules: tuple[dict[str, tuple[str, ...]], tuple[str, ...] | None] | None = None

    def open(self) -> None:
        """Admit all names that the Authority has certified or invited, to write to the master and their receivers."""
        self.follow()

    def open_ways(self, ways: Reach) -> None:
        """Let robots write to their receivers in `ways`."""
        self._ways = ways
        self.follow()

    def follow(self) -> None:
        """Admit newly enrolled names, and exclude revoked names. Raises `RouterError`.

        Invited names have rules, too. No certificate for these names exists yet, and the router need not be restarted
        when it is issued.
        """
        names = partial(self._admission.names, invited=True)
        there = [name for role in Role for name in names(role) if name not in self._masters]
        admitted = {name: self._ways.get(name, ()) for name in there if not self.is_revoked(name)}
        sniffers = tuple(name for name in names(right=Right.SNIFF) if name in admitted)
        rules = admitted, sniffers if self.sniffable else None
        if rules != self._rules:
            self._rules = rules
            self.admitted = tuple(admitted)
            self._router.open(*rules)

    def may_sniff(self, name: str) -> bool:
        """Return whether this run's journal is published, and `name` has the right to receive it."""
        return self.sniffable and name in self._admission.names(right=Right.SNIFF)

    def is_revoked(self, name: str) -> bool:
        """Return whether the certificate of `name` was revoked."""
        return self._admission.is_revoked(name)

    def admits(self, name: str) -> bool:
        """Return whether `name` has a valid certificate, even if the router does not yet know it."""
        return name in self._admission.names()

    def is_robot(self, name: str) -> bool:
        """Return whether `name` is enrolled as a robot, and not only as an observer."""
        return name in self._admission.names(Role.ROBOT)

    @property
    def has_other_masters(self) -> bool:
        """True if several masters are enrolled."""
        return len(self._admission.names(Role.MASTER)) > 1

    def share_of(self, name: str) -> Share:
        """Return the quota for messages from `name` at the master."""
        return ROBOT_SHARE if self.is_robot(name) else OBSERVER_SHARE

    def revoked(self, names: Collection[str]) -> list[str]:
        """Return those of `names` whose certificates were revoked."""
        return [name for name in names if self.is_revoked(name)]

    @property
    def failure(self) -> str:
        """The reason why the router has failed; empty if it works."""
        return self._router.failure

    def close(self) -> None:
        """End the router."""
        self._router.close()


class MasterConnection:
    """The master's connection in the run `run`.

    Attributes:
        policy: The rights to connect and to write.
        framing: The master's frames.
        journal_server: Serves the run's journal to authorized sniffers.

    Args:
        run: The name of the run.
        identity: The master's certificate and key.
        admission: The admitted identities.
        endpoint: The address at which robots reach the master (`HOST:PORT`).
        ways: The allowed receivers of each robot, if they are known in advance.
        settings: The settings of the run.
        events: Receives grants and refusals.
    """

    def __init__(
        self,
        run: str,
        identity: Identity,
        admission: Admission,
        endpoint: str,
        ways: Reach,
        settings: NetworkSettings,
        events: MasterEvents,
    ) -> None:
        self._endpoint = endpoint
        self._identity = identity
        self._settings = settings
        self._events = events
        note_refusal, listen = self._note_refusal if events.observed else None, settings.listen or endpoint
        self.policy = ConnectionPolicy(
            admission, identity, listen, note_refusal, settings.lease_ms, ways, settings.scratch, settings.patience_s
        )
        self.framing = Framing(MASTER, run)
        self.journal_server = JournalServer(run, self.policy.may_sniff, events)

    def open(self) -> None:
        """Listen. Raises `RouterError` and `CannotConnectError`."""
        try:
            self.policy.open()
            inbox, lease_ms = Inbox(self.policy.share_of), self._settings.lease_ms
            senders = self.policy.admitted
            self._transport = Transport(
                self._endpoint, self._identity, name=MASTER, senders=senders, inbox=inbox, lease_ms=lease_ms
            )
            if self.journal_server.publication:
                self._transport.answer(journal_key(ALL), self.journal_server.answer)
        except BaseException:
            self.policy.close()
            raise

    def close(self) -> None:
        """End all links."""
        try:
            self._transport.close()
        finally:
            self.policy.close()

    def publish(self, publication: Publication) -> None:
        """Offer `publication`, this run's journal, to authorized sniffers. Must be called before `open`."""
        publication.run = self.framing.run
        self.journal_server.publication = publication
        self.policy.sniffable = True

    def send(self, name: str, message: ToRobot) -> None:
        """Send a control message to a robot."""
        self._transport.send(name, self.framing.write(name, message))

    def receive(self, patience_s: float) -> Item | None:
        """Return the oldest item in the inbox, or None if none arrives within `patience_s` seconds."""
        try:
            return self._transport.inbox.get(timeout=patience_s)
        except Empty:
            return None

    def read(self, sender: str, content: bytes) -> Opened | None:
        """Return the content of a frame, or None if the frame was refused. Refusals are reported."""
        try:
            opened = self.framing.read(sender, content)
        except FrameRefusedError as refused:
            self._events.refuse(sender, TO_MASTER, str(refused))
            return None
        self.framing.accept(sender, opened.number)
        return opened

    def wake(self) -> None:
        """End a wait for the inbox. May be called from any thread."""
        self._transport.wake()

    def follow_registry(self) -> None:
        """Admit newly enrolled identities, and exclude revoked ones."""
        self.policy.follow()
        self._transport.subscribe(self.policy.admitted)

    def _note_refusal(self, refusal: Refusal) -> None:
        """Report a refusal by the router, unless the identity has meanwhile been admitted and will try again."""
        if refusal.why == CLOSED_EARLY and self.policy.has_other_masters:  # robots look whether a master listens
            return
        if refusal.what != "connect" or not self.policy.admits(refusal.who):
            self._events.refuse(*refusal)
