"""The simulated flight: quadrotors fly a mission's legs, with wind, motor failures and obstacles.

Drones stand at their homes with their motors off until their routes begin, and stop their motors after landing.
Possible events:

- A motor stops. The drone tumbles. Its other motors are switched off once the drone is tilted by 60 degrees, like the
  failure detectors of autopilots do. It stays where it falls and never flies again; later routes keep their distance
  from it.
- An obstacle (a point) is nearer to a goal than `CLEARANCE_M`, or than the planned distance if that is larger. The
  planner learns of such an obstacle only when a drone sees it; it avoids all others from the start. A drone whose route
  passes too near to the obstacle sees it from a distance of `SIGHT_M`, or more if the drone needs more space to stop.
  This space is the sum of the clearance, the distance flown while the common clock stops (`quadrotor/trajectory.py`),
  and `_SIGHT_MARGIN_M` for tracking errors and the time between samples.
- A drone cannot follow its setpoints. A leg waits for such a drone for at most `SETTLING_S` after the planned end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from robochoc.flight.coordination.motion import MotionLimits, RoutePlan
from robochoc.flight.coordination.move_order import NoRouteError
from robochoc.flight.coordination.spacing import TooCloseError
from robochoc.flight.coordination.timetable import plan_routes
from robochoc.flight.layout import Point
from robochoc.flight.log import SAMPLE_RATE_HZ, FlightLog, LegTimes
from robochoc.flight.mission import Goal, Mission
from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.conditions import DISTANCE_MIN_M, FlightConditions
from robochoc.flight.quadrotor.free_points import nearest_distances, nearest_two
from robochoc.flight.quadrotor.goals import Hazards, LegGoals, check_separation, start_delays
from robochoc.flight.quadrotor.rigid_bodies import Mask
from robochoc.flight.quadrotor.simulation import DT, QuadrotorSimulation
from robochoc.flight.quadrotor.trajectory import STOP_S, ObstacleEncounter, Trajectory, encounters
from robochoc.flight.reports import BlockedReport, OutOfOrderReport, Report
from robochoc.flight.wall_watch import WallWatch
from robochoc.maps.routes.distances import squashed
from robochoc.maps.routes.wall_plan import WallPlan
from robochoc.maps.walls import Walls

DISTANCE_M = 0.5
"""The default distance between drones' centres."""
_SHARE = 0.8
"""The default distance as a fraction of the smallest distance between homes or goals, if that is below `DISTANCE_M`."""
LIMITS = MotionLimits()
CLEARANCE_M = 0.5
SIGHT_M = 1.5
_SIGHT_MARGIN_M = 0.2
SETTLING_S = 5.0
_LATE_S = 1.5
"""After this time, a landing drone that is not directly above its landing point lands in place."""
_STILL_S = 1.0
"""The time for which all drones stand still before the first leg, and hover after the last leg."""
_CLOSE_M = 0.005
_SLOW_M_S = 0.02
_FAR_M = 0.05
"""A drone within this distance of its final setpoint has completed the leg."""
DRONES_MAX = 1_000
"""The maximum number of drones, since planning considers all pairs."""
COORDINATE_MAX_M = 1e8
"""The largest coordinate. The resolution of floating-point numbers is a tenth of a micrometre there."""
_NEAR_ORIGIN_M = 1_000.0
"""Flights are moved to the origin only if their homes are farther away than this."""
PATH_MAX_M = 2_000.0
"""The longest path of a drone in a leg: planning uses steps of a twentieth of a second, or less."""
_SAMPLES_MAX = 3_000_000
"""The maximum number of samples, of about 300 bytes each: enough for 1,000 drones for 100 s, or 100 for 1,000 s."""


class Flight:
    """Simulates drones that start from their homes and fly one leg after another.

    If the homes are far away, the simulation uses an origin near them, where floating-point numbers are more precise.

    Args:
        names: The drones' names.
        homes: The drones' initial places (N, 3), in metres.
        conditions: Distance, wind, failures and obstacles.
        progress: Called with a description of the progress at every logged sample.
        rises: True if drones take off and land vertically where possible.
        ground: The height of the ground. None: the lowest home is on the ground.
        walls: Walls that drones fly around, at the speed for which the team was made.

    Raises:
        ValueError: There are no drones, or too many; the conditions name unknown drones; or homes are nearer to each
            other than the distance, or in a wall.
    """

    def __init__(
        self,
        names: Sequence[str],
        homes: Array,
        conditions: FlightConditions,
        progress: Callable[[str], None] | None = None,
        *,
        rises: bool = False,
        ground: float | None = None,
        walls: Walls | None = None,
    ) -> None:
        self._rises = rises
        homes = np.array(homes, dtype=np.float64).reshape(-1, 3)
        check_homes(names, homes)
        conditions.check(names)
        self.names = tuple(names)
        self.conditions = conditions
        self._progress = progress or (lambda _: None)
        self._origin = origin_of(homes)
        self._homes = homes - self._origin
        lowest = float(self._homes[:, 2].min())
        self._ground = lowest if ground is None else min(lowest, ground - float(self._origin[2]))
        self._downwash = conditions.downwash
        self._distance = conditions.distance or _distance([self._homes], self._downwash)
        places: dict[int, Point] = {number: (x, y, z) for number, (x, y, z) in enumerate(homes)}
        check_separation("homes", self.names, places, self._distance, self._downwash)
        check_near(["an obstacle"] * len(conditions.obstacles), conditions.obstacles)
        self._obstacles = np.array(conditions.obstacles, dtype=np.float64).reshape(-1, 3) - self._origin
        self._known = np.zeros(len(self._obstacles), dtype=np.bool_)
        self._seen_s = [0.0] * len(self._obstacles)
        self._blocks = np.empty((0, 3))
        self._asked: dict[int, Goal] = {}
        self._legs: list[LegTimes] = []
        self._wall_s = 0.0
        self._watch = WallWatch(walls.moved(-self._origin), self.names) if walls else None
        self._limits = self._watch.limits(LIMITS) if self._watch else LIMITS
        if self._watch:
            self._watch.floor_plan(self._homes)
        floor = self._watch.floor if self._watch else None
        self._simulation = QuadrotorSimulation(self.names, self._homes, self._ground, conditions, floor)
        self._hovers = False

    def fly(
        self, title: str, goals: Mapping[int, Goal], *, stop_on_report: bool = False, blocks: Sequence[Point] = ()
    ) -> tuple[Report, ...]:
        """Fly one leg from the present places, and return the drones' reports.

        Args:
            title: The leg's title in the log.
            goals: Goals by the drones' numbers. A drone without a goal stays in place.
            stop_on_report: True if all drones stop and hover at the first report, before they reach their goals. If
                False, no reports are returned.
            blocks: Points that routes avoid, except points too near to a start or a goal.

        Raises:
            ValueError: Two goals are nearer to each other than the distance, a drone's path is too long, or obstacles
                block all routes.
        """
        began = time.perf_counter()
        if blocks and self._downwash > 1:
            raise ValueError("downwash cannot be combined with obstacles, such as the blocked cells of a map")
        with np.errstate(all="ignore"):  # the simulation checks for nan itself
            self._blocks = np.array(blocks, dtype=np.float64).reshape(-1, 3) - self._origin
            leg_goals = self._leg_goals(goals)
            if not self._legs:
                self._hover()
            begins_s = self._simulation.now_s
            reports = self._fly_leg(leg_goals, stop_on_report=stop_on_report)
        self._legs.append(LegTimes(title, begins_s, self._simulation.now_s))
        self._hovers = False
        self._wall_s += time.perf_counter() - began
        return reports

    def log(self) -> FlightLog:
        """Let the drones hover for `_STILL_S`, and return the log of the flight so far."""
        began = time.perf_counter()
        if not self._hovers:
            with np.errstate(all="ignore"):
                self._hover()
            self._hovers = True
        simulation = self._simulation
        times, positions, attitudes = simulation.record()
        self._wall_s += time.perf_counter() - began
        return FlightLog(
            names=self.names,
            times=times,
            positions=positions + self._origin if self._origin.any() else positions,
            attitudes=attitudes,
            legs=tuple(self._legs),
            events=tuple(simulation.events),
            errors_m=self._errors(),
            nearest=simulation.separation.nearest,
            nearest_fallen=simulation.separation.nearest_fallen,
            distance=self._distance,
            downwash=self._downwash,
            obstacles=self.conditions.obstacles,
            seen_s=tuple(self._seen_s),
            wall_s=self._wall_s,
            nearest_wall=self._watch.nearest(positions, simulation.failures) if self._watch else None,
        )

    def _errors(self) -> Array:
        errors = np.zeros(len(self.names))
        for number, goal in self._asked.items():
            errors[number] = float(np.sqrt(np.square(self._simulation.places[number] - goal.at).sum()))
        errors[self._simulation.failed] = np.nan
        return errors

    def _hover(self) -> None:
        for _ in range(round(_STILL_S / DT)):
            self._simulation.advance()

    def _leg_goals(self, goals: Mapping[int, Goal]) -> LegGoals:
        if strange := [number for number in goals if not 0 <= number < len(self.names)]:
            raise ValueError(f"there is no drone with the number {strange[0]}: numbers are 0 to {len(self.names) - 1}")
        simulation = self._simulation
        places = np.array([goal.at for goal in goals.values()]).reshape(-1, 3)
        check_near([self.names[number] for number in goals], places)
        if self.conditions.distance is None:
            self._distance = min(self._distance, _distance([places], self._downwash))
        moved = [(x, y, z) for x, y, z in (places - self._origin).tolist()]
        goals = {number: replace(goal, at=at) for (number, goal), at in zip(goals.items(), moved, strict=True)}
        starts = simulation.setpoints[:3].T
        leg_goals = LegGoals(self.names, goals, starts, simulation.failed, self._distance, self._downwash)
        self._asked.update(goals)
        return leg_goals

    def _fly_leg(self, leg_goals: LegGoals, *, stop_on_report: bool) -> tuple[Report, ...]:
        """Plan and fly a leg; without `stop_on_report`, plan again whenever an obstacle is found."""
        simulation = self._simulation
        reported = len(simulation.failures)
        preferred = leg_goals.places.copy()
        delays = start_delays(leg_goals.goals, self._homes)
        reports: list[Report] = []
        while True:
            trajectory, watched = self._trajectory(leg_goals, preferred, delays)
            seen = self._follow(trajectory, watched, reported if stop_on_report else None)
            reports += seen
            if stop_on_report or not seen:
                break
            preferred = simulation.setpoints[:3].T.copy()
            delays = np.zeros_like(delays)
        failed = [OutOfOrderReport(self.names[drone], why, at_s) for drone, why, at_s in simulation.failures[reported:]]
        if not (stop_on_report and (reports or failed)):
            self._log_unfinished()
        return tuple(sorted([*reports, *failed], key=lambda report: report.at_s)) if stop_on_report else ()

    def _trajectory(
        self, leg_goals: LegGoals, preferred: Array, delays: Array
    ) -> tuple[Trajectory, list[ObstacleEncounter]]:
        """Return the trajectory from the current setpoints, and the encounters with unknown obstacles on it."""
        simulation = self._simulation
        starts = simulation.setpoints[:3].T.copy()
        check_paths(self.names, starts, leg_goals.places)
        keep = max(CLEARANCE_M, leg_goals.planned_distance(starts))
        ends = np.array([goal.at for goal in leg_goals.goals.values()]).reshape(-1, 3)
        known = self._known | (nearest_distances(self._obstacles, ends) >= keep)
        hazards = self._hazards(known, keep, np.vstack((starts, leg_goals.places)))
        floor_plan = self._watch.floor_plan(np.vstack((starts, leg_goals.places))) if self._watch else None
        for drone, what in leg_goals.give_way(hazards, preferred, self._ground, floor_plan):
            simulation.log_event(drone, what)
        routes = self._routes(leg_goals, hazards, starts, delays, floor_plan)
        check_length(len(self.names), simulation.now_s + routes.duration_s)
        trajectory = Trajectory(routes, leg_goals.who, simulation.setpoints)
        unknown = {int(number): self._obstacles[number] for number in np.flatnonzero(~known)}
        return trajectory, encounters(trajectory, unknown, keep)

    def _hazards(self, known: Mask, keep: float, ends: Array) -> Hazards:
        """Return the hazards for routes: fallen drones with the usual distance, known obstacles and blocks with `keep`.

        Blocks nearer than `keep` to one of `ends` (K, 3) are left out, since goals are not moved away from blocks.
        """
        fallen = self._simulation.places[self._simulation.failed & ~self._simulation.falling]
        blocks = self._blocks[nearest_distances(self._blocks, ends) >= keep]
        points = np.vstack((fallen, self._obstacles[known], blocks))
        kept = int(known.sum()) + len(blocks)
        radii = np.concatenate((np.full(len(fallen), self._distance), np.full(kept, keep)))
        return Hazards(points, radii)

    def _routes(
        self, leg_goals: LegGoals, hazards: Hazards, starts: Array, delays: Array, floor_plan: WallPlan | None
    ) -> RoutePlan:
        """Plan the routes of a leg, from `starts` (N, 3)."""
        planned = leg_goals.planned_distance(starts, hazards)
        self._simulation.set_spare_distance(planned - self._distance)
        who = leg_goals.who
        self._progress(f"planning routes of {len(who)} drones")
        if self._watch and floor_plan:
            floor_plan = self._watch.with_routes(floor_plan, who, starts, leg_goals.places)
        try:
            return plan_routes(
                starts[who],
                leg_goals.places[who],
                distance=planned,
                standing=leg_goals.standing(hazards, starts, planned),
                delays=delays[who],
                limits=self._limits,
                ground=self._ground,
                rises=self._rises,
                downwash=self._downwash,
                floor_plan=floor_plan,
            )
        except (TooCloseError, NoRouteError) as refused:
            raise ValueError(self._refusal(refused, who)) from refused

    def _refusal(self, refused: TooCloseError | NoRouteError, who: npt.NDArray[np.intp]) -> str:
        """Return the error text of `refused`, with the drones' names. The planner only has their indices in `who`."""
        numbers = refused.drones if isinstance(refused, NoRouteError) else (refused.first, refused.second)
        named = [self.names[who[number]] if number < len(who) else "an obstacle" for number in numbers]
        if isinstance(refused, NoRouteError) and refused.indoors:
            past = f"{named[0]} gets past the others" if len(named) == 1 else f"{', '.join(named)} get past each other"
            problem = f"no order of flying was found in which {past} between the walls"
            return f"{problem}: use a smaller distance, or other goals"
        if isinstance(refused, NoRouteError):
            return f"there is no route for {', '.join(named)}: obstacles enclose the start or the end"
        ends = "start" if refused.where == "start" else "are to end"
        return f"{' and '.join(named)} {ends} only {refused.distance_m:.3g} m from each other"

    def _follow(
        self, trajectory: Trajectory, watched: Sequence[ObstacleEncounter], reported: int | None
    ) -> list[BlockedReport]:
        """Fly the trajectory to its end, or until it has stopped because of an obstacle.

        Unless `reported` is None, also stop once there are more than `reported` failures.
        """
        simulation = self._simulation
        reports: list[BlockedReport] = []
        waited = 0.0
        while True:
            late = waited > _LATE_S
            simulation.advance(trajectory, late=late)
            if not simulation.is_sampled:
                continue
            planned_s = trajectory.plan.duration_s
            self._progress(f"leg {len(self._legs) + 1}, {trajectory.s:.1f} s of {planned_s:.1f} s flown")
            reports += self._newly_seen_obstacles(trajectory, watched)
            if reports or (reported is not None and len(simulation.failures) > reported):
                trajectory.stop()
            if trajectory.has_ended:
                trajectory.update_setpoints()
                if reports and reported is None:
                    return reports
                if simulation.settled(_CLOSE_M, _SLOW_M_S) or waited > SETTLING_S:
                    return reports
                waited += 1 / SAMPLE_RATE_HZ

    def _newly_seen_obstacles(
        self, trajectory: Trajectory, watched: Sequence[ObstacleEncounter]
    ) -> list[BlockedReport]:
        """Return a report for each unknown obstacle that a drone sees now."""
        simulation = self._simulation
        reports = []
        for number, drone, until, keep in watched:
            if self._known[number] or simulation.failed[drone] or trajectory.s > until:
                continue
            gap = float(np.sqrt(np.square(simulation.places[drone] - self._obstacles[number]).sum()))
            if gap <= max(SIGHT_M, keep + LIMITS.speed * STOP_S / 2 + _SIGHT_MARGIN_M):
                self._known[number] = True
                self._seen_s[number] = simulation.now_s
                place = self.conditions.obstacles[number]
                simulation.log_event(drone, f"sees an obstacle at ({', '.join(f'{x:g}' for x in place)})")
                reports.append(BlockedReport(self.names[drone], place, simulation.now_s))
        return reports

    def _log_unfinished(self) -> None:
        apart = self._simulation.tracking_errors()
        worst = int(apart.argmax())
        if apart[worst] > _FAR_M:
            self._simulation.log_event(worst, f"is {apart[worst]:.2f} m from its setpoint at the end of the leg")


def fly(
    mission: Mission, conditions: FlightConditions | None = None, progress: Callable[[str], None] | None = None
) -> FlightLog:
    """Fly all legs of `mission` and return the log.

    Args:
        mission: The drones and the legs.
        conditions: Distance, wind, failures and obstacles. None: calm air, and no failures.
        progress: See `Flight`.

    Raises:
        ValueError: There are no drones, the conditions do not fit the mission, or places are too near to each other.
    """
    conditions = conditions or FlightConditions()
    names = [drone.name for drone in mission.drones]
    homes = np.array([drone.home for drone in mission.drones], dtype=np.float64).reshape(-1, 3)
    check_homes(names, homes)
    if conditions.distance is None:
        goals = [np.array([goal.at for goal in leg.goals.values()]).reshape(-1, 3) for leg in mission.legs]
        for leg, places in zip(mission.legs, goals, strict=True):
            check_near([names[number] for number in leg.goals], places)
        conditions = replace(conditions, distance=_distance([homes, *goals], conditions.downwash))
    ground = mission.ground if mission.has_volume else None
    flight = Flight(names, homes, conditions, progress, rises=mission.rises, ground=ground, walls=mission.walls)
    blocks = [block for block in mission.blocks if not block.is_cube]
    for number, leg in enumerate(mission.legs):
        flight.fly(leg.opened_by, leg.goals, blocks=[block.at for block in blocks if block.leg <= number])
    return flight.log()


def _distance(places: Sequence[Array], downwash: float) -> float:
    """Return the default distance: `DISTANCE_M`, or less if two points in the same (K, 3) array are nearer."""
    nearest = (nearest_two(squashed(points, downwash)) for points in places)
    return max(DISTANCE_MIN_M, min(DISTANCE_M, *(_SHARE * apart for apart in nearest)))


def check_homes(names: Sequence[str], homes: Array) -> None:
    """Raise `ValueError` if there are no drones, too many, or one is too far away."""
    if not names:
        raise ValueError("there are no drones to fly: the run has decided no position")
    if len(names) > DRONES_MAX:
        raise ValueError(f"there are {len(names):,} drones, more than the maximum of {DRONES_MAX:,}")
    check_near(names, homes)


def check_near(names: Sequence[str], places: npt.ArrayLike) -> None:
    """Raise `ValueError` for the first of `places` (K, 3) that is too far away or not finite."""
    places = np.array(places, dtype=np.float64).reshape(-1, 3)
    far = np.flatnonzero(~(np.abs(places) <= COORDINATE_MAX_M).all(axis=1))  # also true for nan
    if len(far):
        place = ", ".join(f"{part:g}" for part in places[far[0]])
        raise ValueError(
            f"{names[far[0]]}: the position ({place}) m is more than {COORDINATE_MAX_M:,.0f} m from the origin;"
            " use a smaller scale"
        )


def origin_of(homes: Array) -> Array:
    """Return the origin (3,) of the simulation: 0, or the rounded mean of `homes` if the homes are far away."""
    return np.zeros(3) if np.abs(homes).max() <= _NEAR_ORIGIN_M else np.asarray(np.round(homes.mean(axis=0)))


def check_paths(names: Sequence[str], starts: Array, places: Array) -> None:
    """Raise `ValueError` if the path of a drone from `starts` to `places` (N, 3) is too long."""
    ways = np.sqrt(np.square(places - starts).sum(1))
    longest = int(ways.argmax())
    if not ways[longest] <= PATH_MAX_M:
        raise ValueError(
            f"{names[longest]} would have to fly {ways[longest]:,.0f} m, more than the maximum of {PATH_MAX_M:,.0f} m: "
            "use a smaller scale"
        )


def check_length(drones: int, until_s: float) -> None:
    """Raise `ValueError` if the log of a flight up to `until_s` would be too long."""
    most_s = _SAMPLES_MAX / drones / SAMPLE_RATE_HZ
    if until_s > most_s:
        raise ValueError(f"the flight would last {until_s:,.0f} s; the limit for {drones:,} drones is {most_s:,.0f} s")
