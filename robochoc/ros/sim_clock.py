"""The clock of a simulation, as it comes on `/clock` (`--use-sim-time`)."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.robots.source import ReceivedMessage

CLOCK = "/clock"
CLOCK_KIND = "rosgraph_msgs/Clock"
_BILLION = 1_000_000_000
_SECONDS = range(1 << 31)


class SimClock:
    """The time of a simulation: the last one that came on `/clock`."""

    now_ns: int | None = None
    """In nanoseconds; None before the first message."""

    def takes(self, received: ReceivedMessage) -> bool:
        """Return whether `received` came on `/clock`. What it says is the time now, unless it is no time."""
        if received.topic != CLOCK:
            return False
        found = _nanoseconds(received.fields.get("clock"))
        self.now_ns = self.now_ns if found is None else found
        return True


def _nanoseconds(value: object) -> int | None:
    """Return a time in nanoseconds; None for what is none. A rosbridge sends seconds and nanoseconds apart."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value if value // _BILLION in _SECONDS else None
    match value:
        case {"secs": int(seconds), "nsecs": int(rest)} | {"sec": int(seconds), "nanosec": int(rest)} if (
            seconds in _SECONDS and 0 <= rest < _BILLION
        ):
            return seconds * _BILLION + rest
        case _:
            return None


def with_clock(topics: Mapping[str, str]) -> dict[str, str]:
    """Return `topics` and that of the clock."""
    return {**topics, CLOCK: CLOCK_KIND}
