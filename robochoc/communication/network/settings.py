"""The settings of a run across machines."""

from __future__ import annotations

from robochoc.system.lazy_dataclass import dataclass

PATIENCE_S = 10.0
"""The longest time for which a robot may be absent, in seconds."""
LEASE_MS = 10_000
"""The longest silence on a link, in milliseconds. TCP survives shorter outages by itself."""


@dataclass(frozen=True)
class NetworkSettings:
    """The settings of a run across machines, besides the problem.

    Attributes:
        filters: The channel filters for messages.
        private: True if robots do not disclose their values.
        patience_s: The seconds for which a robot may be absent.
        lease_ms: The milliseconds of silence after which a link counts as down.
        survive: True if the loss of robots only ends the search, whose result names them. Otherwise it raises
            `RobotsLostError`.
        protocol: The protocol in the robots' entries in the Directory Facilitator.
        listen: The address on which the router listens (`HOST:PORT`), if it differs from the address at which the
            robots reach the router. For example, it may mean all addresses of a machine.
        scratch: A folder of this process that the router removes if the router outlives this process (empty: no
            folder).
    """

    filters: tuple[str, ...] = ()
    private: bool = False
    patience_s: float = PATIENCE_S
    lease_ms: int = LEASE_MS
    survive: bool = False
    protocol: str = ""
    listen: str = ""
    scratch: str = ""
