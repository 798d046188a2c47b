"""Channel models: the time that a message needs by radio.

A message is divided into frames. Each frame needs time on the air according to its size, and may be lost and sent
again. The remaining time is latency: queues, access to the medium, relays. The loss of a frame only delays a message:
every message arrives, and no message overtakes another one in the same channel, as protocols require. Whole messages
are lost only by `message_loss` and the models in `loss_models.py`. Sources of the numbers: docs/guides/channels.md.
"""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import NamedTuple

import msgspec

from robochoc.communication.simulator.loss_models import (
    Bursts,
    NamedLink,
    PathLoss,
    Point,
    either,
    loss_by_table,
    refuse_beyond,
    refuse_positions,
    refuse_table,
)
from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, MistakeError, invalid_input, shortened
from robochoc.formats.toml import convert, toml_tables

LARGEST_FILE = 2**16
"""The largest size of a channel file, in bytes."""
NS_PER_MS, NS_PER_US, NS_PER_S = 10**6, 10**3, 10**9

_MOST_MS = 60_000
_RANGES = {
    "latency_ms": (0, _MOST_MS),
    "minimum_ms": (0, _MOST_MS),
    "sigma": (0, 3),
    "bandwidth_bps": (1, 10**12),
    "payload_bytes": (8, 65_535),
    "overhead_bytes": (0, 65_535),
    "frame_us": (0, 10**6),
    "loss": (0, 0.9),
    "message_loss": (0, 0.9),
    "timeout_ms": (0, _MOST_MS),
    "backoff": (1, 10),
    "longest_timeout_ms": (0, _MOST_MS),
    "check_ns": (0, NS_PER_S),
    "unit_m": (0.001, 10**6),
}
"""The accepted range of each value. Values outside are certainly mistakes, and might prevent the run from ending."""
_NAME = re.compile(r"[\w.+-]{1,40}")


class Crossing(NamedTuple):
    """The times that a message needs, in nanoseconds.

    `air`: the time on the air of all its frames, including retransmissions; `waiting`: the time until losses of frames
    were detected; `latency`: the remaining time.
    """

    air: int
    waiting: int
    latency: int


class ChannelModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A model of the channel between any two robots. All random numbers come from the caller's generator.

    `latency_ms` is the median of a log-normal distribution that begins at `minimum_ms` and has the shape `sigma` (the
    jitter). It is never negative, skewed, with a long tail, and two percentiles of a measurement are enough to fit it.
    A frame carries up to `payload_bytes` of the message and `overhead_bytes` of headers, at `bandwidth_bps` bits a
    second (None: bytes take no time), and needs `frame_us` in addition (preamble, spaces between frames,
    acknowledgement). Each transmission of a frame is lost with the probability `loss`. The frame is sent again after
    `timeout_ms`, which is multiplied by `backoff` each time up to `longest_timeout_ms`. If the medium is `shared`, only
    one robot is on the air at a time; otherwise each robot sends one message at a time, independently of the others.
    `check_ns` is the time for one constraint check, in nanoseconds.

    With the probability `message_loss` a message is permanently lost: it is not sent again. In addition, messages are
    lost depending on the distance between sender and receiver, in units of `unit_m` metres: by `path_loss`, or by
    `distance_loss`, pairs of a distance in metres and a probability. `positions` are the positions of robots. Messages
    are also lost in `bursts`. `links` are links with their own probabilities. Raises `ValueError` for invalid values.
    """

    name: str
    latency_ms: float
    minimum_ms: float = 0.0
    sigma: float = 0.0
    bandwidth_bps: float | None = None
    payload_bytes: int = 1448
    overhead_bytes: int = 0
    frame_us: float = 0.0
    loss: float = 0.0
    timeout_ms: float = 200.0
    backoff: float = 2.0
    longest_timeout_ms: float = 60_000.0
    shared: bool = False
    check_ns: int = 1000
    message_loss: float = 0.0
    path_loss: PathLoss | None = None
    distance_loss: tuple[tuple[float, float], ...] = ()
    unit_m: float = 1.0
    positions: dict[str, Point] = {}
    bursts: Bursts | None = None
    links: tuple[NamedLink, ...] = ()

    def __post_init__(self) -> None:
        """Refuse values out of range, values that are not numbers, and fields that contradict each other."""
        if not _NAME.fullmatch(self.name):
            raise ValueError("name: expected up to 40 letters, digits and '.+-_'; write a line such as name = \"mesh\"")
        for field, (least, most) in _RANGES.items():
            value = getattr(self, field)
            if value is not None:
                refuse_beyond(field, value, least, most)
        if self.minimum_ms > self.latency_ms:
            raise ValueError(f"minimum_ms: expected at most latency_ms, the median, which is {self.latency_ms:g}")
        if self.longest_timeout_ms < self.timeout_ms:
            raise ValueError(f"longest_timeout_ms: expected at least timeout_ms, which is {self.timeout_ms:g}")
        refuse_table(self.distance_loss)
        refuse_positions(self.positions)
        if self.path_loss and self.distance_loss:
            raise ValueError("distance_loss: cannot be combined with path_loss; remove one of them")
        if self.positions and not self.by_distance:
            raise ValueError("positions: requires path_loss or distance_loss; add one of them")

    @property
    def by_distance(self) -> bool:
        """True if message loss depends on the distance between sender and receiver."""
        return self.path_loss is not None or bool(self.distance_loss)

    def loss_at(self, distance: float) -> float:
        """Return the probability that a message is lost because of this distance, which is in units of coordinates."""
        if self.path_loss is not None:
            return self.path_loss.loss_at(distance * self.unit_m)
        return loss_by_table(self.distance_loss, distance * self.unit_m) if self.distance_loss else 0.0

    @property
    def most_loss(self) -> float:
        """The largest long-run probability in any link that a message is permanently lost."""
        far = 1.0 if self.path_loss else max([loss for _, loss in self.distance_loss], default=0.0)
        usual = either(either(self.message_loss, far), self.bursts.mean if self.bursts else 0.0)
        return max([usual, *[link.loss for link in self.links]])

    def crossing(self, size: int, chance: Random) -> Crossing:
        """Draw the times of a message of `size` bytes. Even an empty message has one frame."""
        whole, rest = divmod(size, self.payload_bytes)
        full, last = self._air(self.payload_bytes), self._air(rest)
        frames = whole + 1 if rest or not whole else whole
        air = whole * full + (frames - whole) * last
        waiting = 0
        for number in range(frames if self.loss else 0):
            timeout_ms = self.timeout_ms
            while chance.random() < self.loss:
                air += full if number < whole else last
                waiting += round(timeout_ms * NS_PER_MS)
                timeout_ms = min(timeout_ms * self.backoff, self.longest_timeout_ms)
        return Crossing(air, waiting, self._latency(chance))

    def _air(self, payload: int) -> int:
        bits = 8 * (payload + self.overhead_bytes)
        bytes_ns = 0 if self.bandwidth_bps is None else math.ceil(bits * NS_PER_S / self.bandwidth_bps)
        return bytes_ns + round(self.frame_us * NS_PER_US)

    def _latency(self, chance: Random) -> int:
        """Draw from the log-normal distribution, exactly once, so that other fields do not shift later draws."""
        minimum = round(self.minimum_ms * NS_PER_MS)
        median = round(self.latency_ms * NS_PER_MS) - minimum
        return minimum + round(median * chance.lognormvariate(0, self.sigma))


_SHIPPED = (
    # 802.11, OFDM at 24 Mbit/s, over an access point: each message is on the air twice, so half of the rate is left.
    # Latency: measured, median 3 ms, 90th percentile 20 ms (Sui et al. 2016), including the link's own retries. TCP
    # repairs the remaining losses: its timeout begins at 200 ms (Linux) and doubles up to 60 s (RFC 6298).
    ChannelModel(
        name="wlan", latency_ms=3, minimum_ms=0.1, sigma=1.5, bandwidth_bps=12e6, payload_bytes=1448,
        overhead_bytes=90, frame_us=196, loss=0.001, timeout_ms=200, shared=True,
    ),
    # 802.15.4 at 2.4 GHz, no beacons, from robot to robot, 6LoWPAN and UDP. All but the loss follows the standard.
    ChannelModel(
        name="wpan", latency_ms=1.44, minimum_ms=0.32, sigma=0.5, bandwidth_bps=250e3, payload_bytes=105,
        overhead_bytes=28, frame_us=1184, loss=0.1, timeout_ms=2, longest_timeout_ms=10, shared=True,
    ),
    # 802.16, 3.5 MHz, TDD, 16-QAM 1/2, frames of 5 ms, over a base station: request, grant, transmission, relay.
    ChannelModel(
        name="wman", latency_ms=20, minimum_ms=10, sigma=0.4, bandwidth_bps=2.67e6, payload_bytes=1448,
        overhead_bytes=62, loss=0.001, timeout_ms=200, shared=True,
    ),
    # LTE over a public network, to a robot in the same one; the uplink is the robot's own (Huang et al. 2012).
    ChannelModel(
        name="wwan", latency_ms=50, minimum_ms=20, sigma=0.5, bandwidth_bps=6e6, payload_bytes=1448,
        overhead_bytes=58, loss=0.001, timeout_ms=200,
    ),
)  # fmt: skip
CHANNELS = MappingProxyType({model.name: model for model in _SHIPPED})
"""The channel models included in robochoc, by name."""


_HINT = "the page Channels of the documentation shows all fields"


def read_channel(path: Path) -> ChannelModel:
    """Return the model in the TOML file at `path`. Its default name is the stem of the path.

    Raises `InvalidInputError`.
    """
    text = _text(path)
    try:
        fields = toml_tables(text)
    except ValueError as wrong:  # including numbers with too many digits
        raise _invalid(path, f"is not a valid TOML file: {shortened(str(wrong))}") from None
    fields.setdefault("name", path.stem)
    if fields["name"] in (*CHANNELS,):
        raise _invalid(path, f"name: {fields['name']} is the name of a shipped model", "use another name")
    try:
        return convert(fields, ChannelModel, text, _HINT)
    except MistakeError as wrong:
        raise invalid_input(os.fspath(path), wrong.message, wrong.hint, wrong.line) from None


def _text(path: Path) -> str:
    if not path.is_file():
        raise _invalid(path, "is not a file", f"give a file, or one of: {', '.join(CHANNELS)}")
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise _invalid(path, f"cannot be read: {error.strerror}", "check its permissions") from None
    if len(content) > LARGEST_FILE:
        raise _invalid(path, f"is too large for a channel's file, which has up to {LARGEST_FILE:,} bytes")
    try:
        return content.decode()
    except UnicodeDecodeError:
        raise _invalid(path, "is not UTF-8", "save it as TOML in UTF-8") from None


def _invalid(path: Path, message: str, hint: str = _HINT) -> InvalidInputError:
    return InvalidInputError([Diagnostic(os.fspath(path), 0, message, hint)])
