"""The runtime `network`: robots in processes on this machine, connected through a master by mutual TLS.

This is a separate module because the network is an extra: `run/runtimes.py` imports it by name on first use.
"""

from __future__ import annotations

from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.network.settings import PATIENCE_S, NetworkSettings
from robochoc.communication.session import Session
from robochoc.run.runtimes import SessionRequest


def open_network(request: SessionRequest) -> Session:
    """Open a session in which each robot is an OS process on a network."""
    options = request.options
    settings = NetworkSettings(
        filters=options.filters, survive=options.survives_losses, patience_s=options.patience or PATIENCE_S
    )
    session = LocalNetwork(request.team, request.protocol, settings=settings, **request.common)
    if request.kills:
        session.master.schedule_kills(request.kills, session.kill)
    return session
