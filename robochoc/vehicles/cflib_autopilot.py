"""The autopilot of Crazyflies. Only this module uses Bitcraze's library cflib (0.1), and CRTP, the Crazyflie protocol.

The firmware's high-level commander plans a path to a target, flies along the path, and hovers at the target. It answers
each command by accepting or rejecting it; cflib ignores these answers, so they are read here. The firmware reports its
state in one log block, ten times a second. The method of cflib for closing a link is not used, because it first sends a
set point without thrust, which makes a Crazyflie in the air fall.

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
from robochoc.vehicles.fleet import VehicleLink
from robochoc.vehicles.supervisor import Supervisor

PROTOCOL = 12
"""The oldest version of the protocol in which the supervisor answers arming requests."""
PEAK = 35 / 16
"""The ratio of the highest to the mean speed on a polynomial path of degree seven from rest to rest."""
LAND_MS = 0.5
"""The highest landing speed, in m/s."""
_SHORTEST_S = 0.5
_PERIOD_MS = 100
_TRIES, _ANSWER_S = 3, 0.5
_JOIN_S = 3.0
SPIN_UP_S = 4.0
"""The longest time for motors to spin up after arming, in seconds; the firmware allows 2 s."""
SETTLED_S = 0.3
"""The longest time until telemetry shows the effect of a command, in seconds."""
STALE_S = 1.0
"""The maximum age of telemetry on which commands are based, in seconds."""
_ATTEMPT_S = 2.0
"""The time without a message after which an attempt to open a link ends, in seconds."""
_REOPEN_S = 5.0
"""The time without telemetry after which a link is opened again, in seconds."""
_NO_DRIVER = "Couldn't load link driver:"
"""The beginning of cflib's error for a missing dongle or host."""
_TAKE_OFF, _LAND, _GO_TO = 7, 8, 12
_ARMED = 0x81
_BUSY = 16
_LOG_DATA = 2
"""The channel of log blocks."""
_LOW_POWER = 3
"""From this state of the power management (pm.h) on, the battery has had a low voltage for some seconds."""
_VARIABLES = (
    *("stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimate.yaw"),
    *("supervisor.info", "pm.batteryLevel", "pm.state"),
)

cflib.crtp.init_drivers()


class CflibAutopilot(Autopilot):
    """Controls the Crazyflie at the other end of `link`, which flies at up to `speed_ms` m/s."""

    def __init__(self, link: VehicleLink, speed_ms: float) -> None:
        self.url = link.url
        self._own = link.at
        self._speed_ms = speed_ms
        self._changed = threading.Condition()
        self._crazyflie: Any = None
        self._block: Any = None
        self._is_connected = self._is_lost = self._climbs = False
        self._values: dict[str, float] = {}
        self._values_at = self._received_at = self._opened_at = self._commanded_at = -math.inf
        self._answers: dict[int, int] = {}
        self._ground_m: float | None = None
        self._fault = ""

    def connect(self) -> bool:
        """Return whether the Crazyflie has reported all its variables; see `Autopilot`."""
        self._keep_link()
        if self._fault:
            raise RefusedError(f"{self.url} cannot be opened ({self._fault})")
        crazyflie = self._crazyflie
        if self._block is None and crazyflie is not None and self._is_connected:
            version = crazyflie.platform.get_protocol_version()
            if version < PROTOCOL:
                raise RefusedError(
                    f"its firmware has version {version} of the protocol: update it to version {PROTOCOL}"
                )
            self._block = self._start_log(crazyflie)
        return bool(self._values)

    def telemetry(self) -> Telemetry:
        """Return the newest telemetry. A lost link is opened again."""
        if self._values:
            with suppress(RefusedError):
                self.connect()
        now = time.monotonic()
        with self._changed:
            values = self._values
            silent_s = now - self._values_at
        if not values:
            return Telemetry(connecting=now - self._received_at < _ATTEMPT_S)
        supervisor = Supervisor(int(values["supervisor.info"]))
        alarm = "its battery is low" if values["pm.state"] >= _LOW_POWER else ""
        return Telemetry(
            place=self._place(values),
            battery=min(max(values["pm.batteryLevel"] / 100, 0.0), 1.0),
            mode=supervisor.mode,
            armed=supervisor.armed,
            in_air=supervisor.flies,
            healthy=not (supervisor.problem or alarm),
            problem=supervisor.problem or alarm,
            alarm=alarm,
            silent_s=silent_s,
        )

    # Commands

    def arm(self) -> None:
        """Arm the motors, and wait until they spin. Brushed motors are always armed."""
        supervisor = self._current_supervisor("arm")
        if not supervisor.arms_itself:
            self._arming("arm", on=True)
        with self._changed:
            if not self._changed.wait_for(lambda: self._supervisor().can_fly, SPIN_UP_S):
                raise RefusedError("it did not arm (its motors do not spin)")

    def disarm(self) -> None:
        """Disarm the motors. Refused in the air, where the firmware would obey and the vehicle would fall."""
        supervisor = self._current_supervisor("disarm")
        if not self._is_on_ground(supervisor):
            raise RefusedError("it did not disarm (it may be in the air)")
        if supervisor.armed and not supervisor.arms_itself:
            self._arming("disarm", on=False)

    def take_off(self, height_m: float) -> None:
        """Rise to a height above the present place, and hover there."""
        self._current_supervisor("take off")
        self._ground_m = self._values["stateEstimate.z"]
        height, duration_s = self._ground_m + height_m, self._duration(height_m, self._speed_ms)
        self._send_command(
            "take off",
            _TAKE_OFF,
            lambda: self._crazyflie.high_level_commander.takeoff(height, duration_s, yaw=None),
        )
        self._climbs = True

    def go_to(self, place: Point) -> None:
        """Fly to `place`, and hover there.

        From a hover, the path is smooth. During a flight, the firmware would bend a smooth path because of the present
        speed; the path is then straight, with constant speed.
        """
        supervisor = self._current_supervisor("fly to its place")
        if self._climbs and not supervisor.finished:
            raise RefusedError("it did not fly to its place (it is still taking off)")
        x, y, z = (at - own for at, own in zip(place, self._own, strict=True))
        here = self._here(self._values)
        left_m = math.dist(here, (x, y, z))
        linear = not supervisor.finished
        duration_s = max(left_m / self._speed_ms, _SHORTEST_S) if linear else self._duration(left_m, self._speed_ms)
        yaw = math.radians(self._values["stateEstimate.yaw"])
        self._send_command(
            "fly to its place",
            _GO_TO,
            lambda: self._crazyflie.high_level_commander.go_to(x, y, z, yaw, duration_s, linear=linear),
        )
        self._climbs = False

    def hold(self) -> None:
        """Hover in place."""
        self._current_supervisor("hold")
        self._send_command(
            "hold",
            _GO_TO,
            lambda: self._crazyflie.high_level_commander.go_to(0, 0, 0, 0, _SHORTEST_S, relative=True, linear=True),
        )

    def land(self) -> None:
        """Land in place, at the height of the take-off, where the firmware stops the motors."""
        supervisor = self._current_supervisor("land")
        if self._is_on_ground(supervisor):
            raise RefusedError("it did not land (it is on the ground)")
        ground_m = self._ground_m or 0.0
        left_m = abs(self._values["stateEstimate.z"] - ground_m)
        duration_s = self._duration(left_m, min(self._speed_ms, LAND_MS))
        self._send_command(
            "land",
            _LAND,
            lambda: self._crazyflie.high_level_commander.land(ground_m, duration_s, yaw=None),
            already=1,
        )

    def close(self) -> None:
        """Close the link; the Crazyflie continues to execute its last command."""
        crazyflie, self._crazyflie = self._crazyflie, None
        if crazyflie is None:
            return
        crazyflie.link_statistics.stop()
        if crazyflie.incoming.is_alive():
            crazyflie.incoming.stop()
            crazyflie.incoming.join(_JOIN_S)
        # Without a link, `close_link` cannot send its set point without thrust.
        driver, crazyflie.link = crazyflie.link, None
        if driver is not None:
            driver.close()
        updater = crazyflie.param.param_updater
        crazyflie.close_link()
        if updater is not None:
            # Cflib wakes this thread before it sets the end flag, so the thread may be waiting again.
            updater.request_queue.put(None)

    # The link

    def _keep_link(self) -> None:
        """Open the link if it is not open yet, or was lost."""
        now = time.monotonic()
        if self._crazyflie is None:
            broken = True
        elif self._block is not None:  # the error may be temporary
            broken = now - max(self._values_at, self._opened_at) > _REOPEN_S
        else:
            broken = self._is_lost or now - max(self._received_at, self._opened_at) > _ATTEMPT_S
        if broken and now - self._opened_at > _ATTEMPT_S:
            self._open(now)

    def _open(self, now: float) -> None:
        self.close()
        self._opened_at = now
        self._is_connected = self._is_lost = False
        self._block, self._fault = None, ""
        crazyflie = self._crazyflie = Crazyflie()
        crazyflie.packet_received.add_callback(self._packet_received)
        crazyflie.connected.add_callback(self._connected)
        crazyflie.connection_failed.add_callback(self._lost)
        # Cflib's error handler waits for threads in a thread that may hold the lock which these need for sending, after
        # which no command could be sent. Here the error is recorded, and the pilot's thread opens the link again.
        crazyflie._link_error_cb = self._broken  # noqa: SLF001
        crazyflie.add_port_callback(CRTPPort.SETPOINT_HL, self._answered)
        crazyflie.add_port_callback(CRTPPort.SUPERVISOR, self._arming_answered)
        crazyflie.open_link(self.url)

    def _start_log(self, crazyflie: Any) -> object:  # noqa: ANN401 - cflib's
        block = LogConfig("robochoc", _PERIOD_MS)
        for name in _VARIABLES:
            block.add_variable(name)
        try:
            crazyflie.log.add_config(block)
        except KeyError as error:
            raise RefusedError(f"its firmware lacks a required log variable ({error.args[0]})") from error
        block.data_received_cb.add_callback(self._store_values)
        block.start()
        return block

    # Callbacks, in cflib's threads

    def _packet_received(self, packet: Any) -> None:  # noqa: ANN401 - cflib's
        # Log blocks continue from before a silence: they are not an answer to the requests of a new link.
        if (packet.port, packet.channel) != (CRTPPort.LOGGING, _LOG_DATA):
            self._received_at = time.monotonic()

    def _connected(self, _url: str) -> None:
        self._is_connected = True

    def _lost(self, _url: str, why: str) -> None:
        self._is_lost = True
        if why.startswith(_NO_DRIVER):
            self._fault = shortened(on_one_line(why.removeprefix(_NO_DRIVER).partition("\n")[0].strip()))

    def _broken(self, _why: str) -> None:
        self._is_lost = True

    def _store_values(self, _time_ms: int, values: dict[str, float], _block: object) -> None:
        if all(map(math.isfinite, values.values())):
            with self._changed:
                self._values, self._values_at = values, time.monotonic()
                self._changed.notify_all()

    def _answered(self, packet: Any) -> None:  # noqa: ANN401 - cflib's
        command, _, _, result, *_ = packet.data
        self._store_answer(command, result)

    def _arming_answered(self, packet: Any) -> None:  # noqa: ANN401 - cflib's
        command, success, *_ = packet.data
        if command == _ARMED:
            self._store_answer(_ARMED, 0 if success else 1)

    def _store_answer(self, command: int, result: int) -> None:
        with self._changed:
            self._answers[command] = result
            self._changed.notify_all()

    # Helpers

    def _supervisor(self) -> Supervisor:
        return Supervisor(int(self._values.get("supervisor.info", 0)))

    def _current_supervisor(self, what: str) -> Supervisor:
        """Return the state of the supervisor. Raises `RefusedError` if the state is outdated."""
        if not self._values or time.monotonic() - self._values_at > STALE_S or self._crazyflie is None:
            raise RefusedError(f"it cannot {what}: no recent message from it")
        return self._supervisor()

    def _is_on_ground(self, supervisor: Supervisor) -> bool:
        """Return whether the vehicle is on the ground: not reported in the air, and not just commanded to rise."""
        return not supervisor.flies and not supervisor.commands and self._values_at - self._commanded_at > SETTLED_S

    def _arming(self, what: str, *, on: bool) -> None:
        self._send_command(what, _ARMED, lambda: self._crazyflie.supervisor.send_arming_request(on))

    def _send_command(self, what: str, number: int, command: Callable[[], object], *, already: int = 0) -> None:
        """Send a command until it is answered. The result `already` (it was done before) is a success, like 0."""
        before = self._commanded_at
        for attempt in range(_TRIES):
            with self._changed:
                self._answers.pop(number, None)
            if number != _ARMED:
                self._commanded_at = time.monotonic()
            command()
            with self._changed:
                if not self._changed.wait_for(lambda: number in self._answers, _ANSWER_S):
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
        """Return the duration of a smooth path from rest to rest whose highest speed is `speed_ms`."""
        return max(PEAK * way_m / speed_ms, _SHORTEST_S)

    def _here(self, values: dict[str, float]) -> Point:
        return values["stateEstimate.x"], values["stateEstimate.y"], values["stateEstimate.z"]

    def _place(self, values: dict[str, float]) -> Point:
        x, y, z = (at + own for at, own in zip(self._here(values), self._own, strict=True))
        return x, y, z
