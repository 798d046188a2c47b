"""RMF's messages through DDS, zenoh and rosbridge, and whole runs of dispatcher, fleet and user as programs."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import msgspec
import pytest

from robochoc.robots.sink import SinkError
from robochoc.ros.message_types import types_of
from robochoc.ros.rmf.exchange import Exchange
from robochoc.ros.rmf.messages import (
    TOPICS,
    ApiRequest,
    ApiResponse,
    Assignment,
    BidNotice,
    BidProposal,
    BidResponse,
    DispatchAck,
    DispatchCommand,
    DispatchState,
    DispatchStates,
    Message,
    TaskStateUpdate,
    fields_of,
    message_of,
)
from tests.support.dds import LOOPBACK_ALONE, free_domain
from tests.support.limits import HANG_S
from tests.support.program import PROGRAM, robochoc, robochoc_within
from tests.support.rosbridge_server import Server, begin_the_loop_of_roslibpy
from tests.support.zenoh_ros2 import Router

AT_NS = 1_700_000_000_123_456_789
MESSAGES: tuple[Message, ...] = (
    ApiRequest('{"é": 1}', "a"),
    ApiResponse(2, "{}", "a"),
    BidNotice("{}", "t", 2_500_000_000, dry_run=True),
    BidResponse("t", has_proposal=True, proposal=BidProposal("f", "r", 1.5, 2.5, AT_NS), errors=("e",)),
    BidResponse("t", has_proposal=False, errors=("e",)),
    DispatchCommand("f", "t", 2**63, AT_NS, 1),
    DispatchAck(5, success=True, errors=("x",)),
    DispatchStates((DispatchState("t", 1),), (DispatchState("u", 3, Assignment(True, "f", "r"), ("e",)),)),
    TaskStateUpdate("{}"),
)


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
    for name in ("ROS_DOMAIN_ID", "ROS_DISTRO", "ZENOH_SESSION_CONFIG_URI"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("message", MESSAGES)
def test_messages_in_cdr_and_in_json(message: Message) -> None:
    topic, kind = TOPICS[type(message)]
    content = types_of(2).encode(kind, fields_of(message))
    assert message_of(topic, types_of(2).decode(kind, content)) == message
    assert message_of(topic, msgspec.json.decode(msgspec.json.encode(fields_of(message, as_json=True)))) == message


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"request": 1, "task_id": "t", "time_window": 1},
        {"request": "", "task_id": "x" * 300, "time_window": 1},
        {"request": "x" * 70_000, "task_id": "t", "time_window": 1},
        {"request": "", "task_id": "\0", "time_window": 1},
        {"request": "\ud800", "task_id": "t", "time_window": 1},
        {"request": "", "task_id": "t", "time_window": {"sec": "1", "nanosec": 0}},
    ],
)
def test_malformed_messages_are_ignored(fields: dict[str, object]) -> None:
    assert message_of("/rmf_task/bid_notice", fields) is None
    assert message_of("/other", fields) is None


def test_a_time_beyond_64_bits_is_malformed() -> None:
    proposal = {"fleet_name": "f", "finish_time": {"sec": 10**400, "nanosec": 0}}
    assert message_of("/rmf_task/bid_response", {"task_id": "t", "has_proposal": True, "proposal": proposal}) is None


def test_layouts_are_those_of_rmf() -> None:
    """The fields of the public definitions, in their order, and the size of the simplest ones in CDR."""
    layouts = {kind: [name for name, _ in types_of(2).layout(kind)] for _, kind in TOPICS.values()}
    assert layouts["rmf_task_msgs/BidNotice"] == ["request", "task_id", "time_window", "dry_run"]
    assert layouts["rmf_task_msgs/BidResponse"] == ["task_id", "has_proposal", "proposal", "errors"]
    assert layouts["rmf_task_msgs/DispatchCommand"] == ["fleet_name", "task_id", "dispatch_id", "timestamp", "type"]
    assert layouts["rmf_task_msgs/DispatchAck"] == ["dispatch_id", "success", "errors"]
    assert len(types_of(2).encode("rmf_task_msgs/DispatchAck", {})) == 4 + 8 + 1 + 3 + 4


def exchanged(place: str) -> None:
    """Every message arrives, and a burst of 60 of one kind in order."""
    kinds = [*TOPICS]
    with Exchange(place, kinds, ()) as sender, Exchange(place, (), kinds) as receiver:
        received: list[Message] = []
        for message in MESSAGES:
            for _ in range(int(HANG_S)):  # until the two have found each other
                sender.send(message)
                if found := receiver.next(1.0):
                    received.append(found)
                    break
        assert [one for one in MESSAGES if one not in received] == []
        burst: list[Message] = [BidNotice("{}", f"n{number}", number) for number in range(60)]
        for message in burst:
            sender.send(message)
        late: list[Message] = []
        while len(late) < len(burst):
            found = receiver.next(HANG_S)
            assert found is not None
            late += [found] if found in burst else []
        assert late == burst


def test_dds() -> None:
    exchanged(f"dds:{free_domain()}")


def test_zenoh(router: Router) -> None:
    exchanged(f"rmw_zenoh:{router.place}")


def test_rosbridge() -> None:
    begin_the_loop_of_roslibpy()
    with Server() as server, Exchange(f"rosbridge:{server.place}", [BidNotice], [BidResponse]) as one:
        one.send(BidNotice("{}", "t", 2_500_000_000))
        assert server.wait_for(lambda: "subscribe" in server.log)
        server.say("/rmf_task/bid_response", fields_of(MESSAGES[3], as_json=True))
        assert one.next(HANG_S) == MESSAGES[3]
    ((topic, fields),) = server.published
    assert topic == "/rmf_task/bid_notice"
    assert fields["time_window"] == {"sec": 2, "nanosec": 500_000_000}


def test_other_middlewares_are_refused() -> None:
    with pytest.raises(SinkError, match="unknown middleware; use dds"):
        Exchange("mcap:x.mcap", (), ())
    for words in (("dispatch",), ("request", "patrol", "a")):
        done = robochoc_within("rmf", *words, "--ros", "mcap:x")
        assert (done.returncode, "unknown middleware" in done.stderr) == (2, True)


# Programs

FLEET = """fleet: carts
robots:
  one: {at: [0, 0], speed: 100}
  two: {at: [20, 0], speed: 100}
places: {pantry: [18, 3], coe: [7, 3]}
"""


@pytest.mark.more
def test_a_burst_of_seven_tasks_through_programs(tmp_path: Path) -> None:
    place = f"dds:{free_domain()}"
    (tmp_path / "fleet.yaml").write_text(FLEET)
    words = (("dispatch", "--tasks", "7"), ("bid", "fleet.yaml", "--tasks", "7"))
    programs = [
        subprocess.Popen([PROGRAM, "rmf", *one, "--ros", place], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
        for one in words
    ]
    try:
        asked = robochoc("rmf", "request", "patrol", "pantry", "coe", "--count", 7, "--ros", place, "--timeout", HANG_S)
        assert asked.returncode == 0, asked.stderr
        ids = asked.stdout.split()
        lines = [[json.loads(line) for line in one.communicate(timeout=HANG_S)[0].splitlines()] for one in programs]
    finally:
        for one in programs:
            one.kill()
            one.wait()
    assert len({*ids}) == 7
    assert {line["status"] for line in lines[0]} == {"dispatched"}
    assert sorted(line["task"] for line in lines[1] if line["event"] == "completed") == sorted(
        line["task"] for line in lines[0]
    )


def test_nobody_answers() -> None:
    done = robochoc_within("rmf", "request", "clean", "hall", "--ros", f"dds:{free_domain()}", "--timeout", 0.1)
    assert done.returncode == 3
    assert "no dispatcher has answered 1 of 1 requests" in done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("delivery", "a"), "'delivery' needs 2 places"),
        (("clean", "a", "b"), "1 place"),
        (("patrol", "a", "--fleet", ""), "the name is empty"),
        (("patrol", ""), "the name is empty"),
    ],
)
def test_places_that_do_not_fit(words: tuple[str, ...], told: str) -> None:
    done = robochoc_within("rmf", "request", *words)
    assert (done.returncode, told in done.stderr) == (2, True)


def test_a_fleet_with_mistakes(tmp_path: Path) -> None:
    (tmp_path / "fleet.yaml").write_text("fleet: carts\n")
    done = robochoc_within("rmf", "bid", tmp_path / "fleet.yaml")
    assert (done.returncode, "the fleet has no robots" in done.stderr) == (1, True)


def test_a_protocol_that_cannot_minimise_costs(tmp_path: Path) -> None:
    """It is refused before the domain is joined."""
    (tmp_path / "fleet.yaml").write_text(FLEET)
    for words in (("bid", tmp_path / "fleet.yaml"), ("dispatch",)):
        done = robochoc_within("rmf", *words, "--protocol", "abt", "--ros", f"dds:{free_domain()}")
        assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1), done.stderr
        assert done.stderr.startswith("--protocol abt, tried on two ")
        assert "which abt does not support" in done.stderr
