"""Part `flight`: how much faster than in real time it is simulated."""

from __future__ import annotations

import statistics

from measure import RUNS, say, spread
from report import Row, Section

from robochoc.flight.flight import fly
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Mission, mission_of
from robochoc.flight.quadrotor.conditions import FlightConditions
from robochoc.flight.quadrotor.simulation import DT
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Outcome, Verdict

SIZES = (4, 7, 11)
WIND = FlightConditions(wind=(3.0, 4.0, 0.0), gusts=1.0)


def measured() -> Section:
    """One mission a size, calm and in wind."""
    notes = (
        "3D queens, planar, a drone in each cell, with levels 3 i + 5 j modulo n; in each third row one has withdrawn "
        f"and lands at the edge (for n = 4, whose levels are not a solution, too). Steps of 1/{1 / DT:.0f} s, the "
        "distances of all pairs measured at each; in this process, planning of paths included. In wind: 5 m/s, gusts "
        "of 1 m/s. `nearest`: of two drones at any step, where 0.5 m are to be kept; `off its goal`: who is "
        "farthest from it in the end. Median (min..max)."
    )
    return Section("flight", "The simulated flight", notes, (_speed(),))


def _speed() -> list[Row]:
    rows: list[Row] = [
        ("drones", "air", "aim", "simulated s", "wall s", "simulated s a wall s", "nearest, m", "off its goal, mm")
    ]
    for n in SIZES:
        mission = _mission(n)
        for air, conditions in (("calm", FlightConditions()), ("wind", WIND)):
            say(f"flight, {len(mission.drones)} drones, {air}")
            runs = [fly(mission, conditions) for _ in range(RUNS)]
            rows.append(_row(air, runs))
    return rows


def _row(air: str, runs: list[FlightLog]) -> Row:
    flown = runs[0]
    drones = len(flown.names)
    rates = [run.simulated_s / run.wall_s for run in runs]
    nearest = f"{flown.nearest.distance_m:.2f}" if flown.nearest else "-"
    aim = "> 5" if drones == max(SIZES) ** 2 else "> 1"
    return (
        str(drones),
        air,
        aim,
        f"{statistics.median(run.simulated_s for run in runs):.1f}",
        spread(run.wall_s for run in runs),
        spread(rates, 1),
        nearest,
        f"{flown.errors_m.max() * 1e3:.1f}",
    )


def _mission(n: int) -> Mission:
    team = queens3d(n)
    away = tuple(f"Robot{i}.{i}" for i in range(1, n + 1, 3))
    names = [variable.name for robot in team.robots if robot.name not in away for variable in robot.variables]
    cells = {name: [int(part) for part in name[1:].split(".")] for name in names}
    values = {name: (3 * row + 5 * column) % n + 1 for name, (row, column) in cells.items()}
    outcome = Outcome(
        Verdict.SOLUTION, team=team.name, protocol="abt", runtime="simulator", seed=0, assignment=values, withdrawn=away
    )
    return mission_of(outcome, team)
