"""Played RMF fleets: adapters after rmf_fleet_adapter's public source, and messages that are lost, late or repeated.

As there: an adapter computes one bid at a time, and drops it for a newer notice; it ignores notices for tasks for which
it has stored a bid; a bid contains the plan for all its tasks, which an award makes its plan; a command for another
fleet drops the stored bid.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random

from robochoc.ros.rmf.bidder import Bidder, TripEvent
from robochoc.ros.rmf.dispatcher import Dispatcher
from robochoc.ros.rmf.fleet_file import RmfFleet
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
)


def base_of(task_id: str) -> str:
    """Return the id of a task without what a dispatcher of robochoc adds for dry runs and later bids."""
    base = task_id.partition("?")[0]
    return ".".join(base.split(".")[:2])


Cost = Callable[[str], float]
"""The time that a task takes a fleet, by the task's id."""


@dataclass
class PlayedFleet:
    """An adapter. `queue` has the ids of its tasks; `think_s` is the time that it needs for a bid."""

    name: str
    cost: Cost = lambda _: 1.0
    think_s: float = 0.0
    knows_dry_runs: bool = True
    """False: an adapter of before 2025."""
    declines: set[str] = field(default_factory=set)
    queue: list[str] = field(default_factory=list)
    bids: dict[str, list[str]] = field(default_factory=dict)
    computing: tuple[float, BidNotice, list[str]] | None = None
    awards: list[str] = field(default_factory=list)

    def receive(self, message: Message, now_s: float) -> list[Message]:
        match message:
            case BidNotice(task_id=task_id) if task_id not in self.bids:
                self.computing = (now_s + self.think_s, message, [*self.queue])
                return self.tick(now_s)
            case DispatchCommand(fleet_name=fleet) if fleet != self.name:
                self.bids.pop(message.task_id, None)
                return []
            case DispatchCommand():
                return [self._obey(message)]
            case _:
                return []

    def tick(self, now_s: float) -> list[Message]:
        if self.computing is None or now_s < self.computing[0]:
            return []
        (_, notice, queue), self.computing = self.computing, None
        task_id = notice.task_id
        if base_of(task_id) in self.declines:
            return [BidResponse(task_id, has_proposal=False, errors=("declined",))]
        if not notice.dry_run or not self.knows_dry_runs:
            self.bids[task_id] = [*queue, task_id]
        cost = sum(self.cost(base_of(one)) for one in queue)
        proposal = BidProposal(self.name, f"{self.name}-robot", cost, cost + self.cost(base_of(task_id)), 10**9)
        return [BidResponse(task_id, has_proposal=True, proposal=proposal)]

    def _obey(self, command: DispatchCommand) -> DispatchAck:
        task_id = command.task_id
        if command.type == CommandType.REMOVE:
            self.bids.pop(task_id, None)
            self.queue = [task for task in self.queue if task != task_id]
            return DispatchAck(command.dispatch_id, success=True)
        if task_id in self.bids:
            self.queue = self.bids.pop(task_id)
            self.awards.append(task_id)
            return DispatchAck(command.dispatch_id, success=True)
        known = task_id in self.queue
        return DispatchAck(command.dispatch_id, success=known, errors=() if known else ("unknown bid",))


class BiddingFleet:
    """A fleet of robochoc, which is played as the others are."""

    def __init__(self, fleet: RmfFleet) -> None:
        self.name, self.bidder = fleet.name, Bidder(fleet)
        self.events: list[TripEvent] = []

    @property
    def queue(self) -> list[str]:
        """The tasks that it has or had."""
        dropped = {event.task_id for event in self.events if event.what == "canceled"}
        return [event.task_id for event in self.events if event.what == "queued" and event.task_id not in dropped]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        self.bidder.receive(message, now_s)
        self.events += self.bidder.drain_events()
        return self.bidder.drain()

    def tick(self, now_s: float) -> list[Message]:
        self.bidder.tick(now_s)
        self.events += self.bidder.drain_events()
        return self.bidder.drain()


def patrol_request(number: int, **more: object) -> ApiRequest:
    """Return a user's request for a patrol."""
    task = {"category": "patrol", "description": {"places": ["pantry", "coe"], "rounds": 1}, **more}
    return ApiRequest(json.dumps({"type": "dispatch_task_request", "request": task}), f"request-{number}")


@dataclass
class PlayedNetwork:
    """A dispatcher, fleets, and a user, with a clock. Messages between two ends on one topic keep their order."""

    dispatcher: Dispatcher
    fleets: Mapping[str, PlayedFleet | BiddingFleet]
    chance: Random
    loss: float = 0.0
    repeat: float = 0.0
    late_s: float = 0.0
    now_s: float = 0.0
    responses: dict[str, str] = field(default_factory=dict)
    cut: set[str] = field(default_factory=set)
    """The fleets that are cut off."""
    _on_way: list[tuple[float, int, str, Message]] = field(default_factory=list)
    _last: dict[tuple[str, str], float] = field(default_factory=dict)
    _count: int = 0

    def send(self, sender: str, receiver: str, message: Message) -> None:
        """Send a message, which may be lost, repeated, or late.

        Notices are not repeated: the dispatcher sends each once, and an adapter plans a task twice if it gets a notice
        again after the award.
        """
        if self.chance.random() < self.loss or {sender, receiver} & self.cut:
            return
        link = (f"{sender}-{receiver}", type(message).__name__)
        twice = self.chance.random() < self.repeat and not isinstance(message, BidNotice)
        for _ in range(1 + twice):
            at_s = max(self.now_s + self.chance.random() * self.late_s, self._last.get(link, 0.0))
            self._last[link] = at_s
            self._count += 1
            self._on_way.append((at_s, self._count, receiver, message))

    def request(self, requests: Sequence[ApiRequest]) -> None:
        for request in requests:
            self.send("user", "dispatcher", request)

    def run(self, limit_s: float, *, step_s: float = 0.25) -> None:
        """Run until all tasks have ended and no message is on its way, for at most `limit_s`."""
        until_s = self.now_s + limit_s
        while self.now_s < until_s:
            self._deliver()
            self.dispatcher.tick(self.now_s)
            self._publish()
            for fleet in self.fleets.values():
                for answer in fleet.tick(self.now_s):
                    self.send(fleet.name, "dispatcher", answer)
            if self.dispatcher.is_idle and not self._on_way:
                return
            self.now_s += step_s

    def _deliver(self) -> None:
        while due := sorted(one for one in self._on_way if one[0] <= self.now_s):
            self._on_way = [one for one in self._on_way if one[0] > self.now_s]
            for _, _, receiver, message in due:
                self._arrive(receiver, message)

    def _arrive(self, receiver: str, message: Message) -> None:
        if receiver == "dispatcher":
            self.dispatcher.receive(message, self.now_s)
            self._publish()
        elif receiver == "user":
            if isinstance(message, ApiResponse):
                self.responses[message.request_id] = message.json_msg
        else:
            for answer in self.fleets[receiver].receive(message, self.now_s):
                self.send(receiver, "dispatcher", answer)

    def _publish(self) -> None:
        for message in self.dispatcher.drain():
            receivers = ["user"] if isinstance(message, ApiResponse) else [*self.fleets]
            for receiver in receivers:
                self.send("dispatcher", receiver, message)
