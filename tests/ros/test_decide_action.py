"""The action of `robochoc serve`: goals over DDS, zenoh and a rosbridge are decided, cancelled and refused."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from lxml import etree

from robochoc.app.sketch.building import model_of
from robochoc.cli.group import cli
from robochoc.robots.sink import Fields
from robochoc.ros.decide_service import DECIDE, refusal
from robochoc.ros.interfaces import DECIDE_ACTION
from robochoc.ros.live import dds_service, service_goals
from robochoc.ros.live.action_goals import ENDED_MAX, ActionGoals, CancelCode, GoalClients, GoalStatus
from robochoc.ros.live.actions import Actions, GoalEvent, GoalPhase, open_actions
from robochoc.ros.live.service_goals import ServiceGoals
from robochoc.ros.live.services import ENDED, WAITING_MAX, ServiceRequest
from tests.support.dds import LOOPBACK_ALONE, free_domain
from tests.support.examples import drawn
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT
from tests.support.rosbridge_server import Server, begin_the_loop_of_roslibpy
from tests.support.slot_sketches import slots
from tests.support.zenoh_ros2 import Router

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
PACKAGES = ROOT / "docs" / "ros2"
ACTION = "/robochoc/decide"
GOAL = "12" * 16
ENDS = {GoalPhase.SUCCEEDED, GoalPhase.ABORTED, GoalPhase.CANCELED, GoalPhase.REJECTED, GoalPhase.LOST}

pytestmark = pytest.mark.usefixtures("no_ros_here")


# Goals


class Recorded(GoalClients):
    """Clients that record everything."""

    def __init__(self) -> None:
        self.statuses: list[dict[str, int]] = []
        self.fed: list[tuple[str, Fields]] = []
        self.results: list[tuple[str, GoalStatus, str]] = []

    def status(self, goals: Mapping[str, tuple[GoalStatus, int]]) -> None:
        self.statuses.append({goal: int(status) for goal, (status, _) in goals.items()})

    def feedback(self, goal: str, fields: Fields) -> None:
        self.fed.append((goal, fields))

    def ended(self, goal: str, status: GoalStatus, result: Fields) -> None:
        self.results.append((goal, status, str(result["message"])))


class Goals:
    """Goals with a queue of a given size."""

    def __init__(self, room: int = WAITING_MAX, refuse: Callable[[str], Fields] = refusal) -> None:
        self.queue: list[ServiceRequest] = []
        self.cancelled = 0
        self.goals = ActionGoals("goal", self._cancel, refuse)
        self.goals.set_queue(self._put)
        self.room = room
        self.clients = self.goals.clients = Recorded()

    def _put(self, request: ServiceRequest) -> bool:
        has_room = len(self.queue) < self.room
        self.queue += [request] * has_room
        return has_room

    def _cancel(self) -> None:
        self.cancelled += 1


def test_a_goal_is_accepted_decided_and_ends() -> None:
    played = Goals()
    assert played.goals.accept("a", {"team": "x"})
    assert not played.goals.accept("a", {}), "an id is used once"
    assert [(one.client, one.fields) for one in played.queue] == [("a", {"team": "x"})]
    assert played.goals.begin("a")
    played.goals.feedback({"cost": "3"})
    played.goals.finish({"success": True, "message": "solution"})
    assert played.clients.statuses == [{"a": 1}, {"a": 2}, {"a": 4}]
    assert played.clients.fed == [("a", {"cost": "3"})]
    assert played.clients.results == [("a", GoalStatus.SUCCEEDED, "solution")]
    assert played.goals.outcome("a") == (GoalStatus.SUCCEEDED, {"success": True, "message": "solution"})
    assert played.goals.outcome("b") == (GoalStatus.UNKNOWN, {})
    played.goals.finish({"success": True, "message": "again"})
    assert len(played.clients.results) == 1


def test_goals_are_cancelled() -> None:
    played = Goals()
    for name in "ab":
        played.goals.accept(name, {})
    assert played.goals.begin("a")
    assert played.goals.cancel("b") is CancelCode.NONE
    assert played.clients.results == [("b", GoalStatus.CANCELED, "cancelled before its decision began")]
    assert not played.goals.begin("b")
    assert played.goals.cancel("a") is CancelCode.NONE
    assert played.cancelled == 1
    played.goals.feedback({})
    assert played.cancelled == 2, "the search may have begun only now"
    played.goals.finish({"success": False, "message": "unknown"})
    assert played.clients.results[-1] == ("a", GoalStatus.CANCELED, "unknown")
    assert played.goals.cancel("a") is CancelCode.ENDED_GOAL
    assert played.goals.cancel("z") is CancelCode.UNKNOWN_GOAL


def test_too_many_goals_are_rejected_and_the_end_is_told() -> None:
    played = Goals(room=2)
    assert [played.goals.accept(name, {}) for name in "abc"] == [True, True, False]
    played.goals.close()
    assert played.clients.results == [(name, GoalStatus.ABORTED, ENDED) for name in "ab"]
    many = Goals(room=1000)
    assert sum(many.goals.accept(str(number), {}) for number in range(100)) == WAITING_MAX
    for _ in range(3):
        for number in range(300):
            many.goals.accept(f"x{number}", {})
        many.goals.close()
    assert len(many.clients.statuses[-1]) <= 100 + WAITING_MAX


def test_goals_before_the_queue_is_there_wait() -> None:
    goals = ActionGoals("goal", lambda: None, refusal)
    queue: list[ServiceRequest] = []
    assert goals.accept("a", {})
    goals.set_queue(lambda request: queue.append(request) is None)  # type: ignore[func-returns-value]
    assert [one.client for one in queue] == ["a"]


@pytest.mark.parametrize("number", range(5))
def test_whatever_clients_do_each_goal_has_one_result(number: int) -> None:
    chance = drawn(f"goals {number}")
    played = Goals(room=chance.randint(1, 20))
    accepted: list[str] = []
    for _ in range(300):
        names = [f"{chance.randrange(250)}" for _ in range(2)]
        match chance.randrange(6):
            case 0 | 1:
                accepted += names[:1] * played.goals.accept(names[0], {"team": chance.choice((1, "", None))})
            case 2:
                code = played.goals.cancel(chance.choice([*played.goals.open_goals(), *names]))
                assert code in set(CancelCode)
            case 3 if played.queue:
                request = played.queue.pop(0)
                if played.goals.begin(request.client):
                    played.goals.feedback({})
            case 4:
                played.goals.finish({"success": chance.random() < 0.5, "message": ""})
            case _:
                played.goals.feedback({})
        assert len(played.goals.open_goals()) <= WAITING_MAX
    played.goals.close()
    played.goals.finish({"success": True, "message": "too late"})
    assert sorted(goal for goal, *_ in played.clients.results) == sorted(accepted)


def test_a_second_cancellation_of_a_waiting_goal_does_not_cancel_the_current_one() -> None:
    again: list[CancelCode] = []

    def refuse(why: str) -> Fields:
        again.append(played.goals.cancel("b"))
        return refusal(why)

    played = Goals(refuse=refuse)
    for name in "ab":
        played.goals.accept(name, {})
    assert played.goals.begin("a")
    assert played.goals.cancel("b") is CancelCode.NONE
    assert (again, played.cancelled) == ([CancelCode.NONE], 0)


def test_results_that_nobody_requests_are_forgotten() -> None:
    played = Goals(room=10_000)
    clients = played.goals.clients = ServiceGoals(ACTION, DECIDE, played.goals)
    for number in range(150):
        goal = f"{number:032x}"
        assert played.goals.accept(goal, {})
        played.goals.cancel(goal)
    assert len(vars(clients)["_owed"]) <= ENDED_MAX + 1


def test_services_of_an_action() -> None:
    played = Goals()
    clients = ServiceGoals(ACTION, DECIDE, played.goals)
    played.goals.clients = clients
    send, cancel, get = clients.handlers.values()
    zero = {"goal_info": {"goal_id": {"uuid": [0] * 16}, "stamp": 0}}
    one = {"goal_id": {"uuid": [*bytes.fromhex(GOAL)]}}

    def ask(handler: Callable[[ServiceRequest], Fields | None], fields: Fields) -> Any:  # noqa: ANN401 - any fields
        return handler(ServiceRequest("", fields, None))

    assert ask(cancel, zero) == {"return_code": 0, "goals_canceling": []}
    assert ask(cancel, {"goal_info": one}) == {"return_code": 2, "goals_canceling": []}
    assert ask(send, {**one, "goal": {}})["accepted"] is True
    assert ask(send, {**one, "goal": {}})["accepted"] is False
    assert ask(get, one) is None, "the answer follows"
    info = {**one, "stamp": 0}
    assert ask(cancel, zero) == {"return_code": 0, "goals_canceling": [info]}
    assert ask(get, one)["status"] == 5
    assert ask(cancel, {"goal_info": one})["return_code"] == 3
    assert ask(get, {"goal_id": {"uuid": [9] * 16}}) == {"status": 0, "result": {}}


# The command


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
    monkeypatch.setattr(dds_service, "MATCH_S", HANG_S)
    monkeypatch.setattr(service_goals, "OWED_S", HANG_S)


@pytest.fixture(params=["dds", "rmw_zenoh"])
def place(request: pytest.FixtureRequest, router: Router) -> str:
    return f"dds:{free_domain()}" if request.param == "dds" else f"rmw_zenoh:{router.place}"


def until_end(actions: Actions) -> Iterator[GoalEvent]:
    """Yield events up to the end of a goal."""
    found: list[GoalEvent] = []
    while not found or found[-1].phase not in ENDS:

        def arrived() -> bool:
            event = actions.next(0.05)
            found.extend([] if event is None else [event])
            return event is not None

        wait_until(arrived, "no event")
        yield found[-1]


def served(place: str, team: str, client: Callable[[Actions], None], *words: str) -> list[str]:
    """Serve `team` while `client` runs in a thread; return the lines of standard error."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            with open_actions(place) as actions:
                actions.prepare({ACTION: DECIDE})
                wait_until(lambda: bool(actions.has_server(ACTION)), "the action is not found")
                client(actions)
        except BaseException as error:  # noqa: BLE001 - raised below
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    done = CliRunner().invoke(cli, ["serve", team, "--ros", place, *words], catch_exceptions=False)
    thread.join(HANG_S)
    if errors:
        raise errors[0]
    assert done.exit_code == 0
    return done.stderr.splitlines()


def test_the_command_decides_goals(place: str) -> None:
    found: list[list[GoalEvent]] = []

    def client(actions: Actions) -> None:
        for team in ("hangar", "yard"):
            actions.send(ACTION, {"team": team, "timeout": HANG_S}, HANG_S)
            found.append([*until_end(actions)])

    lines = served(place, HANGAR, client, "--requests", "2")
    assert any(line.endswith("/robochoc/decide (an action, robochoc_msgs/action/Decide)") for line in lines)
    assert lines[-2:] == [
        "/robochoc/decide (goal): solution, 1 epoch",
        "/robochoc/decide (goal): unknown team 'yard'; known teams: hangar",
    ]
    decided, refused = (events[-1] for events in found)
    assert (decided.phase, decided.fields["verdict"]) == (GoalPhase.SUCCEEDED, "solution")
    assert dict(zip(decided.fields["variables"], decided.fields["values"], strict=True))["port"] == 3
    assert (refused.phase, refused.fields["success"]) == (GoalPhase.ABORTED, False)


def test_a_goal_is_cancelled_with_the_best_so_far(place: str, tmp_path: Path) -> None:
    model_of(slots(14, 14)).save(tmp_path / "slots")
    found: list[GoalEvent] = []

    def client(actions: Actions) -> None:
        goal = actions.send(ACTION, {}, HANG_S)
        for event in until_end(actions):
            found.append(event)
            if event.phase is GoalPhase.FEEDBACK and event.fields["variables"]:
                actions.cancel(goal)

    served(place, str(tmp_path / "slots"), client, "--requests", "1", "--protocol", "syncbb")
    assert found[-1].phase is GoalPhase.CANCELED
    result = found[-1].fields
    assert result["message"].endswith("the assignment is the best so far")
    assert len(result["variables"]) == len(result["values"]) > 0
    costs = [float(one.fields["cost"]) for one in found if one.phase is GoalPhase.FEEDBACK and one.fields["cost"]]
    assert costs == sorted(costs, reverse=True)
    assert float(result["cost"]) <= costs[-1]


def test_a_bridge_offers_the_action() -> None:
    begin_the_loop_of_roslibpy()
    with Server() as server:

        def client() -> None:
            assert server.wait_for(lambda: any(one["op"] == "advertise_action" for one in server.goals))
            for strange in ({}, {"id": 5}, {"id": "x" * 2000}, {"id": "other", "action": "/other"}):
                server.raw(json.dumps({"op": "send_action_goal", "action": ACTION, **strange}))
            server.raw(json.dumps({"op": "send_action_goal", "action": ACTION, "id": "deep", "args": [1]}))
            sent = {"op": "send_action_goal", "action": ACTION, "id": "g", "args": {"team": "hangar", "timeout": 0}}
            server.raw(json.dumps(sent))

        thread = threading.Thread(target=client)
        thread.start()
        words = ["serve", HANGAR, "--ros", f"rosbridge:{server.place}", "--requests", "1"]
        done = CliRunner().invoke(cli, words, catch_exceptions=False)
        thread.join(HANG_S)
        assert done.exit_code == 0
        assert server.wait_for(lambda: any(one["op"] == "unadvertise_action" for one in server.goals))
        offered = server.goals[0]
        assert (offered["action"], offered["type"]) == (ACTION, "robochoc_msgs/action/Decide")
        results = {one["id"]: one for one in server.goals if one["op"] == "action_result"}
    assert results.keys() == {"deep", "g"}
    assert (results["deep"]["result"], results["g"]["result"], results["g"]["status"]) == (False, True, 4)
    assert results["g"]["values"]["verdict"] == "solution"


# Packages for ROS 2


def without_comments(text: str) -> list[str]:
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def test_the_action_is_the_one_that_is_offered() -> None:
    text = (PACKAGES / "robochoc_msgs" / "action" / "Decide.action").read_text(encoding="utf-8")
    assert without_comments(text) == without_comments(DECIDE_ACTION)
    assert "action/Decide.action" in (PACKAGES / "robochoc_msgs" / "CMakeLists.txt").read_text(encoding="utf-8")


def test_the_node_of_a_behaviour_tree_has_the_ports_of_its_model() -> None:
    source = (PACKAGES / "robochoc_bt" / "src" / "decide.cpp").read_text(encoding="utf-8")
    tree = etree.parse(PACKAGES / "robochoc_bt" / "trees" / "decide.xml")
    ports = {side: set(re.findall(rf'BT::{side}Port<[^(]*>\("(\w+)"', source)) for side in ("Input", "Output")}
    model = {
        side: {one.get("name") for one in tree.iterfind(f".//Action[@ID='Decide']/{side.lower()}_port")}
        for side in ports
    }
    assert model == {"Input": ports["Input"] | {"action_name"}, "Output": ports["Output"]}
    goal, result, _ = DECIDE_ACTION.split("---\n")
    assert {line.split()[1] for line in without_comments(goal)} == ports["Input"]
    assert {line.split()[1] for line in without_comments(result)} >= ports["Output"]
    (used,) = tree.iterfind(".//BehaviorTree//Decide")
    assert {*used.attrib} == model["Input"] | model["Output"]
