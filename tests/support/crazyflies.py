"""Crazyflies, played in a thread of the test: they speak CRTP by UDP, one packet a datagram, as simulated ones do.

They know what cflib and robochoc rely on: the echo and the source of the link, the version of the protocol, the tables
of log variables and parameters, blocks of the log, memories, and what `crazyflie_firmware.py` does when it is told. A
path that is asked for again, as the answer came late, is one path.

Source: the firmware's documentation of CRTP, protocol version 12.
"""

from __future__ import annotations

import math
import selectors
import socket
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from tests.support.crazyflie_firmware import REFUSED, Crazyfly, Firmware
from tests.support.played_fleet import PlayedFleet
from tests.support.ports import LOOPBACK

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


def _bound(port: int) -> socket.socket:
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.bind((LOOPBACK, port))
    found.setblocking(False)
    return found


class _Played:
    """The machinery of one Crazyflie."""

    def __init__(self, vehicle: Crazyfly) -> None:
        self.vehicle = vehicle
        self._firmware = Firmware(vehicle)
        self.socket = _bound(vehicle.port)
        self._peer: tuple[str, int] | None = None
        self._parameters = [("hlCommander.vtoff", 6, struct.pack("<f", 0.5)), ("stabilizer.stop", 8, b"\0")]
        self._blocks: dict[int, list[int]] = {}
        self._running: dict[int, tuple[float, float]] = {}
        self._asked = b""
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

    # Time goes by

    def live(self, now: float, passed: float) -> None:
        vehicle = self.vehicle
        self._firmware.live(now, passed)
        if vehicle.at[2] > vehicle.silent_above:
            vehicle.silent, vehicle.silent_above = True, math.inf
        while vehicle.noise and self._peer is not None:
            self.socket.sendto(vehicle.noise.pop(), self._peer)
        for block, (period, told) in [*self._running.items()]:
            if now - told >= period:
                self._running[block] = (period, now)
                stamp = round((now - self._begun_at) * 1000) & 0xFFFFFF
                head = bytes([block]) + stamp.to_bytes(3, "little")
                self._send(_LOG, 2, head + b"".join(map(self._value, self._blocks[block])))

    def _value(self, number: int) -> bytes:
        name, kind = self._variables[number]
        values = {
            **dict(zip(("stateEstimate.x", "stateEstimate.y", "stateEstimate.z"), self.vehicle.at, strict=True)),
            "pm.batteryLevel": round(self.vehicle.battery * 100),
            "supervisor.info": self._firmware.bits(),
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
        self._firmware.stop_planner("low-level set point")

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
        if channel != 1 or content[0] != 1:
            return
        allowed = self._firmware.arm(on=bool(content[1]))
        self._answer("arm", _SUPERVISOR, 1, bytes([0x81, allowed, self._firmware.is_armed]))

    def _answer(self, what: str, port: int, channel: int, content: bytes) -> None:
        if what in self.vehicle.deaf:
            self.vehicle.deaf.discard(what)
        else:
            self._send(port, channel, content)

    def _high_level(self, _channel: int, content: bytes) -> None:
        commands: dict[int, tuple[str, Callable[[bytes], int]]] = {
            3: ("stop", self._firmware.stop),
            7: ("takeoff", self._firmware.take_off),
            8: ("land", self._firmware.land),
            12: ("goto", self._firmware.go_to),
        }
        what, obey = commands[content[0]]
        if what in self.vehicle.refuses:
            self._firmware.say(f"refused {what}")
            result = REFUSED
        elif what != "stop" and not self._firmware.can_fly:
            result = BUSY
        elif what == "goto" and content == self._asked and self.vehicle.planner == "flying":
            result = 0
        else:
            result = obey(content[2:])
            self._asked = content
        self._answer(what, _HIGH_LEVEL, 0, content[:3] + bytes([result]))


class Crazyflies(PlayedFleet[Crazyfly]):
    """Plays Crazyflies while it is a context."""

    def __init__(self, vehicles: Sequence[Crazyfly]) -> None:
        super().__init__(vehicles, lambda vehicle, _: _Played(vehicle))
