"""What every process of a run tells zenoh. Imports little, as the router's process starts with it, and fast."""

from __future__ import annotations

import json
from collections.abc import Mapping

import zenoh

RX_BYTES = 32 * 2**20
"""What zenoh takes from the network at once: more than a frame, so that one that is too large is refused aloud."""


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
