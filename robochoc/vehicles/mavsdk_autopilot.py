"""Autopilots with MAVLink. Only this module uses MAVSDK (mavsdk 4), a library in this process without a server.

Each vehicle has its own instance of MAVSDK, so that two vehicles may have the same MAVLink system number. MAVSDK
repeats set points 20 times a second; PX4 requires at least 2.

ArduCopter differs from PX4. Its GUIDED mode corresponds to PX4's offboard mode, which is also its name in MAVSDK.
ArduCopter arms only in a few modes: it is switched to GUIDED before arming, and takes off some time later. It has no
separate mode for the take-off. PX4 keeps its heading if a set point has no heading; ArduCopter requires a heading, and
gets the heading that the vehicle had at the first set point.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from typing import Any

import mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mavlink_direct import MavlinkDirect
from mavsdk.plugins.mavlink_direct.mavlink_direct import MavlinkMessage
from mavsdk.plugins.offboard import Offboard
from mavsdk.plugins.offboard.offboard import PositionGlobalYaw, PositionNedYaw
from mavsdk.plugins.telemetry import Telemetry as TelemetryPlugin
from mavsdk.plugins.telemetry.telemetry import FlightMode, LandedState

from robochoc.flight.layout import Point
from robochoc.vehicles.autopilot import Autopilot, RefusedError, Telemetry
from robochoc.vehicles.fleet import VehicleLink
from robochoc.vehicles.frames import GpsPlace, enu_from_gps, enu_of, gps_of, ned_of

_IN_AIR = {LandedState.IN_AIR, LandedState.TAKING_OFF, LandedState.LANDING}
_ANY_YAW = math.nan
"""A set point without a heading, for which PX4 keeps its heading."""
_DO_SET_MODE, _CUSTOM_MODE, _GUIDED = 176, 1, 4
_AUTOPILOT = 1
"""The component number of an autopilot (MAV_COMP_ID_AUTOPILOT1)."""
_ANSWER_S, _POLL_S, _RISE_S = 5.0, 0.1, 0.5


class MavsdkAutopilot(Autopilot):
    """Controls the autopilot at the other end of `link`. With an `origin`, places are sent as places on the earth."""

    def __init__(self, link: VehicleLink, origin: GpsPlace | None) -> None:
        self.url = link.url
        self._link = link
        self._origin = origin
        self._sdk: Any = None
        self._system_number = 0
        self._heartbeat_at = self._place_at = -math.inf
        self._telemetry: Any = None
        self._action: Any = None
        self._offboard: Any = None
        self._direct: Any = None
        self._follows = self._is_ardupilot = False
        self._yaw_deg = _ANY_YAW

    def connect(self) -> bool:
        """Return whether a message has been received from the vehicle; see `Autopilot`."""
        if self._sdk is None:
            kind = mavsdk.ComponentType.GROUND_STATION
            self._sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
            result = self._sdk.add_any_connection(self._link.url)
            if result is not mavsdk.ConnectionResult.SUCCESS:
                raise RefusedError(f"{self.url} cannot be opened ({_words(result)})")
        if self._telemetry is None:
            system = self._sdk.first_autopilot(0)
            if system is None:
                return False
            self._is_ardupilot = system.autopilot_type() is mavsdk.Autopilot.ARDUPILOT
            self._system_number = system.get_system_id()
            self._direct = MavlinkDirect(system)
            self._direct.subscribe_message("HEARTBEAT", self._heartbeat_received)
            place = "GLOBAL_POSITION_INT" if self._origin else "LOCAL_POSITION_NED"
            self._direct.subscribe_message(place, self._place_received)
            self._action, self._offboard = Action(system), Offboard(system)
            self._telemetry = TelemetryPlugin(system)
            self._heartbeat_at = self._place_at = time.monotonic()
        return True

    def telemetry(self) -> Telemetry:
        """Return the newest telemetry; see `Autopilot`."""
        if self._telemetry is None:
            return Telemetry()
        percent, now = self._telemetry.battery().remaining_percent, time.monotonic()
        return Telemetry(
            place=self._place(),
            battery=percent / 100 if math.isfinite(percent) else None,
            mode=FlightMode(self._telemetry.flight_mode()).name,
            armed=bool(self._telemetry.armed()),
            in_air=self._telemetry.landed_state() in _IN_AIR,
            healthy=bool(self._telemetry.health().is_armable),
            silent_s=now - self._heartbeat_at,
            place_age_s=now - self._place_at,
        )

    def arm(self) -> None:
        """Arm the motors. ArduCopter arms in its GUIDED mode."""
        if self._is_ardupilot:
            self._command("enter its mode GUIDED", self._enter_guided_mode)
        self._command("arm", self._action.arm)
        if self._is_ardupilot:
            self._wait_until("arm", lambda: bool(self._telemetry.armed()))

    def disarm(self) -> None:
        """Disarm the motors."""
        self._command("disarm", self._action.disarm)

    def take_off(self, height_m: float) -> None:
        """Take off, and hold. The height is a parameter of the vehicle (PX4's MIS_TAKEOFF_ALT), or of the command.

        ArduCopter refuses the command for some time after arming, so it is repeated.
        """
        self._command("set the height of its take-off", lambda: self._action.set_takeoff_altitude(height_m))
        until = time.monotonic() + (_ANSWER_S if self._is_ardupilot else 0.0)
        while True:
            try:
                return self._command("take off", self._action.takeoff)
            except RefusedError:
                if time.monotonic() > until:
                    raise
                time.sleep(_RISE_S)

    def go_to(self, place: Point) -> None:
        """Fly straight to `place`."""
        if self._is_ardupilot and not self._follows and self._telemetry is not None:
            self._yaw_deg = float(self._telemetry.heading().heading_deg)
        if self._origin:
            gps = gps_of(place, self._origin)
            above_sea = PositionGlobalYaw.AltitudeType.AMSL
            self._command(
                "accept a set point",
                lambda: self._offboard.set_position_global(
                    PositionGlobalYaw(gps.latitude, gps.longitude, gps.altitude_m, self._yaw_deg, above_sea)
                ),
            )
        else:
            x, y, z = place
            own_x, own_y, own_z = self._link.at
            north, east, down = ned_of((x - own_x, y - own_y, z - own_z))
            self._command(
                "accept a set point",
                lambda: self._offboard.set_position_ned(PositionNedYaw(north, east, down, self._yaw_deg)),
            )
        if not self._follows:
            self._command("follow set points", self._offboard.start)
            self._follows = True

    def hold(self) -> None:
        """Stay in place."""
        self._command("hold", self._action.hold)
        self._follows = False

    def land(self) -> None:
        """Land in place."""
        self._command("land", self._action.land)
        self._follows = False

    def close(self) -> None:
        """Close the link."""
        if self._sdk is not None:
            self._sdk.destroy()
            self._sdk = self._telemetry = None

    def _heartbeat_received(self, message: Any, _data: object) -> None:  # noqa: ANN401 - MAVSDK's, in its own thread
        if self._is_from_autopilot(message):
            self._heartbeat_at = time.monotonic()

    def _place_received(self, message: Any, _data: object) -> None:  # noqa: ANN401 - MAVSDK's, in its own thread
        """Record the time of a position report: MAVSDK returns the last position, regardless of its age."""
        if self._is_from_autopilot(message):
            self._place_at = time.monotonic()

    def _is_from_autopilot(self, message: Any) -> bool:  # noqa: ANN401 - MAVSDK's
        """Return whether a message is from the autopilot; cameras and on-board computers send heartbeats, too."""
        return bool(message.system_id == self._system_number and message.component_id == _AUTOPILOT)

    def _place(self) -> Point | None:
        if self._origin:
            at = self._telemetry.position()
            if not _are_finite(at.latitude_deg, at.longitude_deg, at.absolute_altitude_m):
                return None
            return enu_from_gps(GpsPlace(at.latitude_deg, at.longitude_deg, at.absolute_altitude_m), self._origin)
        local = self._telemetry.position_velocity_ned().position
        if not _are_finite(local.north_m, local.east_m, local.down_m):
            return None
        x, y, z = enu_of((local.north_m, local.east_m, local.down_m))
        own_x, own_y, own_z = self._link.at
        return x + own_x, y + own_y, z + own_z

    def _enter_guided_mode(self) -> None:
        """Switch ArduCopter to its GUIDED mode, and wait for the mode. MAVSDK itself does so only with a set point."""
        fields: dict[str, float] = {f"param{number}": 0.0 for number in range(1, 8)}
        fields |= {"param1": _CUSTOM_MODE, "param2": _GUIDED, "command": _DO_SET_MODE, "confirmation": 0}
        fields |= {"target_system": self._system_number, "target_component": _AUTOPILOT}
        self._direct.send_message(
            MavlinkMessage("COMMAND_LONG", 0, 0, self._system_number, _AUTOPILOT, json.dumps(fields))
        )
        self._wait_until("enter its mode GUIDED", lambda: self._telemetry.flight_mode() == FlightMode.OFFBOARD)

    @staticmethod
    def _wait_until(what: str, is_so: Callable[[], bool]) -> None:
        until = time.monotonic() + _ANSWER_S
        while not is_so():
            if time.monotonic() > until:
                raise RefusedError(f"it did not {what} (timeout)")
            time.sleep(_POLL_S)

    def _command(self, what: str, command: Callable[[], object]) -> None:
        if self._telemetry is None:
            raise RefusedError(f"it cannot {what}: no message received from it yet")
        try:
            command()
        except mavsdk.MavsdkError as error:
            raise RefusedError(f"it did not {what} ({_words(getattr(error, 'result', error))})") from error


def _are_finite(*values: float) -> bool:
    return all(map(math.isfinite, values))


def _words(result: object) -> str:
    return str(getattr(result, "name", result)).replace("_", " ").lower()
