"""A fleet of robots that bids for RMF's tasks, and makes their trips. No input or output.

The cost of a bid is the sum of the delays of all trips of the fleet, from now to their ends, in seconds. The robots'
positions are estimated from their speeds; a program that drives real robots follows `drain_events`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from robochoc.ros.rmf.fleet_file import Place, RmfFleet
from robochoc.ros.rmf.messages import (
    ApiRequest,
    ApiResponse,
    BidNotice,
    BidProposal,
    BidResponse,
    CommandType,
    DispatchAck,
    DispatchCommand,
    Message,
    ResponseType,
)
from robochoc.ros.rmf.task_request import (
    INVALID_REQUEST,
    NOT_FEASIBLE,
    OUT_OF_ORDER,
    CancelTask,
    RequestError,
    TaskRequest,
    error_json,
    failure_json,
    read_request,
    read_task,
    state_json,
    success_json,
    task_state_update,
)
from robochoc.ros.rmf.trips import PLANNED_MAX, Plan, RobotState, Trip, plan, timed, trip_of
from robochoc.run.defaults import AUTO

BIDS_MAX = 1000
"""The number of stored bids; the oldest are dropped."""
WAITING_MAX = 100
"""The number of trips that may wait; further ones are refused."""
ENDED_MAX = 1000
_NS, _MS = 10**9, 1000


class TripEvent(NamedTuple):
    """An event of a task: `queued`, `underway`, `completed` or `canceled`, with its robot and its stops."""

    what: str
    task_id: str
    robot: str
    stops: tuple[Place, ...]


@dataclass
class _Robot:
    """A robot: where and when its present trip ends, and the trips that wait, in order."""

    at: Place
    speed_ms: float
    free_s: float = 0.0
    present: str = ""
    order: list[str] = field(default_factory=list)


class _Task(NamedTuple):
    request: TaskRequest
    trip: Trip


class _Bid(NamedTuple):
    task: _Task
    response: BidResponse


class Bidder:
    """Bids for `fleet`. Each method takes the time in seconds, which never decreases, and `drain` returns messages.

    Args:
        fleet: The fleet.
        epoch_ns: The time since 1970 in nanoseconds at the time 0 s.
        protocol: The protocol by which the robots decide about their trips.
    """

    def __init__(self, fleet: RmfFleet, *, epoch_ns: int = 0, protocol: str = AUTO) -> None:
        self._fleet, self._epoch_ns, self._protocol = fleet, epoch_ns, protocol
        self._robots = {name: _Robot(spec.at, spec.speed_ms) for name, spec in fleet.robots.items()}
        self._bids: dict[str, _Bid] = {}
        self._tasks: dict[str, _Task] = {}
        """The tasks that wait or are underway, in the order of their awards."""
        self._ended: dict[str, None] = {}
        self._outgoing: list[Message] = []
        self._events: list[TripEvent] = []

    def receive(self, message: Message, now_s: float) -> None:
        """Handle a message. Messages that are unexpected or repeated have no effect."""
        self._proceed(now_s)
        match message:
            case BidNotice():
                self._bid(message, now_s)
            case DispatchCommand(fleet_name=fleet, task_id=task_id) if fleet != self._fleet.name:
                self._bids.pop(task_id, None)
            case DispatchCommand():
                self._outgoing.append(self._obey(message, now_s))
            case ApiRequest():
                self._answer(message, now_s)
            case _:
                pass

    def tick(self, now_s: float) -> None:
        """Let robots begin and end trips."""
        self._proceed(now_s)

    def drain(self) -> list[Message]:
        """Return the messages to send, in order."""
        found, self._outgoing = self._outgoing, []
        return found

    def drain_events(self) -> list[TripEvent]:
        """Return the events of tasks since the last call."""
        found, self._events = self._events, []
        return found

    @property
    def orders(self) -> Mapping[str, tuple[str, ...]]:
        """The tasks of each robot: the one that is underway, and those that wait, in order."""
        return {name: (*filter(None, [one.present]), *one.order) for name, one in self._robots.items()}

    # Bids

    def _bid(self, notice: BidNotice, now_s: float) -> None:
        task_id = notice.task_id
        if not task_id or task_id in self._tasks or task_id in self._ended:
            return
        if task_id in self._bids:  # a second, different bid would look like that of another bidder
            self._outgoing.append(self._bids[task_id].response)
            return
        try:
            request = read_task(notice.request)
            if request.fleet_name not in (None, self._fleet.name):
                return
            task = _Task(request, trip_of(request, self._fleet))
        except RequestError as error:
            self._refuse(task_id, INVALID_REQUEST, "Invalid request format", str(error))
            return
        if sum(len(one.order) for one in self._robots.values()) >= WAITING_MAX:
            self._refuse(task_id, NOT_FEASIBLE, "Not feasible", f"{WAITING_MAX} tasks wait")
            return
        before, after = self._plan(now_s), self._plan(now_s, task_id, task.trip)
        end_ns = self._epoch_ns + round(after.ends_s[task_id] * _NS)
        proposal = BidProposal(self._fleet.name, after.robot_of(task_id), before.cost_s, after.cost_s, end_ns)
        response = BidResponse(task_id, has_proposal=True, proposal=proposal)
        self._outgoing.append(response)
        if not notice.dry_run:
            self._bids[task_id] = _Bid(task, response)
            if len(self._bids) > BIDS_MAX:
                del self._bids[next(iter(self._bids))]

    def _refuse(self, task_id: str, code: int, category: str, detail: str) -> None:
        self._outgoing.append(BidResponse(task_id, has_proposal=False, errors=(error_json(code, category, detail),)))

    def _plan(self, now_s: float, new_id: str = "", new: Trip | None = None) -> Plan:
        """Return the plan for the trips that wait, and a new one. The newest are planned together."""
        trips = {name: self._tasks[name].trip for one in self._robots.values() for name in one.order}
        orders = {name: tuple(one.order) for name, one in self._robots.items()}
        robots = {name: RobotState(one.at, max(one.free_s, now_s), one.speed_ms) for name, one in self._robots.items()}
        present = timed(self._fleet, robots, trips, orders, now_s)
        if new is None:
            return present
        if len(trips) < PLANNED_MAX:
            found = plan(self._fleet, robots, {**trips, new_id: new}, now_s, protocol=self._protocol)
            if found is not None:
                return found
        appended = (
            timed(self._fleet, robots, {**trips, new_id: new}, {**orders, name: (*order, new_id)}, now_s)
            for name, order in orders.items()
        )
        return min(appended, key=lambda one: one.cost_s)

    # Commands

    def _obey(self, command: DispatchCommand, now_s: float) -> DispatchAck:
        task_id, number = command.task_id, command.dispatch_id
        if command.type == CommandType.REMOVE:
            self._bids.pop(task_id, None)
            self._cancel(task_id, now_s)
            return DispatchAck(number, success=True)
        if command.type != CommandType.AWARD:
            error = error_json(4, "Unsupported type", f"the command has the type {command.type}")
            return DispatchAck(number, success=False, errors=(error,))
        bid = self._bids.pop(task_id, None)
        if bid is not None:
            self._accept(task_id, bid.task, now_s)
        elif task_id not in self._tasks and task_id not in self._ended:
            error = error_json(OUT_OF_ORDER, "Invalid sequence", f"there is no bid for {task_id}")
            return DispatchAck(number, success=False, errors=(error,))
        return DispatchAck(number, success=True)

    def _accept(self, task_id: str, task: _Task, now_s: float) -> None:
        chosen = self._plan(now_s, task_id, task.trip)
        self._tasks[task_id] = task
        for name, order in chosen.orders.items():
            robot = self._robots[name]
            robot.order, robot.free_s = [*order], max(robot.free_s, now_s)
        self._report("queued", task_id, chosen.robot_of(task_id), chosen.ends_s[task_id])
        self._proceed(now_s)

    def _cancel(self, task_id: str, now_s: float) -> bool:
        """Drop a task that waits; return whether there was one."""
        for name, robot in self._robots.items():
            if task_id in robot.order:
                robot.order.remove(task_id)
                self._report("canceled", task_id, name, now_s)
                self._end(task_id)
                return True
        return False

    def _answer(self, request: ApiRequest, now_s: float) -> None:
        """Answer a request to cancel a task of this fleet; others answer all other requests."""
        try:
            found = read_request(request.json_msg)
        except RequestError:
            return
        if not isinstance(found, CancelTask) or found.task_id not in self._tasks:
            return
        if self._cancel(found.task_id, now_s):
            text = success_json()
        else:
            text = failure_json(NOT_FEASIBLE, "Not feasible", f"{found.task_id} is underway")
        self._outgoing.append(ApiResponse(int(ResponseType.RESPONDING), text, request.request_id))

    # Trips

    def _proceed(self, now_s: float) -> None:
        """End trips, and begin the next ones."""
        for name, robot in self._robots.items():
            while robot.free_s <= now_s and (robot.present or robot.order):
                if robot.present:
                    self._report("completed", robot.present, name, robot.free_s)
                    self._end(robot.present)
                    robot.present = ""
                else:
                    self._begin(name, robot)

    def _begin(self, name: str, robot: _Robot) -> None:
        robot.present = robot.order.pop(0)
        trip = self._tasks[robot.present].trip
        way_m = self._fleet.way_m(robot.at, trip.stops[0]) + trip.length_m
        robot.at, robot.free_s = trip.stops[-1], robot.free_s + way_m / robot.speed_ms
        self._report("underway", robot.present, name, robot.free_s)

    def _end(self, task_id: str) -> None:
        del self._tasks[task_id]
        self._ended[task_id] = None
        if len(self._ended) > ENDED_MAX:
            del self._ended[next(iter(self._ended))]

    def _report(self, what: str, task_id: str, robot: str, end_s: float) -> None:
        task = self._tasks[task_id]
        end_ms = self._epoch_ns // (_NS // _MS) + round(end_s * _MS)
        state = state_json(task_id, task.request, what, (self._fleet.name, robot), unix_millis_finish_time=end_ms)
        self._outgoing.append(task_state_update(state))
        self._events.append(TripEvent(what, task_id, robot, task.trip.stops))
