"""Flights by autopilots of two kinds: what tests of kills see of them, and what each firmware promises by itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from tests.support.faults import Run, running
from tests.support.limits import wait_until
from tests.support.mavlink_teams import team_folder
from tests.support.played_fleet import PlayedFleet
from tests.support.program import PROGRAM


class AutopilotKind(ABC):
    """A sink that flies, and four vehicles for it. They fly slowly, so that each phase can be met."""

    sink: str
    library: str
    """The Python package that the sink needs."""
    phases: Mapping[str, Callable[[Any], bool]]
    """By the name of each phase of a flight: returns whether a vehicle has come to it."""
    without_a_guard: str
    """The program's message when its guard has ended."""
    quick: Mapping[str, object] = {}
    """Settings of the fleet with which a flight is short."""

    @abstractmethod
    def field(self, folder: Path, **settings: object) -> AbstractContextManager[tuple[PlayedFleet[Any], Path]]:
        """Play four slow vehicles, and write their fleet file."""

    @abstractmethod
    def needed_nobody(self, vehicle: Any) -> bool:  # noqa: ANN401 - of the kind
        """Return whether the firmware had to bring it down by itself at no time."""

    @abstractmethod
    def holds(self, vehicle: Any) -> bool:  # noqa: ANN401 - of the kind
        """Return whether it keeps its place in the air, by itself."""

    @contextmanager
    def flight(self, folder: Path, **settings: object) -> Iterator[tuple[PlayedFleet[Any], Run]]:
        """A run with these vehicles, whose guard is there."""
        with self.field(folder, **settings) as (vehicles, fleet):
            command = [PROGRAM, "solve", str(team_folder(folder)), "--ros", f"{self.sink}:{fleet}", "--arm"]
            with running(command, folder / "run") as run:
                wait_until(lambda: run.program("guard") is not None or run.is_over, run.errors)
                yield vehicles, run


class Px4(AutopilotKind):
    """PX4 over MAVLink. Without set points it lands, after a second (COM_OF_LOSS_T): the guard is quicker."""

    sink, library = "mavlink", "mavsdk"
    phases: Mapping[str, Callable[[Any], bool]] = {
        "before": lambda vehicle: not vehicle.armed,
        "climbing": lambda vehicle: vehicle.mode == "takeoff",
        "flying": lambda vehicle: vehicle.mode == "offboard",
        "landing": lambda vehicle: vehicle.mode == "land",
    }
    without_a_guard = "the guard process has ended"

    def field(self, folder: Path, **settings: object) -> AbstractContextManager[tuple[PlayedFleet[Any], Path]]:
        from tests.support.mavlink_field import mavlink_field  # noqa: PLC0415 - it needs pymavlink

        return mavlink_field(folder, 0.8, **settings)  # type: ignore[arg-type]

    def needed_nobody(self, vehicle: Any) -> bool:  # noqa: ANN401 - a `Vehicle`
        return "offboard lost" not in vehicle.log

    def holds(self, vehicle: Any) -> bool:  # noqa: ANN401 - the same
        return bool(vehicle.mode == "hold")


class Crazyflie(AutopilotKind):
    """Crazyflies. Without us they fly on to where they were sent, and hover there: they need no set points.

    None may fall, as it does where a set point without thrust comes.
    """

    sink, library = "crazyflie", "cflib"
    phases: Mapping[str, Callable[[Any], bool]] = {
        "before": lambda vehicle: not vehicle.armed,
        "climbing": lambda vehicle: bool(vehicle.log) and vehicle.log[-1] == "takeoff" and vehicle.flies,
        "flying": lambda vehicle: bool(vehicle.log) and vehicle.log[-1].startswith("goto"),
        "landing": lambda vehicle: vehicle.planner == "landing",
    }
    quick: Mapping[str, object] = {"takeoff": 0.5}
    without_a_guard = "the guard process has ended; vehicles fly to their targets, and hover there"

    def field(self, folder: Path, **settings: object) -> AbstractContextManager[tuple[PlayedFleet[Any], Path]]:
        from tests.support.crazyflie_teams import crazyflie_field  # noqa: PLC0415 - as for the other kind

        return crazyflie_field(folder, haste=2.0, **settings)

    def needed_nobody(self, vehicle: Any) -> bool:  # noqa: ANN401 - a `Crazyfly`
        return "fell" not in vehicle.log

    def holds(self, vehicle: Any) -> bool:  # noqa: ANN401 - the same
        return bool(vehicle.log[-1] == "hold")
