"""`--ros nav2` and `--situation nav2`: decisions become goals of robots with Nav2, and failed goals change the team."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.flight.mission import GoalStop
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.commands import nav2
from robochoc.ros.commands.commander import GONE_S, Commander, RobotPhase, Target
from robochoc.ros.commands.nav2 import Nav2Commander, Nav2Source, read_nav2
from robochoc.ros.commands.place import CommandPlace
from robochoc.ros.live.actions import Actions, GoalEvent, GoalPhase
from robochoc.ros.live.rosbridge_actions import RosbridgeActions
from tests.support.cases import looped
from tests.support.dds import LOOPBACK_ALONE, free_domain
from tests.support.limits import HANG_S, wait_until
from tests.support.nav2_robots import PlayedRobots
from tests.support.program import ROOT
from tests.support.rosbridge_server import Server, begin_the_loop_of_roslibpy
from tests.support.zenoh_ros2 import Router

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
NAMES = ("Fin", "Nose", "Port", "Roof", "Starboard", "Tail")
ACTION = "/nose/navigate_to_pose"

pytestmark = pytest.mark.usefixtures("no_ros_here")


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)


# Whole runs


def solved(place: str, *words: str) -> Any:  # noqa: ANN401 - click's result
    given = ["solve", HANGAR, "--runtime", "simulator", "--ros", f"nav2:{place}", *words]
    return CliRunner().invoke(cli, given, catch_exceptions=False)


def driving(place: str, **others: str) -> PlayedRobots:
    """All robots of the hangar; all but `others` drive well."""
    return PlayedRobots(place, {f"/{name.lower()}": others.get(name, "drives") for name in NAMES})


def test_robots_drive_to_their_waypoints() -> None:
    place = f"dds:{free_domain()}"
    with driving(place) as robots:
        done = solved(place)
        goals = {name.lower(): robots.wait_for(f"/{name.lower()}", "goal") for name in NAMES}
    assert done.exit_code == 0, done.stderr
    assert done.stderr.splitlines()[-1].endswith("6 waypoints, 0 landings; 6 sent, 6 arrived")
    assert goals["nose"][0][:2] == [1.0, 2.0]
    assert goals["nose"][1] == "map"


def test_a_robot_whose_goal_is_aborted_leaves(router: Router) -> None:
    place = f"rmw_zenoh:{router.place}"
    with driving(place, Nose="aborts"):
        done = solved(place, "--situation", f"nav2:{place}", "--report-timeout", "1", "--json")
    assert done.exit_code == 0, done.stderr
    result = json.loads(done.stdout)
    assert [len(one["robots"]) for one in result["epochs"]] == [6, 5]
    assert "nose" not in result["assignment"]


def test_without_a_source_a_failure_ends_the_run() -> None:
    place = f"dds:{free_domain()}"
    with driving(place, Fin="keeps driving", Nose="rejects") as robots:
        done = solved(place)
        robots.wait_for("/fin", "cancel")
    assert done.exit_code == 1
    assert "Nose is out of order: its goal was rejected; the others are stopped" in done.stderr


TOURS = """tours: yes
distance: streets
robots:
  ann: {at: [0, 0], most: 3}
  bob: {at: [9, 9], most: 3}
  cid: {at: [0, 9], most: 3}
tasks:
  near: {at: [4, 0], worth: 9}
  far: {at: [6, 0.5], worth: 12}
  top: {at: [5, 9], worth: 12}
  mid: {at: [5, 5], worth: 14}
"""


def test_robots_go_to_all_their_tasks_and_done_ones_remain_done(tmp_path: Path) -> None:
    (tmp_path / "tasks.yaml").write_text(TOURS)
    place = f"dds:{free_domain()}"
    words = ["--runtime", "simulator", "--protocol", "cbba", "--ros", f"nav2:{place}", "--situation", f"nav2:{place}"]
    with PlayedRobots(place, {"/ann": "drives", "/bob": "aborts later", "/cid": "drives"}) as robots:
        given = ["solve", str(tmp_path / "tasks.yaml"), *words, "--report-timeout", "1", "--json"]
        done = CliRunner().invoke(cli, given, catch_exceptions=False)
        events = robots.past()
    assert done.exit_code == 0, done.stderr
    goals = {name: [goal[:2] for other, what, goal, *_ in events if (other, what) == (name, "goal")] for name in ROBOTS}
    assert goals["/ann"][:2] == [[4.0, 0.0], [6.0, 0.5]], "all stops, in order"
    assert goals["/bob"] == [[5.0, 9.0], [5.0, 5.0]]
    others = [*goals["/ann"], *goals["/cid"]]
    assert [5.0, 5.0] in others, "the task that bob has not done"
    assert [5.0, 9.0] not in others, "bob has left, and its first task remains done"
    assert len(goals["/ann"]) == len({*map(tuple, goals["/ann"])}), "no task is done twice"


ROBOTS = ("/ann", "/bob", "/cid")


def test_a_robot_without_a_server(tmp_path: Path) -> None:
    (tmp_path / "robots.yaml").write_text("patience: 1\n")
    done = solved(f"{tmp_path}/robots.yaml@dds:{free_domain()}")
    assert done.exit_code == 1
    assert "no action server /fin/navigate_to_pose for Fin: start Nav2 there" in done.stderr


@looped(
    ("place", "told"),
    lambda: [
        ("dcps:5", "'dcps' is not a middleware; use dds, rmw_zenoh, rosbridge, as in dds:5"),
        ("robots@dds:5", "'robots' is not the name of a YAML file; expected FILE.yaml@MIDDLEWARE"),
        ("dds:900", "'900' is not a DDS domain"),
        ("dds:5?wait=3", "'wait' is not an option of DDS"),
        ("rosbridge://127.0.0.1:1", "no rosbridge listens at"),
        ("rmw_zenoh://127.0.0.1:1", "no zenoh router listens at"),
        ("missing.yaml@dds:5", "missing.yaml: No such file or directory; name a file, as in nav2:robots.yaml@dds:5"),
        ("robots.yaml?speed=1&speed=2@dds:5", "the options 'speed=1&speed=2' have a duplicate"),
        ("robots.yaml?speed=1@dds:5", "nav2 has no options: write them into its file"),
    ],
)
def test_places_that_are_none(place: str, told: str) -> None:
    with pytest.raises(SinkError) as wrong:
        Nav2Commander(place)
    assert told in str(wrong.value)


def test_a_source_needs_the_sink() -> None:
    source = Nav2Source(f"dds:{free_domain()}")
    with source, pytest.raises(SourceError, match="give --ros the same text as --situation"):
        source.check()


# Files


def settings(folder: Path, text: str) -> nav2.Nav2Settings:
    (folder / "robots.yaml").write_text(text)
    return read_nav2(folder / "robots.yaml")


def test_a_file_names_robots(tmp_path: Path) -> None:
    found = settings(tmp_path, "robots:\n  Nose: /robot1\n  Fin: site/robot2/\naction: go\ntime: 5\npatience: 2\n")
    assert (found.robots, found.action) == ({"Nose": "/robot1", "Fin": "/site/robot2"}, "go")
    assert (found.time_s, found.patience_s, found.behavior_tree) == (5, 2, "")


@looped(
    ("text", "told"),
    lambda: [
        ("robots: 5\n", "robots.yaml:1: 'robots' is not a mapping"),
        ("robots:\n  Nose: 5\n", "robots.yaml:2: Nose is not text"),
        ("robots:\n  Nose: /a b\n", "robots.yaml:2: Nose is '/a b', which is not a ROS name"),
        ("robots:\n  Nose: /\n", "which is not a ROS name"),
        ("robots:\n  Nose: /a\n  Fin: /a\n", "robots.yaml:3: Fin and Nose have the same namespace"),
        ("time: -1\n", "robots.yaml:1: 'time' is '-1'; expected 1 to 86,400"),
        ("speed: 1\n", "robots.yaml:1: "),
        ("- 1\n", "a file of Nav2 robots is not a mapping"),
    ],
)
def test_what_is_wrong_with_a_file_has_a_line(tmp_path_factory: pytest.TempPathFactory, text: str, told: str) -> None:
    with pytest.raises(SinkError) as wrong:
        settings(tmp_path_factory.mktemp("nav2"), text)
    assert told in str(wrong.value)


@looped(
    ("text", "file", "middleware"),
    lambda: [
        ("", None, "dds"),
        ("dds:5?partition=a@b.yaml", None, "dds:5?partition=a@b.yaml"),
        ("a/robots.yaml", "a/robots.yaml", "dds"),
        ("robots.yml@rosbridge://here:9090", "robots.yml", "rosbridge://here:9090"),
        ("rmw_zenoh://here:7447", None, "rmw_zenoh://here:7447"),
    ],
)
def test_a_place_has_a_file_and_a_middleware(text: str, file: str | None, middleware: str) -> None:
    found = CommandPlace.parse(text)
    assert (found.file and str(found.file), found.middleware) == (file, middleware)


# What becomes of a goal


class ScriptedActions(Actions):
    """Actions whose events are those that a test puts."""

    where = "a script"

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[tuple[str, str, Fields]] = []
        self.cancelled: list[str] = []
        self.servers: dict[str, bool | None] = {}
        self.events: list[GoalEvent] = []

    def prepare(self, actions: Mapping[str, str]) -> None:
        self.servers = dict.fromkeys(actions, True)

    def has_server(self, action: str) -> bool | None:
        return self.servers[action]

    def put(self, phase: GoalPhase, fields: Fields | None = None, why: str = "", number: int = -1) -> None:
        event = self._event(self.sent[number][0], phase, fields or {}, why)
        if event is not None:
            self.events.append(event)

    def next(self, wait_s: float) -> GoalEvent | None:
        if self.events:
            return self.events.pop(0)
        time.sleep(wait_s)
        return None

    def close(self) -> None:
        pass

    def _send(self, goal: str, action: str, fields: Fields, wait_s: float) -> None:  # noqa: ARG002 - not needed
        self.sent.append((goal, action, fields))

    def _cancel(self, goal: str, action: str) -> None:  # noqa: ARG002 - not needed
        self.cancelled.append(goal)


class Played:
    """A commander of two robots with scripted actions, whose clock stands."""

    def __init__(self, commander: Nav2Commander, actions: ScriptedActions, clock: list[float]) -> None:
        self.commander, self.actions, self.clock = commander, actions, clock
        self.reports: list[tuple[str, str, Fields]] = []
        commander.observers.append(lambda *report: self.reports.append(report))
        commander.assign({"Nose": "/nose", "Fin": "/fin"})

    def send(self, x: float, *, lands: bool = False, name: str = "Nose") -> None:
        self.commander.command({name: Target((x, 2.0, 0.0), lands, "map", 7)})

    def poll(self, after_s: float = 0.0) -> RobotPhase:
        self.clock[0] += after_s
        self.commander.poll(0)
        return self.commander.robots["Nose"].phase

    @property
    def why(self) -> str:
        return self.commander.robots["Nose"].why


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Iterator[Played]:
    actions, clock = ScriptedActions(), [100.0]
    monkeypatch.setattr(nav2, "open_actions", lambda _: actions)
    commander = Nav2Commander("dds:1")
    monkeypatch.setattr("robochoc.ros.commands.commander.time.monotonic", lambda: clock[0])
    monkeypatch.setattr(nav2, "END_S", 0.0)
    yield Played(commander, actions, clock)
    monkeypatch.undo()


def test_a_goal_is_accepted_pursued_and_reached(played: Played) -> None:
    played.send(1.0)
    goal, action, fields = played.actions.sent[0]
    assert (action, fields["pose"]["header"]) == (ACTION, {"stamp": 7, "frame_id": "map"})
    assert fields["pose"]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 0.0}
    assert played.poll() is RobotPhase.SENT
    played.actions.put(GoalPhase.ACCEPTED)
    assert played.poll() is RobotPhase.MOVING
    pose = {"header": {"frame_id": "map"}, "pose": {"position": {"x": 0.5, "y": 1.0, "z": 0.0}}}
    for _ in range(3):
        played.actions.put(GoalPhase.FEEDBACK, {"current_pose": pose})
    played.poll()
    assert played.reports == [("Nose", "pose", pose)], "at most one in half a second"
    played.actions.put(GoalPhase.SUCCEEDED, {"error_code": 0})
    assert played.poll() is RobotPhase.ARRIVED
    assert not played.commander.is_busy
    played.send(1.0)
    assert len(played.actions.sent) == 1, "it is there already"
    played.send(2.0)
    assert len(played.actions.sent) == 2
    assert goal != played.actions.sent[1][0]


@pytest.mark.parametrize(
    ("phase", "fields", "why", "told"),
    [
        (GoalPhase.REJECTED, {}, "", "its goal was rejected"),
        (GoalPhase.REJECTED, {}, "no such action", "its goal was rejected: no such action"),
        (GoalPhase.ABORTED, {}, "", "its goal was aborted"),
        (
            GoalPhase.ABORTED,
            {"error_code": 1, "error_msg": "a\x1bb"},
            "",
            r"its goal was aborted: error code 1, a\x1bb",
        ),
        (GoalPhase.ABORTED, {"error_code": "x", "error_msg": 5}, "", "its goal was aborted"),
        (GoalPhase.CANCELED, {}, "", "its goal was cancelled by another client"),
        (GoalPhase.LOST, {}, "garbage", "its goal is lost: garbage"),
    ],
)
def test_a_goal_that_fails_is_reported_once(
    played: Played, phase: GoalPhase, fields: Fields, why: str, told: str
) -> None:
    played.send(1.0)
    played.actions.put(GoalPhase.ACCEPTED)
    played.poll()
    played.actions.put(phase, fields, why)
    assert played.poll() is RobotPhase.OUT
    assert played.reports == [("Nose", "out_of_order", {"data": told})]
    played.poll(1000.0)
    played.send(3.0)
    assert len(played.actions.sent) == 1, "a robot that is out of order gets no goal"
    assert len(played.reports) == 1


@pytest.mark.parametrize(
    ("before", "told"),
    [
        ([], "its server has not answered within 10 s"),
        ([GoalPhase.ACCEPTED], "its server has sent no feedback for 10 s"),
        ([GoalPhase.ACCEPTED, GoalPhase.FEEDBACK], "its server has sent no feedback for 10 s"),
    ],
)
def test_a_silent_server(played: Played, before: list[GoalPhase], told: str) -> None:
    played.send(1.0)
    for phase in before:
        played.actions.put(phase)
    assert played.poll() is not RobotPhase.OUT
    assert played.poll(Commander.patience_s + 1) is RobotPhase.OUT
    assert played.why == told
    assert played.actions.cancelled == [played.actions.sent[0][0]], "it is stopped, if it can be reached"


def test_a_robot_that_does_not_arrive(played: Played) -> None:
    played.send(1.0)
    phase = RobotPhase.SENT
    for _ in range(62):
        played.actions.put(GoalPhase.FEEDBACK)
        phase = played.poll(5.0)
    assert phase is RobotPhase.OUT
    assert played.why == "it has not arrived within 300 s"


def test_a_server_that_is_gone(played: Played) -> None:
    played.actions.servers[ACTION] = False
    assert played.poll(1.0) is RobotPhase.IDLE
    played.actions.servers[ACTION] = True
    assert played.poll(GONE_S + 1) is RobotPhase.IDLE, "it came back"
    played.actions.servers[ACTION] = False
    played.poll()
    assert played.poll(GONE_S + 1) is RobotPhase.OUT
    assert played.why == "its server is gone"
    assert not played.commander.robots["Fin"].why


def test_a_new_decision_replaces_the_goal(played: Played) -> None:
    played.send(1.0)
    played.actions.put(GoalPhase.ACCEPTED)
    played.poll()
    played.send(2.0)
    played.actions.put(GoalPhase.ABORTED, number=0)
    assert played.poll() is RobotPhase.SENT, "the end of the goal before means nothing"
    played.actions.put(GoalPhase.SUCCEEDED)
    assert played.poll() is RobotPhase.ARRIVED


def tour(*xs: float) -> Target:
    stops = tuple(GoalStop((x, 2.0, 0.0), f"task{x:g}") for x in xs)
    return Target(stops[0].at, False, "map", 7, stops)


def test_a_tour_continues_after_a_decision_that_does_not_change_it(played: Played) -> None:
    def arrive() -> None:
        played.actions.put(GoalPhase.SUCCEEDED)
        played.poll()

    played.commander.command({"Nose": tour(1, 2, 3)})
    arrive()
    assert played.reports == [("Nose", "done", {"data": "task1"})]
    assert len(played.actions.sent) == 2
    played.commander.command({"Nose": tour(1, 2, 3)})
    assert len(played.actions.sent) == 2, "it is on its way to the second stop"
    played.commander.command({"Nose": tour(1, 3)})
    assert played.actions.sent[-1][2]["pose"]["pose"]["position"]["x"] == 3
    arrive()
    assert played.poll() is RobotPhase.ARRIVED
    played.commander.command({"Nose": tour(3, 1)})
    assert played.poll() is RobotPhase.ARRIVED, "it has done both"
    assert len(played.actions.sent) == 3
    assert [fields["data"] for _, _, fields in played.reports] == ["task1", "task3"]


def test_a_robot_that_withdraws_stops(played: Played) -> None:
    played.send(1.0)
    played.send(9.0, lands=True)
    assert played.actions.cancelled == [played.actions.sent[0][0]]
    assert played.poll() is RobotPhase.IDLE
    played.actions.put(GoalPhase.CANCELED)
    assert played.poll() is RobotPhase.IDLE
    played.send(1.0)
    assert len(played.actions.sent) == 2, "it may come back"


def test_the_end_cancels_all_goals(played: Played) -> None:
    played.send(1.0)
    played.send(2.0, name="Fin")
    played.commander.end()
    assert sorted(played.actions.cancelled) == sorted(goal for goal, _, _ in played.actions.sent)
    assert not played.commander.is_busy


# Through a rosbridge


@pytest.fixture
def bridge() -> Iterator[tuple[Server, RosbridgeActions]]:
    begin_the_loop_of_roslibpy()
    with Server() as server, RosbridgeActions(server.place) as actions:
        actions.prepare({ACTION: "nav2_msgs/NavigateToPose"})
        yield server, actions


def result(goal: str, **fields: object) -> str:
    return json.dumps({"op": "action_result", "action": ACTION, "id": goal, "result": True, "values": {}, **fields})


def event_of(actions: RosbridgeActions, until: Callable[[GoalEvent], bool] = lambda _: True) -> GoalEvent:
    found: list[GoalEvent] = []

    def arrived() -> bool:
        event = actions.next(0.01)
        found.extend([event] if event is not None and until(event) else [])
        return bool(found)

    wait_until(arrived, "no event")
    return found[0]


def test_a_bridge_sends_goals_and_feedback(bridge: tuple[Server, RosbridgeActions]) -> None:
    server, actions = bridge
    goal = actions.send(ACTION, {"pose": {"header": {"stamp": 5_000_000_001, "frame_id": "map"}}}, HANG_S)
    assert server.wait_for(lambda: server.goals)
    stamp = {"secs": 5, "nsecs": 1}
    assert server.goals[0] == {
        "op": "send_action_goal",
        "id": goal,
        "action": ACTION,
        "action_type": "nav2_msgs/action/NavigateToPose",
        "args": {"pose": {"header": {"stamp": stamp, "frame_id": "map"}}},
        "feedback": True,
    }
    for strange in ("{}", '{"values": 5}', f'{{"id": "{goal}", "action": "/other", "values": {{}}}}', '{"id": [1]}'):
        server.raw(json.dumps({"op": "action_feedback", **json.loads(strange)}))
    values = {"distance_remaining": 2.5}
    server.raw(json.dumps({"op": "action_feedback", "id": goal, "action": ACTION, "values": values}))
    assert event_of(actions) == GoalEvent(goal, GoalPhase.FEEDBACK, values)
    actions.cancel(goal)
    assert server.wait_for(lambda: len(server.goals) == 2)
    assert server.goals[1] == {"op": "cancel_action_goal", "id": goal, "action": ACTION}
    server.raw(result("another", status=4))
    for _ in range(2):
        server.raw(result(goal, status=5))
    assert event_of(actions).phase is GoalPhase.CANCELED
    assert actions.next(0.1) is None


@pytest.mark.parametrize(
    ("fields", "phase", "why"),
    [
        ({"status": 4, "values": {"error_code": 0}}, GoalPhase.SUCCEEDED, ""),
        ({"status": 6, "values": {"error_code": 9001, "error_msg": "no tree"}}, GoalPhase.ABORTED, ""),
        ({"status": 77}, GoalPhase.LOST, ""),
        ({"status": [1]}, GoalPhase.LOST, ""),
        ({"status": 4, "values": [1]}, GoalPhase.LOST, "the result cannot be read: not an object"),
        ({"status": 0, "result": False, "values": "Action goal was rejected\n"}, GoalPhase.REJECTED, "Action goal was"),
    ],
)
def test_a_bridge_ends_goals(
    bridge: tuple[Server, RosbridgeActions], fields: dict[str, object], phase: GoalPhase, why: str
) -> None:
    server, actions = bridge
    goal = actions.send(ACTION, {}, HANG_S)
    assert server.wait_for(lambda: server.goals)
    server.raw(result(goal, **fields))
    event = event_of(actions)
    assert (event.goal, event.phase) == (goal, phase)
    assert event.why.startswith(why)


def test_a_bridge_that_is_gone(bridge: tuple[Server, RosbridgeActions]) -> None:
    server, actions = bridge
    server.die()

    def is_told() -> bool:
        try:
            actions.next(0.01)
        except SinkError as gone:
            return "has closed the connection" in str(gone)
        return False

    wait_until(is_told, "nobody says that the bridge is gone")
