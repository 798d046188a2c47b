"""Crazyflies, played in a thread of the test: they speak CRTP by UDP, one packet a datagram, as simulated ones do.

They know what cflib and robochoc rely on: the echo and the source of the link, the version of the protocol, the tables
of log variables and parameters, blocks of the log, memories, the supervisor with its arming, and the high-level
commander. A set point of low level takes over from that commander, and one without thrust lets a Crazyflie fall, as it
does in the firmware. All times of the firmware are divided by `haste`, but for the one that it gives to whoever is
armed and does not take off: that is for people, and a busy machine needs some of it. A path that is asked for again, as
the answer came late, is one path. Places are in metres, from where each was switched on.

Source: the firmware's documentation of CRTP, and its supervisor.c, planner.c and crtp_commander_high_level.c, protocol
version 12.
"""

from __future__ import annotations

import math
import selectors
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

from tests.support.limits import HANG_S, wait_until
from tests.support.ports import LOOPBACK

Place = tuple[float, float, float]
TICK_S = 0.02
PREFLIGHT_S, LANDED_S, THRUST_S = 30.0, 3.0, 2.0
"""The firmware's: armed without a flight; landed and still armed; since the last thrust."""
_NEAR_M = 0.02
_PARAM, _SETPOINT, _MEMORY, _LOG, _GENERIC_SETPOINT, _HIGH_LEVEL, _SUPERVISOR, _PLATFORM, _LINK = (
    *(2, 3, 4, 5, 7, 8, 9, 13, 15),
)
_RESET, _CREATE, _START = 5, 6, 3
_FORMATS = {1: "B", 2: "H", 4: "b", 7: "f"}
_VARIABLES = (
    *(("stateEstimate.x", 7), ("stateEstimate.y", 7), ("stateEstimate.z", 7), ("stateEstimate.yaw", 7)),
    *(("pm.vbat", 7), ("pm.batteryLevel", 1), ("supervisor.info", 2), ("radio.rssi", 1), ("pm.state", 4)),
)
BUSY = 16
_REFUSED = 1


@dataclass
class Crazyfly:
    """A Crazyflie: what it is told to be, and what has become of it. Tests read and set the fields while it lives."""

    port: int
    at: Place = (0.0, 0.0, 0.0)
    haste: float = 20.0
    battery: float = 1.0
    drain: float = 0.0
    """The charge that it uses in a second of flight."""
    arms_itself: bool = False
    version: int = 12
    refuses: set[str] = field(default_factory=set)
    """Of "arm", "takeoff", "goto", "land": commands that are denied."""
    deaf: set[str] = field(default_factory=set)
    """Of the same: commands that are obeyed, and whose first answer is lost."""
    lacks: set[str] = field(default_factory=set)
    """Log variables that its firmware does not have."""
    silent: bool = False
    """True: neither sends nor hears, as without radio."""
    missed: int = 0
    """The packets that have come while it was silent."""
    silent_above: float = math.inf
    """The height from which on it is silent, in metres."""
    gone: bool = False
    """True: nobody is at its port, as when a simulator has ended."""
    low_power: bool = False
    """Whether its power management tells a low voltage."""
    noise: list[bytes] = field(default_factory=list)
    """What it sends besides, once."""
    tumbled: bool = False
    flown_by_hand: bool = False
    """Somebody else sends it set points."""
    hand_after: str = ""
    """The entry of the log from which on it is flown by hand."""
    planner: str = "idle"
    armed: bool = False
    locked: bool = False
    log: list[str] = field(default_factory=list)
    """What has happened to it, in order."""
    paths: list[tuple[Place, float, bool]] = field(default_factory=list)
    """Where it was sent to, in how many seconds, and whether in a straight line."""

    @property
    def flies(self) -> bool:
        return self.at[2] > _NEAR_M

    @property
    def is_down(self) -> bool:
        """Return whether it has landed, as it should."""
        return (
            not self.flies
            and self.planner == "idle"
            and "fell" not in self.log
            and (self.arms_itself or not self.armed)
        )

    @property
    def is_safe(self) -> bool:
        """Return whether it is on the ground, hovers by itself, or lands."""
        return "fell" not in self.log and (self.is_down or (self.planner in {"flying", "landing"}))


def _bound(port: int) -> socket.socket:
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.bind((LOOPBACK, port))
    found.setblocking(False)
    return found


class _Played:
    """The machinery of one Crazyflie."""

    def __init__(self, vehicle: Crazyfly) -> None:
        self.vehicle = vehicle
        self.socket = _bound(vehicle.port)
        self._peer: tuple[str, int] | None = None
        self._parameters = [("hlCommander.vtoff", 6, struct.pack("<f", 0.5)), ("stabilizer.stop", 8, b"\0")]
        self._blocks: dict[int, list[int]] = {}
        self._running: dict[int, tuple[float, float]] = {}
        self._from = self._to = vehicle.at
        self._begun = self._armed_at = self._down_at = 0.0
        self._lasts = 0.001
        self._straight = False
        self._asked = b""
        self._thrust_at = -math.inf
        self._begun_at = time.monotonic()

    def come_and_go(self, selector: selectors.BaseSelector) -> None:
        """Leave the port, or take it again."""
        is_gone = self.socket.fileno() < 0
        if self.vehicle.gone and not is_gone:
            selector.unregister(self.socket)
            self.socket.close()
        elif is_gone and not self.vehicle.gone:
            self.socket = _bound(self.vehicle.port)
            selector.register(self.socket, selectors.EVENT_READ, self)

    @property
    def _variables(self) -> list[tuple[str, int]]:
        return [(name, kind) for name, kind in _VARIABLES if name not in self.vehicle.lacks]

    def hear(self) -> None:
        while True:
            try:
                content, self._peer = self.socket.recvfrom(64)
            except BlockingIOError:
                return
            except OSError:
                continue  # what was sent before has reached nobody
            if self.vehicle.silent:
                self.vehicle.missed += 1
            elif content:
                self._take(content[0] >> 4, content[0] & 3, content[1:])

    def _send(self, port: int, channel: int, content: bytes) -> None:
        if self._peer is not None and not self.vehicle.silent:
            with suppress(OSError):
                self.socket.sendto(bytes([port << 4 | 3 << 2 | channel]) + content[:30], self._peer)

    def _say(self, what: str) -> None:
        vehicle = self.vehicle
        vehicle.log.append(what)
        if what == vehicle.hand_after:
            vehicle.flown_by_hand, vehicle.planner = True, "idle"

    # Time goes by

    def live(self, now: float, passed: float) -> None:
        vehicle = self.vehicle
        if vehicle.planner in {"flying", "landing"}:
            self._move(now)
        if vehicle.flown_by_hand or (vehicle.planner != "idle" and (vehicle.flies or self._to[2] > _NEAR_M)):
            self._thrust_at = now
        elif vehicle.flies:
            self._fall()
        if vehicle.at[2] > vehicle.silent_above:
            vehicle.silent, vehicle.silent_above = True, math.inf
        if vehicle.flies:
            vehicle.battery = max(0.0, vehicle.battery - vehicle.drain * passed)
        self._supervise(now)
        while vehicle.noise and self._peer is not None:
            self.socket.sendto(vehicle.noise.pop(), self._peer)
        for block, (period, told) in [*self._running.items()]:
            if now - told >= period:
                self._running[block] = (period, now)
                stamp = round((now - self._begun_at) * 1000) & 0xFFFFFF
                head = bytes([block]) + stamp.to_bytes(3, "little")
                self._send(_LOG, 2, head + b"".join(map(self._value, self._blocks[block])))

    def _move(self, now: float) -> None:
        vehicle = self.vehicle
        part = min((now - self._begun) / self._lasts, 1.0)
        if not self._straight:
            part = part**4 * (35 - 84 * part + 70 * part**2 - 20 * part**3)
        x, y, z = (a + (b - a) * part for a, b in zip(self._from, self._to, strict=True))
        vehicle.at = (x, y, z)
        if self._is_finished(now) and vehicle.planner == "landing":
            vehicle.planner = "idle"
            self._say("landed")

    def _supervise(self, now: float) -> None:
        """Disarm as the firmware does: after a landing, and when nobody takes off."""
        vehicle = self.vehicle
        if self._is_flying(now) or not vehicle.armed or vehicle.arms_itself:
            self._down_at = now
            return
        flew = math.isfinite(self._thrust_at) and self._thrust_at > self._armed_at
        if now - self._down_at > (LANDED_S / vehicle.haste if flew else PREFLIGHT_S):
            vehicle.armed = False
            self._say("disarmed by itself")

    def _fall(self) -> None:
        vehicle = self.vehicle
        vehicle.at, vehicle.locked, vehicle.armed, vehicle.planner = (*vehicle.at[:2], 0.0), True, False, "idle"
        self._say("fell")

    def _is_finished(self, now: float) -> bool:
        return now - self._begun >= self._lasts

    def _is_flying(self, now: float) -> bool:
        return now - self._thrust_at < THRUST_S / self.vehicle.haste

    def _is_armed(self) -> bool:
        return self.vehicle.armed or self.vehicle.arms_itself

    def _can_fly(self) -> bool:
        return self._is_armed() and not self.vehicle.locked and not self.vehicle.tumbled

    def _bits(self) -> int:
        vehicle, now = self.vehicle, time.monotonic()
        fit = not vehicle.locked and not vehicle.tumbled
        return sum(
            1 << bit
            for bit, holds in enumerate(
                (
                    *(fit and not self._is_armed(), self._is_armed(), vehicle.arms_itself, self._can_fly()),
                    *(self._is_flying(now), vehicle.tumbled, vehicle.locked, False),
                    *(vehicle.planner != "idle", self._is_finished(now), False, False),
                )
            )
            if holds
        )

    def _value(self, number: int) -> bytes:
        name, kind = self._variables[number]
        values = {
            **dict(zip(("stateEstimate.x", "stateEstimate.y", "stateEstimate.z"), self.vehicle.at, strict=True)),
            "pm.batteryLevel": round(self.vehicle.battery * 100),
            "supervisor.info": self._bits(),
            "pm.state": 3 if self.vehicle.low_power else 0,
            "stateEstimate.yaw": 90.0,
        }
        return struct.pack("<" + _FORMATS[kind], values.get(name, 0))

    # What comes

    def _take(self, port: int, channel: int, content: bytes) -> None:
        obey: dict[int, Callable[[int, bytes], None]] = {
            _PARAM: self._parameter,
            _MEMORY: self._memory,
            _LOG: self._log,
            _HIGH_LEVEL: self._high_level,
            _SUPERVISOR: self._command,
            _PLATFORM: self._platform,
            _LINK: self._link,
            _SETPOINT: self._low_level,
            _GENERIC_SETPOINT: self._low_level,
        }
        if content and port in obey:
            obey[port](channel, content)

    def _link(self, channel: int, content: bytes) -> None:
        if channel == 0:
            self._send(_LINK, 0, content)
        elif channel == 1:
            self._send(_LINK, 1, b"Bitcraze Crazyflie\0")

    def _platform(self, channel: int, content: bytes) -> None:
        if channel == 1 and content[0] == 0:
            self._send(_PLATFORM, 1, struct.pack("<Bi", 0, self.vehicle.version))

    def _parameter(self, channel: int, content: bytes) -> None:
        if channel == 0:
            self._table(_PARAM, content, [(name, kind) for name, kind, _ in self._parameters])
        elif channel == 1:
            number = int.from_bytes(content[:2], "little")
            self._send(_PARAM, 1, content[:2] + b"\0" + self._parameters[number][2])

    def _memory(self, channel: int, content: bytes) -> None:
        """Tell of one memory, for paths, as others are decks'."""
        if channel == 0:
            self._send(_MEMORY, 0, b"\1\1" if content[0] == 1 else struct.pack("<BBBI8x", 2, 0, 0x12, 4096))

    def _low_level(self, _channel: int, _content: bytes) -> None:
        self.vehicle.planner = "idle"
        self._say("low-level set point")

    def _table(self, port: int, content: bytes, entries: Sequence[tuple[str, int]]) -> None:
        if content[0] == 3:
            self._send(port, 0, struct.pack("<BHIBB", 3, len(entries), 0xC0FFEE + port, 16, 128))
        elif content[0] == 2:
            name, kind = entries[int.from_bytes(content[1:3], "little")]
            self._send(port, 0, content[:3] + bytes([kind]) + name.replace(".", "\0").encode() + b"\0")

    def _log(self, channel: int, content: bytes) -> None:
        if channel == 0:
            self._table(_LOG, content, self._variables)
        elif channel == 1:
            self._settings(content[0], content[1] if len(content) > 1 else 0, content[2:])

    def _settings(self, command: int, block: int, content: bytes) -> None:
        """Obey a command for blocks of the log."""
        if command == _RESET:
            self._blocks.clear()
            self._running.clear()
        elif command == _CREATE:
            self._blocks[block] = [int.from_bytes(content[n + 1 : n + 3], "little") for n in range(0, len(content), 3)]
        elif command == _START:
            self._running[block] = (content[0] / 100, 0.0)
        self._send(_LOG, 1, bytes([command, block, 0]))

    def _command(self, channel: int, content: bytes) -> None:
        """Arm, or disarm."""
        vehicle = self.vehicle
        if channel != 1 or content[0] != 1:
            return
        on = bool(content[1])
        allowed = "arm" not in vehicle.refuses and (not on or not (vehicle.locked or vehicle.tumbled))
        if not allowed:
            self._say("refused arm")
        elif on != vehicle.armed:
            vehicle.armed = on
            self._armed_at = self._down_at = time.monotonic()
            self._say("armed" if on else "disarmed")
        self._answer("arm", _SUPERVISOR, 1, bytes([0x81, allowed, self._is_armed()]))

    def _answer(self, what: str, port: int, channel: int, content: bytes) -> None:
        if what in self.vehicle.deaf:
            self.vehicle.deaf.discard(what)
        else:
            self._send(port, channel, content)

    def _high_level(self, _channel: int, content: bytes) -> None:
        commands: dict[int, tuple[str, Callable[[bytes], int]]] = {
            3: ("stop", self._stop),
            7: ("takeoff", self._take_off),
            8: ("land", self._land),
            12: ("goto", self._go_to),
        }
        what, obey = commands[content[0]]
        if what in self.vehicle.refuses:
            self._say(f"refused {what}")
            result = _REFUSED
        elif what != "stop" and not self._can_fly():
            result = BUSY
        elif what == "goto" and content == self._asked and self.vehicle.planner == "flying":
            result = 0
        else:
            result = obey(content[2:])
            self._asked = content
        self._answer(what, _HIGH_LEVEL, 0, content[:3] + bytes([result]))

    def _stop(self, _content: bytes) -> int:
        self.vehicle.planner = "idle"
        self._say("stop")
        return 0

    def _take_off(self, content: bytes) -> int:
        if self.vehicle.planner != "idle":
            return _REFUSED
        height, _, own_yaw, lasts = struct.unpack("<ff?f", content)
        assert own_yaw
        self._path((*self.vehicle.at[:2], height), lasts, "flying", "takeoff", straight=False)
        return 0

    def _land(self, content: bytes) -> int:
        if self.vehicle.planner == "landing":
            return _REFUSED
        height, _, own_yaw, lasts = struct.unpack("<ff?f", content)
        assert own_yaw
        self._path((*self.vehicle.at[:2], height), lasts, "landing", "land", straight=False)
        return 0

    def _go_to(self, content: bytes) -> int:
        relative, straight, x, y, z, yaw, lasts = struct.unpack("<BBfffff", content)
        if relative:
            x, y, z = (a + b for a, b in zip(self.vehicle.at, (x, y, z), strict=True))
        else:
            assert math.isclose(yaw, math.pi / 2, rel_tol=1e-6)  # it keeps its heading
        what = "hold" if relative else f"goto {x:g},{y:g},{z:g}"
        self._path((x, y, z), lasts, "flying", what, straight=bool(straight))
        return 0

    def _path(self, to: Place, lasts: float, planner: str, what: str, *, straight: bool) -> None:
        vehicle = self.vehicle
        self._from, self._to, self._begun, self._straight = vehicle.at, to, time.monotonic(), straight
        self._lasts = lasts / vehicle.haste
        vehicle.planner = planner
        vehicle.paths.append((to, lasts, straight))
        self._say(what)


class Crazyflies:
    """Plays `vehicles` while it is a context."""

    def __init__(self, vehicles: Sequence[Crazyfly]) -> None:
        self.vehicles = vehicles
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._play, name="played Crazyflies")

    def __enter__(self) -> Self:
        self._played = [_Played(vehicle) for vehicle in self.vehicles]
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(HANG_S)
        for played in self._played:
            played.socket.close()

    def __iter__(self) -> Iterator[Crazyfly]:
        return iter(self.vehicles)

    def __getitem__(self, number: int) -> Crazyfly:
        return self.vehicles[number]

    def wait_until_safe(self) -> None:
        """Wait until each is on the ground, hovers by itself, or lands."""
        wait_until(lambda: all(vehicle.is_safe for vehicle in self.vehicles), self.state)

    def wait_until_landed(self) -> None:
        wait_until(lambda: all(vehicle.is_down for vehicle in self.vehicles), self.state)

    def state(self) -> str:
        """Return in words where all are."""
        return "; ".join(f"{one.planner} armed={one.armed} at {one.at}: {one.log}" for one in self.vehicles)

    def _play(self) -> None:
        with selectors.DefaultSelector() as selector:
            for played in self._played:
                selector.register(played.socket, selectors.EVENT_READ, played)
            before = time.monotonic()
            while not self._over.is_set():
                for key, _ in selector.select(TICK_S):
                    key.data.hear()
                now = time.monotonic()
                if now - before >= TICK_S:
                    passed, before = now - before, now
                    for played in self._played:
                        played.live(now, passed)
                        played.come_and_go(selector)
