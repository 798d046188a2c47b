"""Vehicles that speak MAVLink as PX4 does, played in a thread of the test: no autopilot, no simulator, no ROS.

They know what robochoc relies on: arming and its refusal, take-off, offboard set points, hold, land, what PX4 does by
itself when set points stay away (`COM_OF_LOSS_T`, `COM_OBL_RC_ACT`), when nobody takes off (`COM_DISARM_PRFLT`), and
after a landing. A vehicle moves straight towards its target at a constant speed. Places are ENU, in metres, from where
the vehicle was switched on; to the other end they are NED, or GPS.
"""

from __future__ import annotations

import math
import selectors
import socket
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import combinations
from random import Random
from typing import Any

from pymavlink.dialects.v20 import common

from tests.support.played_fleet import PlayedFleet
from tests.support.ports import LOOPBACK
from tests.support.wgs84 import Geodetic, enu_of, geodetic_of

OFFBOARD_LOSS_S = 1.0
"""PX4's COM_OF_LOSS_T: after so long without a set point it leaves the offboard mode."""
DISARM_S = 3.0
"""PX4's COM_DISARM_PRFLT, shortened: who is armed and does not take off is disarmed."""
GUST_S = 0.5
_SPEEDS_MS = 1.0, 8.0
_CHANGE_S, _STALL_S = 0.5, 1.0
_HEARTBEAT_S, _TELEMETRY_S = 0.2, 0.05
_NEAR_M = 0.05
SETTLE_S = 0.5
"""So long after arming ArduCopter refuses to take off."""
_COPTER = {"hold": 17, "offboard": 4, "takeoff": 4, "land": 9, "stabilize": 0, "posctl": 16, "rtl": 6}
"""ArduCopter's modes: BRAKE, GUIDED, GUIDED, LAND, STABILIZE, POSHOLD, RTL."""
_AUTO = {"takeoff": 2, "hold": 3, "land": 6}
_MAIN_AUTO, _MAIN_OFFBOARD = 4, 6
_MODES = {(_MAIN_AUTO, sub): name for name, sub in _AUTO.items()} | {(_MAIN_OFFBOARD, 0): "offboard"}
_CUSTOM = {"offboard": _MAIN_OFFBOARD << 16, **{name: _MAIN_AUTO << 16 | sub << 24 for name, sub in _AUTO.items()}}
HOME = Geodetic(47.397742, 8.545594, 488.0)
"""Where vehicles are switched on, unless a test says otherwise: PX4's own simulated field."""


@dataclass
class Vehicle:
    """A vehicle: what it is told to be, and what has become of it. Tests read and set the fields while it lives."""

    port: int
    home: Geodetic = HOME
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    speed: float = 20.0
    battery: float = 1.0
    drain: float = 0.0
    """The charge that it uses in a second of flight."""
    refuses: set[str] = field(default_factory=set)
    """Of "arm", "takeoff", "offboard", "land": commands that are denied."""
    silent: bool = False
    """True: neither sends nor hears, as without radio."""
    silent_from: str = ""
    """The mode from whose beginning on it is silent."""
    has_camera: bool = False
    """True: a camera on board sends heartbeats of its own, also while the autopilot is silent."""
    lost_from: str = ""
    """The mode from whose beginning on it tells no place any more, as without GPS."""
    is_lost: bool = False
    healthy: bool = True
    is_ardupilot: bool = False
    """True: it speaks as ArduCopter does. It keeps on flying to the last set point when no others come."""
    stalls: bool = False
    """True: it stays where it is, whatever it is told."""
    chance: Random | None = None
    """With it the vehicle flies at random speeds, and stands still at times."""
    blown_ms: float = 0.0
    """With `chance`, gusts blow it aside at that speed, for `GUST_S` each."""
    mode: str = "hold"
    armed: bool = False
    log: list[str] = field(default_factory=list)
    """What has happened to it, in order."""
    setpoints: list[float] = field(default_factory=list)
    """When set points came."""
    takeoff_m: float = 2.5
    target: tuple[float, float, float] | None = None

    @property
    def flies(self) -> bool:
        return self.at[2] > _NEAR_M

    @property
    def is_safe(self) -> bool:
        """Return whether it is on the ground and disarmed, or keeps its place by itself, or lands."""
        return not self.armed or (self.flies and self.mode in {"hold", "land"})

    @property
    def is_down(self) -> bool:
        return not self.armed and not self.flies

    @property
    def state(self) -> str:
        """Return in words what it does and where it is."""
        return f"{self.mode} armed={self.armed} at {self.at}: {self.log}"

    def is_near(self, at: tuple[float, float, float], within: float = 0.3) -> bool:
        return math.dist(self.at, at) < within


class _Played:
    """The machinery of one vehicle."""

    def __init__(self, vehicle: Vehicle, system: int) -> None:
        self.vehicle = vehicle
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((LOOPBACK, 0))
        self.socket.setblocking(False)
        self._mav: Any = common.MAVLink(self, srcSystem=system, srcComponent=1)
        self._mav.robust_parsing = True
        self._camera: Any = common.MAVLink(None, srcSystem=system, srcComponent=common.MAV_COMP_ID_CAMERA)
        self._begun = time.monotonic()
        self._heartbeat_at = self._telemetry_at = self._armed_at = 0.0
        self._setpoint_at = -math.inf
        self._disturbed_until = self._stalled_until = self._gust_until = -math.inf
        self._gust_angle = 0.0
        self._wanted: tuple[float, float, float] | None = None

    def write(self, content: bytes) -> None:
        """Send, as the library's file."""
        if not self.vehicle.silent:
            self._send(content)

    def _send(self, content: bytes) -> None:
        with suppress(OSError):
            self.socket.sendto(content, (LOOPBACK, self.vehicle.port))

    def hear(self) -> None:
        while True:
            try:
                content = self.socket.recv(4096)
            except BlockingIOError:
                return
            except OSError:
                continue  # what was sent before has reached nobody
            if self.vehicle.silent:
                continue
            for message in self._mav.parse_buffer(content) or ():
                self._take(message)

    def come_and_go(self, selector: selectors.BaseSelector) -> None:
        """Stay: tests of vehicles that are gone have silent ones."""

    # Time goes by

    def live(self, now: float, passed: float) -> None:
        vehicle = self.vehicle
        self._move(vehicle, passed)
        if vehicle.flies:
            vehicle.battery = max(0.0, vehicle.battery - vehicle.drain * passed)
        if vehicle.mode == "offboard" and not vehicle.is_ardupilot and now - self._setpoint_at > OFFBOARD_LOSS_S:
            self._enter("land", "offboard lost")
        if vehicle.armed and not vehicle.flies:
            if vehicle.mode == "land":
                self._disarm("landed")
            elif vehicle.mode == "hold" and now - self._armed_at > DISARM_S:
                self._disarm("disarmed by itself")
        if now - self._heartbeat_at > _HEARTBEAT_S:
            self._heartbeat_at = now
            base = common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (
                common.MAV_MODE_FLAG_SAFETY_ARMED if vehicle.armed else 0
            )
            state = common.MAV_STATE_ACTIVE if vehicle.armed else common.MAV_STATE_STANDBY
            kind, mode = common.MAV_AUTOPILOT_PX4, _CUSTOM.get(vehicle.mode, 0)
            if vehicle.is_ardupilot:
                kind, mode = common.MAV_AUTOPILOT_ARDUPILOTMEGA, _COPTER[vehicle.mode]
            self._mav.heartbeat_send(common.MAV_TYPE_QUADROTOR, kind, base, mode, state)
            if vehicle.has_camera:
                beat = self._camera.heartbeat_encode(common.MAV_TYPE_CAMERA, common.MAV_AUTOPILOT_INVALID, 0, 0, state)
                self._send(beat.pack(self._camera))
        if now - self._telemetry_at > _TELEMETRY_S:
            self._telemetry_at = now
            self._tell(round((now - self._begun) * 1000))

    def _move(self, vehicle: Vehicle, passed: float) -> None:
        if not vehicle.armed:
            return
        if vehicle.mode == "land":
            vehicle.target = (vehicle.at[0], vehicle.at[1], 0.0)
        elif vehicle.mode == "offboard":
            vehicle.target = self._wanted
        if vehicle.chance and vehicle.flies and self._is_disturbed(vehicle, vehicle.chance, passed):
            return
        if vehicle.target is None or vehicle.stalls:
            return
        left = math.dist(vehicle.at, vehicle.target)
        step = vehicle.speed * passed
        if left <= step:
            if left and vehicle.mode == "offboard":
                vehicle.log.append("reached " + ",".join(f"{one:g}" for one in vehicle.target))
            vehicle.at = vehicle.target
            if vehicle.mode == "takeoff":
                self._wanted = vehicle.at
                self._enter("offboard" if vehicle.is_ardupilot else "hold", "took off")
            return
        e, n, u = (here + (there - here) * step / left for here, there in zip(vehicle.at, vehicle.target, strict=True))
        vehicle.at = (e, n, u)

    def _is_disturbed(self, vehicle: Vehicle, chance: Random, passed: float) -> bool:
        """Change its speed at times, and blow it aside. Return whether it stands still."""
        now = time.monotonic()
        if now > self._disturbed_until:
            self._disturbed_until = now + chance.uniform(0, _CHANGE_S)
            vehicle.speed = chance.uniform(*_SPEEDS_MS)
            if chance.random() < 0.1:
                self._stalled_until = now + chance.uniform(0, _STALL_S)
            if chance.random() < 0.2 and vehicle.mode == "offboard":
                self._gust_until, self._gust_angle = now + GUST_S, chance.uniform(0, 2 * math.pi)
        if now < self._gust_until:
            step, (east, north, up) = vehicle.blown_ms * passed, vehicle.at
            vehicle.at = east + step * math.cos(self._gust_angle), north + step * math.sin(self._gust_angle), up
        return now < self._stalled_until

    def _enter(self, mode: str, why: str = "") -> None:
        if why:
            self.vehicle.log.append(why)
        if mode != self.vehicle.mode:
            self.vehicle.mode = mode
            self.vehicle.silent = self.vehicle.silent or mode == self.vehicle.silent_from
            self.vehicle.is_lost = self.vehicle.is_lost or mode == self.vehicle.lost_from
            self.vehicle.log.append(mode)
        if mode == "hold":
            self.vehicle.target = self.vehicle.at if self.vehicle.flies else None

    def _disarm(self, why: str) -> None:
        self.vehicle.armed = False
        self.vehicle.log.append(why)
        self._enter("hold")

    def _tell(self, boot_ms: int) -> None:
        vehicle, mav = self.vehicle, self._mav
        east, north, up = vehicle.at
        place = geodetic_of((east, north, up), vehicle.home)
        lat, lon = round(place.lat * 1e7), round(place.lon * 1e7)
        if not vehicle.is_lost:
            mav.local_position_ned_send(boot_ms, north, east, -up, 0, 0, 0)
            mav.global_position_int_send(boot_ms, lat, lon, round(place.alt * 1000), round(up * 1000), 0, 0, 0, 0)
        mav.gps_raw_int_send(boot_ms * 1000, 3, lat, lon, round(place.alt * 1000), 100, 100, 0, 0, 10)
        home = vehicle.home
        mav.home_position_send(
            round(home.lat * 1e7), round(home.lon * 1e7), round(home.alt * 1000), 0, 0, 0, [1, 0, 0, 0], 0, 0, 0
        )
        landed = common.MAV_LANDED_STATE_IN_AIR if vehicle.flies else common.MAV_LANDED_STATE_ON_GROUND
        mav.extended_sys_state_send(0, landed)
        sensors = common.MAV_SYS_STATUS_SENSOR_3D_GYRO | common.MAV_SYS_STATUS_PREARM_CHECK
        percent = round(vehicle.battery * 100)
        mav.sys_status_send(sensors, sensors, sensors if vehicle.healthy else 0, 0, 12000, 0, percent, 0, 0, 0, 0, 0, 0)
        mav.battery_status_send(0, 0, 0, 0, [12000] + [65535] * 9, 0, -1, -1, percent)

    # What comes

    def _take(self, message: Any) -> None:  # noqa: ANN401 - the library's
        match message.get_type():
            case "COMMAND_LONG":
                self._mav.command_ack_send(message.command, self._obey(message))
            case "SET_POSITION_TARGET_LOCAL_NED" | "SET_POSITION_TARGET_GLOBAL_INT" if (
                self.vehicle.is_ardupilot and math.isnan(message.yaw)
            ):
                self.vehicle.log.append("no heading")
            case "SET_POSITION_TARGET_LOCAL_NED":
                self._set((message.y, message.x, -message.z))
            case "SET_POSITION_TARGET_GLOBAL_INT":
                place = Geodetic(message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
                self._set(enu_of(place, self.vehicle.home))
            case "PARAM_SET":
                if message.param_id == "MIS_TAKEOFF_ALT":
                    self.vehicle.takeoff_m = message.param_value
                self._value(message.param_id, message.param_value, message.param_type)
            case "PARAM_REQUEST_READ":
                if message.param_id == "MIS_TAKEOFF_ALT":
                    self._value(message.param_id, self.vehicle.takeoff_m, common.MAV_PARAM_TYPE_REAL32)
            case _:
                pass

    def _value(self, name: str, value: float, kind: int) -> None:
        self._mav.param_value_send(name.encode(), value, kind, 1, 0)

    def _set(self, place: tuple[float, float, float]) -> None:
        self._setpoint_at = time.monotonic()
        self.vehicle.setpoints.append(self._setpoint_at)
        self._wanted = place

    def _obey(self, message: Any) -> int:  # noqa: ANN401 - the library's
        match message.command:
            case common.MAV_CMD_COMPONENT_ARM_DISARM:
                result = self._armed(on=message.param1 > 0)
            case common.MAV_CMD_NAV_TAKEOFF:
                result = self._mode("takeoff") if not self.vehicle.is_ardupilot else self._rise(message.param7)
            case common.MAV_CMD_NAV_LAND:
                result = self._mode("land")
            case common.MAV_CMD_DO_SET_MODE:
                main, sub = round(message.param2), round(message.param3)
                if self.vehicle.is_ardupilot:
                    modes = {number: mode for mode, number in _COPTER.items() if mode != "takeoff"}
                    return self._mode(modes.get(main, ""))
                result = self._mode(_MODES.get((main, 0 if main == _MAIN_OFFBOARD else sub), ""))
            case common.MAV_CMD_REQUEST_MESSAGE:
                result = self._answer(round(message.param1))
            case common.MAV_CMD_SET_MESSAGE_INTERVAL:
                result = common.MAV_RESULT_ACCEPTED
            case _:
                result = common.MAV_RESULT_UNSUPPORTED
        return int(result)

    def _answer(self, number: int) -> int:
        """Send a message that was asked for, by its number."""
        if number == common.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._mav.autopilot_version_send(0, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, self.vehicle.port)
            return int(common.MAV_RESULT_ACCEPTED)
        return int(common.MAV_RESULT_UNSUPPORTED)

    def _armed(self, *, on: bool) -> int:
        vehicle = self.vehicle
        unarmable = vehicle.is_ardupilot and on and vehicle.mode != "offboard"
        if unarmable or "arm" in vehicle.refuses or (not on and vehicle.flies):
            vehicle.log.append("refused to arm")
            return int(common.MAV_RESULT_DENIED)
        if on and not vehicle.armed:
            vehicle.armed, self._armed_at = True, time.monotonic()
            vehicle.log.append("armed")
        elif not on and vehicle.armed:
            self._disarm("disarmed")
        return int(common.MAV_RESULT_ACCEPTED)

    def _rise(self, height_m: float) -> int:
        """Take off as ArduCopter does: in GUIDED, and some time after arming."""
        vehicle = self.vehicle
        if vehicle.mode != "offboard" or not vehicle.armed or time.monotonic() - self._armed_at < SETTLE_S:
            vehicle.log.append("refused takeoff")
            return int(common.MAV_RESULT_FAILED)
        vehicle.takeoff_m = height_m
        return self._mode("takeoff")

    def _mode(self, mode: str) -> int:
        vehicle = self.vehicle
        stale = (
            mode == "offboard" and not vehicle.is_ardupilot and time.monotonic() - self._setpoint_at > OFFBOARD_LOSS_S
        )
        if not mode or mode in vehicle.refuses or stale or (mode == "takeoff" and not vehicle.armed):
            vehicle.log.append(f"refused {mode}")
            return int(common.MAV_RESULT_DENIED)
        self._enter(mode)
        if mode == "takeoff":
            vehicle.target = (vehicle.at[0], vehicle.at[1], vehicle.takeoff_m)
        return int(common.MAV_RESULT_ACCEPTED)


class Vehicles(PlayedFleet[Vehicle]):
    """Plays `vehicles` while it is a context, each with a MAVLink system of its own."""

    def __init__(self, vehicles: Sequence[Vehicle]) -> None:
        super().__init__(vehicles, lambda vehicle, number: _Played(vehicle, number + 1))
        self.nearest_m = math.inf
        """The smallest distance that two of them have had, if all share one frame."""

    def watch(self) -> None:
        """See how near two have come."""
        apart = (math.dist(one.at, other.at) for one, other in combinations(self.vehicles, 2))
        self.nearest_m = min(self.nearest_m, *apart, math.inf)
