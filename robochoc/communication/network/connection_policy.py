"""The connection policy: the members that may connect, and their receivers, according to the Authority's registry."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from types import MappingProxyType

from robochoc.authority.admission import Admission
from robochoc.authority.identity import Identity
from robochoc.authority.registry import Right, Role
from robochoc.communication.network.quotas import OBSERVER_SHARE, ROBOT_SHARE, Share
from robochoc.communication.network.router import RefusalObserver, Router
from robochoc.communication.network.settings import PATIENCE_S

Reach = Mapping[str, tuple[str, ...]]
"""The admitted members, each with its allowed receivers besides the master."""


class ConnectionPolicy:
    """The router at `endpoint`, with rules that follow `admission`. Its opener closes it.

    `ways` are the team's receivers, if they are known in advance: then the router need not be restarted for them.
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
        # Robots give up after their patience: the end of the router must be detected earlier.
        self._router = Router(endpoint, identity, refused, lease_ms, scratch, patience_s / 2)
        self._ways = ways
        self.admitted: tuple[str, ...] = ()
        """The names that may connect by the router's present rules."""
        self.sniffable = False
        """Whether sniffers may receive the journal of this run."""
        self._rules: tuple[dict[str, tuple[str, ...]], tuple[str, ...] | None] | None = None

    def open(self) -> None:
        """Admit all names that the Authority has certified or invited, to write to the master and their receivers."""
        self.follow()

    def open_ways(self, ways: Reach) -> None:
        """Let robots write to their receivers in `ways`."""
        self._ways = ways
        self.follow()

    def follow(self) -> None:
        """Admit newly enrolled names, and exclude revoked ones. Raises `RouterError`.

        Invited names have rules, too: nobody has a certificate in their names yet, and the router need not be restarted
        when they receive one.
        """
        names = partial(self._admission.names, invited=True)
        there = [*names(Role.ROBOT), *names(Role.OBSERVER)]
        admitted = {name: self._ways.get(name, ()) for name in there if not self.is_revoked(name)}
        sniffers = tuple(name for name in names(right=Right.SNIFF) if name in admitted)
        rules = admitted, sniffers if self.sniffable else None
        if rules != self._rules:
            self._rules = rules
            self.admitted = tuple(admitted)
            self._router.open(*rules)

    def may_sniff(self, name: str) -> bool:
        """Return whether this run's journal is public, and `name` has the right to receive it."""
        return self.sniffable and name in self._admission.names(right=Right.SNIFF)

    def is_revoked(self, name: str) -> bool:
        """Return whether the certificate of `name` was revoked."""
        return self._admission.is_revoked(name)

    def admits(self, name: str) -> bool:
        """Return whether `name` has a valid certificate, even if the router does not know it yet."""
        return name in self._admission.names()

    def is_robot(self, name: str) -> bool:
        """Return whether `name` is enrolled as a robot, and not only as an observer."""
        return name in self._admission.names(Role.ROBOT)

    def share_of(self, name: str) -> Share:
        """Return the quota of `name` at the master."""
        return ROBOT_SHARE if self.is_robot(name) else OBSERVER_SHARE

    def revoked(self, names: Collection[str]) -> list[str]:
        """Return the revoked ones of `names`."""
        return [name for name in names if self.is_revoked(name)]

    @property
    def failure(self) -> str:
        """The reason why the router has failed; empty if it works."""
        return self._router.failure

    def close(self) -> None:
        """End the router."""
        self._router.close()
