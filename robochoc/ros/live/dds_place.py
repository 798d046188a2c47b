"""Places in DDS: `dds:DOMAIN?OPTION=VALUE&...`. Options set the quality of service, as in ROS 2."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace
from urllib.parse import parse_qsl

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.ros.live.ros2_names import DOMAIN_MAX, domain_id
from robochoc.ros.live.transport import ErrorClass
from robochoc.system.lazy_dataclass import dataclass

DEPTHS = range(1, 1001)
WAIT_S_MAX = 600.0
PARTITIONS_MAX = 16
_NAME_MAX = 255
_NUMBER = re.compile(r"\d{1,4}", re.ASCII)
_WORDS = {
    "reliability": {"reliable": True, "best_effort": False},
    "durability": {"transient_local": True, "volatile": False},
}


@dataclass(frozen=True)
class Quality:
    """The part of the quality of service that a place can set."""

    reliable: bool
    """False: lost messages are not resent, and subscribers that require reliable messages receive none."""
    latched: bool
    """True: transient local. Later subscribers receive the last messages."""
    depth: int
    """The number of messages stored per topic, for later subscribers or until they are read."""
    wait_s: float = 0.0
    """The longest wait for the first subscriber of each waypoint's topic, in seconds."""
    partitions: tuple[str, ...] = ()


@dataclass(frozen=True)
class DdsPlace:
    """A domain, and the quality of service in this domain."""

    domain: int
    quality: Quality

    @classmethod
    def parse(cls, place: str, default: Quality, options: Collection[str], failed: ErrorClass) -> DdsPlace:
        """Parse `place`, in which only `options` may be given; others have their `default`. Raises `failed`.

        >>> from robochoc.robots.sink import SinkError
        >>> default = Quality(reliable=True, latched=True, depth=1)
        >>> DdsPlace.parse("5?partition=hall&depth=3", default, ("partition", "depth"), SinkError)
        DdsPlace(domain=5, quality=Quality(reliable=True, latched=True, depth=3, wait_s=0.0, partitions=('hall',)))
        """
        number, _, rest = place.partition("?")
        try:
            domain = _domain(number) if number else domain_id(failed)
            quality = default
            for name, value in _pairs(rest):
                if name not in options:
                    raise _wrong(f"{name!r} is not an option of DDS", f"known options: {', '.join(options)}")
                quality = _with(quality, name, value)
        except ValueError as error:
            raise failed(str(error)) from error
        return cls(domain, quality)


def _domain(number: str) -> int:
    if _NUMBER.fullmatch(number) and int(number) <= DOMAIN_MAX:
        return int(number)
    raise _wrong(f"{number!r} is not a DDS domain", f"expected a number from 0 to {DOMAIN_MAX}, as in dds:0")


def _pairs(rest: str) -> list[tuple[str, str]]:
    if not rest:
        return []
    try:
        return parse_qsl(rest, keep_blank_values=True, strict_parsing=True, errors="strict", max_num_fields=50)
    except ValueError:
        raise _wrong(f"the options {rest!r} cannot be read", "expected OPTION=VALUE&OPTION=VALUE") from None


def _with(quality: Quality, name: str, value: str) -> Quality:
    """Return `quality` with an option changed. Raises `ValueError`."""
    if name == "partition":
        return replace(quality, partitions=_partitions(quality, value))
    if name == "depth":
        if not _NUMBER.fullmatch(value) or int(value) not in DEPTHS:
            raise _wrong(f"depth={value} is not valid", f"expected a number from 1 to {DEPTHS[-1]:,}")
        return replace(quality, depth=int(value))
    if name == "wait":
        return replace(quality, wait_s=_seconds(value))
    words = _WORDS[name]
    if value not in words:
        raise _wrong(f"{name}={value} is not valid", f"expected {' or '.join(words)}")
    chosen = words[value]
    return replace(quality, reliable=chosen) if name == "reliability" else replace(quality, latched=chosen)


def _partitions(quality: Quality, value: str) -> tuple[str, ...]:
    if not value.isascii() or not value.isprintable() or not 0 < len(value) <= _NAME_MAX:
        raise _wrong(f"partition={value} is not a valid name", f"expected 1 to {_NAME_MAX} characters of ASCII")
    if len(quality.partitions) >= PARTITIONS_MAX:
        raise ValueError(f"at most {PARTITIONS_MAX} partitions are allowed")
    return (*quality.partitions, value)


def _seconds(value: str) -> float:
    try:
        found = float(value)
    except ValueError:
        found = -1.0
    if not 0 <= found <= WAIT_S_MAX:
        raise _wrong(f"wait={value} is not a valid time", f"expected seconds from 0 to {WAIT_S_MAX:g}")
    return found


def _wrong(problem: str, wanted: str) -> ValueError:
    return ValueError(f"{shortened(on_one_line(problem))}; {wanted}")
