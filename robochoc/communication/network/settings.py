"""Under which conditions a run across machines takes place."""

from __future__ import annotations

from dataclasses import dataclass

PATIENCE_S = 10.0
"""How long a robot may be away."""
LEASE_MS = 10_000
"""How long a link may be silent. TCP survives shorter outages by itself."""


@dataclass(frozen=True)
class NetworkSettings:
    """What the master is told besides the problem.

    `filters` are the channel filters that messages go through. In a `private` run nobody tells its values. A robot may
    be away for `patience_s`; a link that is silent for `lease_ms` counts as down. With `survive`, robots that are
    lost break the search off, and are told of in its result; otherwise `RobotsLostError` is raised. `protocol` is what
    the Directory Facilitator says that robots speak. `listen` is where the router listens (`HOST:PORT`), if that is not
    where it is reached: all addresses of a machine are the name of none. `scratch` is a folder of this process that the
    router removes should it outlive the process (empty: there is none).
    """

    filters: tuple[str, ...] = ()
    private: bool = False
    patience_s: float = PATIENCE_S
    lease_ms: int = LEASE_MS
    survive: bool = False
    protocol: str = ""
    listen: str = ""
    scratch: str = ""
