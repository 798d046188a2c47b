"""What vehicles send: frames of MAVLink with right checksums and any values, and damaged ones, over UDP."""

from __future__ import annotations

import json
import math
import os
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from typing import Any

from tests.fuzz.harness import Target
from tests.fuzz.mutations import one_of, spoilt_bytes, spoilt_json

TRIES, PAUSE_S = 100, 0.005
"""The number of looks for telemetry, and the pause between two of them."""
FRAMES: Sequence[tuple[str, list[Any]]] = (
    ("heartbeat", [2, 12, 0x81, 0, 4]),
    ("local_position_ned", [1, 1.0, 2.0, -3.0, 0, 0, 0]),
    ("global_position_int", [1, 473977420, 85455940, 488000, 3000, 0, 0, 0, 0]),
    ("sys_status", [0, 0, 0, 0, 12000, 10, 80, 0, 0, 0, 0, 0, 0]),
    ("battery_status", [0, 0, 0, 0, [12000] + [65535] * 9, 0, -1, -1, 80]),
    ("extended_sys_state", [0, 2]),
    ("gps_raw_int", [1000, 3, 473977420, 85455940, 488000, 100, 100, 0, 0, 10]),
)


class _Bytes:
    """Collects the frames that pymavlink writes."""

    def __init__(self) -> None:
        self.content = b""

    def write(self, frame: bytes) -> None:
        self.content += frame


def frames() -> Sequence[bytes]:
    """Flights: messages as JSON. NaN is one of the values that vehicles send."""
    lost = [("local_position_ned", [1, math.nan, math.inf, -3.0e38, 0, 0, 0])]
    return [json.dumps(one).encode() for one in (FRAMES, [*FRAMES, *lost], FRAMES[:1])]


def _as_frames(content: bytes) -> list[bytes]:
    """Return the messages in a flight as frames; any other content is one damaged frame."""
    from pymavlink.dialects.v20 import common  # noqa: PLC0415 - only here

    try:
        flight = json.loads(content)
    except (ValueError, RecursionError):
        flight = []
    if not isinstance(flight, list) or not flight:
        return [content]
    made = []
    for one in flight:
        written = _Bytes()
        writer = common.MAVLink(written, srcSystem=1, srcComponent=1)
        with suppress(Exception):  # some values do not fit a frame
            name, values = one
            getattr(writer, f"{name}_send")(*values)
            made.append(written.content)
    return made


@contextmanager
def _silenced() -> Iterator[None]:
    """Discard what MAVSDK prints."""
    before = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - a device
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(before, 1)
        os.close(before)


def check_frames(content: bytes) -> bool:
    """Telemetry is finite, whatever a vehicle sends."""
    from robochoc.vehicles.fleet import VehicleLink  # noqa: PLC0415 - mavsdk is an extra
    from robochoc.vehicles.mavsdk_autopilot import MavsdkAutopilot  # noqa: PLC0415 - the same

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    autopilot = MavsdkAutopilot(VehicleLink(f"udpin://127.0.0.1:{port}"), None)
    with _silenced(), closing(autopilot), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        sent, is_connected = _as_frames(content), False
        for _ in range(TRIES if any(frame[:1] == b"\xfd" for frame in sent) else 1):
            is_connected = autopilot.connect()
            for frame in sent:
                vehicle.sendto(frame[:60_000], ("127.0.0.1", port))
            telemetry = autopilot.telemetry()
            assert telemetry.place is None or all(map(math.isfinite, telemetry.place)), telemetry
            assert telemetry.battery is None or math.isfinite(telemetry.battery), telemetry
            if is_connected and telemetry.place:
                break
            time.sleep(PAUSE_S)
    return is_connected


TARGETS = (Target("mavlink", frames, one_of(spoilt_json, spoilt_json, spoilt_json, spoilt_bytes), check_frames),)
