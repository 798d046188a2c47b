"""Played Nav2 robots: action servers of `NavigateToPose`, which behave well or badly. They share no code with clients.

Run as `python -m tests.support.played_nav2 dds:DOMAIN ROBOTS` or `... rmw_zenoh:HOST:PORT ROBOTS`. ROBOTS is a JSON
object with the manner of each robot, such as `{"/nose": "drives"}` (`MANNERS`). It prints "ready", then a line of JSON
for each event, `["/nose", "goal", [1.0, 2.0, 0.0]]`. A line `["/nose", "aborts"]` of its input changes the manner. It
ends with its input.
"""

import argparse
import json
import os
import select
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from tests.support.dds_peer import Header, Point, Pose, PoseStamped
from tests.support.nav2_types import (
    SERVICES,
    UUID,
    CancelResponse,
    Feedback,
    FeedbackMessage,
    GetResultResponse,
    GoalInfo,
    Result,
    SendGoalResponse,
    with_header,
)

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
TF_ERROR = 9002
MANNERS = {
    "drives": "it accepts goals, sends feedback, and arrives after some steps",
    "keeps driving": "it never arrives",
    "rejects": "it rejects every goal",
    "aborts": "it aborts every goal after some steps",
    "aborts later": "it arrives at its first goal, and aborts every later one after some steps",
    "mute": "it answers nothing",
    "falls silent": "it accepts goals, and then sends nothing",
    "twice": "as 'drives', but everything is sent twice",
    "others": "as 'drives', but first it sends feedback of another goal, and an answer to nobody",
    "garbage": "its answers cannot be read",
    "unknown status": "its results have a status that does not exist",
    "vanishes": "its server is gone after some steps",
}
STEPS = 3
_STEP_S = 0.02

Reply = Callable[[Any], None]


def uuid_of(goal: bytes) -> UUID:
    return UUID(uuid=[*goal])  # type: ignore[arg-type]  # the library's arrays are lists


def say(*what: object) -> None:
    sys.stdout.write(json.dumps(what if len(what) > 1 else what[0]) + "\n")
    sys.stdout.flush()


@dataclass
class Robot:
    """A robot that is at most on the way to one goal."""

    name: str
    manner: str
    publish: Callable[[FeedbackMessage], None]
    vanish: Callable[[], None]
    goal: bytes = b""
    steps: int = 0
    at: Point = field(default_factory=Point)
    to: Point = field(default_factory=Point)
    waiting: dict[bytes, list[Reply]] = field(default_factory=dict)
    results: dict[bytes, int] = field(default_factory=dict)

    def receive(self, service: str, request: Any, reply: Reply) -> None:  # noqa: ANN401 - one of three types
        """Handle a request."""
        if self.manner == "mute":
            return
        match service:
            case "send_goal":
                self._begin(request, reply)
            case "get_result":
                goal = bytes(request.goal_id.uuid)
                self.waiting.setdefault(goal, []).append(reply)
                if goal in self.results:
                    self._end(goal, self.results[goal])
            case "cancel_goal":
                goal = bytes(request.goal_info.goal_id.uuid)
                say(self.name, "cancel", goal.hex())
                reply(CancelResponse(goals_canceling=[GoalInfo(goal_id=uuid_of(goal))]))  # type: ignore[arg-type]  # a list
                if goal == self.goal:
                    self._end(goal, CANCELED)
            case _:
                raise AssertionError(service)

    def _begin(self, request: Any, reply: Reply) -> None:  # noqa: ANN401 - made at run time
        place = request.goal.pose.pose.position
        goal = bytes(request.goal_id.uuid)
        say(self.name, "goal", [place.x, place.y, place.z], request.goal.pose.header.frame_id)
        reply(SendGoalResponse(accepted=self.manner != "rejects"))
        if self.manner == "rejects":
            return
        if self.goal:
            self._end(self.goal, ABORTED)  # as Nav2 does with a goal that another one replaces
        self.goal, self.steps, self.to = goal, 0, place

    def step(self) -> None:
        """Drive on."""
        if not self.goal or self.manner in {"mute", "falls silent"}:
            return
        self.steps += 1
        share = min(self.steps / STEPS, 1)
        here = Point(*(a + (b - a) * share for a, b in zip(self._xyz(self.at), self._xyz(self.to), strict=True)))
        pose = PoseStamped(header=Header(frame_id="map"), pose=Pose(position=here))
        if self.manner == "others":
            self.publish(FeedbackMessage(goal_id=uuid_of(bytes([7] * 16)), feedback=Feedback(current_pose=pose)))
        for _ in range(1 + (self.manner == "twice")):
            message = FeedbackMessage(goal_id=uuid_of(self.goal), feedback=Feedback(current_pose=pose))
            self.publish(message)
        if self.steps < STEPS:
            return
        match self.manner:
            case "aborts":
                self._end(self.goal, ABORTED)
            case "aborts later":
                self.at = self.to
                self._end(self.goal, ABORTED if SUCCEEDED in self.results.values() else SUCCEEDED)
            case "unknown status":
                self._end(self.goal, 77)
            case "vanishes":
                self.goal = b""
                self.vanish()
            case "drives" | "twice" | "others" | "garbage":
                self.at = self.to
                self._end(self.goal, SUCCEEDED)
            case _:
                pass

    def _end(self, goal: bytes, status: int) -> None:
        self.results[goal] = status
        say(self.name, "ended", status)
        if goal == self.goal:
            self.goal = b""
        for reply in self.waiting.pop(goal, ()):
            error = TF_ERROR if status == ABORTED else 0
            reply(GetResultResponse(status=status, result=Result(error_code=error)))

    @staticmethod
    def _xyz(point: Point) -> tuple[float, float, float]:
        return point.x, point.y, point.z


class DdsEnd:
    """The servers in a DDS domain, as rmw_cyclonedds has them."""

    def __init__(self, place: str, manners: dict[str, str]) -> None:
        from cyclonedds.core import Policy, Qos  # noqa: PLC0415 - the other end needs none
        from cyclonedds.domain import DomainParticipant  # noqa: PLC0415 - as above
        from cyclonedds.pub import DataWriter  # noqa: PLC0415 - as above
        from cyclonedds.sub import DataReader  # noqa: PLC0415 - as above
        from cyclonedds.topic import Topic  # noqa: PLC0415 - as above

        participant = DomainParticipant(int(place))
        quality = Qos(
            Policy.Reliability.Reliable(1_000_000_000),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(10),
            Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),
        )
        self.robots: dict[str, Robot] = {}
        self.ends: dict[tuple[str, str], tuple[Any, Any, Any]] = {}
        for name, manner in manners.items():
            action = f"{name}/navigate_to_pose/_action"
            for service, kinds in SERVICES.items():
                asked, told = (with_header(kind) for kind in kinds)
                reader = DataReader(participant, Topic(participant, f"rq{action}/{service}Request", asked), qos=quality)
                writer = DataWriter(participant, Topic(participant, f"rr{action}/{service}Reply", told), qos=quality)
                self.ends[name, service] = reader, writer, told
            feedback = DataWriter(participant, Topic(participant, f"rt{action}/feedback", FeedbackMessage), qos=quality)
            self.robots[name] = Robot(name, manner, feedback.write, lambda name=name: self.vanish(name))  # type: ignore[misc]

    def vanish(self, name: str) -> None:
        for service in SERVICES:
            self.ends.pop((name, service))
        import gc  # noqa: PLC0415 - the library deletes what nobody refers to

        gc.collect()

    def take(self) -> None:
        for (name, service), (reader, writer, told) in [*self.ends.items()]:
            for request in reader.take(100):
                if request.sample_info.valid_data:
                    self.robots[name].receive(service, request, self._reply(self.robots[name], writer, told, request))

    def _reply(self, robot: Robot, writer: Any, told: Any, request: Any) -> Reply:  # noqa: ANN401 - as above
        header = {"guid": request.guid, "seq": request.seq}

        def reply(answer: Any) -> None:  # noqa: ANN401 - as above
            deadline = time.monotonic() + 10
            while not writer.get_publication_matched_status().current_count and time.monotonic() < deadline:
                time.sleep(0.005)
            if robot.manner == "others":
                writer.write(told(guid=1, seq=1, **vars(answer)))
                writer.write(told(guid=request.guid, seq=10**12, **vars(answer)))
            for _ in range(1 + (robot.manner == "twice")):
                writer.write(told(**header, **vars(answer)))

        return reply


class ZenohEnd:
    """The servers at a zenoh router, as rmw_zenoh has them."""

    def __init__(self, place: str, manners: dict[str, str]) -> None:
        import zenoh  # noqa: PLC0415 - the other end needs none

        from robochoc.ros.type_hashes import service_hash, type_hash  # noqa: PLC0415 - they are compared with ROS 2's

        settings = zenoh.Config()
        settings.insert_json5("mode", '"client"')
        settings.insert_json5("connect/endpoints", json.dumps([f"tcp/{place}"]))
        self.session = zenoh.open(settings)
        self.robots: dict[str, Robot] = {}
        self.declared: dict[str, list[Any]] = {}
        self.waiting: list[tuple[str, str, Any]] = []
        kinds = {"send_goal": "SendGoal", "get_result": "GetResult"}
        node = f"@ros2_lv/0/{self.session.zid()}/0"
        for number, (name, manner) in enumerate(manners.items()):
            self.declared[name] = []
            for service in SERVICES:
                action = f"{name}/navigate_to_pose/_action/{service}"
                kind = f"nav2_msgs/NavigateToPose_{kinds[service]}" if service in kinds else "action_msgs/CancelGoal"
                package, short = kind.split("/")
                dds = f"{package}::{'action' if service in kinds else 'srv'}::dds_::{short}_/{service_hash(kind)}"
                key = f"0/{action[1:]}/{dds}"
                queryable = self.session.declare_queryable(
                    key,
                    lambda query, name=name, service=service: self.waiting.append((name, service, query)),  # type: ignore[misc]
                    complete=True,
                )
                token = f"{node}/{number}/SS/%/%/player/{action.replace('/', '%')}/{dds}/::,10:,:,:,,"
                self.declared[name] += [queryable, self.session.liveliness().declare_token(token)]
            feedback = f"0/{name[1:]}/navigate_to_pose/_action/feedback/nav2_msgs::action::dds_::"
            feedback += f"NavigateToPose_FeedbackMessage_/{type_hash('nav2_msgs/NavigateToPose_FeedbackMessage')}"

            def publish(message: FeedbackMessage, key: str = feedback) -> None:
                self.session.put(key, message.serialize(use_version_2=False), attachment=bytes(33))

            self.robots[name] = Robot(name, manner, publish, lambda name=name: self.vanish(name))  # type: ignore[misc]

    def vanish(self, name: str) -> None:
        for one in self.declared[name]:
            one.undeclare()

    def take(self) -> None:
        while self.waiting:
            name, service, query = self.waiting.pop(0)
            request = SERVICES[service][0].deserialize(query.payload.to_bytes())
            self.robots[name].receive(service, request, self._reply(self.robots[name], query))

    @staticmethod
    def _reply(robot: Robot, query: Any) -> Reply:  # noqa: ANN401 - as above
        def reply(answer: Any) -> None:  # noqa: ANN401 - as above
            content = b"\0\1\0\0\xff" if robot.manner == "garbage" else answer.serialize(use_version_2=False)
            for _ in range(1 + (robot.manner == "twice")):
                query.reply(query.key_expr, content, attachment=query.attachment)
            query.drop()

        return reply


def run(end: DdsEnd | ZenohEnd) -> None:
    """Serve until the input ends."""
    say("ready")
    next_s = time.monotonic()
    while True:
        if select.select([sys.stdin], [], [], 0.005)[0]:
            line = sys.stdin.readline()
            if not line:
                return
            name, manner = json.loads(line)
            end.robots[name].manner = manner
            say(name, "is told", manner)
        end.take()
        if time.monotonic() >= next_s:
            next_s = time.monotonic() + _STEP_S
            for robot in end.robots.values():
                robot.step()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("place", metavar="PLACE")
    parser.add_argument("robots", type=json.loads, metavar="ROBOTS", help="a JSON object")
    asked = parser.parse_args()
    middleware, _, where = asked.place.partition(":")
    with suppress(KeyboardInterrupt, BrokenPipeError):
        run(DdsEnd(where, asked.robots) if middleware == "dds" else ZenohEnd(where, asked.robots))
    os._exit(0)  # zenoh's threads would keep it
