"""Crazyflies, by Bitcraze's library. This module alone knows cflib (0.1), and CRTP, the protocol of Crazyflies.

The firmware's high-level commander flies: it plans a path to where it is sent, flies it by itself, and hovers there.
Its answers to commands, which cflib does not read, say whether it has taken them up. What the firmware tells comes in
one block of its log, ten times a second. Cflib's way to close a link is not taken: it sends a set point without thrust
first, by which a Crazyflie in the air falls.

Source: the firmware's crtp_commander_high_level.c, crtp_supervisor.c, supervisor.c and planner.c, protocol version 12.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crtp.crtpstack import CRTPPort

from robochoc.flight.layout import Point
from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.vehicles.autopilot import Autopilot, RefusedError, Telemetry
from robochoc.vehicles.fleet import Link
from robochoc.vehicles.supervisor import Supervisor

PROTOCOL = 12
"""The oldest version of the protocol in which the supervisor answers to arming."""
PEAK = 35 / 16
"""The highest speed of a path of the seventh degree that begins and ends at rest, in mean speeds of it."""
LAND_MS = 0.5
"""The highest speed of a landing, in metres a second."""
_SHORTEST_S = 0.5
_PERIOD_MS = 100
_TRIES, _ANSWER_S = 3, 0.5
_JOIN_S = 3.0
SPIN_UP_S = 4.0
"""Motors that have to be armed may take so long to spin up, in seconds; the firmware gives them 2."""
SETTLED_S = 0.3
"""The longest time after which it is told what a command has brought about, in seconds."""
STALE_S = 1.0
"""No command is given by telemetry that is older, in seconds."""
_ATTEMPT_S = 2.0
"""An attempt to open a link ends when nothing is heard for so long, in seconds."""
_REOPEN_S = 5.0
"""A link is opened anew when nothing is told for so long, in seconds."""
_NO_DRIVER = "Couldn't load link driver:"
"""So begins what cflib says where a dongle, or a host, is not there."""
_TAKE_OFF, _LAND, _GO_TO = 7, 8, 12
_ARMED = 0x81
_BUSY = 16
_LOG_DATA = 2
"""The channel on which blocks of the log come."""
_LOW_POWER = 3
"""From this state of the power management on (its pm.h), the battery has had a low voltage for some seconds."""
_VARIABLES = (
    *("stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimate.yaw"),
    *("supervisor.info", "pm.batteryLevel", "pm.state"),
)

cflib.crtp.init_drivers()


class CflibAutopilot(Autopilot):
    """The Crazyflie at the other end of `link`, which flies at `speed_ms` at most, in metres a second."""

    def __init__(self, link: Link, speed_ms: float) -> None:
        self.url = link.url
        self._own = link.at
        self._speed_ms = speed_ms
        self._came = threading.Condition()
        self._crazyflie: Any = None
        self._block: Any = None
        self._is_connected = self._is_lost = self._climbs = False
        self._values: dict[str, float] = {}
        self._told_at = self._heard_at = self._opened_at = self._commanded_at = -math.inf
        self._answers: dict[int, int] = {}
        self._ground_m: float | None = None
        self._fault = ""

    def connect(self) -> bool:
        """Return whether the Crazyflie has told all that it has to tell; see `Autopilot`."""
        self._keep_link()
        if self._fault:
            raise RefusedError(f"{self.url} cannot be opened ({self._fault})")
        crazyflie = self._crazyflie
        if self._block is None and crazyflie is not None and self._is_connected:
            version = crazyflie.platform.get_protocol_version()
            if version < PROTOCOL:
                raise RefusedError(
                    f"its firmware speaks version {version} of the protocol: update it, to version {PROTOCOL}"
                )
            self._block = self._listen(crazyflie)
        return bool(self._values)

    def telemetry(self) -> Telemetry:
        """Return the newest telemetry. A link that is lost is opened anew."""
        if self._values:
            with suppress(RefusedError):
                self.connect()
        now = time.monotonic()
        with self._came:
            values = self._values
            silent_s = now - self._told_at
        if not values:
            return Telemetry(connecting=now - self._heard_at < _ATTEMPT_S)
        told = Supervisor(int(values["supervisor.info"]))
        alarm = "its battery is low" if values["pm.state"] >= _LOW_POWER else ""
        return Telemetry(
            place=self._place(values),
            battery=min(max(values["pm.batteryLevel"] / 100, 0.0), 1.0),
            mode=told.mode,
            armed=told.armed,
            in_air=told.flies,
            healthy=not (told.problem or alarm),
            problem=told.problem or alarm,
            alarm=alarm,
            silent_s=silent_s,
        )

    # Commands

    def arm(self) -> None:
        """Arm the motors, and wait until they spin; those of a Crazyflie with brushes are always armed."""
        told = self._fresh("arm")
        if not told.arms_itself:
            self._arming("arm", on=True)
        with self._came:
            if not self._came.wait_for(lambda: self._told().can_fly, SPIN_UP_S):
                raise RefusedError("it did not arm (its motors do not spin)")

    def disarm(self) -> None:
        """Disarm the motors: refused in the air, where the firmware would do it, and it would fall."""
        told = self._fresh("disarm")
        if not self._is_on_ground(told):
            raise RefusedError("it did not disarm (it may be in the air)")
        if told.armed and not told.arms_itself:
            self._arming("disarm", on=False)

    def take_off(self, height_m: float) -> None:
        """Rise, and hover there."""
        self._fresh("take off")
        self._ground_m = self._values["stateEstimate.z"]
        height, duration_s = self._ground_m + height_m, self._duration(height_m, self._speed_ms)
        self._ask(
            "take off",
            _TAKE_OFF,
            lambda: self._crazyflie.high_level_commander.takeoff(height, duration_s, yaw=None),
        )
        self._climbs = True

    def go_to(self, place: Point) -> None:
        """Fly to `place`, and hover there.

        From a hover the path is smooth. On the way, the firmware would bend such a path by its present speed, so
        the path is a straight one of constant speed then.
        """
        told = self._fresh("fly to its place")
        if self._climbs and not told.finished:
            raise RefusedError("it did not fly to its place (it still takes off)")
        x, y, z = (at - own for at, own in zip(place, self._own, strict=True))
        here = self._here(self._values)
        left_m = math.dist(here, (x, y, z))
        linear = not told.finished
        duration_s = max(left_m / self._speed_ms, _SHORTEST_S) if linear else self._duration(left_m, self._speed_ms)
        yaw = math.radians(self._values["stateEstimate.yaw"])
        self._ask(
            "fly to its place",
            _GO_TO,
            lambda: self._crazyflie.high_level_commander.go_to(x, y, z, yaw, duration_s, linear=linear),
        )
        self._climbs = False

    def hold(self) -> None:
        """Hover where it is."""
        self._fresh("hold")
        self._ask(
            "hold",
            _GO_TO,
            lambda: self._crazyflie.high_level_commander.go_to(0, 0, 0, 0, _SHORTEST_S, relative=True, linear=True),
        )

    def land(self) -> None:
        """Land where it is, at the height from which it took off; the firmware stops the motors there."""
        told = self._fresh("land")
        if self._is_on_ground(told):
            raise RefusedError("it did not land (it is on the ground)")
        ground_m = self._ground_m or 0.0
        left_m = abs(self._values["stateEstimate.z"] - ground_m)
        duration_s = self._duration(left_m, min(self._speed_ms, LAND_MS))
        self._ask(
            "land",
            _LAND,
            lambda: self._crazyflie.high_level_commander.land(ground_m, duration_s, yaw=None),
            already=1,
        )

    def close(self) -> None:
        """Close the link; the Crazyflie goes on with what it does."""
        crazyflie, self._crazyflie = self._crazyflie, None
        if crazyflie is None:
            return
        crazyflie.link_statistics.stop()
        if crazyflie.incoming.is_alive():
            crazyflie.incoming.stop()
            crazyflie.incoming.join(_JOIN_S)
        # Without a link there is nothing by which `close_link` could send its set point without thrust.
        driver, crazyflie.link = crazyflie.link, None
        if driver is not None:
            driver.close()
        updater = crazyflie.param.param_updater
        crazyflie.close_link()
        if updater is not None:
            # Cflib wakes this thread before it says that all is over, so it may have gone back to wait.
            updater.request_queue.put(None)

    # The link

    def _keep_link(self) -> None:
        """Open the link, or open it anew if it was lost."""
        now = time.monotonic()
        if self._crazyflie is None:
            broken = True
        elif self._block is not None:  # an error may pass by itself
            broken = now - max(self._told_at, self._opened_at) > _REOPEN_S
        else:
            broken = self._is_lost or now - max(self._heard_at, self._opened_at) > _ATTEMPT_S
        if broken and now - self._opened_at > _ATTEMPT_S:
            self._open(now)

    def _open(self, now: float) -> None:
        self.close()
        self._opened_at = now
        self._is_connected = self._is_lost = False
        self._block, self._fault = None, ""
        crazyflie = self._crazyflie = Crazyflie()
        crazyflie.packet_received.add_callback(self._heard)
        crazyflie.connected.add_callback(self._connected)
        crazyflie.connection_failed.add_callback(self._lost)
        # Cflib's own way with an error waits for threads, in a thread that may hold the lock by which those send; then
        # no command would get through any more. Here it is noted, and the link opened anew by the pilot's thread.
        crazyflie._link_error_cb = self._broken  # noqa: SLF001
        crazyflie.add_port_callback(CRTPPort.SETPOINT_HL, self._answered)
        crazyflie.add_port_callback(CRTPPort.SUPERVISOR, self._armed)
        crazyflie.open_link(self.url)

    def _listen(self, crazyflie: Any) -> object:  # noqa: ANN401 - cflib's
        block = LogConfig("robochoc", _PERIOD_MS)
        for name in _VARIABLES:
            block.add_variable(name)
        try:
            crazyflie.log.add_config(block)
        except KeyError as error:
            raise RefusedError(f"its firmware does not tell all that is needed ({error.args[0]})") from error
        block.data_received_cb.add_callback(self._told_values)
        block.start()
        return block

    # What comes, in cflib's threads

    def _heard(self, packet: Any) -> None:  # noqa: ANN401 - cflib's
        # Blocks of the log go on from before a silence: they are no answer to what a new link has asked for in vain.
        if (packet.port, packet.channel) != (CRTPPort.LOGGING, _LOG_DATA):
            self._heard_at = time.monotonic()

    def _connected(self, _url: str) -> None:
        self._is_connected = True

    def _lost(self, _url: str, why: str) -> None:
        self._is_lost = True
        if why.startswith(_NO_DRIVER):
            self._fault = shortened(on_one_line(why.removeprefix(_NO_DRIVER).partition("\n")[0].strip()))

    def _broken(self, _why: str) -> None:
        self._is_lost = True

    def _told_values(self, _time_ms: int, values: dict[str, float], _block: object) -> None:
        if all(map(math.isfinite, values.values())):
            with self._came:
                self._values, self._told_at = values, time.monotonic()
                self._came.notify_all()

    def _answered(self, packet: Any) -> None:  # noqa: ANN401 - cflib's
        command, _, _, result, *_ = packet.data
        self._note(command, result)

    def _armed(self, packet: Any) -> None:  # noqa: ANN401 - cflib's
        command, success, *_ = packet.data
        if command == _ARMED:
            self._note(_ARMED, 0 if success else 1)

    def _note(self, command: int, result: int) -> None:
        with self._came:
            self._answers[command] = result
            self._came.notify_all()

    # Small things

    def _told(self) -> Supervisor:
        return Supervisor(int(self._values.get("supervisor.info", 0)))

    def _fresh(self, what: str) -> Supervisor:
        """Return what the supervisor tells. Raises `RefusedError` if that is too old."""
        if not self._values or time.monotonic() - self._told_at > STALE_S or self._crazyflie is None:
            raise RefusedError(f"it cannot {what}: it is not heard")
        return self._told()

    def _is_on_ground(self, told: Supervisor) -> bool:
        """Return whether it is surely on the ground: neither told in the air, nor sent there a moment ago."""
        return not told.flies and not told.commands and self._told_at - self._commanded_at > SETTLED_S

    def _arming(self, what: str, *, on: bool) -> None:
        self._ask(what, _ARMED, lambda: self._crazyflie.supervisor.send_arming_request(on))

    def _ask(self, what: str, number: int, command: Callable[[], object], *, already: int = 0) -> None:
        """Give a command until it is answered. The result `already` is as good as 0: it is done already."""
        before = self._commanded_at
        for attempt in range(_TRIES):
            with self._came:
                self._answers.pop(number, None)
            if number != _ARMED:
                self._commanded_at = time.monotonic()
            command()
            with self._came:
                if not self._came.wait_for(lambda: number in self._answers, _ANSWER_S):
                    continue
                result = self._answers[number]
            if result in {0, already} or (attempt and number == _TAKE_OFF and result == 1):
                return
            if attempt == 0:
                self._commanded_at = before
            why = "busy" if result == _BUSY else "command denied"
            raise RefusedError(f"it did not {what} ({why})")
        raise RefusedError(f"it did not {what} (no answer)")

    def _duration(self, way_m: float, speed_ms: float) -> float:
        """Return how long a smooth path from rest to rest takes that nowhere is faster than `speed_ms`."""
        return max(PEAK * way_m / speed_ms, _SHORTEST_S)

    def _here(self, values: dict[str, float]) -> Point:
        return values["stateEstimate.x"], values["stateEstimate.y"], values["stateEstimate.z"]

    def _place(self, values: dict[str, float]) -> Point:
        x, y, z = (at + own for at, own in zip(self._here(values), self._own, strict=True))
        return x, y, z
