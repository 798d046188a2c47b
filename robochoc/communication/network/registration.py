"""A robot's registration with the master: it is repeated until the master answers, and after each outage."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable

from robochoc.communication.network.control_messages import Welcome
from robochoc.communication.network.transport import Transport
from robochoc.system.errors import RobochocError

REGISTER_AGAIN_S = 1.0
_INCARNATION_BYTES = 8


class RunOverError(RobochocError):
    """The run is over for this robot; `failed`: it could not be completed."""

    def __init__(self, why: str, *, failed: bool) -> None:
        super().__init__(why)
        self.why = why
        self.failed = failed


class Registration:
    """The registration of the robot `name`.

    Attributes:
        incarnation: The name of this process of the robot; a restarted robot has another one.
        welcome: The master's answer; None before it arrives.

    Args:
        name: The robot's name.
        transport: Its connection to the router.
        patience_s: Seconds for which the master may be absent or silent.
        register: Sends a registration for an incarnation.
    """

    def __init__(self, name: str, transport: Transport, patience_s: float, register: Callable[[str], None]) -> None:
        self.incarnation = secrets.token_hex(_INCARNATION_BYTES)
        self.welcome: Welcome | None = None
        self._name = name
        self._transport = transport
        self._patience_s = patience_s
        self._register = register
        self._registered_at = 0.0
        self._unanswered_since: float | None = None
        self._connected_at = time.monotonic()
        self._router = transport.router

    def send(self) -> None:
        """Register with the master, for the first time or again."""
        self._registered_at = time.monotonic()
        if self._unanswered_since is None:
            self._unanswered_since = self._registered_at
        self._register(self.incarnation)

    def accept(self, welcome: Welcome) -> bool:
        """Note the master's answer; return whether it is the first one.

        Raises `RunOverError` if the answer comes from another run.
        """
        self._unanswered_since = None
        if self.welcome is None:
            self.welcome = welcome
            return True
        if welcome.run != self.welcome.run:
            raise RunOverError("the master was restarted: restart this robot as well", failed=True)
        return False

    def check_link(self) -> None:
        """Register again if necessary: after a restart of the router, and while no answer arrives.

        Raises `RunOverError` if the master is absent or silent for longer than the patience.
        """
        now = time.monotonic()
        router = self._transport.router
        if router:
            self._connected_at = now
            if router != self._router:
                self._router = router
                self.send()
        elif now - self._connected_at > self._patience_s:
            raise RunOverError(f"the master is gone: no link to it for {self._patience_s:g} s", failed=True)
        if self._unanswered_since is None:
            return
        if now - self._unanswered_since > max(self._patience_s, 2 * REGISTER_AGAIN_S):
            why = f"the master does not answer {self._name}: is it enrolled there, and not revoked?"
            raise RunOverError(why, failed=True)
        if now - self._registered_at >= REGISTER_AGAIN_S:
            self.send()
