"""The settings of a run across machines."""

from __future__ import annotations

from dataclasses import dataclass

PATIENCE_S = 10.0
"""The longest time for which a robot may be absent, in seconds."""
LEASE_MS = 10_000
"""The longest silence of a link, in milliseconds. TCP survives shorter outages by itself."""


@dataclass(frozen=True)
class NetworkSettings:
    """The settings of a run, besides the problem.

    Attributes:
        filters: The channel filters that messages go through.
        private: No robot tells its values.
        patience_s: How long a robot may be away.
        lease_ms: A link that is silent for so long counts as down.
        survive: Lost robots break the search off, and are named in its result. Otherwise `RobotsLostError` is raised.
        protocol: The protocol that the Directory Facilitator says robots use.
        listen: Where the router listens (`HOST:PORT`), if that is not where it is reached: all addresses of a machine
            are the name of none.
        scratch: A folder of this process that the router removes should it outlive the process (empty: there is none).
    """

    filters: tuple[str, ...] = ()
    private: bool = False
    patience_s: float = PATIENCE_S
    lease_ms: int = LEASE_MS
    survive: bool = False
    protocol: str = ""
    listen: str = ""
    scratch: str = ""
