"""The trips of RMF's tasks, and which robot makes which trip, in which order: a plan, decided by a team's protocol."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.model.allocation import Schedule, TaskSpec, Worker, several_tasks
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind
from robochoc.ros.rmf.fleet_file import Place, RmfFleet
from robochoc.ros.rmf.task_request import RequestError, TaskRequest
from robochoc.run.defaults import AUTO
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve

PLANNED_MAX = 5
"""The number of trips that are planned together. Older ones stay with their robots."""
STOPS_MAX = 1000
SOLVE_S = 1.0
"""The time limit of a plan, in seconds. Then the new trip is appended where it ends first."""
CATEGORIES = "patrol, delivery, clean"
_DONE = 10**12
"""The worth of a trip: more than all delays of a plan, in milliseconds."""


class Trip(NamedTuple):
    """The places of a task, in order, and the length of the way between them, in metres."""

    stops: tuple[Place, ...]
    length_m: float


class RobotState(NamedTuple):
    """The state of a robot: when and where it has ended all fixed trips, and its speed."""

    at: Place
    free_s: float
    speed_ms: float


@dataclass(frozen=True)
class Plan:
    """A plan.

    Attributes:
        orders: The trips of each robot, in order.
        cost_s: The sum over all trips of the times from now to their ends, in seconds.
        ends_s: The time at which each trip ends.
    """

    orders: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    cost_s: float = 0.0
    ends_s: Mapping[str, float] = field(default_factory=dict)

    def robot_of(self, trip: str) -> str:
        """Return the robot of a trip."""
        return next(robot for robot, order in self.orders.items() if trip in order)


class _Patrol(msgspec.Struct):
    places: list[str]
    rounds: int = 1


class _Delivery(msgspec.Struct):
    pickup: _Stop
    dropoff: _Stop


class _Stop(msgspec.Struct):
    place: str


class _Clean(msgspec.Struct):
    zone: str


def trip_of(task: TaskRequest, fleet: RmfFleet) -> Trip:
    """Return the trip of a task. Raises `RequestError` if the fleet cannot do it."""
    names = _stops(task)
    if not names:
        raise RequestError("the task has no stops")
    for name in names:
        if name not in fleet.places:
            raise RequestError(f"unknown place {shortened(on_one_line(name))!r}")
    stops = tuple(fleet.places[name] for name in names)
    length = sum(fleet.way_m(start, end) for start, end in itertools.pairwise(stops))
    return Trip(stops, length)


def _stops(task: TaskRequest) -> list[str]:
    kinds: dict[str, type[Any]] = {"patrol": _Patrol, "delivery": _Delivery, "clean": _Clean}
    kind = kinds.get(task.category)
    if kind is None:
        raise RequestError(f"category {shortened(task.category)!r} is not supported: {CATEGORIES} are")
    try:
        found = msgspec.convert(task.description, kind)
    except (msgspec.ValidationError, RecursionError) as error:
        raise RequestError(f"the description of the {task.category} is invalid: {error}") from None
    match found:
        case _Patrol():
            rounds = max(found.rounds, 1)
            if len(found.places) * rounds > STOPS_MAX:
                raise RequestError(f"the patrol has more than {STOPS_MAX:,} stops: use fewer rounds")
            return found.places * rounds
        case _Delivery():
            return [found.pickup.place, found.dropoff.place]
        case _:
            return [found.zone]


def plan(
    fleet: RmfFleet,
    robots: Mapping[str, RobotState],
    trips: Mapping[str, Trip],
    now_s: float,
    *,
    protocol: str = AUTO,
    seed: int = 0,
) -> Plan | None:
    """Return the plan with the lowest cost; None if the protocol finds none in time.

    Args:
        fleet: The fleet.
        robots: The state of each robot.
        trips: The trips by task, at most `PLANNED_MAX`.
        now_s: The time now. Delays are measured from it.
        protocol: The protocol, for costs.
        seed: The seed of the protocol.
    """
    names = [*trips]
    orders = {
        robot: _best_orders(fleet, state, [trips[name] for name in names], now_s) for robot, state in robots.items()
    }
    workers = []
    for place, robot in enumerate(robots):
        tours = {
            Schedule(tuple(one + 1 for one in chosen)): round(1000 * cost)
            for chosen, (cost, _) in orders[robot].items()
        }
        profit = dict.fromkeys(range(1, len(names) + 1), _DONE)
        workers.append(Worker(f"R{place}", f"R{place}", f"R{place}", profit, tours=tours))
    jobs = {number: TaskSpec(f"t{number}") for number in range(1, len(names) + 1)}
    variables, constraints = several_tasks(workers, jobs)
    team = assemble(
        "robots", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True, places=0)
    )
    outcome = solve(team, Options(protocol, Runtime.SIMULATOR, seed, timeout=SOLVE_S))
    chosen = {}
    for place, robot in enumerate(robots):
        does = tuple(n for n in range(len(names)) if outcome.assignment.get(f"R{place}.t{n + 1}") == 1)
        chosen[robot] = tuple(names[n] for n in orders[robot][does][1]) if does else ()
    if sorted(one for order in chosen.values() for one in order) != sorted(names):
        return None
    return timed(fleet, robots, trips, chosen, now_s)


def trial_plan(fleet: RmfFleet, protocol: str) -> None:
    """Plan two trips of no length. Raises `UnknownProtocolError` or `UnsupportedError` if the protocol cannot."""
    robots = {name: RobotState(robot.at, 0.0, robot.speed_ms) for name, robot in fleet.robots.items()}
    trip = Trip((next(iter(robots.values())).at,), 0.0)
    plan(fleet, robots, {"a": trip, "b": trip}, 0.0, protocol=protocol)


def timed(
    fleet: RmfFleet,
    robots: Mapping[str, RobotState],
    trips: Mapping[str, Trip],
    orders: Mapping[str, Sequence[str]],
    now_s: float,
) -> Plan:
    """Return the plan with these orders of trips, with its times and its cost."""
    ends: dict[str, float] = {}
    for robot, order in orders.items():
        at, at_s, speed_ms = robots[robot]
        for name in order:
            at, at_s = _after(fleet, at, at_s, speed_ms, trips[name])
            ends[name] = at_s
    cost = sum(end - now_s for end in ends.values())
    return Plan({robot: tuple(order) for robot, order in orders.items()}, cost, ends)


def _after(fleet: RmfFleet, at: Place, at_s: float, speed_ms: float, trip: Trip) -> tuple[Place, float]:
    """Return the place and the time after a trip."""
    return trip.stops[-1], at_s + (fleet.way_m(at, trip.stops[0]) + trip.length_m) / speed_ms


def _best_orders(
    fleet: RmfFleet, robot: RobotState, trips: Sequence[Trip], now_s: float
) -> dict[tuple[int, ...], tuple[float, tuple[int, ...]]]:
    """Return the lowest cost, in seconds, and its order, for each set of trips: each order is tried."""
    best: dict[tuple[int, ...], tuple[float, tuple[int, ...]]] = {}
    waiting: list[tuple[tuple[int, ...], Place, float, float]] = [((), robot.at, robot.free_s, 0.0)]
    while waiting:
        order, at, at_s, cost = waiting.pop()
        key = tuple(sorted(order))
        if order and (key not in best or cost < best[key][0]):
            best[key] = (cost, order)
        for number, trip in enumerate(trips):
            if number not in order:
                place, end_s = _after(fleet, at, at_s, robot.speed_ms, trip)
                waiting.append(((*order, number), place, end_s, cost + end_s - now_s))
    return best
