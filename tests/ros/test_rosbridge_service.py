"""`robochoc serve --ros rosbridge`: clients of the bridge ask with roslibpy, and each is answered."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Iterator
from typing import Any, Self

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.robots.decision import CancellableDecision
from robochoc.robots.sink import SinkError
from robochoc.ros.decide_service import DECIDE, TRIGGER, DecideService, refusal
from robochoc.ros.live import rosbridge_connection
from robochoc.ros.live.rosbridge_connection import Connection
from robochoc.ros.live.rosbridge_service import RosbridgeServices
from robochoc.ros.live.services import WAITING_MAX
from robochoc.run import Options, Runtime
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT
from tests.support.rosbridge_server import Manner, Server, begin_the_loop_of_roslibpy
from tests.support.small_teams import pair

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
SERVICE, CANCEL = "/robochoc/decide", "/robochoc/cancel"
SERVICES = {SERVICE: DECIDE, CANCEL: TRIGGER}


@pytest.fixture(autouse=True)
def _loop(monkeypatch: pytest.MonkeyPatch) -> None:
    begin_the_loop_of_roslibpy()
    for name in ("CONNECT_S", "DRAIN_S", "LOOP_S", "CONFIRM_S", "CLOSE_S"):
        monkeypatch.setattr(rosbridge_connection, name, HANG_S)


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as server:
        yield server
        assert not server.wrong


@pytest.fixture
def offered(server: Server) -> Iterator[RosbridgeServices]:
    with RosbridgeServices(server.place, SERVICES, refusal, {CANCEL: lambda _: refusal("nothing")}) as offered:
        assert server.wait_for(lambda: len(server.offered) == len(SERVICES))
        yield offered


class Client:
    """A client of the bridge: roslibpy alone."""

    def __init__(self, server: Server) -> None:
        self.connection = Connection(server.place, RuntimeError)
        self.answers: list[dict[str, Any]] = []
        self.came = threading.Condition()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.connection.close()

    def ask(self, name: str, **fields: object) -> None:
        roslibpy = self.connection.roslibpy
        service = roslibpy.Service(self.connection.ros, name, "", reconnect_on_close=False)
        service.call(roslibpy.ServiceRequest(fields), self._hear, self._hear)

    def _hear(self, answer: Any) -> None:  # noqa: ANN401 - roslibpy is untyped
        with self.came:
            self.answers.append(dict(answer))
            self.came.notify()

    def wait_for(self, number: int) -> list[dict[str, Any]]:
        with self.came:
            assert self.came.wait_for(lambda: len(self.answers) >= number, HANG_S), self.answers
            return self.answers


def test_a_client_is_answered(server: Server, offered: RosbridgeServices) -> None:
    assert server.offered[SERVICE][0] == "robochoc_msgs/Decide"
    assert server.offered[CANCEL][0] == "std_srvs/Trigger"
    with Client(server) as client:
        client.ask(SERVICE, team="hangar", changes="ü", timeout=2.5)
        request = offered.next(HANG_S)
        assert request is not None
        assert (request.name, request.fields) == (SERVICE, {"team": "hangar", "changes": "ü", "timeout": 2.5})
        client.ask(CANCEL)
        assert client.wait_for(1) == [{"success": False, "message": "nothing"}], "this one does not wait for its turn"
        offered.reply(request, {"success": True, "message": "a", "variables": ["x"], "values": [1 << 40]})
        assert client.wait_for(2)[1] == {"success": True, "message": "a", "variables": ["x"], "values": [1 << 40]}


def test_feedback_is_published(server: Server, offered: RosbridgeServices) -> None:
    offered.announce("/robochoc/feedback", "std_msgs/String")
    offered.publish("/robochoc/feedback", "std_msgs/String", {"data": "{}"})
    assert server.wait_for(lambda: server.published == [("/robochoc/feedback", {"data": "{}"})])
    assert server.advertised == {"/robochoc/feedback": "std_msgs/String"}


def test_too_many_at_once_are_refused_and_the_end_is_told(server: Server, offered: RosbridgeServices) -> None:
    with Client(server) as client:
        for _ in range(WAITING_MAX + 3):
            client.ask(SERVICE)
        told = [answer["message"] for answer in client.wait_for(3)]
        assert told == [f"{WAITING_MAX} requests are already waiting; try again later"] * 3
        offered.close()
        told = [answer["message"] for answer in client.wait_for(WAITING_MAX + 3)]
        assert told.count("the service has ended") == WAITING_MAX
    assert server.wait_for(lambda: not server.offered)


@pytest.mark.parametrize(
    ("args", "told"),
    [
        ([1, 2], f"the request cannot be read as one of {DECIDE}: not an object"),
        ({"team": [[[[[[[[[[[[1]]]]]]]]]]]]}, f"the request cannot be read as one of {DECIDE}: nested"),
        ({"team": 5}, "team is 5: it must be text"),
        ({"timeout": None}, "timeout is nan: it must be seconds, or 0 for the longest time"),
        ({"timeout": True}, "timeout is True: it must be seconds, or 0 for the longest time"),
        ({"team": "\ud800"}, "team must be text that UTF-8 can encode: character 1 is half of a pair (U+D800)"),
        ({"changes": {"remove_agent": "Nose"}}, "changes is {'remove_agent': 'Nose'}: it must be text"),
    ],
)
def test_what_is_no_request_is_answered(server: Server, offered: RosbridgeServices, args: object, told: str) -> None:
    decider = DecideService([pair(values=3)], CancellableDecision(), Options(runtime=Runtime.SIMULATOR))
    with Client(server) as client:
        ask = {"op": "call_service", "id": "raw", "service": SERVICE, "args": args}
        client.connection.ros.call_async_service(client.connection.roslibpy.Message(ask), client._hear, client._hear)  # noqa: SLF001
        wait_until(lambda: bool(client.answers) or _answered(offered, decider), "nothing was answered")
        (answer,) = client.wait_for(1)
    assert answer["success"] is False
    assert answer["message"].startswith(told)


def _answered(offered: RosbridgeServices, decider: DecideService) -> bool:
    request = offered.next(0.01)
    if request is not None:
        offered.reply(request, decider.decide(request.fields))
    return request is not None


@pytest.mark.parametrize("raw", ['{"op": "call_service", "service": "/robochoc/decide"}', '{"op": "call_service"}'])
def test_a_call_without_a_number_is_passed_over(server: Server, offered: RosbridgeServices, raw: str) -> None:
    server.raw(raw)
    with Client(server) as client:
        client.ask(SERVICE, team="after")
        request = offered.next(HANG_S)
    assert request is not None
    assert request.fields == {"team": "after"}


def test_a_client_that_is_gone_does_no_harm(server: Server, offered: RosbridgeServices) -> None:
    with Client(server) as client:
        client.ask(SERVICE)
        request = offered.next(HANG_S)
        client.connection.abort()
    assert request is not None
    assert server.wait_for(lambda: "closed" in server.log), "the bridge has not seen that the client is gone"
    offered.reply(request, {"success": True, "message": "nobody hears it"})
    with Client(server) as another:
        another.ask(CANCEL)
        assert another.wait_for(1) == [{"success": False, "message": "nothing"}]
    offered.check()


def test_a_server_that_is_gone_ends_it(server: Server, offered: RosbridgeServices) -> None:
    server.die()
    connection = offered._connection  # noqa: SLF001 - its end
    wait_until(connection.ended.is_set, "the end of the connection is not seen")
    with pytest.raises(SinkError, match="has closed the connection"):
        offered.next(0)


def test_a_server_that_does_not_know_the_type_is_told() -> None:
    with Server(Manner(complains="Unable to load robochoc_msgs")) as server:
        done = CliRunner().invoke(cli, ["serve", HANGAR, "--ros", f"rosbridge:{server.place}"], catch_exceptions=False)
    assert done.exit_code == 1
    assert "reports an error: Unable to load robochoc_msgs; see its log" in done.stderr


def test_the_command_answers(server: Server) -> None:
    def ask() -> None:
        assert server.wait_for(lambda: CANCEL in server.offered)
        with Client(server) as client:
            client.ask(SERVICE, team="hangar", changes="", timeout=0)
            answers.extend(client.wait_for(1))

    answers: list[dict[str, Any]] = []
    asking = threading.Thread(target=ask)
    asking.start()
    words = ["serve", HANGAR, "--ros", f"rosbridge:{server.place}", "--requests", "1", "--feedback"]
    done = CliRunner().invoke(cli, words, catch_exceptions=False)
    asking.join(HANG_S)
    assert (done.exit_code, done.stderr.splitlines()[-1]) == (0, "/robochoc/decide: solution, 1 epoch")
    (answer,) = answers
    assert answer["verdict"] == "solution"
    topic, message = server.published[-1]
    told = json.loads(message["data"])
    assert (topic, told["state"], told["verdict"], told["team"]) == (
        "/robochoc/feedback",
        "decided",
        "solution",
        "hangar",
    )
    assert math.isfinite(told["elapsed_s"])
