"""The report of `robochoc fly` about a flight, as a table and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import isfinite, isnan

import msgspec

from robochoc.cli.reports.table import table_lines
from robochoc.flight.log import ClosestApproach, FlightLog
from robochoc.flight.mission import Leg, Mission
from robochoc.formats import on_one_line
from robochoc.formats.diagnostics import shortened

ARRIVED_M = 0.1
"""A drone closer to its goal has arrived. In calm air it ends within a millimetre, in gusts within centimetres."""
_MOST_NAMES = 6


def as_planned(flown: FlightLog, *, may_fall: bool = False) -> bool:
    """Return whether all drones arrived and kept the required distance, and none fell (unless `may_fall`)."""
    apart = flown.nearest is None or flown.nearest.distance_m >= flown.distance
    walls = flown.nearest_wall
    apart = apart and (walls is None or walls.distance_m >= walls.set_m)
    return apart and all(error <= ARRIVED_M or (may_fall and isnan(error)) for error in flown.errors_m)


def flight_report(mission: Mission, flown: FlightLog) -> str:
    """Return a table of the legs, followed by the summary of the flight."""
    return "\n".join(
        [f"{on_one_line(mission.team)}: {_verdict(mission, flown)}", *_legs(mission, flown), flight_summary(flown)]
    )


def flight_summary(flown: FlightLog) -> str:
    """Return a text about the flight: events, arrivals, the smallest distance, and the speed of the simulation."""
    lines = [f"{one.at_s:6.1f} s  {_name(flown, one.drone)}: {one.what}" for one in flown.events]
    lines += [_arrival(flown), _separation(flown), *_wall_distance(flown), _speed(flown)]
    return "\n".join(f"  {line}" for line in lines)


def late_failures(failures: Iterable[tuple[str, float]], flown: FlightLog) -> list[str]:
    """Return a line for each of the requested `failures` whose time is after the end of the flight."""
    return [
        f"--fail {on_one_line(name)}@{at_s:g}: the flight ended earlier, after {flown.simulated_s:.1f} s"
        for name, at_s in failures
        if at_s > flown.simulated_s
    ]


def _verdict(mission: Mission, flown: FlightLog) -> str:
    last = mission.legs[-1].goals if mission.legs else {}
    fallen = [number for number, error in enumerate(flown.errors_m) if not isfinite(error)]
    landing = sum(goal.lands for number, goal in last.items() if number not in fallen)
    flying = sum(not goal.lands for number, goal in last.items() if number not in fallen)
    counts = {"at their goals": flying, "at the edge": landing, "fallen": len(fallen)}
    text = ", ".join(f"{number} {words}" for words, number in counts.items() if number)
    plural = "s" * (len(flown.names) != 1)
    return f"{len(flown.names)} drone{plural}: {text or 'no drone has a goal'}"


def _legs(mission: Mission, flown: FlightLog) -> Iterator[str]:
    headings = ("leg", "opened by", "verdict", "fly", "land", "from s", "to s")
    rows = [
        (
            str(number),
            shortened(leg.opened_by),
            leg.verdict,
            *_movers(leg),
            f"{times.begins_s:.1f}",
            f"{times.ends_s:.1f}",
        )
        for number, (leg, times) in enumerate(zip(mission.legs, flown.legs, strict=True))
    ]
    for line in table_lines(headings, rows, right=("leg", "fly", "land", "from s", "to s")):
        yield f"  {line}"


def _movers(leg: Leg) -> tuple[str, str]:
    landing = sum(goal.lands for goal in leg.goals.values())
    return f"{len(leg.goals) - landing}", f"{landing}"


def _arrival(flown: FlightLog) -> str:
    away = [number for number, error in enumerate(flown.errors_m) if isfinite(error) and error > ARRIVED_M]
    fallen = [number for number, error in enumerate(flown.errors_m) if not isfinite(error)]
    largest = max((error for error in flown.errors_m if isfinite(error)), default=0.0)
    parts = [f"{_names(flown, fallen)} fell"] if fallen else []
    if away:
        parts.append(f"not at their goals: {_names(flown, away)} (up to {_length(largest)} away)")
    else:
        others = "all others" if fallen else "all"
        parts.append(f"{others} within {_length(largest)} of their goals")
    return "; ".join(parts)


def _separation(flown: FlightLog) -> str:
    near = flown.nearest
    word = "too near" if near and near.distance_m < flown.distance else "nearest"
    word += f", heights divided by {flown.downwash:g}" * (flown.downwash != 1)
    parts = [f"{word}: {_pair(flown, near)}" if near else "no two drones flew at the same time"]
    above = f", {_length(flown.downwash * flown.distance)} above each other" * (flown.downwash != 1)
    parts.append(f"minimum: {_length(flown.distance)}{above}")
    if flown.nearest_fallen:
        parts.append(f"to a fallen drone: {_pair(flown, flown.nearest_fallen)}")
    return "; ".join(parts)


def _wall_distance(flown: FlightLog) -> Iterator[str]:
    wall = flown.nearest_wall
    if wall:
        word = "too near to a wall" if wall.distance_m < wall.set_m else "nearest to a wall"
        distance = f"{_length(wall.distance_m)} ({_name(flown, wall.drone)}, at {wall.at_s:.1f} s)"
        yield f"{word}: {distance}; minimum: {_length(wall.set_m)}"


def _speed(flown: FlightLog) -> str:
    seconds = float(flown.times[-1]) if len(flown.times) else 0.0
    return f"{seconds:.1f} s of flight simulated in {flown.wall_s:.2f} s{_rate(seconds, flown.wall_s)}"


def _rate(seconds: float, wall_s: float) -> str:
    """Return the speed of the simulation relative to real time; empty if one of them took no time."""
    if seconds <= 0 or wall_s <= 0:
        return ""
    if seconds >= wall_s:
        return f" ({seconds / wall_s:.1f} times as fast as real time)"
    return f" ({wall_s / seconds:.1f} times slower than real time)"


def _pair(flown: FlightLog, nearest: ClosestApproach) -> str:
    both = f"{_name(flown, nearest.first)} and {_name(flown, nearest.second)}"
    return f"{_length(nearest.distance_m)} ({both}, at {nearest.at_s:.1f} s)"


def _length(metres: float) -> str:
    return f"{1000 * metres:.1f} mm" if metres < 0.1 else f"{metres:.2f} m"  # noqa: PLR2004 - ten centimetres


def _name(flown: FlightLog, number: int) -> str:
    return on_one_line(flown.names[number])


def _names(flown: FlightLog, numbers: Sequence[int]) -> str:
    more = f" and {len(numbers) - _MOST_NAMES} more" if len(numbers) > _MOST_NAMES else ""
    return ", ".join(_name(flown, number) for number in numbers[:_MOST_NAMES]) + more


def flight_json(mission: Mission, flown: FlightLog) -> bytes:
    """Return the report as one line of JSON: lengths in metres, times in seconds, and null for a drone that fell."""
    ends = flown.positions[-1] if len(flown.positions) else ()
    legs = zip(mission.legs, flown.legs, strict=True)
    report = {
        "team": mission.team,
        "scale": mission.scale,
        "as_planned": as_planned(flown),
        "flight_s": float(flown.times[-1]) if len(flown.times) else 0.0,
        "wall_s": flown.wall_s,
        "distance_m": flown.distance,
        "downwash": flown.downwash,
        "nearest": _approach(flown, flown.nearest),
        "nearest_fallen": _approach(flown, flown.nearest_fallen),
        "nearest_wall": _wall_approach(flown),
        "drones": [
            {"name": name, "at": [float(part) for part in end], "error_m": float(error) if isfinite(error) else None}
            for name, end, error in zip(flown.names, ends, flown.errors_m, strict=True)
        ],
        "legs": [
            {"opened_by": leg.opened_by, "verdict": leg.verdict, "begins_s": times.begins_s, "ends_s": times.ends_s}
            for leg, times in legs
        ],
        "happenings": [
            {"at_s": event.at_s, "drone": flown.names[event.drone], "what": event.what} for event in flown.events
        ],
    }
    return msgspec.json.encode(report)


def _approach(flown: FlightLog, nearest: ClosestApproach | None) -> dict[str, object] | None:
    if nearest is None:
        return None
    drones = [flown.names[nearest.first], flown.names[nearest.second]]
    return {"distance_m": nearest.distance_m, "drones": drones, "at_s": nearest.at_s}


def _wall_approach(flown: FlightLog) -> dict[str, object] | None:
    wall = flown.nearest_wall
    if wall is None:
        return None
    return {
        "distance_m": wall.distance_m,
        "drone": flown.names[wall.drone],
        "at_s": wall.at_s,
        "set_m": wall.set_m,
    }
