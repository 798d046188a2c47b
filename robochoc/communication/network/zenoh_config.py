"""The zenoh configuration of every process of a run. It imports little, so that the router starts fast."""

from __future__ import annotations

import json
from collections.abc import Mapping

import zenoh

RX_BYTES = 32 * 2**20
"""The largest message that zenoh receives. It exceeds a frame's limit, so that too large a frame causes an error."""


def config(settings: Mapping[str, object]) -> zenoh.Config:
    """Return a configuration of zenoh with `settings`, and without discovery or other listeners."""
    made = zenoh.Config()
    common = {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # a router that may not look for others would still wait half a second for them
        "transport/link/rx/max_message_size": RX_BYTES,
        "transport/shared_memory/enabled": False,
    }
    for key, value in {**common, **settings}.items():
        made.insert_json5(key, json.dumps(value))
    return made
