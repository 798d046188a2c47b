"""The zenoh configuration for every process in a run, and for sessions with ROS 2.

It imports little, so that the router starts fast.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import zenoh

RX_BYTES = 32 * 2**20
"""The largest message that zenoh receives, in bytes. It exceeds the frame limit, so that larger frames are detected."""


def config(settings: Mapping[str, object], file: Path | None = None) -> zenoh.Config:
    """Return a zenoh configuration with `settings`, without discovery and without other listeners.

    Other settings come from `file`, or have zenoh's defaults.
    """
    made = zenoh.Config() if file is None else zenoh.Config.from_file(file)
    common = {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # without scouting, a router would still wait half a second for others
        "transport/link/rx/max_message_size": RX_BYTES,
        "transport/shared_memory/enabled": False,
    }
    for key, value in {**common, **settings}.items():
        made.insert_json5(key, json.dumps(value))
    return made
